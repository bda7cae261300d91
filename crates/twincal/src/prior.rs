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

impl Prior {
    /// Number of families.
    pub fn families(&self) -> usize {
        self.family.iter().map(|f| f + 1).max().unwrap_or(0)
    }

    /// Columns per family.
    pub fn family_sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0; self.families()];
        self.family.iter().for_each(|&f| sizes[f] += 1);
        sizes
    }

    /// `(P(z = 1), P(z = 0))` of the next column of a family of which `seen` columns are decided, `included` of them in:
    /// the Pólya urn of the Beta–Binomial(1, b), b = K/m0 − 1. Multiplied over all columns, in any order, it gives the
    /// prior probability of a model.
    ///
    /// ```text
    /// P(z = 1 | included, seen) = (1 + included) / (1 + b + seen)
    /// ```
    pub fn next(&self, included: usize, seen: usize) -> (f64, f64) {
        match self.inclusion {
            Inclusion::Probability(p) => (p, 1.0 - p),
            Inclusion::ExpectedTerms(expected) => {
                let b = self.family.len() as f64 / expected - 1.0;
                let total = 1.0 + b + seen as f64;
                (
                    (1.0 + included as f64) / total,
                    (b + (seen - included) as f64) / total,
                )
            }
        }
    }

    /// `ln p(z)` of a model by its number of members in each family.
    pub fn log_model(&self, members: &[usize]) -> f64 {
        let family = |(&size, &included): (&usize, &usize)| -> f64 {
            let inside: f64 = (0..included).map(|i| self.next(i, i).0.ln()).sum();
            inside
                + (included..size)
                    .map(|seen| self.next(included, seen).1.ln())
                    .sum::<f64>()
        };
        self.family_sizes().iter().zip(members).map(family).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prior(inclusion: Inclusion) -> Prior {
        Prior {
            slab: vec![1.0; 7],
            family: vec![0, 1, 0, 1, 0, 0, 1],
            inclusion,
            shape: 1e-3,
            scale: 1e-3,
        }
    }

    /// ln Γ by Stirling's series with recurrence: independent of the urn.
    fn ln_gamma(x: f64) -> f64 {
        if x < 20.0 {
            return ln_gamma(x + 1.0) - x.ln();
        }
        (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + 1.0 / (12.0 * x)
            - 1.0 / (360.0 * x.powi(3))
            + 1.0 / (1260.0 * x.powi(5))
    }

    fn ln_beta(a: f64, b: f64) -> f64 {
        ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b)
    }

    #[test]
    fn the_urn_is_the_beta_binomial_of_each_family() {
        let prior = prior(Inclusion::ExpectedTerms(2.0));
        let b = 7.0 / 2.0 - 1.0;
        for m0 in 0..=4usize {
            for m1 in 0..=3usize {
                let expected = ln_beta(1.0 + m0 as f64, b + 4.0 - m0 as f64) - ln_beta(1.0, b)
                    + ln_beta(1.0 + m1 as f64, b + 3.0 - m1 as f64)
                    - ln_beta(1.0, b);
                assert!(
                    (prior.log_model(&[m0, m1]) - expected).abs() < 1e-12,
                    "{m0} {m1}"
                );
            }
        }
    }

    /// Probabilities sum to one and the expected number of terms is the stated one.
    #[test]
    fn expected_terms_are_expected() {
        for (inclusion, expected) in [
            (Inclusion::ExpectedTerms(2.0), 2.0),
            (Inclusion::Probability(0.2), 1.4),
        ] {
            let prior = prior(inclusion);
            let (mut total, mut terms) = (0.0, 0.0);
            for model in 0u32..128 {
                let mut members = [0, 0];
                (0..7)
                    .filter(|k| model >> k & 1 == 1)
                    .for_each(|k| members[prior.family[k]] += 1);
                let p = prior.log_model(&members).exp();
                total += p;
                terms += p * f64::from(model.count_ones());
            }
            assert!(
                (total - 1.0).abs() < 1e-13 && (terms - expected).abs() < 1e-12,
                "{total} {terms}"
            );
        }
    }
}
