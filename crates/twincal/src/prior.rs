//! What is believed before the data: spike and slab in the user's words (method section 6).

use crate::signal::Auto;
use serde::{Deserialize, Serialize};

/// `[prior] inclusion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Inclusion {
    /// Every column independently with this probability.
    Probability(f64),
    /// Beta–Binomial(1, K/m0 − 1) per family, K all columns: m0 terms expected in total.
    ExpectedTerms(f64),
}

/// `[prior]`.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorSettings {
    /// v in `β_k·rms(column k) ~ N(0, v φ)`; auto: learned.
    pub scaled_variance: Auto,
    /// `None`: `ExpectedTerms(min(5, K/2))`.
    pub inclusion: Option<Inclusion>,
    /// `(a0, b0)` of `φ ~ InvGamma`; b0 in (N·m)²; `None`: `(1e-3, 1e-3 · mean(y²))`.
    pub noise: Option<(f64, f64)>,
}

/// The prior with every number filled in, for the K columns of one problem.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// v_k: `β_k | z_k=1, φ ~ N(0, φ v_k)` in the column's own units, K.
    pub slab: Vec<f64>,
    /// Family index of each column (0..families), K.
    pub family: Vec<usize>,
    /// Inclusion.
    pub inclusion: Inclusion,
    /// a0.
    pub shape: f64,
    /// b0, (N·m)².
    pub scale: f64,
}
