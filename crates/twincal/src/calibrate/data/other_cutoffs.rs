//! The same filters at other cut-offs, for the sweep.

use crate::calibrate::settings::CalibrationSettings;
use crate::signal::Pipeline;

/// Factors on the cut-off.
pub(in crate::calibrate) const FACTORS: [f64; 2] = [0.7, 1.4];

/// The pipelines of the sweep beside that of the fit: none without a filter, and where rows are weighed.
pub(in crate::calibrate) fn pipelines(
    pipeline: &Pipeline,
    settings: &CalibrationSettings,
) -> Vec<Pipeline> {
    if pipeline.is_off() || settings.noise.weighs_rows() {
        return Vec::new();
    }
    FACTORS.iter().map(|f| scaled(pipeline, *f)).collect()
}

/// The same filters at `factor` times the cut-off.
pub(in crate::calibrate) fn scaled(pipeline: &Pipeline, factor: f64) -> Pipeline {
    Pipeline {
        cutoff_hz: factor * pipeline.cutoff_hz,
        motion_cutoff_hz: factor * pipeline.motion_cutoff_hz,
        rate_hz: factor * pipeline.rate_hz,
        ..pipeline.clone()
    }
}
