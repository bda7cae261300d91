//! The rows of each log and joint as columns: torque of the model, its regressor, friction's shapes.

use super::excerpt::Excerpt;
use crate::robot::{
    BLOCK, BlockWorkspace, Motion, Regressor, Robot, STRIDE, gravity_regressor, nominal_torque,
};
use rayon::prelude::*;

/// Velocities of dry friction's shapes, rad/s or m/s.
const DRY: [f64; 2] = [0.02, 0.2];
/// Friction of one joint in one log: offset, viscous, and dry friction of two shapes.
pub(super) const FRICTION: usize = 4;

/// Rows of one joint in one log.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    pub(super) log: usize,
    pub(super) joint: usize,
    /// s; rows are [`TRIPLE`](super::excerpt::TRIPLE) neighbours each.
    pub(super) time: Vec<f64>,
    /// Whether the joint moves and its torque says something.
    pub(super) live: Vec<bool>,
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

/// Rows of all logs that have torque, in the order of the logs; `logs` numbers them as given.
pub(super) fn blocks(robot: &Robot, logs: &[Excerpt]) -> Vec<Block> {
    let regressor = Regressor::new(robot);
    let of_log = |(log, rows): (usize, &Excerpt)| match rows.len() {
        0 => Vec::new(),
        _ => of_log((robot, &regressor), log, rows),
    };
    let all: Vec<Vec<Block>> = logs.par_iter().enumerate().map(of_log).collect();
    all.into_iter().flatten().collect()
}

fn of_log((robot, regressor): (&Robot, &Regressor), log: usize, rows: &Excerpt) -> Vec<Block> {
    let [q, qd, qdd, tau] = rows.motion();
    let len = rows.len();
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut nominal = vec![0.0; robot.dof() * len];
    nominal_torque(robot, motion, &mut nominal);
    let of_joint = |joint: usize| {
        let own = joint * len..(joint + 1) * len;
        Block {
            log,
            joint,
            time: rows.time().to_vec(),
            live: rows.live(joint).to_vec(),
            columns: vec![10 * bodies(regressor) + joint],
            x: qdd[own.clone()].to_vec(),
            friction: friction(&qd[own.clone()]),
            measured: tau[own.clone()].to_vec(),
            nominal: nominal[own].to_vec(),
        }
    };
    let mut blocks: Vec<Block> = (0..robot.dof()).map(of_joint).collect();
    let places = lay_out(regressor, &mut blocks, len);
    fill((robot, regressor), motion, &places, &mut blocks);
    blocks
}

/// Offset, viscous, and dry friction of two shapes.
fn friction(qd: &[f64]) -> Vec<f64> {
    let mut friction = vec![1.0; qd.len()];
    friction.extend(qd);
    for dry in DRY {
        friction.extend(qd.iter().map(|v| (v / dry).tanh()));
    }
    friction
}

/// Where the columns of a block begin.
struct Places {
    /// Of each pair of body and joint: of its block, the first inertial parameter.
    inertia: Vec<usize>,
    /// Of each joint, gravity along the first axis.
    gravity: Vec<usize>,
}

/// Gives the blocks empty columns for inertial parameters and gravity.
fn lay_out(regressor: &Regressor, blocks: &mut [Block], len: usize) -> Places {
    let after_motors = 10 * bodies(regressor) + blocks.len();
    let add = |block: &mut Block, columns: &mut dyn Iterator<Item = usize>| {
        let first = block.columns.len();
        block.columns.extend(columns);
        block.x.resize(block.columns.len() * len, 0.0);
        first
    };
    let inertia = (regressor.pairs().iter()).map(|pair| {
        let mut own = (0..10)
            .filter(|k| pair.present[*k])
            .map(|k| 10 * pair.body + k);
        add(&mut blocks[pair.coordinate], &mut own)
    });
    let inertia = inertia.collect();
    let gravity = blocks.iter_mut().map(|block| {
        let mut own = (0..GRAVITY).map(|axis| after_motors + axis);
        add(block, &mut own)
    });
    let gravity = gravity.collect();
    Places { inertia, gravity }
}

/// Fills the columns of inertial parameters and gravity.
fn fill(
    (robot, regressor): (&Robot, &Regressor),
    motion: Motion<'_>,
    places: &Places,
    blocks: &mut [Block],
) {
    let len = motion.len;
    let mut cells = regressor.block(robot);
    let mut workspace = BlockWorkspace::new(robot);
    let mut gravity = vec![0.0; GRAVITY * robot.dof() * STRIDE];
    for from in (0..len).step_by(BLOCK) {
        let samples = from..(from + BLOCK).min(len);
        let put = |block: &mut Block, column: usize, values: &[f64]| {
            let start = column * len;
            block.x[start + samples.start..start + samples.end]
                .copy_from_slice(&values[..samples.len()]);
        };
        regressor.evaluate(robot, motion, samples.clone(), &mut cells);
        gravity_regressor(robot, &mut workspace, motion, samples.clone(), &mut gravity);
        for (joint, block) in blocks.iter_mut().enumerate() {
            for axis in 0..GRAVITY {
                let own = (GRAVITY * joint + axis) * STRIDE;
                put(block, places.gravity[joint] + axis, &gravity[own..]);
            }
        }
        for (index, pair) in regressor.pairs().iter().enumerate() {
            let present = (0..10).filter(|k| pair.present[*k]);
            for (place, k) in present.enumerate() {
                let column = places.inertia[index] + place;
                put(&mut blocks[pair.coordinate], column, cells.column(index, k));
            }
        }
    }
}
