//! The figures of the report, one file each.

pub(super) mod autocorrelation;
pub(super) mod coverage;
pub(super) mod curves;
pub(super) mod inclusion;
pub(super) mod pairs;
pub(super) mod pit;
pub(super) mod residual_state;
pub(super) mod residual_time;
pub(super) mod sensitivity;
pub(super) mod torque;
