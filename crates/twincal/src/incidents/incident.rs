//! A stretch of a log that the fit leaves out, and what happened there.

use serde::{Deserialize, Serialize};

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IncidentKind {
    /// Torque that neither rigid bodies nor friction explain, for a short time: a contact, a collision or a push.
    #[serde(alias = "spike")]
    Contact,
    /// All joints stand still without the torque that holds them: brakes, or a protective stop.
    DrivesOff,
}

/// A stretch of a log that is not the robot's own motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Incident {
    /// What happened.
    pub kind: IncidentKind,
    /// Joint in which it is largest.
    pub joint: String,
    /// First and last stamp, s.
    pub span: [f64; 2],
    /// Contact: largest torque that is not explained. Drives off: largest torque that holding would take. N·m or N.
    pub torque: f64,
    /// Samples from first to last.
    pub samples: u64,
}
