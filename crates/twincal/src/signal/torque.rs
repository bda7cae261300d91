//! What measured torque lacks: samples of it.

use super::Recording;
use crate::error::{Finding, Severity};
use crate::robot::Robot;

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
