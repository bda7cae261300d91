//! Random regression problems for the tests of this module.

use crate::infer::{Choice, InferenceSettings, infer};
use crate::posterior::{Posterior, Problem};
use crate::prior::{Inclusion, Prior};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A standard normal number (Box and Muller).
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

/// `(XᵀX, Xᵀy, yᵀy)` of `rows` rows: columns with pairwise correlation about `correlation`, every third one acts.
fn random_gram(seed: u64, size: usize, rows: usize, correlation: f64) -> (Vec<f64>, Vec<f64>, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut gram, mut xy, mut yy) = (vec![0.0; size * size], vec![0.0; size], 0.0);
    for _ in 0..rows {
        let common = normal(&mut rng);
        let x: Vec<f64> = (0..size)
            .map(|k| {
                (1.0 + 0.3 * k as f64)
                    * (correlation.sqrt() * common + (1.0 - correlation).sqrt() * normal(&mut rng))
            })
            .collect();
        let signal: f64 = x
            .iter()
            .step_by(3)
            .enumerate()
            .map(|(i, x)| x * 0.3 / (1.0 + i as f64))
            .sum();
        let y = signal + 0.5 * normal(&mut rng);
        for i in 0..size {
            xy[i] += x[i] * y;
            (0..size).for_each(|j| gram[i * size + j] += x[i] * x[j]);
        }
        yy += y * y;
    }
    (gram, xy, yy)
}

/// A problem on [`random_gram`] with three families that do not lie together.
pub(super) fn problem(
    seed: u64,
    size: usize,
    rows: usize,
    correlation: f64,
    inclusion: Inclusion,
) -> Problem {
    let (gram, xy, yy) = random_gram(seed, size, rows, correlation);
    let prior = Prior::single(
        (0..size).map(|k| 10.0 / (1.0 + k as f64)).collect(),
        (0..size).map(|k| [0, 1, 0, 2, 1][k % 5]).collect(),
        inclusion,
        (0.01, 0.02),
    );
    let names = (0..size).map(|k| format!("x{k}")).collect();
    Problem {
        gram,
        xy,
        yy,
        n: rows as f64,
        log_constant: 0.7,
        prior,
        names,
    }
}

/// The posterior by a short run of four chains.
pub(super) fn sampled(problem: &Problem) -> Posterior {
    let settings = InferenceSettings {
        method: Choice::Gibbs,
        chains: 4,
        draws: 400,
        seed: 1,
        allow_disagreement: true,
    };
    infer(problem, &settings).unwrap()
}
