//! How far a calibration has come, and who hears of it.

use crate::error::Result;

/// How far a calibration has come; for progress bars.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Cutting, resampling and filtering the logs.
    Rows,
    /// Inference on all fit logs.
    Inference,
    /// Predicting held-out data: (done, all) splits.
    Validation(usize, usize),
    /// Prior and cut-off sensitivity.
    Sensitivity,
}

/// Hears of each stage, and may end the calibration with an error.
pub(super) type Watch<'a> = dyn Fn(Stage) -> Result<()> + 'a;
