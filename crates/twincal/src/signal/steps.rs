//! What the channels of a log resolve: the step by which each of them changes (case 27).

use super::encoder::quantum;
use super::long::Log;
use crate::error::Result;
use crate::robot::Robot;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Steps of one joint's channels; `None` for a channel that is not quantised, or not logged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Steps {
    /// Name of the joint.
    pub joint: String,
    /// Of position, rad or m.
    pub position: Option<f64>,
    /// Of velocity, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Of torque, N·m or N.
    pub torque: Option<f64>,
}

/// Steps of every moving joint's channels in a log.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn steps(robot: &Robot, log: &Log<'_>) -> Result<Vec<Steps>> {
    let names = robot.joint_names();
    let mut found = vec![[const { Vec::new() }; 3]; names.len()];
    log.until(|recording| {
        let joints = found.par_iter_mut().zip(&recording.joints);
        joints.for_each(|(found, channels)| {
            let values = [
                Some(&channels.q),
                channels.qd.as_ref(),
                channels.tau.as_ref(),
            ];
            for (steps, values) in found.iter_mut().zip(values) {
                // A channel at rest says nothing.
                if let Some(values) = values.filter(|values| changes(values)) {
                    steps.push(quantum(std::iter::once(values.as_slice())));
                }
            }
        });
        false
    })?;
    let joints = names.into_iter().zip(&found);
    Ok(joints
        .map(|(name, found)| {
            let [position, velocity, torque] = found.each_ref().map(|steps| common_step(steps));
            Steps {
                joint: name.to_owned(),
                position,
                velocity,
                torque,
            }
        })
        .collect())
}

/// Whether a channel ever changes.
pub(super) fn changes(values: &[f64]) -> bool {
    values.iter().any(|value| *value != values[0])
}

/// The step of a channel from that of each part of a log: the smallest, if at least every second part has one.
pub(super) fn common_step(steps: &[Option<f64>]) -> Option<f64> {
    let known = || steps.iter().flatten().copied();
    let count = known().count();
    (count > 0 && 2 * count >= steps.len()).then(|| known().fold(f64::INFINITY, f64::min))
}
