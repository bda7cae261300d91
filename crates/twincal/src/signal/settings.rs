//! What a user says of the pipeline: numbers, or that they are chosen from the data.

use super::correct::Corrections;

/// A number, or "auto": chosen from the data and stated in the result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Auto {
    /// Chosen from the data.
    Auto,
    /// As given.
    Value(f64),
}

/// `[signal]` and the parts of `[library]` and `[log]` that the pipeline needs.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalSettings {
    /// Cut-off f_c of the torque-and-column filter, Hz. 0: no filter, decimation, resampling, trimming or mask.
    pub cutoff_hz: Auto,
    /// Rate of the kept rows, Hz; auto = 2.5 f_c.
    pub rate_hz: Auto,
    /// v_s of Coulomb friction and of the standstill mask, rad/s or m/s; `None`: 0 with cut-off 0, else 0.02, of which a calibration
    /// takes a quarter to four times for friction where training data clearly ask for it.
    pub coulomb_velocity: Option<f64>,
    /// What is put right in every log first.
    pub corrections: Corrections,
    /// Columns may change faster than the motion does (expressions of the user, gear ripple): evaluate them at every sample.
    pub every_sample: bool,
}
