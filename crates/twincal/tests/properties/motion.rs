//! Closed motions: every joint a trigonometric polynomial of period 2π, so that sums over one period are integrals to
//! rounding and variations need no boundary terms.

use proptest::prelude::*;
use std::f64::consts::TAU;

/// Samples per period.
pub(crate) const SAMPLES: usize = 256;
/// Step of the sums over a period.
pub(crate) const STEP: f64 = TAU / SAMPLES as f64;

/// `Σ_h a_h cos(h t) + b_h sin(h t)` for harmonics h = 0, 1, 2.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wave([[f64; 2]; 3]);

impl Wave {
    /// Value and first two derivatives.
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        let mut value = [0.0; 3];
        for (harmonic, [a, b]) in self.0.iter().enumerate() {
            let h = harmonic as f64;
            let (s, c) = (h * t).sin_cos();
            value[0] += a * c + b * s;
            value[1] += h * (b * c - a * s);
            value[2] -= h * h * (a * c + b * s);
        }
        value
    }
}

pub(crate) fn wave(size: f64) -> impl Strategy<Value = Wave> {
    prop::array::uniform3(prop::array::uniform2(-size..size)).prop_map(Wave)
}

/// `q, qd, qdd` of all joints over one period, `joint * SAMPLES + sample`.
pub(crate) fn sampled(waves: &[Wave]) -> [Vec<f64>; 3] {
    let mut motion = [(); 3].map(|()| Vec::with_capacity(waves.len() * SAMPLES));
    for wave in waves {
        for sample in 0..SAMPLES {
            let value = wave.at(sample as f64 * STEP);
            for (part, value) in motion.iter_mut().zip(value) {
                part.push(value);
            }
        }
    }
    motion
}

/// `d/dε ∮ L(q + ε η, q̇ + ε η̇) dt` at ε = 0, by a difference of fourth order.
pub(crate) fn variation(
    waves: &[Wave],
    direction: &[Wave],
    lagrangian: impl Fn(&[f64], &[f64]) -> f64,
) -> f64 {
    let action = |epsilon: f64| -> f64 {
        let sample = |sample: usize| {
            let t = sample as f64 * STEP;
            let state: Vec<[f64; 2]> = waves
                .iter()
                .zip(direction)
                .map(|(wave, direction)| {
                    let (own, shift) = (wave.at(t), direction.at(t));
                    [own[0] + epsilon * shift[0], own[1] + epsilon * shift[1]]
                })
                .collect();
            let q: Vec<f64> = state.iter().map(|s| s[0]).collect();
            let qd: Vec<f64> = state.iter().map(|s| s[1]).collect();
            lagrangian(&q, &qd)
        };
        (0..SAMPLES).map(sample).sum::<f64>() * STEP
    };
    let e = 1e-3;
    (8.0 * (action(e) - action(-e)) - (action(2.0 * e) - action(-2.0 * e))) / (12.0 * e)
}

/// `∮ τᵀη dt` and `∮ |τᵀη| dt`, the scale of its rounding.
pub(crate) fn work(torque: &[f64], direction: &[Wave]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (joint, direction) in direction.iter().enumerate() {
        for sample in 0..SAMPLES {
            let term =
                torque[joint * SAMPLES + sample] * direction.at(sample as f64 * STEP)[0] * STEP;
            sums[0] += term;
            sums[1] += term.abs();
        }
    }
    sums
}

/// The same with the motion's own velocity: the work done over one cycle.
pub(crate) fn cycle_work(torque: &[f64], qd: &[f64]) -> [f64; 2] {
    torque
        .iter()
        .zip(qd)
        .fold([0.0; 2], |[sum, size], (tau, qd)| {
            [sum + tau * qd * STEP, size + (tau * qd * STEP).abs()]
        })
}
