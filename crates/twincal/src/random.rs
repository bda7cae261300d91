//! Random numbers whose bytes never change: ChaCha8 streams and our own samplers for uniform, normal and gamma.
//!
//! A generator crate may change its samplers between versions; a result with a seed must not. So only the cipher itself
//! is taken from outside (its output is a published specification), and seeds are expanded here.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// One reproducible stream: the same `(seed, stream)` gives the same numbers on any machine and any number of threads.
///
/// # Example
/// ```
/// use twincal::random::Random;
///
/// let first = |seed, stream| Random::new(seed, stream).normal();
/// assert_eq!(first(7, 0), first(7, 0)); // on any machine
/// assert_ne!(first(7, 0), first(7, 1));
/// ```
#[derive(Debug, Clone)]
pub struct Random {
    bits: ChaCha8Rng,
    /// The second of a pair of normals.
    spare: Option<f64>,
}

impl Random {
    /// Stream number `stream` of `seed`; different streams never overlap.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        // SplitMix64 (Steele, Lea & Flood 2014) spreads the seed over the key.
        let mut state = seed;
        let mut key = [0_u8; 32];
        for word in key.chunks_exact_mut(8) {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut mixed = state;
            mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            word.copy_from_slice(&(mixed ^ (mixed >> 31)).to_le_bytes());
        }
        let mut bits = ChaCha8Rng::from_seed(key);
        bits.set_stream(stream);
        Self { bits, spare: None }
    }

    /// 64 uniform bits.
    pub fn bits(&mut self) -> u64 {
        self.bits.next_u64()
    }

    /// Uniform on the open interval (0, 1): the midpoints of 2^53 cells, so that neither end is ever drawn.
    pub fn uniform(&mut self) -> f64 {
        ((self.bits() >> 12) as f64 + 0.5) * (1.0 / (1_u64 << 52) as f64)
    }

    /// Standard normal (polar method, Marsaglia & Bray 1964).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = x * x + y * y;
            if square < 1.0 && square > 0.0 {
                let length = (-2.0 * square.ln() / square).sqrt();
                self.spare = Some(y * length);
                return x * length;
            }
        }
    }

    /// Gamma with `shape` > 0 and scale 1 (Marsaglia & Tsang 2000; below 1 by their power of a uniform).
    pub fn gamma(&mut self, shape: f64) -> f64 {
        if shape < 1.0 {
            let boost = self.uniform().ln() / shape;
            return self.gamma(shape + 1.0) * boost.exp();
        }
        let d = shape - 1.0 / 3.0;
        let c = 1.0 / (9.0 * d).sqrt();
        loop {
            let x = self.normal();
            let root = 1.0 + c * x;
            if root <= 0.0 {
                continue;
            }
            let v = root * root * root;
            if self.uniform().ln() < 0.5 * x * x + d - d * v + d * v.ln() {
                return d * v;
            }
        }
    }

    /// A standard normal number that is at least `lowest` (Robert 1995 in the tail).
    pub fn normal_above(&mut self, lowest: f64) -> f64 {
        if lowest < 0.5 {
            loop {
                let x = self.normal();
                if x >= lowest {
                    return x;
                }
            }
        }
        let rate = 0.5 * (lowest + (lowest * lowest + 4.0).sqrt());
        loop {
            let x = lowest - (1.0 - self.uniform()).ln() / rate;
            if self.uniform() <= (-0.5 * (x - rate) * (x - rate)).exp() {
                return x;
            }
        }
    }

    /// A standard normal number between two ends (Robert 1995).
    pub fn normal_between(&mut self, [low, high]: [f64; 2]) -> f64 {
        if high == f64::INFINITY {
            return self.normal_above(low);
        }
        if low + high < 0.0 {
            return -self.normal_between([-high, -low]);
        }
        // The interval's middle is on the positive side: |low| ≤ high.
        let decay = low.max(1.0);
        if (high - low) * decay > 1.5 {
            loop {
                let x = self.normal_above(low);
                if x <= high {
                    return x;
                }
            }
        }
        let least = low.max(0.0);
        loop {
            let x = low + (high - low) * self.uniform();
            if self.uniform() <= (0.5 * (least * least - x * x)).exp() {
                return x;
            }
        }
    }

    /// φ ~ InvGamma(shape, scale), density ∝ φ^−(shape+1) e^(−scale/φ).
    pub fn inverse_gamma(&mut self, shape: f64, scale: f64) -> f64 {
        scale / self.gamma(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Gamma, Normal};

    const DRAWS: usize = 20_000;

    /// √n · Kolmogorov–Smirnov distance; exceeds 2.225 with probability 1e-4 (2 e^(−2x²)).
    fn distance(mut draws: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
        draws.sort_by(f64::total_cmp);
        let n = draws.len() as f64;
        let worst = draws.iter().enumerate().fold(0.0_f64, |worst, (i, &x)| {
            let p = cdf(x);
            worst.max(p - i as f64 / n).max((i + 1) as f64 / n - p)
        });
        worst * n.sqrt()
    }

    /// False alarm 1e-4 per distribution, 8 of them; the seed is fixed.
    #[test]
    fn samplers_follow_their_distributions() {
        let mut random = Random::new(7, 0);
        let uniform: Vec<f64> = (0..DRAWS).map(|_| random.uniform()).collect();
        assert!(distance(uniform, |x| x) < 2.225);
        let normal: Vec<f64> = (0..DRAWS).map(|_| random.normal()).collect();
        let law = Normal::standard();
        assert!(distance(normal, |x| law.cdf(x)) < 2.225);
        for shape in [0.05, 0.5, 1.0, 1.5, 20.0, 4000.0] {
            let draws: Vec<f64> = (0..DRAWS).map(|_| random.gamma(shape)).collect();
            let law = Gamma::new(shape, 1.0).unwrap();
            let found = distance(draws, |x| law.cdf(x));
            assert!(found < 2.225, "gamma({shape}): {found}");
        }
    }

    /// Consecutive normals come in pairs: their correlation must vanish. False alarm 6e-5 (|z| > 4).
    #[test]
    fn the_two_normals_of_a_pair_are_independent() {
        let mut random = Random::new(8, 3);
        let sum: f64 = (0..DRAWS).map(|_| random.normal() * random.normal()).sum();
        assert!(sum.abs() / (DRAWS as f64).sqrt() < 4.0);
    }

    #[test]
    fn the_bytes_of_a_stream_never_change() {
        let mut random = Random::new(1, 2);
        let found = [
            random.bits(),
            random.uniform().to_bits(),
            random.normal().to_bits(),
            random.gamma(2.5).to_bits(),
        ];
        let again = {
            let mut random = Random::new(1, 2);
            [
                random.bits(),
                random.uniform().to_bits(),
                random.normal().to_bits(),
                random.gamma(2.5).to_bits(),
            ]
        };
        assert_eq!(found, again);
        assert_eq!(found[0], FIRST_BITS);
        assert_ne!(Random::new(1, 3).bits(), found[0]);
        assert_ne!(Random::new(2, 2).bits(), found[0]);
    }

    /// ChaCha8 keyed with SplitMix64(1), stream 2, block 0: by `tests/reference/twin/chacha8.py`, a plain-Python cipher.
    const FIRST_BITS: u64 = 0xd8d6_fac1_07ac_9688;
}
