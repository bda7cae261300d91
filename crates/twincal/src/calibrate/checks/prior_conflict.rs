//! Do data and prior contradict each other? Then one of them is wrong, and the estimate lies between them.

use crate::error::{Code, Finding, Severity};
use crate::likelihood::Columns;
use crate::posterior::{Posterior, Problem};
use crate::prior::PriorSettings;
use crate::signal::Auto;
use crate::words::significant;
use statrs::function::gamma::{gamma_lr, gamma_ur};

/// Prior predictive sds from which an estimate contradicts its prior: 1 in 16 000 by chance.
const CONFLICT: f64 = 4.0;
/// Tail probability of the noise under its prior below which they contradict each other.
const TAIL: f64 = 1e-4;
/// A posterior wider than this share of the prior is the prior: it contradicts nothing.
const NOT_SEEN: f64 = 0.9;
/// Shape of a noise prior from which it says anything about size.
const SAYS_SOMETHING: f64 = 1.0;

/// How far a coefficient lies from its prior, in sds of what the prior predicts for its estimate.
///
/// The least-squares estimate b of a coefficient with prior N(0, s²) is `N(0, s² + e²)` before the data, e its standard error;
/// by the posterior's mean m and sd p that is
///
/// ```text
/// z = b / √(s² + e²) = m / √(s² − p²)
/// ```
///
/// # Source
/// Box 1980; Evans & Moshonov 2006: prior predictive check.
fn score(mean: f64, sd: f64, prior: f64) -> f64 {
    mean / (prior * prior - sd * sd).sqrt()
}

/// Findings on coefficients with a prior that was not learned, and on a noise prior that the user gave; `conditional` are mean
/// and sd of each column's coefficient given that it is in.
pub(in crate::calibrate) fn findings(
    columns: &Columns,
    settings: &PriorSettings,
    problem: &Problem,
    posterior: &Posterior,
    conditional: &[(f64, f64)],
) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (k, &(mean, sd)) in conditional.iter().enumerate() {
        let prior = match (settings.scaled_variance, columns.prior_sd[k]) {
            (Auto::Value(_), _) => (problem.prior.slab[k] * posterior.noise).sqrt(),
            (Auto::Auto, Some(physical)) => physical,
            (Auto::Auto, None) => continue,
        };
        if posterior.inclusion[k] < 0.5 || sd > NOT_SEEN * prior {
            continue;
        }
        let z = score(mean, sd, prior);
        if z.abs() > CONFLICT {
            let name = &columns.names[k];
            findings.push(Finding::new(
                Severity::Warning,
                Code::PriorConflict,
                name.clone(),
                format!(
                    "`{name}` = {} ± {} is {} sd of its prior (sd {}) from 0, {:.1} sd of what the prior predicts for its estimate: look whether the \
                     model's numbers there are right, or give a wider prior.slab",
                    significant(mean, 4),
                    significant(sd, 2),
                    significant((mean / prior).abs(), 2),
                    significant(prior, 3),
                    z.abs()
                ),
                0,
            )
            .with([("mean", mean), ("sd", sd), ("prior_sd", prior), ("distance_in_sd", z.abs())]));
        }
    }
    findings.extend(impossible_noise(settings, posterior.noise));
    findings
}

/// A noise variance that the prior of the noise holds for impossible.
fn impossible_noise(settings: &PriorSettings, noise: f64) -> Option<Finding> {
    let (shape, scale) = settings.noise?;
    if shape < SAYS_SOMETHING || !noise.is_finite() {
        return None;
    }
    // 1/φ ~ Gamma(shape, rate = scale)
    let x = scale / noise;
    (gamma_lr(shape, x).min(gamma_ur(shape, x)) < TAIL).then(|| {
        Finding::new(
            Severity::Warning,
            Code::PriorConflict,
            "prior.noise",
            format!(
                "the noise variance is {} (N·m)², which prior.noise holds for impossible (it expects about {}): \
                 leave prior.noise out, or look at the torque's unit",
                significant(noise, 4),
                significant(scale / shape, 4)
            ),
            0,
        )
        .with([("noise_variance", noise), ("noise_variance_of_prior", scale / shape)])
    })
}

#[cfg(test)]
mod tests {
    use super::score;

    /// m / √(s² − p²) is b / √(s² + e²) for the conjugate normal: posterior by hand.
    #[test]
    fn the_predictive_score_is_that_of_the_estimate() {
        let (b, e, s) = (3.0f64, 0.5f64, 0.7f64);
        let p2 = 1.0 / (1.0 / (s * s) + 1.0 / (e * e));
        let m = p2 * b / (e * e);
        assert!((score(m, p2.sqrt(), s) - b / (s * s + e * e).sqrt()).abs() < 1e-12);
    }
}
