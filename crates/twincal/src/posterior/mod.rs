//! What is known after the data: models, inclusion probabilities, coefficients, draws (method section 7).

mod bounded;
mod covariance;
pub mod draws;
pub mod mixture;
pub mod student;
pub mod summary;
mod triangle;

use crate::prior::Prior;
use serde::{Deserialize, Serialize};

/// The only input of inference: weighted statistics, and the prior. Both methods target exactly this posterior:
///
/// ```text
/// ln p(y, z) = ln p(z) + log_constant − n/2 ln 2π + a0 ln b0 − lnΓ(a0) + lnΓ(a0+n/2)
///              − ½Σ_{k∈z} ln v_k − ½ ln|A_z| − (a0+n/2) ln(b0 + RSS_z/2)
/// A_z = G_zz + V_z⁻¹,  RSS_z = yy − r_zᵀ A_z⁻¹ r_z
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    /// G, K × K row-major; written as its lower triangle.
    #[serde(with = "triangle")]
    pub gram: Vec<f64>,
    /// r = Φᵀy, K.
    pub xy: Vec<f64>,
    /// yᵀy.
    pub yy: f64,
    /// n (tempered where the likelihood is tempered).
    pub n: f64,
    /// `½Σ n_j ln w_j + ½Σ starts_j ln(1−ρ_j²)`.
    pub log_constant: f64,
    /// The prior.
    pub prior: Prior,
    /// Names of the K columns, for messages.
    pub names: Vec<String>,
}

/// One model z with its conditional posterior: `β_z | φ ~ N(μ_z, φ A_z⁻¹)`, `φ ~ InvGamma(a_n, b_n)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// Columns in z, ascending.
    pub members: Vec<u32>,
    /// Posterior probability.
    pub weight: f64,
    /// b_n = b0 + RSS_z/2.
    pub scale: f64,
    /// μ_z, same order as `members`.
    pub mean: Vec<f64>,
    /// Lower Cholesky factor L of A_z = L Lᵀ, row-major, m × m.
    pub factor: Vec<f64>,
    /// Bounds that act on the coefficients; empty without bounds.
    #[serde(default)]
    pub sites: Vec<Site>,
}

/// One bound `β_k ≥ lower` of a model, or `Σ f β_k ≥ lower`. `mean` and `factor` of the model are those of the normal distribution with the
/// moments of the bounded one; without its sites it is the conjugate posterior, so that draws can respect the bound:
///
/// ```text
/// A_z (conjugate) = L Lᵀ − diag(precision),     A_z μ (conjugate) = L Lᵀ mean − shift
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Site {
    /// Index in `members`; of a sum its first term.
    pub place: u32,
    /// (index in `members`, factor f) of a sum; empty: the coefficient at `place` alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<(u32, f64)>,
    /// The bound, in the coefficients' unit.
    pub lower: f64,
    /// What the bound adds to the diagonal of A_z, of a sum times f fᵀ.
    pub precision: f64,
    /// What it adds to A_z μ, of a sum times f.
    pub shift: f64,
}

impl Site {
    /// (index in `members`, factor) of what is bounded.
    pub fn direction(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let single = self.terms.is_empty().then_some((self.place as usize, 1.0));
        let terms = self.terms.iter().map(|&(i, f)| (i as usize, f));
        single.into_iter().chain(terms)
    }

    /// What is bounded, at these coefficients of the members.
    #[must_use]
    pub fn value(&self, beta: &[f64]) -> f64 {
        self.direction().map(|(i, f)| f * beta[i]).sum()
    }
}

/// Inclusion probabilities between which an effect is an open question, and outside which it is decided.
pub const OPEN: [f64; 2] = [0.05, 0.95];

/// Difference of a robot's probability between the chains of a fleet above which they disagree.
pub const CHAINS_APART: f64 = 0.1;

/// How the posterior was computed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "snake_case")]
pub enum Method {
    /// Every model was summed.
    Exact {
        /// 2^C.
        models: u64,
    },
    /// The models that a search found.
    Search {
        /// Models that were weighed.
        models: u64,
        /// Estimated share of the mass that was not found.
        missing: f64,
    },
    /// Collapsed Gibbs sampling of the structure.
    Gibbs {
        /// Chains.
        chains: usize,
        /// Draws per chain after warm-up.
        draws: usize,
        /// Largest rank-normalised split R̂ over terms.
        r_hat: f64,
        /// Smallest bulk ESS over terms.
        ess: f64,
    },
    /// That of a fleet: chains that alternate between the type and its robots.
    Fleet {
        /// Robots whose statistics are behind it.
        robots: usize,
        /// Chains.
        chains: usize,
        /// Draws per chain after it settled.
        draws: usize,
        /// Largest difference between the chains of the probability that a robot deviates.
        spread: f64,
    },
}

/// The posterior over models, coefficients and noise.
///
/// # Example
/// Weights of the models sum to 1. Column 0 is a hidden term of 0.8 sin(q1 − q2), which nearly all of them contain.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// # let fit = two_link::study()?;
/// let posterior = &fit.twin().posterior;
/// let all: f64 = posterior.models.iter().map(|model| model.weight).sum();
/// assert!((all - 1.0).abs() < 1e-9);
/// assert!((posterior.mean[0] - 0.8).abs() < 0.02 && posterior.inclusion[0] > 0.99);
/// assert!(posterior.any(&[posterior.component[0]]) > 0.99); // at least one of these components
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// Component of each column (0..C), K.
    #[serde(default)]
    pub component: Vec<usize>,
    /// P(z_k = 1 | y): that of the column's component, K.
    pub inclusion: Vec<f64>,
    /// Monte Carlo standard error of `inclusion`; 0 when exact.
    pub inclusion_mcse: Vec<f64>,
    /// E[β_k | y], unconditional, K.
    pub mean: Vec<f64>,
    /// sd of β_k | y, unconditional, K.
    pub sd: Vec<f64>,
    /// a_n = a0 + n/2.
    pub shape: f64,
    /// E[φ | y].
    pub noise: f64,
    /// Heaviest models, descending weight (ties: members ascending); weights are renormalised to sum to 1.
    pub models: Vec<Model>,
    /// Posterior mass of `models` before renormalising.
    pub models_mass: f64,
    /// ln of the sum over all models of p(y, z); `None` with Gibbs.
    pub log_evidence: Option<f64>,
    /// How it was computed.
    pub method: Method,
}

impl Posterior {
    /// P(at least one of these components is in | y), from the listed models, within what the components' own
    /// probabilities allow: `max PIP ≤ P ≤ min(1, Σ PIP)`. 0 for no component.
    pub fn any(&self, components: &[usize]) -> f64 {
        let asked = |k: usize| components.contains(&self.component[k]);
        let listed: f64 = self
            .models
            .iter()
            .filter(|model| model.members.iter().any(|&k| asked(k as usize)))
            .map(|model| model.weight)
            .sum();
        let mut own: Vec<(usize, f64)> = (0..self.component.len())
            .filter(|&k| asked(k))
            .map(|k| (self.component[k], self.inclusion[k]))
            .collect();
        own.sort_by_key(|pip| pip.0);
        own.dedup_by_key(|pip| pip.0);
        let largest = own.iter().map(|pip| pip.1).fold(0.0, f64::max);
        let sum: f64 = own.iter().map(|pip| pip.1).sum();
        listed.min(sum).max(largest).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_of_several_is_a_sum_over_models() {
        let model = |members: &[u32], weight: f64| Model {
            members: members.to_vec(),
            weight,
            scale: 1.0,
            mean: Vec::new(),
            factor: Vec::new(),
            sites: Vec::new(),
        };
        let posterior = Posterior {
            component: vec![0, 1, 1, 2],
            inclusion: vec![0.5, 0.4, 0.4, 0.2],
            inclusion_mcse: vec![0.0; 4],
            mean: vec![0.0; 4],
            sd: vec![0.0; 4],
            shape: 3.0,
            noise: 1.0,
            models: vec![
                model(&[0], 0.5),
                model(&[1, 2], 0.2),
                model(&[1, 2, 3], 0.2),
                model(&[], 0.1),
            ],
            models_mass: 1.0,
            log_evidence: None,
            method: Method::Exact { models: 8 },
        };
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(posterior.any(&[0, 1]), 0.9);
        near(posterior.any(&[1, 2]), 0.4);
        near(posterior.any(&[2]), 0.2);
        near(posterior.any(&[]), 0.0);
    }
}
