//! Statistics of logs as files: an Arrow IPC file of one row per log, in the order of their names.
//!
//! ```text
//! schema metadata    key `twincal.statistics` → JSON: format, checksum, model, header, logs
//! column `log`       text: JSON: header, records, each [joint, quantity, block, rows, runs, numbers]
//! column `value`     list of float64: the numbers of these records, one after the other
//! ```
//! Every row is a record batch by itself, so that files are merged row by row. The metadata hold SHA-256 of the text and of the numbers of each
//! row (doubles, little-endian), and of themselves with an empty checksum.

mod files;
mod reader;
mod write;

pub use files::StatisticsFiles;

use crate::artifact::sha256;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;
use twincal::Finding;
use twincal::calibrate::{Header, Identity, LogHeader, Quantity, Statistics};

/// What this version writes.
const FORMAT: u32 = 5;
/// Key of the schema's metadata, and the names of the columns.
const KEY: &str = "twincal.statistics";
const COLUMNS: [&str; 2] = ["log", "value"];
/// Largest file, bytes: some thousand logs of ten minutes.
const MAX_BYTES: u64 = 16 << 30;

/// Statistics with the model file that their robot was read from.
///
/// # Example
/// ```
/// # #[path = "../../../twincal/examples/two_link.rs"] mod two_link;
/// # use twincal::calibrate::{Statistics, plan};
/// # use twincal::prelude::*;
/// use twincal_io::statistics::{ModelFile, StatisticsFile};
///
/// # let (robot, mut noise) = (two_link::arm(2.0)?, twincal::random::Random::new(1, 0));
/// # let log = two_link::log("run1", 0.3, &two_link::arm(2.6)?, &mut noise);
/// # let mut settings = Settings::default();
/// # settings.library.families = vec![Family::Payload, Family::Viscous];
/// # let (plan, _) = plan(&robot, std::slice::from_ref(&log), &settings, &|_| {})?;
/// # let statistics = Statistics::of(("arm", &robot), &plan, &Log::from(&log), "")?;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("run1.arrow");
/// # let model = ModelFile {
/// #     name: "arm.urdf".into(), stored_as: "model.urdf".into(), robot: "arm".into(), text: "<robot/>".into(), findings: Vec::new(),
/// # };
/// let file = StatisticsFile { statistics, model };
/// file.write_to(std::fs::File::create(&path)?)??;
/// let again = StatisticsFile::read(&path)?;
/// assert_eq!(again, file);
/// assert!(again.statistics.log_names().eq(["run1"]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct StatisticsFile {
    /// What a fit takes.
    pub statistics: Statistics,
    /// What `twincal export` writes the result back into.
    pub model: ModelFile,
}

/// A model file as it was.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelFile {
    /// Name as given.
    pub name: String,
    /// Name within a twin's folder, `model.urdf` or `model.xml`.
    pub stored_as: String,
    /// What the file calls the robot; may be empty.
    pub robot: String,
    /// The file.
    pub text: String,
    /// What was found when it was read.
    pub findings: Vec<Finding>,
}

/// The JSON of the metadata.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Metadata {
    format: u32,
    checksum: String,
    model: ModelFile,
    header: Header,
    logs: Vec<Entry>,
}

/// The only key that all formats have.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

/// What distinguishes logs, and the checksums of a row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Entry {
    name: String,
    /// SHA-256 of the log, or empty.
    source: String,
    ends: [f64; 2],
    /// See [`Identity::sums`].
    sums: u64,
    /// SHA-256 of the row's text.
    text: String,
    /// SHA-256 of its numbers.
    numbers: String,
}

/// The JSON of a row.
#[derive(Debug, Serialize, Deserialize)]
struct RowText {
    header: LogHeader,
    records: Vec<Layout>,
}

/// `[joint, quantity, block, rows, runs, numbers]`.
#[derive(Debug, Serialize, Deserialize)]
struct Layout(u32, Quantity, u32, f64, f64, u64);

impl StatisticsFile {
    /// Reads a file that [`StatisticsFile::write_to`] or [`StatisticsFiles::write_to`] wrote.
    ///
    /// # Errors
    /// Those of [`StatisticsFiles`].
    pub fn read(path: &Path) -> Result<Self> {
        StatisticsFiles::open(&[path.to_owned()], &mut |_| {})?.read()
    }
}

impl Metadata {
    /// SHA-256 of the metadata with an empty checksum.
    fn own_checksum(&self) -> Result<String> {
        let without = Self {
            checksum: String::new(),
            ..self.clone()
        };
        Ok(sha256(json(&without)?.as_bytes()))
    }
}

impl Entry {
    fn new(header: &LogHeader, [text, numbers]: [String; 2]) -> Self {
        let Identity {
            name,
            source,
            ends,
            sums,
        } = header.identity();
        Self {
            name: name.to_owned(),
            source: source.to_owned(),
            ends,
            sums,
            text,
            numbers,
        }
    }

    fn identity(&self) -> Identity<'_> {
        Identity {
            name: &self.name,
            source: &self.source,
            ends: self.ends,
            sums: self.sums,
        }
    }
}

fn json(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|e| Error::Internal {
        what: "statistics as JSON".into(),
        problem: e.to_string(),
    })
}

#[cfg(test)]
mod tests;
