//! Can these draws be trusted? Rank-normalised R̂, effective sample sizes, Monte Carlo errors, autocorrelation times.
//!
//! Chains are slices of equal length; the functions split every chain in two halves themselves.
//!
//! # Source
//! Vehtari, Gelman, Simpson, Carpenter, Bürkner (2021), "Rank-normalization, folding, and localization: an improved R̂";
//! the same numbers as ArviZ 0.23.4 (`tests/reference/infer/diagnostics.json`).

mod autocorrelation;
mod ranks;

pub(crate) use autocorrelation::initial_positive_sequence;
pub use autocorrelation::integrated_autocorrelation_time;
pub use ranks::NormalScores;

use autocorrelation::effective_samples;
use ranks::{cut, folded, mean_and_variance, median, median_of, normal_scores, quantile, sorted};

/// Fewest draws per chain.
const LEAST_DRAWS: usize = 4;

/// Chains cut in halves; `None` if they are too short, of different lengths or hold a NaN.
fn halves<C: AsRef<[f64]>>(chains: &[C]) -> Option<Vec<&[f64]>> {
    let draws = chains.first()?.as_ref().len();
    let valid = draws >= LEAST_DRAWS
        && chains
            .iter()
            .all(|c| c.as_ref().len() == draws && c.as_ref().iter().all(|x| !x.is_nan()));
    let half = draws / 2;
    valid.then(|| {
        chains
            .iter()
            .flat_map(|c| [&c.as_ref()[..half], &c.as_ref()[draws - half..]])
            .collect()
    })
}

/// Rank-normalised split R̂: the larger one of location (bulk) and scale (folded draws). 1 means that the chains agree.
///
/// NaN for fewer than 2 chains, fewer than 4 draws, or draws that are all equal; ∞ for chains that each stand still at
/// different values.
///
/// # Example
/// Two chains over the same range agree. A shifted chain does not.
/// ```
/// use twincal::diagnostics::r_hat;
///
/// let chain = |step: u32, shift: f64| -> Vec<f64> { (0..100).map(|i| shift + f64::from(step * i % 100)).collect() };
/// assert!(r_hat(&[chain(37, 0.0), chain(43, 0.0)]) < 1.01);
/// assert!(r_hat(&[chain(37, 0.0), chain(43, 1000.0)]) > 1.5);
/// assert!(r_hat(&[chain(37, 0.0)]).is_nan()); // one chain says nothing
/// ```
pub fn r_hat<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    let Some(halves) = halves(chains).filter(|_| chains.len() >= 2) else {
        return f64::NAN;
    };
    let center = median(&halves);
    let folded: Vec<Vec<f64>> = halves
        .iter()
        .map(|c| c.iter().map(|x| (x - center).abs()).collect())
        .collect();
    let (bulk, tail) = (
        plain_r_hat(&normal_scores(&halves)),
        plain_r_hat(&normal_scores(&folded)),
    );
    if bulk.is_nan() { bulk } else { bulk.max(tail) }
}

/// ([`r_hat`], [`ess_bulk`]) to the last bit, from one sort of the draws and one table of scores.
pub fn convergence<C: AsRef<[f64]>>(chains: &[C], scores: &NormalScores) -> (f64, f64) {
    let Some(halves) = halves(chains) else {
        return (f64::NAN, f64::NAN);
    };
    let pooled = sorted(&halves);
    let bulk = cut(&scores.of(&pooled), &halves);
    let ess = effective_samples(&bulk);
    let bulk = plain_r_hat(&bulk);
    if chains.len() < 2 || bulk.is_nan() {
        return (f64::NAN, ess);
    }
    let distances = folded(&pooled, median_of(&pooled));
    let tail = plain_r_hat(&cut(&scores.of(&distances), &halves));
    (bulk.max(tail), ess)
}

/// `√((B/W + n − 1)/n)`.
fn plain_r_hat(chains: &[Vec<f64>]) -> f64 {
    let draws = chains[0].len() as f64;
    let (means, variances): (Vec<f64>, Vec<f64>) =
        chains.iter().map(|c| mean_and_variance(c)).unzip();
    let between = draws * mean_and_variance(&means).1;
    let within = mean_and_variance(&variances).0;
    ((between / within + draws - 1.0) / draws).sqrt()
}

/// Effective sample size of the bulk: of the rank-normalised split chains. NaN for fewer than 4 draws.
pub fn ess_bulk<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    halves(chains).map_or(f64::NAN, |halves| {
        effective_samples(&normal_scores(&halves))
    })
}

/// Effective sample size of the tails: the smaller one of those of the 5 % and 95 % quantiles.
pub fn ess_tail<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    let Some(_) = halves(chains) else {
        return f64::NAN;
    };
    let whole: Vec<&[f64]> = chains.iter().map(AsRef::as_ref).collect();
    let below = |probability: f64| -> f64 {
        let limit = quantile(&whole, probability);
        let indicator: Vec<Vec<f64>> = whole
            .iter()
            .map(|c| c.iter().map(|&x| f64::from(x <= limit)).collect())
            .collect();
        halves(&indicator).map_or(f64::NAN, |halves| effective_samples(&halves))
    };
    below(0.05).min(below(0.95))
}

/// Effective sample size for the mean: of the split chains as they are.
pub fn ess_mean<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    halves(chains).map_or(f64::NAN, |halves| effective_samples(&halves))
}

/// Monte Carlo standard error of the mean: `sd / √ess_mean`. 0 for draws that are all equal.
pub fn mcse_mean<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    let all: Vec<f64> = chains
        .iter()
        .flat_map(|c| c.as_ref().iter().copied())
        .collect();
    mean_and_variance(&all).1.sqrt() / ess_mean(chains).sqrt()
}

#[cfg(test)]
mod tests;
