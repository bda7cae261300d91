//! From averages in natural units to a [`Posterior`]: what every method does at its end.

use super::standard::Standard;
use crate::error::Result;
use crate::posterior::{Method, Model, Posterior};

/// Share of the mass that the list of models holds, unless it is full before.
pub(super) const LISTED_MASS: f64 = 1.0 - 1e-6;
/// Most models in the list.
pub(super) const LISTED_MODELS: usize = 1000;

/// Averages over models by position.
pub(super) struct Averages {
    /// PIP and its Monte Carlo standard error.
    pub(super) inclusion: Vec<f64>,
    pub(super) mcse: Vec<f64>,
    /// E[δ] and E[δ²].
    pub(super) shift: Vec<f64>,
    pub(super) moment: Vec<f64>,
    /// E[1 + c].
    pub(super) misfit: f64,
}

/// Some models of the posterior.
pub(super) struct Listed {
    /// Heaviest first, weights relative to all models.
    pub(super) models: Vec<Model>,
    /// Positions of each one's members, in the order of `members`.
    pub(super) positions: Vec<Vec<usize>>,
}

impl Listed {
    /// The heaviest of `found` (share of the mass, columns, positions) until `mass` is reached or there are `most`.
    pub(super) fn new(
        standard: &Standard,
        mut found: Vec<(f64, Vec<u32>, Vec<usize>)>,
        mass: f64,
        most: usize,
    ) -> Result<Self> {
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        let mut sum = 0.0;
        let count = found
            .iter()
            .position(|(weight, ..)| {
                sum += weight;
                sum >= mass
            })
            .map_or(found.len(), |last| last + 1);
        found.truncate(count.min(most));
        let mut listed = Self {
            models: Vec::with_capacity(found.len()),
            positions: Vec::with_capacity(found.len()),
        };
        for (weight, _, mut positions) in found {
            positions.sort_unstable_by_key(|&d| standard.order[d]);
            listed.models.push(standard.model(&positions, weight)?);
            listed.positions.push(positions);
        }
        Ok(listed)
    }

    /// Σ of weights.
    pub(super) fn mass(&self) -> f64 {
        self.models.iter().map(|m| m.weight).sum()
    }
}

/// Puts the pieces together in the columns' order and units; weights of models become shares of the listed mass.
pub(super) fn posterior(
    standard: &Standard,
    averages: &Averages,
    listed: Listed,
    log_evidence: Option<f64>,
    method: Method,
) -> Posterior {
    let factor = standard.noise_factor();
    let mass = listed.mass();
    let mut models = listed.models;
    models.iter_mut().for_each(|model| model.weight /= mass);
    let (inclusion, shift) = (&averages.inclusion, &averages.shift);
    let variance = |d: usize| (averages.moment[d] - shift[d] * shift[d]).max(0.0);
    Posterior {
        component: standard.component.clone(),
        inclusion: standard.in_columns(|d| inclusion[d].clamp(0.0, 1.0)),
        inclusion_mcse: standard.in_columns(|d| averages.mcse[d]),
        mean: standard.coefficients(|d| standard.center[d] + shift[d]),
        // With a_n ≤ 1 the noise has no mean, and an included coefficient no variance.
        sd: standard.coefficients(|d| match inclusion[d] > 0.0 {
            true if factor.is_finite() => variance(d).sqrt(),
            true => f64::INFINITY,
            false => 0.0,
        }),
        shape: standard.shape,
        noise: standard.noise(averages.misfit * factor),
        models,
        models_mass: mass.min(1.0),
        log_evidence,
        method,
    }
}
