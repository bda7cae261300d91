//! A calibration that could not go on.

use crate::error::{Error, Finding};

/// Why there is no calibration, and what was found before that: it often says why as well, as a step of an encoder does
/// that cuts a log into pieces too short to use.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct Stopped {
    /// Why it could not go on.
    pub error: Error,
    /// Findings up to there, in order.
    pub findings: Vec<Finding>,
}

impl From<Stopped> for Error {
    fn from(stopped: Stopped) -> Self {
        stopped.error
    }
}
