//! Filters, and a log through those of a pipeline: smooth motion with what rests, saturates or depends on history.

pub(super) mod agreement;
pub(super) mod align;
pub(super) mod chapter_motion;
pub(super) mod convolve;
pub(crate) mod decimate;
pub(crate) mod fir;
pub(super) mod fourier;
pub(super) mod history;
pub(crate) mod interpolate;
pub(super) mod mask;
pub(super) mod pipeline;
pub(super) mod prepared_log;
pub(super) mod remember;
pub(super) mod segment;
pub(super) mod spectrum;
pub(super) mod thin;
pub(super) mod trajectory;
