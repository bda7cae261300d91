//! `assessment` of `result.json`: what may be concluded, in codes and numbers.

use serde::Serialize;
use twincal::assess::{Assessment, assess};
use twincal::calibrate::Calibration;

/// Version of its layout.
const VERSION: u64 = 1;

/// An assessment with the version of its layout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Versioned {
    version: u64,
    #[serde(flatten)]
    assessment: Assessment,
}

impl Versioned {
    /// Of a calibration.
    pub(crate) fn of(calibration: &Calibration) -> Self {
        Self {
            version: VERSION,
            assessment: assess(calibration),
        }
    }
}
