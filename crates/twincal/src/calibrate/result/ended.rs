//! The end of a calibration, with or without a result.

use super::calibration::Calibration;
use crate::calibrate::stopped::Stopped;
use crate::error::{Finding, Mistake, Result};

/// The end of a calibration with the findings on logs as recorded first. Nothing is guaranteed by a log that is no recording of its own.
pub(in crate::calibrate) fn ended(
    calibration: Result<Calibration>,
    mut as_recorded: Vec<Finding>,
    findings: Vec<Finding>,
) -> std::result::Result<Calibration, Stopped> {
    let copied = (as_recorded.iter()).any(|f| f.mistake() == Some(Mistake::Copy));
    match calibration {
        Ok(mut calibration) => {
            if copied {
                calibration.validation.conformal = None;
            }
            as_recorded.append(&mut calibration.findings);
            calibration.findings = as_recorded;
            Ok(calibration)
        }
        Err(error) => {
            as_recorded.extend(findings);
            Err(Stopped {
                error,
                findings: as_recorded,
            })
        }
    }
}
