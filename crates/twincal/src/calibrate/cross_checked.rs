//! What logs say of each other before they are filtered, and what follows for the calibration.

use super::Calibration;
use crate::cross_check::{copies, stuck_encoders};
use crate::error::{Finding, Mistake, Result};
use crate::robot::Robot;
use crate::signal::Log;

/// Findings on logs as recorded; logs to fit come first.
pub(super) fn as_recorded(robot: &Robot, logs: &[Log<'_>]) -> Result<Vec<Finding>> {
    let mut findings = copies(logs)?;
    findings.extend(stuck_encoders(robot, logs)?);
    Ok(findings)
}

/// The calibration with these findings first. Nothing is guaranteed by a log that is no recording of its own.
pub(super) fn told(calibration: Calibration, mut findings: Vec<Finding>) -> Calibration {
    let copied = findings.iter().any(|f| f.mistake() == Some(Mistake::Copy));
    let mut calibration = calibration;
    if copied {
        calibration.validation.conformal = None;
    }
    findings.append(&mut calibration.findings);
    Calibration {
        findings,
        ..calibration
    }
}
