//! Torque that is logged later than the motion is moved back before anything is fitted, where training logs clearly say so.

use super::all_logs::Trajectories;
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Finding, Result};
use crate::lag::{Lags, lag_findings, lags, late_logs};
use crate::robot::Robot;
use crate::signal::{Lag, Log, Pipeline, ReadyLog, Trajectory, ready, stretches};

/// Samples of all training logs together that are looked at, about.
const SAMPLES: usize = 1 << 16;

/// Estimates the lags of the training logs unless the user said one; what is clear becomes a correction of the pipeline, and logs in memory are
/// prepared again with it. Those in chapters are prepared whenever they are visited.
///
/// # Errors
/// Of chapters that cannot be read, and those of [`ready`].
pub(in crate::calibrate) fn align<'a>(
    robot: &Robot,
    logs: &'a [Log<'_>],
    pipeline: &mut Pipeline,
    prepared: &mut [ReadyLog<'a>],
    findings: &mut Vec<Finding>,
) -> Result<Option<Lags>> {
    if pipeline.is_off() || pipeline.corrections.lag != Lag::Unsaid {
        return Ok(None);
    }
    let trajectories = stretches(prepared, SAMPLES, pipeline)?;
    let seen: Vec<&Trajectory> = trajectories.iter().collect();
    let Some(mut found) = lags(robot, pipeline, &seen) else {
        return Ok(None);
    };
    // Logs that differ are told when all of them are read.
    found.logs.iter_mut().for_each(|log| log.differs = false);
    let Some(lag) = found.correction(robot) else {
        return Ok(Some(found));
    };
    let said = lag_findings(&pipeline.corrections.lag, &found, findings);
    findings.extend(said);
    pipeline.corrections.lag = lag;
    for (log, prepared) in logs.iter().zip(prepared) {
        if matches!(prepared, ReadyLog::Whole(_)) {
            *prepared = ready(robot, log, pipeline)?;
        }
    }
    Ok(Some(found))
}

/// Says which logs have another lag than the others, held-out ones included; where the user said a lag, what there is beside it.
pub(in crate::calibrate) fn of_every_log(
    robot: &Robot,
    pipeline: &Pipeline,
    settings: &CalibrationSettings,
    trajectories: &Trajectories,
    findings: &mut Vec<Finding>,
) -> Option<Lags> {
    let all: Vec<&Trajectory> = trajectories.all().collect();
    let found = lags(robot, pipeline, &all)?;
    let said = &settings.signal.corrections.lag;
    if *said == Lag::Unsaid {
        findings.extend(late_logs(&found, findings));
        return None;
    }
    findings.extend(lag_findings(said, &found, findings));
    Some(found)
}
