//! Logs beside their model before anything is fitted: what `inspect` and `doctor` share.

use std::collections::BTreeMap;
use twincal::incidents::{Incident, incident_findings, incidents, leave_out};
use twincal::lag::{LogLag, estimate_lag, lag_findings};
use twincal::robot::Robot;
use twincal::self_check::{JointCheck, look};
use twincal::signal::{Agreement, Pipeline, Recording, Trajectory, align, velocity_agreement};
use twincal::{Error, Finding, Severity};

/// Logs as a fit would filter them, and what log and model say of each other.
#[derive(Default)]
pub(super) struct Checkup {
    /// Logs that could be filtered; incidents are masked.
    pub(super) trajectories: Vec<Trajectory>,
    /// Why others could not.
    pub(super) refused: Vec<Error>,
    /// By log.
    pub(super) lags: BTreeMap<String, LogLag>,
    pub(super) incidents: BTreeMap<String, Vec<Incident>>,
    pub(super) agreement: BTreeMap<String, Vec<Option<Agreement>>>,
    /// By joint, over all logs.
    pub(super) joints: Vec<JointCheck>,
    /// Warnings; notes of the filters are left to `fit`.
    pub(super) findings: Vec<Finding>,
}

/// Filters the logs, looks for incidents and lags, and compares with the model.
///
/// # Errors
/// Positions in degrees.
pub(super) fn checkup(
    robot: &Robot,
    recordings: &[Recording],
    pipeline: &Pipeline,
) -> twincal::Result<Checkup> {
    let mut checkup = Checkup::default();
    for recording in recordings {
        let (mut trajectory, more) = match align(robot, recording, pipeline) {
            Ok(aligned) => aligned,
            Err(error) => {
                checkup.refused.push(error);
                continue;
            }
        };
        let warnings = more.into_iter().filter(|f| f.severity > Severity::Note);
        checkup.findings.extend(warnings);
        let happened = incidents(robot, pipeline, &trajectory);
        leave_out(pipeline, &mut trajectory, &happened);
        let said = incident_findings(&recording.name, &happened);
        checkup.findings.extend(said);
        let name = &recording.name;
        checkup.incidents.insert(name.clone(), happened);
        if recording.joints.iter().all(|joint| joint.qd.is_some()) && !pipeline.is_off() {
            let agreement = velocity_agreement(&trajectory, &pipeline.standstill_velocity);
            checkup.agreement.insert(name.clone(), agreement);
        }
        checkup.trajectories.push(trajectory);
    }
    let found = look(robot, pipeline, &checkup.trajectories)?;
    checkup.joints = found.joints;
    checkup.findings.extend(found.findings);
    let lags = checkup.trajectories.iter();
    let lags: Vec<LogLag> = lags
        .filter_map(|trajectory| estimate_lag(robot, pipeline, trajectory))
        .collect();
    checkup.findings.extend(lag_findings(pipeline, &lags));
    checkup.lags = lags.into_iter().map(|lag| (lag.log.clone(), lag)).collect();
    Ok(checkup)
}
