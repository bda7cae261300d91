//! Is the posterior the posterior? Against brute force written elsewhere, and against its own prior.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

mod calibration;
mod enumeration;
mod many;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random numbers with a fixed seed.
struct Source(ChaCha8Rng);

impl Source {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }

    /// Gamma of half-integer shape with rate 1: a sum of exponentials and half a squared normal.
    fn gamma(&mut self, twice_shape: usize) -> f64 {
        let whole: f64 = (0..twice_shape / 2)
            .map(|_| -(1.0 - self.uniform()).ln())
            .sum();
        whole
            + if twice_shape % 2 == 1 {
                0.5 * self.normal().powi(2)
            } else {
                0.0
            }
    }
}
