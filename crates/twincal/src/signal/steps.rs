//! What the channels of a log resolve: the step by which each of them changes (case 27).

use super::Recording;
use super::encoder::quantum;
use crate::robot::Robot;
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
pub fn steps(robot: &Robot, log: &Recording) -> Vec<Steps> {
    let step = |values: Option<&[f64]>| values.and_then(|values| quantum(std::iter::once(values)));
    let joints = robot.joint_names().into_iter().zip(&log.joints);
    joints
        .map(|(name, channels)| Steps {
            joint: name.to_owned(),
            position: step(Some(&channels.q)),
            velocity: step(channels.qd.as_deref()),
            torque: step(channels.tau.as_deref()),
        })
        .collect()
}
