//! Worlds for tests: what an encoder reads of a known motion, and how a receiver logs it.

use crate::signal::log::recording::{Channels, Payload, Recording};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// How joints move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Motion {
    /// Fourier series of three harmonics.
    Fourier,
    /// Fifth-order moves of 0.8 s with dwells of 0.4 s.
    PointToPoint,
    /// Moves of constant velocity between ramps, with dwells of 0.3 s.
    Trapezoid,
    /// 0.003 to 0.02 rad/s up and down, with dwells of 1 s.
    Slow,
}

pub(super) const MOTIONS: [Motion; 4] = [
    Motion::Fourier,
    Motion::PointToPoint,
    Motion::Trapezoid,
    Motion::Slow,
];

/// Position after a share of a move (0 to 1), and its slope.
fn fifth_order(x: f64) -> [f64; 2] {
    [
        x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x),
        30.0 * x * x * (1.0 - x).powi(2),
    ]
}

/// A ramp over a fifth of the move at either end.
fn trapezoid(x: f64) -> [f64; 2] {
    let (ramp, speed) = (0.2, 1.25);
    if x < ramp {
        [0.5 * speed / ramp * x * x, speed / ramp * x]
    } else if x > 1.0 - ramp {
        let [p, v] = trapezoid(1.0 - x);
        [1.0 - p, v]
    } else {
        [speed * (x - 0.5 * ramp), speed]
    }
}

impl Motion {
    /// `[q, q̇]` of a joint at a time, rad and rad/s.
    pub(super) fn at(self, joint: usize, t: f64) -> [f64; 2] {
        let moves = |period: f64, moving: f64, way: f64, profile: fn(f64) -> [f64; 2]| {
            // There and back.
            let phase = (t / period).rem_euclid(2.0);
            let (leg, share) = (phase.floor(), phase.fract() * period / moving);
            let [p, v] = if share < 1.0 {
                profile(share)
            } else {
                [1.0, 0.0]
            };
            let sign = 1.0 - 2.0 * leg;
            [way * (leg + sign * p), way * sign * v / moving]
        };
        let scale = 1.0 + 0.3 * joint as f64;
        match self {
            Self::Fourier => (1..=3).fold([0.0; 2], |[q, v], k| {
                let omega = TAU * 0.1 * f64::from(k);
                let (sin, cos) = (omega * t + f64::from(k * k) + joint as f64).sin_cos();
                let amplitude = 0.5 / f64::from(k);
                [q + amplitude * sin, v + amplitude * omega * cos]
            }),
            Self::PointToPoint => moves(1.2, 0.8, 0.7 * scale, fifth_order),
            Self::Trapezoid => moves(1.3, 1.0, 0.9 * scale, trapezoid),
            Self::Slow => moves(6.0, 5.0, 0.05 * scale, |x| [x, 1.0]),
        }
    }
}

/// What an encoder reads and a drive measures.
#[derive(Debug, Clone, Copy)]
pub(super) struct World {
    pub(super) motion: Motion,
    pub(super) seed: u64,
    /// Controller's rate, Hz.
    pub(super) rate: f64,
    pub(super) seconds: f64,
    /// Encoder counts per turn.
    pub(super) counts: f64,
    /// Noise before counting, in counts.
    pub(super) dither: f64,
    /// Noise of torque, N·m.
    pub(super) torque_noise: f64,
    pub(super) with_velocity: bool,
}

pub(super) const JOINTS: usize = 2;

/// Standard normal.
pub(super) fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}

impl World {
    /// The usual one: 20 s at 1 kHz, 2²⁰ counts.
    pub(super) fn new(motion: Motion, seed: u64) -> Self {
        Self {
            motion,
            seed,
            rate: 1000.0,
            seconds: 20.0,
            counts: f64::from(1 << 20),
            dither: 0.5,
            torque_noise: 0.05,
            with_velocity: true,
        }
    }

    pub(super) fn random(&self) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(self.seed)
    }

    /// As the controller has it, a row per step.
    pub(super) fn clean(&self) -> Recording {
        let mut random = self.random();
        let count = TAU / self.counts;
        let time: Vec<f64> = (0..(self.rate * self.seconds) as usize)
            .map(|i| i as f64 / self.rate)
            .collect();
        let mut joint = |joint: usize| {
            let state: Vec<[f64; 2]> = time.iter().map(|&t| self.motion.at(joint, t)).collect();
            let mut noisy = |sd: f64| sd * normal(&mut random);
            Channels {
                q: (state.iter())
                    .map(|[q, _]| (q / count + noisy(self.dither)).round() * count)
                    .collect(),
                qd: (self.with_velocity).then(|| {
                    state
                        .iter()
                        .map(|[_, v]| v + noisy(1e-3 * self.dither))
                        .collect()
                }),
                qdd: None,
                tau: Some(
                    (state.iter())
                        .map(|[q, v]| {
                            3.0 * q.cos() + 0.4 * (v / 0.02).tanh() + noisy(self.torque_noise)
                        })
                        .collect(),
                ),
                temperature: None,
            }
        };
        Recording {
            unfolded: false,
            start_ns: 0,
            name: "run".into(),
            joints: (0..JOINTS).map(&mut joint).collect(),
            time,
            payload: Payload::None,
        }
    }
}

/// Some rows of a log, one behind the other, repeated ones too.
pub(super) fn rows_of(log: &Recording, rows: &[usize], time: Vec<f64>) -> Recording {
    let pick = |values: &Vec<f64>| rows.iter().map(|&row| values[row]).collect();
    Recording {
        joints: (log.joints.iter())
            .map(|joint| Channels {
                q: pick(&joint.q),
                qd: joint.qd.as_ref().map(pick),
                qdd: joint.qdd.as_ref().map(pick),
                tau: joint.tau.as_ref().map(pick),
                temperature: None,
            })
            .collect(),
        time,
        ..log.clone()
    }
}

/// What a receiver logs that polls once per step with a jitter: its stamps, and of each row the controller's step.
pub(super) fn polled(log: &Recording, rate: f64, seed: u64) -> (Recording, Vec<usize>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut stamps, mut steps) = (Vec::new(), Vec::new());
    let mut phase = 0.5;
    for i in 0..log.time.len() {
        // The poll wanders about the step, by a third of it and now and then more.
        phase += 0.05 * (0.5 - phase) + 0.06 * normal(&mut random);
        let late = phase
            + 0.2 * normal(&mut random)
            + f64::from(u8::from(random.random::<f64>() < 0.01)) * 0.6;
        let at = i as f64 + late;
        let at = at.max(stamps.last().map_or(0.0, |last: &f64| last * rate + 0.2));
        let step = at.floor();
        if step as usize >= log.time.len() {
            break;
        }
        steps.push(step as usize);
        stamps.push(at / rate);
    }
    let time: Vec<f64> = stamps.iter().map(|t| t + 17.3).collect();
    (rows_of(log, &steps, time), steps)
}
