//! Which rows count how much: iid, tempered and AR(1) noise, plug-ins by fixed point (method section 5).

use serde::{Deserialize, Serialize};

/// `[noise] model`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseModel {
    /// Independent rows (the paper's).
    Iid,
    /// Independent rows, statistics divided by c·τ_j.
    Tempered,
    /// First-order autoregression per joint.
    Ar1,
}

/// `[noise]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseSettings {
    /// Likelihood.
    pub model: NoiseModel,
    /// One variance per joint; false: all w_j = 1.
    pub per_joint: bool,
}

/// Plug-in noise of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointNoise {
    /// Joint name.
    pub joint: String,
    /// √E[φ/(w_j(1−ρ_j²)) | y], N·m or N.
    pub sigma: f64,
    /// AR(1) coefficient; 0 unless `ar1`.
    pub rho: f64,
    /// w_j; n_j-weighted geometric mean 1.
    pub weight: f64,
    /// Rows.
    pub n: f64,
    /// Rows after tempering: n/(c·τ_j); with ar1 n(1−ρ)/(1+ρ).
    pub n_eff: f64,
    /// Integrated autocorrelation time τ_j of the residual, rows.
    pub autocorrelation_time: f64,
    /// Factor on the noise part of intervals from left-out blocks; 1 unless `tempered`.
    pub interval_factor: f64,
    /// sd of the torque outside the filter's band, measured on the training residual, N·m; 0 with the filter off.
    pub out_of_band: f64,
}
