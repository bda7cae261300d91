//! Expectation propagation for a normal vector with `x ≥ 0`.

use crate::infer::moments::log_normal_mass;

/// Sweeps over all sites at most.
const SWEEPS: usize = 200;
/// Change of every site below which they rest.
const TOLERANCE: f64 = 1e-10;

/// `ln P(x ≥ 0)` for `x ~ N(mean, correlation)` with unit variances, and the sites (τ, ν) of `exp(−½ τ x² + ν x)` that
/// match the moments of the truncated distribution.
pub(super) fn propagate(mean: &[f64], correlation: &[f64]) -> (f64, Vec<(f64, f64)>) {
    let size = mean.len();
    let mut sites = vec![(0.0, 0.0); size];
    let mut covariance = correlation.to_vec();
    let mut center = mean.to_vec();
    let mut log_scale = vec![0.0; size];
    for _ in 0..SWEEPS {
        let mut change = 0.0f64;
        for i in 0..size {
            let variance = covariance[i * size + i];
            let (precision, shift) = (1.0 / variance, center[i] / variance);
            let (cavity, cavity_shift) = (precision - sites[i].0, shift - sites[i].1);
            if cavity <= 0.0 {
                continue;
            }
            let tilted = Tilted::new(cavity_shift / cavity, 1.0 / cavity);
            let next = (
                (1.0 / tilted.variance - cavity).max(0.0),
                tilted.mean / tilted.variance - cavity_shift,
            );
            let step = (next.0 - sites[i].0, next.1 - sites[i].1);
            change = change
                .max(step.0.abs() / (1.0 + next.0))
                .max(step.1.abs() / (1.0 + next.1.abs()));
            sites[i] = next;
            let one =
                |precision: f64, shift: f64| 0.5 * (shift * shift / precision - precision.ln());
            log_scale[i] = tilted.log_mass - one(cavity + next.0, cavity_shift + next.1)
                + one(cavity, cavity_shift);
            // Σ' = Σ − Σ_·i Σ_i· Δτ/(1 + Δτ Σ_ii), mean' = mean + Σ_·i (Δν − Δτ mean_i)/(1 + Δτ Σ_ii)
            let denominator = 1.0 + step.0 * variance;
            let column: Vec<f64> = (0..size).map(|k| covariance[k * size + i]).collect();
            let move_by = (step.1 - step.0 * center[i]) / denominator;
            for k in 0..size {
                center[k] += column[k] * move_by;
                for l in 0..size {
                    covariance[k * size + l] -= column[k] * column[l] * step.0 / denominator;
                }
            }
        }
        if change < TOLERANCE {
            break;
        }
    }
    (
        log_mass(mean, correlation, &sites) + log_scale.iter().sum::<f64>(),
        sites,
    )
}

/// `ln ∫ N(x; mean, correlation) Π exp(−½ τ x² + ν x) dx`, one site after the other.
fn log_mass(mean: &[f64], correlation: &[f64], sites: &[(f64, f64)]) -> f64 {
    let size = mean.len();
    let (mut center, mut covariance) = (mean.to_vec(), correlation.to_vec());
    let mut log = 0.0;
    for (i, &(precision, shift)) in sites.iter().enumerate() {
        let (m, v) = (center[i], covariance[i * size + i]);
        let d = 1.0 + precision * v;
        // ∫ N(x; m, v) e^{−½τx² + νx} dx
        log += -0.5 * d.ln() + (m * shift + 0.5 * shift * shift * v - 0.5 * precision * m * m) / d;
        let column: Vec<f64> = (0..size).map(|k| covariance[k * size + i]).collect();
        let move_by = (shift - precision * m) / d;
        for k in 0..size {
            center[k] += column[k] * move_by;
            for l in 0..size {
                covariance[k * size + l] -= column[k] * column[l] * precision / d;
            }
        }
    }
    log
}

/// A normal distribution cut off below 0.
struct Tilted {
    log_mass: f64,
    mean: f64,
    variance: f64,
}

impl Tilted {
    fn new(mean: f64, variance: f64) -> Self {
        let sd = variance.sqrt();
        let t = mean / sd;
        let log_mass = log_normal_mass(t);
        let (above, share) = if t > -12.0 {
            // λ = φ(t)/Φ(t): mean t + λ, variance 1 − λ(λ + t)
            let density = -0.5 * t * t - 0.5 * (2.0 * std::f64::consts::PI).ln();
            let lambda = (density - log_mass).exp();
            (t + lambda, 1.0 - lambda * (lambda + t))
        } else {
            // Series in s = 1/t²: no difference of nearly equal numbers.
            let s = 1.0 / (t * t);
            let above = -(1.0 - s * (2.0 - s * (10.0 - 74.0 * s))) / t;
            (above, s * (1.0 - s * (6.0 - s * (50.0 - 518.0 * s))))
        };
        Self {
            log_mass,
            mean: sd * above,
            variance: variance * share.max(1e-12),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms: one dimension (erfc), two dimensions with zero mean (the orthant 1/4 + asin ρ / 2π).
    #[test]
    fn masses_are_those_of_closed_forms() {
        for t in [-20.0, -3.0, 0.0, 2.0, 7.0] {
            let (log, sites) = propagate(&[t], &[1.0]);
            assert!(
                (log - log_normal_mass(t)).abs() < 1e-9 * (1.0 + log.abs()),
                "{t}"
            );
            let tilted = Tilted::new(t, 1.0);
            let precision = 1.0 + sites[0].0;
            assert!(((t + sites[0].1) / precision - tilted.mean).abs() < 1e-9);
        }
        for rho in [-0.8f64, -0.3, 0.4, 0.9] {
            let (log, _) = propagate(&[0.0, 0.0], &[1.0, rho, rho, 1.0]);
            let exact = 0.25 + rho.asin() / (2.0 * std::f64::consts::PI);
            // EP is an approximation: 5 % of the mass at ρ = −0.8, far less between.
            assert!(
                (log - exact.ln()).abs() < 0.06,
                "{rho}: {} {exact}",
                log.exp()
            );
        }
    }

    /// Both branches of the tilted moments meet, and equal Mills' ratio by its continued fraction.
    #[test]
    fn tails_are_smooth() {
        for t in [-11.99f64, -12.01, -40.0, -1e3] {
            let mut fraction = 0.0;
            for k in (1..400).rev() {
                fraction = f64::from(k) / (-t + fraction);
            }
            let lambda = -t + fraction;
            let tilted = Tilted::new(t, 1.0);
            assert!((tilted.mean / (t + lambda) - 1.0).abs() < 1e-5, "{t}");
            let log = -0.5 * t * t - 0.5 * (2.0 * std::f64::consts::PI).ln() - lambda.ln();
            assert!((tilted.log_mass / log - 1.0).abs() < 1e-9, "{t}");
        }
    }
}
