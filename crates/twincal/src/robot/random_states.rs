//! Random states of fixed seed at which the structure of a robot is read from its torque.

use super::Robot;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Positions anywhere, velocities and accelerations such that gravity, acceleration and velocity matter alike; always
/// the same ones. Layout of [`Motion`](super::Motion).
pub(crate) fn random_states(robot: &Robot, len: usize) -> [Vec<f64>; 3] {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    [PI, 2.0, 5.0].map(|scale| {
        (0..robot.dof() * len)
            .map(|_| scale * (2.0 * random.random::<f64>() - 1.0))
            .collect()
    })
}
