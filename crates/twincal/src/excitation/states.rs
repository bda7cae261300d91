//! States and the power of columns over them.

use super::ROBOT_SHOWS;
use crate::gram::Gram;
use crate::linear_algebra::product_transposed;
use crate::robot::{JointKind, Motion, Robot, nominal_torque};
use crate::term::Library;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Velocity and acceleration of ordinary motion, rad/s and rad/s² (m/s, m/s²), at most.
const VELOCITY: f64 = 2.0;
const ACCELERATION: f64 = 5.0;

/// Some states of a robot, `[joint * len + state]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct States {
    /// How many.
    pub len: usize,
    /// Positions.
    pub q: Vec<f64>,
    /// Velocities.
    pub qd: Vec<f64>,
    /// Accelerations.
    pub qdd: Vec<f64>,
    /// Torque that is not used: the joint stands still.
    pub still: Vec<bool>,
}

/// Positions within the joints' limits (or ±π), velocities of at most 2 rad/s or the joint's limit, accelerations of at most
/// 5 rad/s²; always the same ones.
pub fn random_states(robot: &Robot, len: usize) -> States {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut states = States {
        len,
        still: vec![false; robot.dof() * len],
        ..States::default()
    };
    for joint in 0..robot.dof() {
        let description = robot.joint(joint);
        let limits = &description.limits;
        let bounded = description.kind != JointKind::Continuous;
        let wide = |limit: Option<f64>, wide: f64| match limit {
            Some(limit) if bounded && limit.is_finite() => limit.clamp(-PI, PI),
            _ => wide,
        };
        let (low, high) = (wide(limits.lower, -PI), wide(limits.upper, PI));
        let (low, high) = if low < high { (low, high) } else { (-PI, PI) };
        let fast = limits.velocity.filter(|v| *v > 0.0).unwrap_or(VELOCITY);
        let fast = fast.min(VELOCITY);
        let mut uniform = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        for _ in 0..len {
            states.q.push(uniform(low, high));
            states.qd.push(uniform(-fast, fast));
            states.qdd.push(uniform(-ACCELERATION, ACCELERATION));
        }
    }
    states
}

impl States {
    /// As [`Motion`].
    pub fn motion(&self) -> Motion<'_> {
        Motion {
            len: self.len,
            q: &self.q,
            qd: &self.qd,
            qdd: &self.qdd,
        }
    }

    /// The same states with one joint moving as in `random`.
    pub(super) fn with_random(&self, joint: usize, random: &Self) -> Self {
        let mut moved = self.clone();
        for k in 0..self.len {
            let (to, from) = (joint * self.len + k, joint * random.len + k % random.len);
            moved.q[to] = random.q[from];
            moved.qd[to] = random.qd[from];
            moved.qdd[to] = random.qdd[from];
            moved.still[to] = false;
        }
        moved
    }
}

/// How large columns and torques are at random states.
pub(crate) struct Reference<'a> {
    robot: &'a Robot,
    /// rms of each column, in torque of size 1 per joint; NaN for a column that is no number somewhere.
    pub(crate) size: Vec<f64>,
    /// Weight of each joint's rows.
    pub(crate) weight: Vec<f64>,
}

/// Sizes of everything at random states.
pub(crate) fn reference<'a>(robot: &'a Robot, library: &Library, all: &States) -> Reference<'a> {
    let (dof, len) = (robot.dof(), all.len);
    let mut torque = vec![0.0; dof * len];
    nominal_torque(robot, all.motion(), &mut torque);
    let mut square: Vec<f64> = torque
        .chunks_exact(len)
        .map(|torque| torque.iter().map(|t| t * t).sum::<f64>() / len as f64)
        .collect();
    let largest = square.iter().fold(0.0_f64, |m, s| m.max(*s));
    for s in &mut square {
        // A joint that carries nothing counts like a light one.
        *s = s.max(ROBOT_SHOWS * ROBOT_SHOWS * largest);
    }
    let weight: Vec<f64> = square
        .iter()
        .map(|s| if *s > 0.0 { 1.0 / s } else { 1.0 })
        .collect();
    let mut reference = Reference {
        robot,
        size: vec![1.0; library.columns().len()],
        weight,
    };
    let every: Vec<usize> = (0..library.columns().len()).collect();
    let power = reference.power(library, &every, all);
    let count = every.len();
    reference.size = (0..count).map(|k| power[k * count + k].sqrt()).collect();
    reference
}

impl Reference<'_> {
    /// ⟨Φᵀ W Φ⟩ of some columns, each of size 1 at random states, over states; row-major.
    pub(crate) fn power(&self, library: &Library, columns: &[usize], states: &States) -> Vec<f64> {
        let (dof, len, count) = (self.robot.dof(), states.len, columns.len());
        let mut out = vec![Vec::new(); dof];
        library.evaluate(states.motion(), &mut out);
        let mut place = vec![None; library.columns().len()];
        for (at, &column) in columns.iter().enumerate() {
            place[column] = Some(at);
        }
        let mut power = vec![0.0; count * count];
        for joint in 0..dof {
            let weight = self.weight[joint] / len.max(1) as f64;
            let still = &states.still[joint * len..(joint + 1) * len];
            let (mut places, mut values) = (Vec::new(), Vec::new());
            let columns = library.columns_of_joint(joint).iter();
            for (&column, own) in columns.zip(out[joint].chunks_exact(len.max(1))) {
                let Some(at) = place[column] else { continue };
                let size = self.size[column];
                let kept = |(value, still): (&f64, &bool)| if *still { 0.0 } else { value / size };
                values.extend(own.iter().zip(still).map(kept));
                places.push(at);
            }
            let own = places.len();
            let sums = product_transposed(&values, &values, [own, len, own]);
            for (i, &a) in places.iter().enumerate() {
                for (j, &b) in places[..=i].iter().enumerate() {
                    let sum = sums[i * own + j];
                    power[a * count + b] += weight * sum;
                    if a != b {
                        power[b * count + a] += weight * sum;
                    }
                }
            }
        }
        power
    }

    /// The same over the rows of a Gram.
    pub(super) fn power_of_gram(&self, columns: &[usize], gram: &Gram) -> Vec<f64> {
        let count = columns.len();
        let mut power = vec![0.0; count * count];
        let rows = gram.joints.iter().fold(1.0_f64, |m, joint| m.max(joint.n));
        for (joint, weight) in gram.joints.iter().zip(&self.weight) {
            let places: Vec<Option<usize>> = (joint.columns.iter())
                .map(|&column| columns.binary_search(&(column as usize)).ok())
                .collect();
            for (i, a) in places.iter().enumerate() {
                for (j, b) in places.iter().enumerate() {
                    if let (Some(a), Some(b)) = (a, b) {
                        let size = self.size[columns[*a]] * self.size[columns[*b]];
                        power[a * count + b] += weight * joint.s0.at(i, j) / (rows * size);
                    }
                }
            }
        }
        power
    }
}
