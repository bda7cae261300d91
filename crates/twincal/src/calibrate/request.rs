//! What one pass over the logs is asked for.

use super::settings::CalibrationSettings;
use crate::robot::Robot;
use crate::signal::{Log, Logs};

/// How far a pass goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Goal {
    /// To the result, unless a coarse encoder masks the torque of the model.
    Result,
    /// To the result in any case.
    ResultAnyway,
    /// To the number of independent rows.
    Count,
}

/// A robot and the settings of one pass.
#[derive(Clone, Copy)]
pub(super) struct Request<'r> {
    pub(super) robot: &'r Robot,
    pub(super) settings: &'r CalibrationSettings,
    pub(super) goal: Goal,
}

/// Logs as recorded; none once the recordings are dropped.
#[derive(Clone, Copy)]
pub(super) struct Recorded<'a> {
    pub(super) fit: &'a [Log<'a>],
    pub(super) heldout: &'a [Log<'a>],
}

impl<'a> Recorded<'a> {
    /// No logs.
    pub(super) const NONE: Recorded<'static> = Recorded {
        fit: &[],
        heldout: &[],
    };

    /// Those of both roles, if they are still there.
    pub(super) fn of(recordings: Option<&'a (Logs<'_>, Logs<'_>)>) -> Self {
        match recordings {
            Some((fit, heldout)) => Self {
                fit: &fit.0,
                heldout: &heldout.0,
            },
            None => Self::NONE,
        }
    }

    /// Logs to fit, then held-out ones.
    pub(super) fn all(self) -> impl Iterator<Item = &'a Log<'a>> + Clone {
        self.fit.iter().chain(self.heldout)
    }
}
