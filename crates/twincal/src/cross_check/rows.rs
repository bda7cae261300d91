//! A few hundred smoothed rows of each log and joint: torque of the model, its regressor, friction's shapes.

use crate::robot::{
    BLOCK, BlockWorkspace, Motion, Regressor, Robot, STRIDE, gravity_regressor, nominal_torque,
};
use crate::signal::{Pipeline, Segment, Trajectory};
use rayon::prelude::*;

/// Rows of one log, at least and at most, and of all logs about.
const LEAST: usize = 40;
const MOST: usize = 600;
const OF_ALL: usize = 12_000;
/// Width of the moving average in periods of the cut-off.
const WINDOW: f64 = 0.5;
/// Velocities of dry friction's shapes, rad/s or m/s.
const DRY: [f64; 2] = [0.02, 0.2];
/// Friction of one joint in one log: offset, viscous, and dry friction of two shapes.
pub(super) const FRICTION: usize = 4;

/// Rows of one joint in one log.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    pub(super) log: usize,
    pub(super) joint: usize,
    /// s.
    pub(super) time: Vec<f64>,
    /// Whether the joint moves and its torque says something.
    pub(super) live: Vec<bool>,
    /// First row of each stretch without a gap.
    pub(super) starts: Vec<usize>,
    /// Columns of the common parameters that are not zero, and their numbers: `x[k * rows + row]`.
    pub(super) columns: Vec<usize>,
    pub(super) x: Vec<f64>,
    /// Columns of its own friction: `friction[k * rows + row]`.
    pub(super) friction: Vec<f64>,
    /// Measured and nominal torque, N·m.
    pub(super) measured: Vec<f64>,
    pub(super) nominal: Vec<f64>,
}

impl Block {
    pub(super) fn rows(&self) -> usize {
        self.time.len()
    }

    /// One of its columns.
    pub(super) fn column(&self, k: usize) -> &[f64] {
        &self.x[k * self.rows()..(k + 1) * self.rows()]
    }
}

/// Gravity along the axes of the base, which may lean.
const GRAVITY: usize = 3;

/// Number of common parameters: ten of each body, the motor's inertia of each joint, and gravity.
pub(super) fn parameters(robot: &Robot) -> usize {
    10 * bodies(&Regressor::new(robot)) + robot.dof() + GRAVITY
}

fn bodies(regressor: &Regressor) -> usize {
    let pairs = regressor.pairs().iter();
    pairs.map(|pair| pair.body + 1).max().unwrap_or(0)
}

/// Smoothed rows of a log before they are columns: `motion[k][joint * len + row]` for position, velocity, acceleration, torque.
#[derive(Debug, Default)]
struct Smooth {
    time: Vec<f64>,
    starts: Vec<usize>,
    motion: [Vec<Vec<f64>>; 4],
    live: Vec<Vec<bool>>,
}

/// Rows of all logs that have torque; `logs` numbers them as given.
pub(super) fn blocks(robot: &Robot, pipeline: &Pipeline, logs: &[&Trajectory]) -> Vec<Block> {
    let regressor = Regressor::new(robot);
    let most = (OF_ALL / logs.len().max(1)).clamp(LEAST, MOST);
    let of_log = |(log, trajectory): (usize, &&Trajectory)| -> Vec<Block> {
        match smooth(pipeline, trajectory, most) {
            Some(rows) => of_log(robot, &regressor, log, rows),
            None => Vec::new(),
        }
    };
    let all: Vec<Vec<Block>> = logs.par_iter().enumerate().map(of_log).collect();
    all.into_iter().flatten().collect()
}

/// `None` without torque, or with hardly a row.
fn smooth(pipeline: &Pipeline, trajectory: &Trajectory, most: usize) -> Option<Smooth> {
    let total: usize = trajectory.segments.iter().map(|s| s.time.len()).sum();
    if total == 0 || trajectory.segments.iter().any(|s| s.tau.is_empty()) {
        return None;
    }
    let step = total.div_ceil(most);
    let dof = trajectory.dof;
    let mut rows = Smooth {
        motion: std::array::from_fn(|_| vec![Vec::new(); dof]),
        live: vec![Vec::new(); dof],
        ..Smooth::default()
    };
    for segment in &trajectory.segments {
        append(pipeline, segment, step, &mut rows);
    }
    (rows.time.len() >= LEAST / 2).then_some(rows)
}

fn append(pipeline: &Pipeline, segment: &Segment, step: usize, rows: &mut Smooth) {
    let len = segment.time.len();
    let half = if pipeline.is_off() {
        0
    } else {
        (0.5 * WINDOW / pipeline.cutoff_hz / segment.interval).round() as usize
    };
    let centres = || (half..len.saturating_sub(half)).step_by(step);
    if centres().next().is_some() {
        rows.starts.push(rows.time.len());
    }
    rows.time.extend(centres().map(|i| segment.time[i]));
    let from = [&segment.q, &segment.qd, &segment.qdd, &segment.tau];
    for joint in 0..rows.live.len() {
        let own = joint * len..(joint + 1) * len;
        for (to, from) in rows.motion.iter_mut().zip(from) {
            let values = &from[own.clone()];
            let mean = |i: usize| {
                let window = &values[i - half..=i + half];
                window.iter().sum::<f64>() / window.len() as f64
            };
            to[joint].extend(centres().map(mean));
        }
        let still = &segment.standstill[own];
        rows.live[joint].extend(centres().map(|i| !still[i]));
    }
}

fn of_log(robot: &Robot, regressor: &Regressor, log: usize, rows: Smooth) -> Vec<Block> {
    let (dof, len) = (robot.dof(), rows.time.len());
    let [q, qd, qdd] = [0, 1, 2].map(|k| rows.motion[k].concat());
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut nominal = vec![0.0; dof * len];
    nominal_torque(robot, motion, &mut nominal);
    let motor = 10 * bodies(regressor);
    let mut blocks: Vec<Block> = (0..dof)
        .map(|joint| {
            let own = joint * len..(joint + 1) * len;
            let v = &qd[own.clone()];
            let mut friction = vec![1.0; len];
            friction.extend(v);
            for dry in DRY {
                friction.extend(v.iter().map(|v| (v / dry).tanh()));
            }
            Block {
                log,
                joint,
                time: rows.time.clone(),
                live: rows.live[joint].clone(),
                starts: rows.starts.clone(),
                columns: vec![motor + joint],
                x: qdd[own.clone()].to_vec(),
                friction,
                measured: rows.motion[3][joint].clone(),
                nominal: nominal[own].to_vec(),
            }
        })
        .collect();
    let mut first = vec![0; regressor.pairs().len()];
    for (pair, first) in regressor.pairs().iter().zip(&mut first) {
        let block = &mut blocks[pair.coordinate];
        *first = block.columns.len();
        let present = (0..10).filter(|k| pair.present[*k]);
        block.columns.extend(present.map(|k| 10 * pair.body + k));
        block.x.resize(block.columns.len() * len, 0.0);
    }
    let mut lean = vec![0; dof];
    for (block, lean) in blocks.iter_mut().zip(&mut lean) {
        *lean = block.columns.len();
        block
            .columns
            .extend((0..GRAVITY).map(|axis| motor + dof + axis));
        block.x.resize(block.columns.len() * len, 0.0);
    }
    let mut cells = regressor.block(robot);
    let mut workspace = BlockWorkspace::new(robot);
    let mut gravity = vec![0.0; GRAVITY * dof * STRIDE];
    for from in (0..len).step_by(BLOCK) {
        let samples = from..(from + BLOCK).min(len);
        regressor.evaluate(robot, motion, samples.clone(), &mut cells);
        gravity_regressor(robot, &mut workspace, motion, samples.clone(), &mut gravity);
        for (joint, block) in blocks.iter_mut().enumerate() {
            for axis in 0..GRAVITY {
                let own = (GRAVITY * joint + axis) * STRIDE;
                let start = (lean[joint] + axis) * len;
                block.x[start + samples.start..start + samples.end]
                    .copy_from_slice(&gravity[own..own + samples.len()]);
            }
        }
        for (index, pair) in regressor.pairs().iter().enumerate() {
            let block = &mut blocks[pair.coordinate];
            let present = (0..10).filter(|k| pair.present[*k]);
            for (place, k) in present.enumerate() {
                let start = (first[index] + place) * len;
                block.x[start + samples.start..start + samples.end]
                    .copy_from_slice(&cells.column(index, k)[..samples.len()]);
            }
        }
    }
    blocks
}
