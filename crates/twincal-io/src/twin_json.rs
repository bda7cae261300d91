//! `twin.json`: everything that `check`, `predict` and `report` need of a calibration.

use crate::artifact::{Artifact, Claim, Maker, Pieces, REPORT, RESULT, RUN_LOG, TWIN};
use crate::config::{Gates, ReadAs};
use crate::context::ReportContext;
use crate::error::{Error, Place, Result};
use crate::result_json::result_json;
use serde::{Deserialize, Serialize};
use std::io::{BufReader, Read};
use twincal::calibrate::Calibration;

/// A calibration as it lies in an artefact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoredTwin {
    /// Gates of `check` as they were set when it was fitted.
    pub gates: Gates,
    /// How its logs were understood; `None` in twins of earlier versions.
    #[serde(default)]
    pub read_as: Option<ReadAs>,
    /// What the report says of the run.
    pub context: ReportContext,
    /// The result.
    pub calibration: Calibration,
}

impl StoredTwin {
    /// Reads it from an artefact whose files are verified; `report.html` is left out if `except_report`.
    ///
    /// # Errors
    /// A file that is missing or damaged.
    pub fn read(artifact: &Artifact, except_report: bool) -> Result<Self> {
        artifact.verify_except(if except_report {
            &[REPORT, TWIN]
        } else {
            &[TWIN]
        })?;
        let bytes = artifact.read(TWIN)?;
        Self::parse(&mut bytes.as_slice()).map_err(|e| {
            let problem = format!("does not hold a twin of this version: {e}");
            Error::content(
                Place::file(TWIN),
                problem,
                "fit again with this version of twincal",
            )
        })
    }

    /// The one reader of a twin: each kind of source of its text would be half a megabyte of the program.
    fn parse(text: &mut dyn Read) -> serde_json::Result<Self> {
        serde_json::from_reader(BufReader::new(text))
    }

    /// The text of `result.json`.
    ///
    /// # Errors
    /// [`Error::Internal`] if the values cannot be written.
    pub fn result_json(&self) -> Result<String> {
        result_json(&self.calibration, &self.context)
    }

    /// Writes the whole artefact with result, report (with the feature `report`), twin, log and `more` files.
    ///
    /// # Errors
    /// The system's refusal; then nothing has changed.
    pub fn write(
        &self,
        claim: Claim,
        made_by: Maker,
        run_log: String,
        more: Vec<(&str, Vec<u8>)>,
    ) -> Result<()> {
        let internal = |problem: String| Error::Internal {
            what: TWIN.into(),
            problem,
        };
        let twin = || -> Result<Pieces> {
            let mut twin = Pieces::default();
            serde_json::to_writer(&mut twin, self).map_err(|e| internal(e.to_string()))?;
            // What cannot be read back must not be written.
            Self::parse(&mut twin.reader()).map_err(|e| {
                internal(format!(
                    "{e}, after `{}`",
                    before(&twin.to_vec(), e.column())
                ))
            })?;
            Ok(twin)
        };
        let shown = || (self.result_json(), self.report());
        let (twin, (result, report)) = rayon::join(twin, shown);
        let mut texts = vec![(RESULT, result?.into_bytes())];
        texts.extend(report?.map(|report| (REPORT, report.into_bytes())));
        texts.push((RUN_LOG, run_log.into_bytes()));
        texts.extend(more);
        let texts = texts.into_iter();
        let mut files: Vec<(&str, Pieces)> =
            texts.map(|(name, text)| (name, text.into())).collect();
        files.push((TWIN, twin?));
        claim.commit(made_by, files)
    }

    /// `None` in a build without the feature `report`.
    fn report(&self) -> Result<Option<String>> {
        #[cfg(feature = "report")]
        return crate::report::render(&self.calibration, &self.context).map(Some);
        #[cfg(not(feature = "report"))]
        Ok(None)
    }

    /// Writes the artefact again with a new report and everything else as it is.
    ///
    /// # Errors
    /// A damaged file, or the system's refusal; then nothing has changed.
    #[cfg(feature = "report")]
    pub fn rewrite_report(&self, artifact: &Artifact, claim: Claim) -> Result<()> {
        let report = crate::report::render(&self.calibration, &self.context)?;
        let mut files = vec![(REPORT, report.into_bytes())];
        for name in artifact.names().filter(|name| *name != REPORT) {
            files.push((name, artifact.read(name)?));
        }
        claim.commit(artifact.made_by(), files)
    }
}

/// The text before a place of the one line: what a bug report needs to say.
fn before(line: &[u8], column: usize) -> String {
    let end = column.min(line.len());
    String::from_utf8_lossy(&line[end.saturating_sub(120)..end]).into_owned()
}
