//! AR(1) coefficient of a residual: the maximum of its exact stationary likelihood.

/// Largest |ρ| that is tried.
const LIMIT: f64 = 0.999;

/// Sums over runs that the stationary AR(1) likelihood of a series needs.
struct Sums {
    rows: f64,
    starts: f64,
    square: f64,
    difference: f64,
    ends: f64,
}

impl Sums {
    fn of(runs: &[&[f64]]) -> Self {
        let mut sums = Sums {
            rows: 0.0,
            starts: 0.0,
            square: 0.0,
            difference: 0.0,
            ends: 0.0,
        };
        for run in runs.iter().filter(|run| !run.is_empty()) {
            sums.rows += run.len() as f64;
            sums.starts += 1.0;
            sums.square += run.iter().map(|r| r * r).sum::<f64>();
            sums.difference += run
                .windows(2)
                .map(|w| (w[1] - w[0]) * (w[1] - w[0]))
                .sum::<f64>();
            sums.ends += run[0] * run[0] + run[run.len() - 1] * run[run.len() - 1];
        }
        sums
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
}

/// ρ in (−0.999, 0.999) that maximises the exact stationary AR(1) likelihood of the runs; 0 with fewer than 3 rows.
///
/// Golden-section search: the profile likelihood of a stationary AR(1) has one maximum.
pub(super) fn coefficient(runs: &[&[f64]]) -> f64 {
    let sums = Sums::of(runs);
    if sums.rows < 3.0 || sums.square <= 0.0 {
        return 0.0;
    }
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (-LIMIT, LIMIT);
    while high - low > 1e-9 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if sums.log_likelihood(a) < sums.log_likelihood(b) {
            low = a
        } else {
            high = b
        }
    }
    0.5 * (low + high)
}

/// Mean innovation variance of the runs at a given ρ (the plain mean square for ρ = 0); 0 without rows.
pub(super) fn innovation_variance(runs: &[&[f64]], rho: f64) -> f64 {
    let sums = Sums::of(runs);
    if sums.rows > 0.0 {
        sums.innovation(rho) / sums.rows
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let error = (coefficient(&slices) - rho).abs();
            let standard_error = ((1.0 - rho * rho) / 8000.0_f64).sqrt();
            assert!(error < 5.0 * standard_error, "rho {rho}: off by {error}");
            assert!((innovation_variance(&slices, rho) - 1.0).abs() < 0.08);
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
            assert!((innovation_variance(&[&run], rho) * 5.0 - brute).abs() < 1e-14);
        }
    }
}
