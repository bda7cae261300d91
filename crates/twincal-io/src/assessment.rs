//! `assessment` of `result.json` and of `check --json`: what may be concluded, in codes and numbers.

use serde::Serialize;
use twincal::assess::{Assessment, assess};
use twincal::calibrate::Calibration;

/// Version of its layout.
const VERSION: u64 = 1;

/// An assessment with the version of its layout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Versioned {
    version: u64,
    #[serde(flatten)]
    assessment: Assessment,
}

impl From<Assessment> for Versioned {
    fn from(assessment: Assessment) -> Self {
        Self {
            version: VERSION,
            assessment,
        }
    }
}

impl Versioned {
    /// Of a calibration.
    pub(crate) fn of(calibration: &Calibration) -> Self {
        assess(calibration).into()
    }
}
