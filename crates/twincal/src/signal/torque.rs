//! What measured torque lacks: samples of it, or any change in it.

use super::Recording;
use crate::error::{Finding, Severity};
use crate::robot::Robot;

/// A joint that travels less in a log stands still there, rad or m.
const TRAVEL: f64 = 0.01;
/// Names at most in one message.
const NAMED: usize = 4;

impl Recording {
    /// Takes the measured torque out, one entry per joint. What is left is motion alone: torque that is missing or late then
    /// neither cuts nor moves a prediction.
    pub fn take_torque(&mut self) -> Vec<Option<Vec<f64>>> {
        self.joints
            .iter_mut()
            .map(|channels| channels.tau.take())
            .collect()
    }
}

/// Says how much measured torque a log lacks that is only to be predicted; nothing is lost from the prediction.
pub fn missing_torque(robot: &Robot, log: &Recording) -> Option<Finding> {
    let samples = log.time.len();
    let lacking = |values: &Vec<f64>| values.iter().filter(|v| !v.is_finite()).count();
    let joints: Vec<(&str, usize)> = (robot.joint_names().into_iter().zip(&log.joints))
        .filter_map(|(name, channels)| Some((name, channels.tau.as_ref().map(lacking)?)))
        .filter(|(_, count)| *count > 0)
        .collect();
    let most = joints.iter().map(|(_, count)| *count).max()?;
    let words: Vec<String> = (joints.iter().take(NAMED))
        .map(|(name, count)| format!("joint `{name}`: {count}"))
        .collect();
    Some(Finding::new(
        Severity::Warning,
        "missing_torque",
        &log.name,
        format!(
            "measured torque is NaN or infinite in some of {samples} rows ({}): they are predicted all the same, with no \
             measured torque beside",
            words.join(", ")
        ),
        most as u64,
    ))
}

/// Torque that never changes while its joint moves: drives off, or a column that was not recorded. One joint like that may be
/// a passive one; a log in which every moving joint is like that is degraded, unless the robot swung freely.
pub fn constant_torque<'a>(
    robot: &Robot,
    logs: impl IntoIterator<Item = &'a Recording>,
) -> Vec<Finding> {
    let names = robot.joint_names();
    let mut findings = Vec::new();
    for log in logs {
        let moving: Vec<(&str, &[f64])> = (names.iter().zip(&log.joints))
            .filter(|(_, channels)| varies(&channels.q, TRAVEL))
            .filter_map(|(name, channels)| Some((*name, channels.tau.as_deref()?)))
            .collect();
        let constant: Vec<String> = (moving.iter())
            .filter(|(_, tau)| !varies(tau, 0.0))
            .map(|(name, tau)| {
                let value = tau.iter().find(|v| v.is_finite()).unwrap_or(&f64::NAN);
                format!("`{name}` is {value}")
            })
            .collect();
        if constant.is_empty() {
            continue;
        }
        let shown = constant[..constant.len().min(NAMED)].join(", ");
        let cause = "the drives were off, or the column was not recorded";
        let severity = if constant.len() == moving.len() {
            Severity::Degraded
        } else {
            Severity::Warning
        };
        findings.push(Finding::new(
            severity,
            "constant_torque",
            &log.name,
            format!(
                "torque never changes while the joint moves (joint {shown} throughout): {cause}; what is found there is wrong \
                 unless it swung freely; map the measured torque in [columns] tau, or leave this log out"
            ),
            constant.len() as u64,
        ));
    }
    findings
}

/// Whether two finite values are more than `by` apart; looks no further than to the first such two.
fn varies(values: &[f64], by: f64) -> bool {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    values.iter().filter(|v| v.is_finite()).any(|v| {
        (low, high) = (low.min(*v), high.max(*v));
        high - low > by
    })
}
