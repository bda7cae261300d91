//! Ranks, normal scores and order statistics of pooled chains.

use statrs::distribution::{ContinuousCDF, Normal};

/// Mean and unbiased variance (NaN below two values), two passes; exactly 0 for values that are all equal.
pub(super) fn mean_and_variance(x: &[f64]) -> (f64, f64) {
    if x.len() > 1 && x.iter().all(|&value| value == x[0]) {
        return (x[0], 0.0);
    }
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    (
        mean,
        x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0),
    )
}

/// Pooled values with their places, ascending.
fn sorted<C: AsRef<[f64]>>(chains: &[C]) -> Vec<(f64, u32)> {
    let values = chains.iter().flat_map(|c| c.as_ref().iter().copied());
    let mut pooled: Vec<(f64, u32)> = values.zip(0u32..).collect();
    // −0 and 0 are ties, so the comparison is that of numbers; there are no NaNs here.
    pooled.sort_unstable_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal));
    pooled
}

/// Standard normal quantiles of the pooled ranks (ties: average rank), Blom's offset 3/8.
pub(super) fn normal_scores<C: AsRef<[f64]>>(chains: &[C]) -> Vec<Vec<f64>> {
    let pooled = sorted(chains);
    let size = pooled.len() as f64;
    let mut flat = vec![0.0; pooled.len()];
    let normal = Normal::standard();
    let mut from = 0;
    for tie in pooled.chunk_by(|a, b| a.0 == b.0) {
        let rank = from as f64 + (tie.len() as f64 + 1.0) / 2.0;
        let score = normal.inverse_cdf((rank - 0.375) / (size + 0.25));
        tie.iter()
            .for_each(|&(_, place)| flat[place as usize] = score);
        from += tie.len();
    }
    let draws = chains.first().map_or(0, |c| c.as_ref().len());
    flat.chunks(draws.max(1)).map(<[f64]>::to_vec).collect()
}

/// Median of all pooled values.
pub(super) fn median<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    let pooled = sorted(chains);
    let n = pooled.len();
    0.5 * (pooled[(n - 1) / 2].0 + pooled[n / 2].0)
}

/// Quantile of all pooled values, R's type 7 in the order of operations of SciPy's `mquantiles`: draws are compared
/// with it by `<=`, so its last bit matters where draws repeat.
pub(super) fn quantile<C: AsRef<[f64]>>(chains: &[C], probability: f64) -> f64 {
    let pooled = sorted(chains);
    let n = pooled.len() as f64;
    let place = n * probability + (1.0 - probability);
    let below = place.clamp(1.0, n - 1.0).floor();
    let share = (place - below).clamp(0.0, 1.0);
    let at = below as usize;
    (1.0 - share) * pooled[at - 1].0 + share * pooled[at].0
}
