//! The held-out scores that a twin is judged by, and how many independent rows stand behind them.

use crate::calibrate::Calibration;
use crate::likelihood::JointNoise;
use crate::posterior::{CHAINS_APART, Method};
use crate::validate::{Scores, Validation};

/// Held-out rows, in independent ones, below which nothing is promised.
pub(super) const FEW: f64 = 20.0;

/// The scores that a twin is judged by: at standstill friction is whatever it takes, so those of moving joints where there are any.
#[must_use]
pub fn decisive(validation: &Validation) -> &Scores {
    let moves = validation.moving.joints.iter().any(|joint| joint.rows > 0);
    if moves && validation.moving.rmse_nominal > 0.0 {
        &validation.moving
    } else {
        &validation.filtered
    }
}

/// Whether [`decisive`] leaves out held-out rows in which a joint stands still.
#[must_use]
pub fn has_standstill(validation: &Validation) -> bool {
    rows_of(decisive(validation)) < rows_of(&validation.filtered)
}

/// Held-out values of all joints.
#[must_use]
pub fn rows_of(scores: &Scores) -> u64 {
    scores.joints.iter().map(|joint| joint.rows).sum()
}

/// RMSE with friction alone over all rows of all joints; `None` where some joint has none.
#[must_use]
pub fn friction_only(scores: &Scores) -> Option<f64> {
    let own = scores.joints.iter().filter(|joint| joint.rows > 0);
    let squares: Option<Vec<f64>> = own
        .map(|joint| Some(joint.rows as f64 * joint.rmse_friction?.powi(2)))
        .collect();
    let sum = squares?.iter().sum::<f64>();
    let left = (sum / rows_of(scores) as f64).sqrt();
    left.is_finite().then_some(left)
}

/// Held-out rows divided by each joint's autocorrelation time: how many independent ones they are worth.
#[must_use]
pub fn independent_rows(calibration: &Calibration) -> f64 {
    let scores = calibration.validation.filtered.joints.iter();
    scores
        .map(|score| score.rows as f64 / memory(&calibration.noise, &score.joint))
        .sum()
}

/// Rows that count as one independent row of a joint, at least 1.
#[must_use]
pub fn memory(noise: &[JointNoise], joint: &str) -> f64 {
    let own = noise.iter().find(|noise| noise.joint == joint);
    let time = own.map_or(1.0, |noise| noise.autocorrelation_time);
    if time.is_finite() { time.max(1.0) } else { 1.0 }
}

/// R̂ and effective sample size as Vehtari et al. (2021) ask for.
#[must_use]
pub fn converged(calibration: &Calibration) -> bool {
    match calibration.twin.posterior.method {
        Method::Exact { .. } => true,
        Method::Search { missing, .. } => missing < 1e-3,
        Method::Gibbs { r_hat, ess, .. } => r_hat <= 1.01 && ess >= 400.0,
        Method::Fleet { spread, .. } => spread <= CHAINS_APART,
    }
}
