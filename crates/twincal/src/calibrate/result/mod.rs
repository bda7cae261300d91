//! A checked fit becomes what people read: one status per effect, sets, curves and findings.

pub(super) mod calibration;
pub(super) mod common_gain;
pub(super) mod components;
pub(super) mod curves;
pub(super) mod drive_scale;
pub(super) mod effects;
pub(super) mod ended;
pub(super) mod groups;
pub(super) mod negative_friction;
pub(super) mod settle;
pub(super) mod status;
pub(super) mod summary;
pub(super) mod unphysical;
pub(super) mod unseen;
