//! AR(1) coefficient of a residual: the maximum of its exact stationary likelihood.

use crate::gram::{JointGram, Symmetric};
use crate::statistics::{of_joint, residual_form};
use std::iter::Sum;

/// Largest |ρ| that is tried.
const LIMIT: f64 = 0.999;

/// Sums over the runs of a joint's residual that the stationary AR(1) likelihood needs; those of several joints add.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Residual {
    rows: f64,
    starts: f64,
    square: f64,
    difference: f64,
    ends: f64,
}

impl Residual {
    /// `y − Xβ` of a joint, `beta` of all columns; squares of at most `rounding` are none. Where runs were forgotten ρ has to be 0.
    pub(super) fn new(joint: &JointGram, beta: &[f64], rounding: f64) -> Self {
        let beta = of_joint(joint, beta);
        let form = |sums: &Symmetric| match sums.size {
            0 => 0.0,
            _ => residual_form(sums, &beta).max(0.0),
        };
        let square = form(&joint.s0);
        if square <= rounding || joint.n == 0.0 {
            return Self {
                rows: joint.n,
                starts: joint.starts,
                ..Self::default()
            };
        }
        Self {
            rows: joint.n,
            starts: joint.starts,
            square,
            difference: form(&joint.d),
            ends: form(&joint.first) + form(&joint.last),
        }
    }

    /// `G(ρ) = (1−ρ)² S0 + ρ D + ρ(1−ρ)(F + L)` of the residual itself.
    fn innovation(&self, rho: f64) -> f64 {
        (1.0 - rho) * (1.0 - rho) * self.square
            + rho * self.difference
            + rho * (1.0 - rho) * self.ends
    }

    /// Profile log-likelihood over the innovation variance, up to a constant.
    fn log_likelihood(&self, rho: f64) -> f64 {
        0.5 * self.starts * (-rho * rho).ln_1p()
            - 0.5 * self.rows * self.innovation(rho).max(f64::MIN_POSITIVE).ln()
    }

    /// ρ in (−0.999, 0.999) that maximises the exact stationary AR(1) likelihood; 0 with fewer than 3 rows.
    ///
    /// Golden-section search: the profile likelihood of a stationary AR(1) has one maximum.
    pub(super) fn coefficient(&self) -> f64 {
        if self.rows < 3.0 || self.square <= 0.0 {
            return 0.0;
        }
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (-LIMIT, LIMIT);
        while high - low > 1e-9 {
            let (a, b) = (high - golden * (high - low), low + golden * (high - low));
            if self.log_likelihood(a) < self.log_likelihood(b) {
                low = a
            } else {
                high = b
            }
        }
        0.5 * (low + high)
    }

    /// Mean innovation variance at a given ρ (the plain mean square for ρ = 0); 0 without rows.
    pub(super) fn innovation_variance(&self, rho: f64) -> f64 {
        if self.rows > 0.0 {
            self.innovation(rho) / self.rows
        } else {
            0.0
        }
    }
}

impl<'a> Sum<&'a Residual> for Residual {
    fn sum<I: Iterator<Item = &'a Residual>>(all: I) -> Self {
        all.fold(Self::default(), |sum, own| Self {
            rows: sum.rows + own.rows,
            starts: sum.starts + own.starts,
            square: sum.square + own.square,
            difference: sum.difference + own.difference,
            ends: sum.ends + own.ends,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gram::{JointAccumulator, Workspace};

    /// Of runs of rows without a column.
    fn residual(runs: &[&[f64]]) -> Residual {
        let mut sums = JointAccumulator::new(Vec::new());
        for run in runs {
            let keep = vec![true; run.len()];
            let workspace = &mut Workspace::default();
            sums.push_block(&[], run.len(), run, &keep, true, workspace);
        }
        Residual::new(&sums.finish(), &[], 0.0)
    }

    /// Two runs of a stationary AR(1); |ρ̂ − ρ| beyond 5 standard errors √((1−ρ²)/n) has a chance below 6e-7.
    #[test]
    fn finds_the_coefficient_of_an_autoregression() {
        for (seed, rho) in [(1_u64, 0.0), (2, 0.5), (3, 0.95), (4, -0.4)] {
            let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
            let mut uniform = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            let runs: Vec<Vec<f64>> = (0..2)
                .map(|_| {
                    let mut value = normal() / (1.0_f64 - rho * rho).sqrt();
                    (0..4000)
                        .map(|_| {
                            let now = value;
                            value = rho * value + normal();
                            now
                        })
                        .collect()
                })
                .collect();
            let slices: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
            let found = residual(&slices);
            let error = (found.coefficient() - rho).abs();
            let standard_error = ((1.0 - rho * rho) / 8000.0_f64).sqrt();
            assert!(error < 5.0 * standard_error, "rho {rho}: off by {error}");
            assert!((found.innovation_variance(rho) - 1.0).abs() < 0.08);
        }
    }

    /// `G(ρ)` against `rᵀC⁻¹r (1−ρ²)`-free brute force: (1−ρ²) r₁² + Σ (r_t − ρ r_{t−1})².
    #[test]
    fn innovation_sum_is_the_whitened_sum() {
        let run = [0.3, -0.7, 1.1, 0.2, -0.4];
        for rho in [-0.6, 0.0, 0.3, 0.97] {
            let brute = (1.0 - rho * rho) * run[0] * run[0]
                + run
                    .windows(2)
                    .map(|w| (w[1] - rho * w[0]) * (w[1] - rho * w[0]))
                    .sum::<f64>();
            let found = residual(&[&run]).innovation_variance(rho);
            assert!((found * 5.0 - brute).abs() < 1e-14);
        }
    }
}
