//! Logs beside their model before anything is fitted: what `inspect` and `doctor` share.

use std::collections::BTreeMap;
use twincal::calibrate::LookedAt;
use twincal::cross_check::{Compared, copies, odd_torque, stuck_encoders};
use twincal::incidents::{Incident, motion};
use twincal::lag::{Lags, lag_findings, lags};
use twincal::robot::Robot;
use twincal::self_check::{Base, JointCheck, look};
use twincal::signal::{Agreement, Log, Pipeline, Trajectory, velocity_agreement};
use twincal::{Error, Finding, Severity};

/// Logs as a fit would filter them, and what log and model say of each other.
#[derive(Default)]
pub(super) struct Checkup {
    /// Logs that could be filtered, long ones in part; incidents are masked.
    pub(super) trajectories: Vec<Trajectory>,
    /// Which of the logs each of them is.
    places: Vec<usize>,
    /// Why others could not.
    pub(super) refused: Vec<Error>,
    /// How much later than the motion torque was logged; `None` where the logs do not say it.
    pub(super) lags: Option<Lags>,
    /// By log.
    pub(super) incidents: BTreeMap<String, Vec<Incident>>,
    pub(super) agreement: BTreeMap<String, Vec<Option<Agreement>>>,
    /// By joint, over all logs.
    pub(super) joints: Vec<JointCheck>,
    /// How the base stands, where the torque contradicts the model.
    pub(super) base: Option<Base>,
    /// Warnings; notes of the filters are left to `fit`.
    pub(super) findings: Vec<Finding>,
}

impl Checkup {
    /// The logs that could be filtered, for [`twincal::calibrate::outlook`].
    pub(super) fn looked_at<'a>(&'a mut self, logs: &'a [Log<'a>]) -> Vec<LookedAt<'a>> {
        let seen = self.trajectories.iter_mut().zip(&self.places);
        seen.map(|(trajectory, &place)| LookedAt {
            incidents: self
                .incidents
                .get(logs[place].name())
                .map_or(&[], |all| all),
            log: &logs[place],
            trajectory,
        })
        .collect()
    }
}

/// Filters the logs, looks for incidents and lags, and compares with the model.
///
/// # Errors
/// Positions in degrees. What is wrong with single logs stands in [`Checkup::refused`].
pub(super) fn checkup(
    robot: &Robot,
    logs: &[Log<'_>],
    pipeline: &Pipeline,
) -> twincal::Result<Checkup> {
    let mut checkup = Checkup::default();
    checkup.findings.extend(copies(logs)?);
    checkup.findings.extend(stuck_encoders(robot, logs)?);
    for (place, log) in logs.iter().enumerate() {
        let (trajectory, happened, more) = match motion(robot, pipeline, log) {
            Ok(seen) => seen,
            Err(error) => {
                checkup.refused.push(error);
                continue;
            }
        };
        let warnings = more.into_iter().filter(|f| f.severity > Severity::Note);
        checkup.findings.extend(warnings);
        let name = log.name().to_owned();
        checkup.incidents.insert(name.clone(), happened);
        let with_velocity =
            log.any_recording(|log| Ok(log.joints.iter().all(|joint| joint.qd.is_some())))?;
        if with_velocity && !pipeline.is_off() {
            let agreement = velocity_agreement(&trajectory, &pipeline.standstill_velocity);
            checkup.agreement.insert(name, agreement);
        }
        checkup.trajectories.push(trajectory);
        checkup.places.push(place);
    }
    let found = look(robot, pipeline, &checkup.trajectories)?;
    checkup.joints = found.joints;
    checkup.base = found.base;
    let compared = |log| Compared::of(pipeline, log);
    let all: Vec<Compared<'_>> = checkup.trajectories.iter().map(compared).collect();
    let odd = odd_torque(robot, &all, found.findings.is_empty());
    checkup.findings.extend(odd);
    checkup.findings.extend(found.findings);
    let trajectories: Vec<&Trajectory> = checkup.trajectories.iter().collect();
    checkup.lags = lags(robot, pipeline, &trajectories);
    if let Some(lags) = &checkup.lags {
        let said = &pipeline.corrections.lag;
        let late = lag_findings(said, lags, &checkup.findings);
        checkup.findings.extend(late);
    }
    Ok(checkup)
}
