//! What a user says of the pipeline: numbers, or that they are chosen from the data.

use crate::error::{Error, Result};
use crate::signal::clean::correct::Corrections;

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

impl SignalSettings {
    /// Refuses numbers that are out of range.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub(crate) fn check(&self) -> Result<()> {
        let positive = |key: &str, value: f64, zero: bool| {
            if value.is_finite() && (value > 0.0 || zero && value == 0.0) {
                return Ok(());
            }
            Err(setting(
                key,
                format!("{value} is out of range"),
                "give a number above 0",
            ))
        };
        if let Auto::Value(value) = self.cutoff_hz {
            positive("signal.cutoff_hz", value, true)?;
        }
        if let Auto::Value(value) = self.rate_hz {
            positive("signal.rate_hz", value, false)?;
        }
        self.coulomb_velocity.map_or(Ok(()), |value| {
            positive("library.coulomb_velocity", value, true)
        })
    }
}

/// The error of a setting that cannot be used.
pub(super) fn setting(key: &str, problem: String, remedy: &str) -> Error {
    Error::Setting {
        key: key.into(),
        problem,
        remedy: remedy.into(),
    }
}
