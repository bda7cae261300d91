//! Do scores rise or fall over the order in which they were recorded? Mann's test (1945) with Kendall's exact distribution.
//!
//! `S = Σ_{i<k} sign(s_k − s_i)`; without a trend all n! orders are equally likely, so that the number of pairs out of order is distributed as inversions
//! of a random permutation (Kendall & Gibbons 1990). Ties count as half a pair, which makes the test a little careful.

use serde::{Deserialize, Serialize};

/// Probability of a trend where there is none.
pub const TREND_ALARM: f64 = 0.05;
/// Scores from which on there may be one: 2/5! is below that probability, 2/4! is not.
pub const TREND_FEWEST: usize = 5;
/// Scores beyond which the normal distribution is taken.
const EXACT: usize = 200;

/// Trend of scores over their order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Trend {
    /// Kendall's τ: 1 where each is larger than all before it, −1 where each is smaller.
    pub tau: f64,
    /// Probability of a τ at least that far from 0 without a trend, two-sided.
    pub p: f64,
}

impl Trend {
    /// Of scores in their order; `None` for fewer than [`TREND_FEWEST`].
    #[must_use]
    pub fn of(scores: &[f64]) -> Option<Self> {
        let n = scores.len();
        if n < TREND_FEWEST {
            return None;
        }
        let mut sum = 0_i64;
        for (i, first) in scores.iter().enumerate() {
            for later in &scores[i + 1..] {
                sum += i64::from(later > first) - i64::from(later < first);
            }
        }
        let pairs = (n * (n - 1) / 2) as f64;
        Some(Self {
            tau: sum as f64 / pairs,
            p: two_sided(n, sum.unsigned_abs()),
        })
    }

    /// Whether it is one, at the level of [`TREND_ALARM`].
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.p < TREND_ALARM
    }
}

/// P(|S| ≥ s) of n scores without a trend.
fn two_sided(n: usize, s: u64) -> f64 {
    if s == 0 {
        return 1.0;
    }
    if n > EXACT {
        let n = n as f64;
        let sd = (n * (n - 1.0) * (2.0 * n + 5.0) / 18.0).sqrt();
        return statrs::function::erf::erfc((s as f64 - 1.0) / sd / std::f64::consts::SQRT_2);
    }
    // Share of permutations with so many inversions, one element more at a time.
    let mut share = vec![1.0];
    for k in 2..=n {
        let mut next = vec![0.0; share.len() + k - 1];
        for (inversions, own) in share.iter().enumerate() {
            for more in &mut next[inversions..inversions + k] {
                *more += own / k as f64;
            }
        }
        share = next;
    }
    // S = pairs − 2 · inversions.
    let pairs = n * (n - 1) / 2;
    let most = (pairs - (s as usize).min(pairs)) / 2;
    (2.0 * share[..=most].iter().sum::<f64>()).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All 720 orders of six scores, counted one by one.
    #[test]
    fn the_probability_is_that_of_all_permutations() {
        let mut orders: Vec<Vec<f64>> = vec![Vec::new()];
        for value in 0..6 {
            let longer = |order: &Vec<f64>| {
                let order = order.clone();
                (0..=order.len()).map(move |place| {
                    let mut order = order.clone();
                    order.insert(place, f64::from(value));
                    order
                })
            };
            orders = orders.iter().flat_map(longer).collect();
        }
        let trends: Vec<Trend> = orders.iter().filter_map(|o| Trend::of(o)).collect();
        assert_eq!(trends.len(), 720);
        for own in &trends {
            let as_far = trends
                .iter()
                .filter(|t| t.tau.abs() >= own.tau.abs() - 1e-12);
            let share = as_far.count() as f64 / 720.0;
            assert!((own.p - share).abs() < 1e-12, "{own:?}: {share}");
        }
        assert!(trends.iter().filter(|t| t.is_clear()).count() <= 36);
    }

    #[test]
    fn few_scores_say_nothing_and_many_use_the_normal_distribution() {
        assert_eq!(Trend::of(&[1.0, 2.0, 3.0, 4.0]), None);
        let rising = Trend::of(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!((rising.tau, rising.is_clear()), (1.0, true));
        assert!((rising.p - 2.0 / 120.0).abs() < 1e-12);
        assert_eq!(Trend::of(&[2.0; 9]).unwrap().p, 1.0);
        // The exact distribution and the normal one meet.
        let (exact, normal) = (two_sided(200, 1500), two_sided(201, 1500));
        assert!((exact - normal).abs() < 0.003, "{exact} {normal}");
    }
}
