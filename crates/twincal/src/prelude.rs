//! What a program that calibrates needs by name: `use twincal::prelude::*`.
//!
//! | | |
//! |---|---|
//! | in | [`Robot`], [`Recording`], [`Payload`], [`Log`], [`Settings`], [`Family`], [`Auto`] |
//! | run | [`Calibrate`], [`Stage`], [`Stopped`], [`Error`], [`Finding`], [`Severity`] |
//! | out | [`Calibration`], [`Effect`], [`Status`], [`ParameterSummary`], [`Twin`], [`Torque`], [`TorqueModel`] |

pub use crate::builder::Calibrate;
pub use crate::calibrate::CalibrationSettings as Settings;
pub use crate::calibrate::{Calibration, Effect, ParameterSummary, Stage, Status, Stopped};
pub use crate::error::{Error, Finding, Severity};
pub use crate::robot::Robot;
pub use crate::signal::{Auto, Log, Payload, Recording};
pub use crate::term::Family;
pub use crate::twin::{Torque, TorqueModel, Twin};
