//! The whole road in one function that reads like the paper.

use crate::error::Finding;
use crate::infer::InferenceSettings;
use crate::likelihood::{JointNoise, NoiseSettings};
use crate::prior::PriorSettings;
use crate::signal::SignalSettings;
use crate::term::{LibrarySettings, Term};
use crate::twin::Twin;
use crate::validate::Validation;
use serde::{Deserialize, Serialize};

/// Everything a calibration can be told; each field is a table of `twincal.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSettings {
    /// `[library]`.
    pub library: LibrarySettings,
    /// `[signal]`.
    pub signal: SignalSettings,
    /// `[prior]`.
    pub prior: PriorSettings,
    /// `[noise]`.
    pub noise: NoiseSettings,
    /// `[inference]`.
    pub inference: InferenceSettings,
}

/// One row of `result.json` `terms[]`; numbers are `None` for dropped terms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TermSummary {
    /// Name, family, unit, status.
    pub term: Term,
    /// Posterior inclusion probability.
    pub pip: Option<f64>,
    /// Monte Carlo standard error of `pip` (0 when exact).
    pub pip_mcse: Option<f64>,
    /// E[β | y].
    pub mean: Option<f64>,
    /// sd of β | y.
    pub sd: Option<f64>,
    /// Central 95 % interval of β | y (unconditional).
    pub interval95: Option<[f64; 2]>,
    /// E[β | y, included].
    pub conditional_mean: Option<f64>,
    /// sd of β | y, included.
    pub conditional_sd: Option<f64>,
    /// PIP ≥ 0.5.
    pub selected: bool,
    /// PIP with the slab variance × 0.1, 1, 10 and expected terms × 0.5, 2 (method section 6).
    pub pip_sensitivity: Vec<f64>,
    /// One sentence in physical words, e.g. "viscous friction on elbow: +0.12 ± 0.01 N·m·s/rad".
    pub words: String,
}

/// What became of one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogSummary {
    /// Name as given.
    pub name: String,
    /// `fit` or `heldout`.
    pub role: String,
    /// Samples read.
    pub samples: u64,
    /// Duration, s.
    pub duration: f64,
    /// Median rate, Hz.
    pub rate_hz: f64,
    /// Segments after cutting.
    pub segments: u64,
    /// Rows used per joint (standstill excluded).
    pub rows: Vec<u64>,
    /// Rows masked as standstill per joint.
    pub standstill: Vec<u64>,
}

/// Kept coefficients' joint posterior draws, for the pair plot (paper fig. 3).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Draws {
    /// Names of the selected terms (at most 8, by |mean|/sd).
    pub terms: Vec<String>,
    /// `values[term][draw]`.
    pub values: Vec<Vec<f64>>,
}

/// The result of a calibration; `twincal-io` writes it as files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The calibrated twin.
    pub twin: Twin,
    /// One per term of the library, in order.
    pub terms: Vec<TermSummary>,
    /// Noise per joint (also in the twin).
    pub noise: Vec<JointNoise>,
    /// Multiplier c of the tempered likelihood; 1 otherwise.
    pub tempering: f64,
    /// v as used, per column family or one value.
    pub scaled_variance: f64,
    /// Held-out scores.
    pub validation: Validation,
    /// Normalised residual autocorrelation at lags 0..=20 rows: entries 2j and 2j+1 are joint j before and after calibration.
    pub autocorrelation: Vec<Vec<f64>>,
    /// Draws for figures.
    pub draws: Draws,
    /// Logs.
    pub logs: Vec<LogSummary>,
    /// Everything that must be said.
    pub findings: Vec<Finding>,
}
