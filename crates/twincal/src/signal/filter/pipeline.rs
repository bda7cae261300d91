//! The numbers by which every log of a fit is filtered, and what follows from them: rates, and how far filters reach.

use super::fir;
use super::history::JointHistory;
use crate::signal::clean::correct::{Corrections, DerivedFrom};
use crate::signal::clean::standstill;
use serde::{Deserialize, Serialize};

/// Motion filter's highest cut-off as a share of the log's rate.
pub(crate) const MOTION_LIMIT: f64 = 0.45;
/// Column filter's highest cut-off as a share of the log's rate: 2.5 f_c is then the rate itself.
pub(crate) const COLUMN_LIMIT: f64 = 0.4;
/// Standstill has to last for this many periods of the cut-off.
const STANDSTILL_PERIODS: f64 = 3.0;
/// Rates that differ by less than this share are one: clocks are known no better.
const SAME_RATE: f64 = 1e-6;

/// The pipeline with every "auto" replaced by its number; the same for all logs of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pipeline {
    /// f_c, Hz; 0 = off.
    pub cutoff_hz: f64,
    /// f_q = 4 f_c of the motion filter, Hz.
    pub motion_cutoff_hz: f64,
    /// Rate of kept rows as asked for, Hz; see [`Pipeline::kept_rate`] for that of a log.
    pub rate_hz: f64,
    /// Longest sampling interval at which motion is held and columns are evaluated, s: a finer clock is thinned behind a separate
    /// filter (`signal/filter/thin.rs`). 0: every sample of the log.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub motion_interval: f64,
    /// v_s, rad/s or m/s.
    pub coulomb_velocity: f64,
    /// Standstill threshold per joint: max(v_s as stated or 0.02, what the encoder resolves), rad/s or m/s. A joint that is slower for long
    /// counts as at rest, as one whose position is constant.
    pub standstill_velocity: Vec<f64>,
    /// What q̈ is derived from where it is not logged, per joint: the channel that leaves less noise.
    pub derived_from: Vec<DerivedFrom>,
    /// Where velocity comes from per joint: from position where the logged one has by far more noise; empty as logged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocity_from: Vec<DerivedFrom>,
    /// What is put right in every log first.
    #[serde(default, skip_serializing_if = "Corrections::is_default")]
    pub corrections: Corrections,
    /// What is followed of each joint's history; empty: nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub history: Vec<JointHistory>,
}

impl Pipeline {
    /// How long the position of a joint has to be constant for a rest, s.
    #[must_use]
    pub fn shortest_rest(&self) -> f64 {
        standstill::SHORTEST
    }

    /// How long a joint has to be slow to count as at rest though its position changes, s: three periods of the cut-off, so that the filter
    /// has forgotten what was before; infinite without a filter.
    #[must_use]
    pub fn shortest_standstill(&self) -> f64 {
        STANDSTILL_PERIODS / self.cutoff_hz
    }

    /// The pipeline that changes nothing: every input row is one row.
    pub fn off(dof: usize) -> Self {
        Self {
            cutoff_hz: 0.0,
            motion_cutoff_hz: 0.0,
            rate_hz: 0.0,
            motion_interval: 0.0,
            coulomb_velocity: 0.0,
            standstill_velocity: vec![0.0; dof],
            derived_from: vec![DerivedFrom::Position; dof],
            velocity_from: Vec::new(),
            corrections: Corrections::default(),
            history: Vec::new(),
        }
    }

    /// True with cut-off 0.
    pub fn is_off(&self) -> bool {
        self.cutoff_hz == 0.0
    }

    /// Where velocity and an acceleration that is not logged come from, of one joint.
    pub(crate) fn sources(&self, joint: usize) -> [DerivedFrom; 2] {
        let velocity = self.velocity_from.get(joint);
        [
            velocity.copied().unwrap_or(DerivedFrom::Velocity),
            self.derived_from[joint],
        ]
    }

    /// Samples between kept rows of a log with this interval, s.
    pub(crate) fn step(&self, interval: f64) -> usize {
        if self.is_off() {
            1
        } else {
            (1.0 / (interval * self.rate_hz)).round().max(1.0) as usize
        }
    }

    /// Rate of the kept rows of a log with this interval (s), Hz: they stand whole samples apart, so that it is only near
    /// `rate_hz`.
    pub fn kept_rate(&self, interval: f64) -> f64 {
        1.0 / (interval * self.step(interval) as f64)
    }

    /// The one rate of the kept rows of several logs, from that of each; `rate_hz` where they differ.
    pub fn common_rate(&self, kept: impl IntoIterator<Item = f64>) -> f64 {
        let alike = |a: f64, b: f64| (a - b).abs() <= SAME_RATE * b;
        let kept: Vec<f64> = kept.into_iter().collect();
        match kept.first() {
            Some(&first) if kept.iter().all(|rate| alike(*rate, first)) => {
                if alike(first, self.rate_hz) {
                    self.rate_hz
                } else {
                    first
                }
            }
            _ => self.rate_hz,
        }
    }

    /// Half length of the column filter F, s; 0 when off. A row at t uses torque and columns from t − half to t + half.
    pub fn filter_half_length(&self) -> f64 {
        if self.is_off() {
            0.0
        } else {
            fir::column_half_seconds(self.cutoff_hz)
        }
    }

    /// Half length of the motion filter with what thins a fine clock before it, s; 0 when off.
    pub fn motion_half_length(&self) -> f64 {
        if self.is_off() {
            return 0.0;
        }
        let thinning = if self.motion_interval > 0.0 {
            fir::thinning_half_seconds(self.motion_cutoff_hz, self.motion_interval)
        } else {
            0.0
        };
        fir::motion_half_seconds(self.motion_cutoff_hz) + thinning
    }

    /// Whole length of what one row sees, s: two rows further apart share no sample. 0 when off.
    pub fn kernel_length(&self) -> f64 {
        2.0 * (self.filter_half_length() + self.motion_half_length())
    }

    /// sd of white torque noise of sd 1 after F, for a log at `rate_hz`; 1 when off.
    pub fn noise_gain(&self, rate_hz: f64) -> f64 {
        if self.is_off() {
            1.0
        } else {
            fir::noise_gain(&fir::column_kernel(self.cutoff_hz, 1.0 / rate_hz))
        }
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
