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
pub(super) fn sorted<C: AsRef<[f64]>>(chains: &[C]) -> Vec<(f64, u32)> {
    let values = chains.iter().flat_map(|c| c.as_ref().iter().copied());
    let mut pooled: Vec<(f64, u32)> = values.zip(0u32..).collect();
    // −0 and 0 are ties, so the comparison is that of numbers; there are no NaNs here.
    pooled.sort_unstable_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal));
    pooled
}

/// Standard normal quantiles of ranks, Blom's offset 3/8: many quantities with as many draws share one table.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalScores {
    /// Of the ranks 1, 2, …
    whole: Vec<f64>,
}

impl NormalScores {
    /// For `size` pooled draws.
    pub fn new(size: usize) -> Self {
        let whole = (1..=size).map(|rank| score(rank as f64, size)).collect();
        Self { whole }
    }

    /// Scores of sorted pooled values, by place; ties have their average rank.
    pub(super) fn of(&self, pooled: &[(f64, u32)]) -> Vec<f64> {
        let mut flat = vec![0.0; pooled.len()];
        let mut from = 0;
        for tie in pooled.chunk_by(|a, b| a.0 == b.0) {
            // of an odd number the average rank is that of the middle one
            let score = if tie.len() % 2 == 1 && pooled.len() == self.whole.len() {
                self.whole[from + tie.len() / 2]
            } else {
                score(from as f64 + (tie.len() as f64 + 1.0) / 2.0, pooled.len())
            };
            tie.iter()
                .for_each(|&(_, place)| flat[place as usize] = score);
            from += tie.len();
        }
        flat
    }
}

fn score(rank: f64, size: usize) -> f64 {
    Normal::standard().inverse_cdf((rank - 0.375) / (size as f64 + 0.25))
}

/// Normal scores of the pooled values, chain by chain.
pub(super) fn normal_scores<C: AsRef<[f64]>>(chains: &[C]) -> Vec<Vec<f64>> {
    let none = NormalScores { whole: Vec::new() };
    cut(&none.of(&sorted(chains)), chains)
}

/// Pooled values by place as chains again.
pub(super) fn cut<C: AsRef<[f64]>>(flat: &[f64], chains: &[C]) -> Vec<Vec<f64>> {
    let draws = chains.first().map_or(0, |c| c.as_ref().len());
    flat.chunks(draws.max(1)).map(<[f64]>::to_vec).collect()
}

/// Distances from `center` of sorted pooled values, sorted: both sides are, and are merged.
pub(super) fn folded(pooled: &[(f64, u32)], center: f64) -> Vec<(f64, u32)> {
    let distance = |&(value, place): &(f64, u32)| ((value - center).abs(), place);
    let (below, above) = pooled.split_at(pooled.partition_point(|&(value, _)| value < center));
    let mut below = below.iter().rev().map(distance).peekable();
    let mut above = above.iter().map(distance).peekable();
    let mut out = Vec::with_capacity(pooled.len());
    loop {
        let next = match (below.peek(), above.peek()) {
            (Some(b), Some(a)) if b.0 <= a.0 => below.next(),
            (_, Some(_)) => above.next(),
            (_, None) => below.next(),
        };
        match next {
            Some(next) => out.push(next),
            None => return out,
        }
    }
}

/// Median of all pooled values.
pub(super) fn median<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    median_of(&sorted(chains))
}

/// The same of sorted values.
pub(super) fn median_of(pooled: &[(f64, u32)]) -> f64 {
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
