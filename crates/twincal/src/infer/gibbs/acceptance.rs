//! How likely a proposed move is accepted.

use crate::lanes::{Lane, exp, ln};
use pulp::Simd;

/// Largest acceptance probability of a move: below 1, or a chain could alternate for ever.
pub(super) const LAZY: f64 = 0.95;

/// Probability that an exchange is accepted which multiplies the weight with `e^gain`.
pub(super) fn exchange_chance(gain: f64) -> f64 {
    LAZY * gain.exp().min(1.0)
}

/// x^power of eight positive numbers.
#[inline(always)]
pub(super) fn to_the<S: Simd>(simd: S, mut x: Lane, power: f64) -> Lane {
    for vector in S::as_mut_simd_f64s(&mut x).0 {
        *vector = exp(
            simd,
            simd.mul_f64s(simd.splat_f64s(power), ln(simd, *vector)),
        );
    }
    x
}
