//! The plan: what must be the same for all logs whose statistics are to be added.

use super::distinct::Fnv;
use super::exit::{Exit, Pass};
use super::fit::relinearise;
use super::request::{Recorded, Request};
use super::settings::CalibrationSettings;
use super::stages;
use crate::error::{Code, Error, Finding, Result};
use crate::likelihood::NoiseModel;
use crate::robot::Robot;
use crate::signal::{Logs, Pipeline};
use crate::statistics::Runs;
use crate::term::LibrarySettings;
use crate::words::quoted;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// Version of what statistics hold and mean.
pub const VERSION: u32 = 2;

/// How logs become statistics, chosen once: by a fit to some of the logs, [`plan`](super::plan).
///
/// Statistics with one plan add; with another they do not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// [`VERSION`] of the program that made it.
    pub version: u32,
    /// Checksum (FNV-1a) of the robot that it was made for: its description and its locked joints.
    pub robot: u64,
    /// The likelihood of the fit: it goes with the band of the filters.
    pub noise: NoiseModel,
    /// The payload component acts only in logs that say they carry something unknown.
    pub payload_where_unknown: bool,
    /// Filters, rates, thresholds and corrections.
    pub pipeline: Pipeline,
    /// Candidates, with reversal velocity, periods of gear ripple and the effects that columns are worked out about.
    pub library: LibrarySettings,
    /// What was found while the pipeline was chosen.
    pub findings: Vec<Finding>,
}

impl Plan {
    /// What a fit has to know of consecutive rows.
    pub(super) fn runs(&self) -> Runs {
        match self.noise {
            NoiseModel::Ar1 => Runs::Joined,
            NoiseModel::Iid | NoiseModel::Tempered => Runs::Apart,
        }
    }

    /// # Errors
    /// [`Error::Statistics`] for a plan of another version or robot, and for filters that no plan has.
    pub fn require_for(&self, robot: &Robot) -> Result<()> {
        match self.unfit_for(robot) {
            None => Ok(()),
            Some(problem) => Err(Error::Statistics {
                problem,
                remedy:
                    "make the plan with this program and this robot: twincal statistics --plan auto"
                        .into(),
            }),
        }
    }

    /// Why logs of this robot cannot be read under it.
    fn unfit_for(&self, robot: &Robot) -> Option<String> {
        if self.version != VERSION {
            let own = self.version;
            return Some(format!(
                "the plan has version {own}, this program {VERSION}"
            ));
        }
        if self.robot != checksum(robot) {
            let joints = quoted(robot.joint_names());
            return Some(format!(
                "the plan was made for another robot or model file than this one with joints {joints}"
            ));
        }
        let [filters, candidates] = [
            self.pipeline.coulomb_velocity,
            self.library.coulomb_velocity,
        ];
        if filters != candidates {
            return Some(format!(
                "the plan has coulomb_velocity {filters} in its pipeline and {candidates} in its library"
            ));
        }
        let (key, value) = self.pipeline.unsound(robot)?;
        let joints = robot.dof();
        Some(format!(
            "the plan has pipeline.{key} = {value}, of which no filter for {joints} joints can be made"
        ))
    }
}

/// Without what is said of the plan's logs alone: others may move what these do not.
fn about_filters(mut findings: Vec<Finding>) -> Vec<Finding> {
    findings.retain(|finding| finding.code != Code::JointNotExcited);
    findings
}

/// Checksum of a robot.
fn checksum(robot: &Robot) -> u64 {
    let mut sum = Fnv::new();
    // Nothing refuses text here.
    let _ = write!(sum, "{:?} {:?}", robot.description(), robot.locked());
    sum.sum()
}

/// What the columns of a plan are worked out about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum About {
    /// The model file, as those of a fit are where nothing that it finds multiplies another effect.
    #[default]
    Model,
    /// What the plan's fit finds: for other robots of the type, which have that and a little more. A joint zero of one of them acts on the payload
    /// of all.
    Found,
}

/// The same road as that of a calibration, as far as the fit that decides.
pub(super) fn road(
    about: About,
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
    let estimated = stages::estimate(&rows, findings)?;
    if about == About::Found {
        let found = relinearise::found(&rows.library, &estimated.fitted.fit);
        drop(estimated);
        rows.prepared.library_settings.linearised_at = found;
    }
    Ok(Plan {
        version: VERSION,
        robot: checksum(request.robot),
        noise: rows.prepared.settings.noise.model,
        payload_where_unknown: rows.prepared.unknown,
        pipeline: rows.prepared.pipeline,
        library: rows.prepared.library_settings,
        findings: about_filters(rows.prepared.of_pipeline),
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
