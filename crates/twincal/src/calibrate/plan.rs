//! The plan: what must be the same for all logs whose statistics are to be added.

use super::exit::{Exit, Pass};
use super::request::{Recorded, Request};
use super::settings::CalibrationSettings;
use super::stages;
use crate::error::{Error, Finding, Result};
use crate::likelihood::NoiseModel;
use crate::signal::{Logs, Pipeline};
use crate::statistics::Runs;
use crate::term::LibrarySettings;
use serde::{Deserialize, Serialize};

/// Version of what statistics hold and mean.
pub const VERSION: u32 = 1;

/// How logs become statistics, chosen once: by a fit to some of the logs, [`plan`](super::plan).
///
/// Statistics with one plan add; with another they do not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// [`VERSION`] of the program that made it.
    pub version: u32,
    /// The likelihood of the fit: it goes with the band of the filters.
    pub noise: NoiseModel,
    /// The payload component acts only in logs that say they carry something unknown.
    pub payload_where_unknown: bool,
    /// Filters, rates, thresholds and corrections.
    pub pipeline: Pipeline,
    /// Candidates, with reversal velocity, periods of gear ripple and the effects that columns are worked out about.
    pub library: LibrarySettings,
}

impl Plan {
    /// What a fit has to know of consecutive rows.
    pub(super) fn runs(&self) -> Runs {
        match self.noise {
            NoiseModel::Ar1 => Runs::Joined,
            NoiseModel::Iid | NoiseModel::Tempered => Runs::Apart,
        }
    }
}

/// The same road as that of a calibration, as far as the fit that decides.
pub(super) fn road(
    request: Request<'_>,
    recordings: &mut Option<(Logs<'_>, Logs<'_>)>,
    findings: &mut Vec<Finding>,
) -> Pass<Plan> {
    let recorded = Recorded::of(recordings.as_ref());
    let prepared = stages::prepare(request, recorded, findings)?;
    let mut rows = stages::read(prepared, findings)?;
    let settings = &rows.prepared.settings;
    require_even_rows(settings).map_err(Exit::Failed)?;
    rows.weigh(findings)?;
    stages::estimate(&rows, findings)?;
    Ok(Plan {
        version: VERSION,
        noise: rows.prepared.settings.noise.model,
        payload_where_unknown: rows.prepared.unknown,
        pipeline: rows.prepared.pipeline,
        library: rows.prepared.library_settings,
    })
}

/// # Errors
/// [`Error::Setting`] for noise that weighs rows one by one.
pub(super) fn require_even_rows(settings: &CalibrationSettings) -> Result<()> {
    if !settings.noise.weighs_rows() {
        return Ok(());
    }
    Err(Error::Setting {
        key: "noise".into(),
        problem: "robust and varies_with_… weigh rows one by one, which statistics do not hold"
            .into(),
        remedy: "leave them out, or fit the logs themselves".into(),
    })
}
