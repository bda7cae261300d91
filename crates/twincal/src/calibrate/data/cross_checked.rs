//! What logs say of each other.

use super::all_logs::Trajectories;
use crate::calibrate::stopped::Stopped;
use crate::cross_check::{Compared, copies, odd_torque, stuck_encoders};
use crate::error::{Finding, Result};
use crate::robot::Robot;
use crate::signal::{Log, Logs, Pipeline, Trajectory};
use rayon::prelude::*;

/// Findings on logs as recorded; logs to fit come first.
pub(in crate::calibrate) fn as_recorded(
    robot: &Robot,
    (fit, heldout): &(Logs<'_>, Logs<'_>),
) -> std::result::Result<Vec<Finding>, Stopped> {
    let logs: Vec<Log<'_>> = fit.0.iter().chain(&heldout.0).map(Log::lent).collect();
    let look = || -> Result<Vec<Finding>> {
        let mut findings = copies(&logs)?;
        findings.extend(stuck_encoders(robot, &logs)?);
        Ok(findings)
    };
    look().map_err(|error| Stopped {
        error,
        findings: Vec::new(),
    })
}

/// Findings on the filtered logs; `compared` is what the self-check says.
pub(in crate::calibrate) fn as_filtered(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectories: &Trajectories,
    compared: &[Finding],
) -> Vec<Finding> {
    let all: Vec<&Trajectory> = trajectories.all().collect();
    let all: Vec<Compared<'_>> = (all.par_iter())
        .map(|log| Compared::of(pipeline, log))
        .collect();
    odd_torque(robot, &all, compared.is_empty())
}
