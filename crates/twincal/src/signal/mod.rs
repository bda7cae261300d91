//! From a recording to uniform, finite, filtered motion and torque (method section 1).

use crate::error::{Finding, Result};
use crate::robot::Robot;
use serde::{Deserialize, Serialize};

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
    /// v_s of Coulomb friction and of the standstill mask, rad/s or m/s; `None`: 0 with cut-off 0, else 0.02.
    pub coulomb_velocity: Option<f64>,
}

/// One joint's channels as logged, SI units, all of the recording's length.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// rad or m.
    pub q: Vec<f64>,
    /// rad/s or m/s, if logged.
    pub qd: Option<Vec<f64>>,
    /// rad/s² or m/s², if logged.
    pub qdd: Option<Vec<f64>>,
    /// N·m or N; absent for a log that is only to be predicted.
    pub tau: Option<Vec<f64>>,
}

/// A log as read: joints already matched to the robot's q1…qn, values untouched (NaN included).
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Name as given by the user.
    pub name: String,
    /// Time stamps as logged, s.
    pub time: Vec<f64>,
    /// One entry per moving joint of the robot, in order.
    pub joints: Vec<Channels>,
}

/// The pipeline with every "auto" replaced by its number; the same for all logs of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pipeline {
    /// f_c, Hz; 0 = off.
    pub cutoff_hz: f64,
    /// f_q = 4 f_c of the motion filter, Hz.
    pub motion_cutoff_hz: f64,
    /// Rate of kept rows, Hz.
    pub rate_hz: f64,
    /// v_s, rad/s or m/s.
    pub coulomb_velocity: f64,
    /// Standstill threshold per joint: max(v_s, what the encoder resolves), rad/s or m/s.
    pub standstill_velocity: Vec<f64>,
}

/// A run of samples on one clock without a cut: finite, time increasing. Arrays are `joint * len + sample`.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Time stamps, s; uniform to rounding unless the pipeline is off.
    pub time: Vec<f64>,
    /// Index of each sample's input row in the recording when the clock was uniform already; otherwise empty.
    pub input_rows: Vec<usize>,
    /// Filtered motion (f_q) at the log's rate; as logged with the pipeline off.
    pub q: Vec<f64>,
    /// Velocity.
    pub qd: Vec<f64>,
    /// Acceleration.
    pub qdd: Vec<f64>,
    /// Torque as logged (resampled if needed), unfiltered.
    pub tau: Vec<f64>,
    /// Standstill per joint and sample.
    pub standstill: Vec<bool>,
    /// Sampling interval, s.
    pub interval: f64,
}

/// One log, ready: segments of filtered motion and raw torque.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Name of its log.
    pub name: String,
    /// Moving joints.
    pub dof: usize,
    /// In time order.
    pub segments: Vec<Segment>,
}

/// Chooses cut-off, rates and thresholds from the training recordings.
pub fn choose_pipeline(_r: &Robot, _logs: &[Recording], _s: &SignalSettings) -> Result<(Pipeline, Vec<Finding>)> {
    todo!()
}

/// One recording through steps 1 and 2 of method section 1: cut, resample, smooth, differentiate, mask.
pub fn align(_r: &Robot, _log: &Recording, _p: &Pipeline) -> Result<(Trajectory, Vec<Finding>)> {
    todo!()
}
