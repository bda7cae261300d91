//! Columns of bins: inertial parameters of every body, gravity in the base, friction of every joint.

use super::bins::{Bins, FRICTION, Zone};
use crate::robot::{
    BLOCK, BlockWorkspace, Motion, Regressor, Robot, STRIDE, gravity_regressor, nominal_torque,
};
use std::ops::Range;

/// Gravity along the axes of the base: a base that leans is a rigid body's matter, too.
const GRAVITY: usize = 3;
/// Prior sd of gravity along an axis, m/s²: a lean of about ten degrees.
const LEAN: f64 = 2.0;
/// Velocity at which Coulomb friction is read from them, rad/s or m/s, and the velocities of the shapes.
const AT: f64 = 0.1;
const SHAPES: [f64; 2] = [0.02, 0.2];
/// Bins that are looked at, numbers of them at most, and bins of a run.
const BINS: usize = 1200;
const NUMBERS: usize = 4_000_000;
const RUN: usize = 8;

/// Bins of a segment: its number, and which.
pub(crate) type Part = (usize, Range<usize>);

/// Rows of all joints.
pub(crate) struct Design {
    /// How many parameters there are.
    pub(crate) parameters: usize,
    /// Which of them is gravity along the first axis.
    gravity: usize,
    /// By joint.
    pub(crate) joints: Vec<JointRows>,
    /// Segment and number of each bin.
    pub(crate) places: Vec<(usize, usize)>,
}

/// Rows of one joint: one for each bin.
pub(crate) struct JointRows {
    /// Which parameter each column is.
    pub(crate) columns: Vec<usize>,
    /// Row by row.
    pub(crate) values: Vec<f64>,
    /// Measured torque.
    pub(crate) torque: Vec<f64>,
    /// Torque of the nominal model.
    pub(crate) nominal: Vec<f64>,
    /// What its friction can be.
    pub(crate) zones: Vec<Zone>,
}

impl JointRows {
    /// Columns of a row.
    pub(crate) fn row(&self, row: usize) -> &[f64] {
        let width = self.columns.len();
        &self.values[row * width..(row + 1) * width]
    }

    /// Torque of a row with these parameters beside the nominal one.
    pub(crate) fn explained(&self, row: usize, theta: &[f64]) -> f64 {
        let columns = self.columns.iter().zip(self.row(row));
        columns.map(|(&column, x)| x * theta[column]).sum()
    }
}

impl Design {
    /// Rows of these bins.
    pub(crate) fn new(robot: &Robot, bins: &[Bins], parts: &[Part]) -> Self {
        let dof = robot.dof();
        let regressor = Regressor::new(robot);
        let bodies = robot.bodies().len();
        let mut joints: Vec<JointRows> = (0..dof)
            .map(|joint| JointRows {
                columns: columns(&regressor, joint, bodies),
                values: Vec::new(),
                torque: Vec::new(),
                nominal: Vec::new(),
                zones: Vec::new(),
            })
            .collect();
        let mut places = Vec::new();
        let mut block = regressor.block(robot);
        for (segment, range) in parts {
            let own = &bins[*segment];
            let mut from = range.start;
            while from < range.end {
                let run = from..range.end.min(from + BLOCK);
                add_block(robot, (&regressor, &mut block), own, &run, &mut joints);
                places.extend(run.clone().map(|bin| (*segment, bin)));
                from = run.end;
            }
        }
        Self {
            parameters: 10 * bodies + GRAVITY + FRICTION * dof,
            gravity: 10 * bodies,
            joints,
            places,
        }
    }

    /// How many bins there are.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// What these parameters leave of each joint's torque.
    pub(crate) fn residual(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let of_joint = |rows: &JointRows| {
            let left = |row| rows.torque[row] - rows.nominal[row] - rows.explained(row, theta);
            (0..rows.torque.len()).map(left).collect()
        };
        self.joints.iter().map(of_joint).collect()
    }

    /// Change of gravity in the base, m/s², and of the ten parameters of each body in turn.
    pub(crate) fn gravity_and_inertia<'a>(&self, theta: &'a [f64]) -> ([f64; 3], &'a [f64]) {
        let (inertia, others) = theta.split_at(self.gravity);
        (std::array::from_fn(|axis| others[axis]), inertia)
    }

    /// Coulomb friction of a joint as these parameters have it, N·m or N: friction at 0.1 rad/s.
    pub(crate) fn coulomb(&self, joint: usize, theta: &[f64]) -> f64 {
        let first = self.parameters - FRICTION * (self.joints.len() - joint);
        let own = &theta[first..first + FRICTION];
        let [slow, fast] = SHAPES.map(|velocity| (AT / velocity).tanh());
        (own[0] * AT + own[1] * slow + own[2] * fast + own[3] * AT * AT).abs()
    }
}

/// Parameters that act on a joint: of the bodies that it moves, and its own.
fn columns(regressor: &Regressor, joint: usize, bodies: usize) -> Vec<usize> {
    let own = regressor.pairs().iter().filter(|p| p.coordinate == joint);
    let inertial = own.flat_map(|pair| {
        let present = (0..10).filter(|&k| pair.present[k]);
        present.map(move |k| 10 * pair.body + k)
    });
    let gravity = 10 * bodies..10 * bodies + GRAVITY;
    let first = gravity.end + FRICTION * joint;
    let own = first..first + FRICTION;
    inertial.chain(gravity).chain(own).collect()
}

/// Adds the rows of a block of bins.
fn add_block(
    robot: &Robot,
    (regressor, block): (&Regressor, &mut crate::robot::RegressorBlock),
    bins: &Bins,
    run: &Range<usize>,
    joints: &mut [JointRows],
) {
    let len = run.len();
    let own: Vec<_> = (0..joints.len()).map(|j| bins.joint(j, run)).collect();
    let stacked = |channel: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
        (0..own.len()).flat_map(channel).collect()
    };
    let q = stacked(&|joint| own[joint].position().to_vec());
    let qd = stacked(&|joint| own[joint].velocity().to_vec());
    let qdd = stacked(&|joint| own[joint].acceleration().to_vec());
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut nominal = vec![0.0; own.len() * len];
    nominal_torque(robot, motion, &mut nominal);
    regressor.evaluate(robot, motion, 0..len, block);
    let mut gravity = vec![0.0; GRAVITY * own.len() * STRIDE];
    let mut workspace = BlockWorkspace::new(robot);
    gravity_regressor(robot, &mut workspace, motion, 0..len, &mut gravity);
    for (joint, rows) in joints.iter_mut().enumerate() {
        let pairs: Vec<usize> = (0..regressor.pairs().len())
            .filter(|&p| regressor.pairs()[p].coordinate == joint)
            .collect();
        for bin in 0..len {
            for &pair in &pairs {
                let present = &regressor.pairs()[pair].present;
                let values = (0..10).filter(|&k| present[k]);
                rows.values
                    .extend(values.map(|k| block.column(pair, k)[bin]));
            }
            let along = (0..GRAVITY).map(|axis| gravity[(GRAVITY * joint + axis) * STRIDE + bin]);
            rows.values.extend(along);
            rows.values.extend(own[joint].friction(bin));
        }
        rows.torque.extend_from_slice(own[joint].torque());
        rows.nominal
            .extend_from_slice(&nominal[joint * len..(joint + 1) * len]);
        rows.zones
            .extend_from_slice(&bins.zones(joint)[run.clone()]);
    }
}

/// Evenly spread bins: all of them where they are few.
pub(crate) fn sample(robot: &Robot, bins: &[Bins]) -> Vec<Part> {
    let all: usize = bins.iter().map(Bins::len).sum();
    let own = GRAVITY + FRICTION;
    let width: usize = 10 * Regressor::new(robot).pairs().len() + own * robot.dof();
    let most = BINS.min(NUMBERS / width).max(RUN);
    let every = all.div_ceil(most);
    let mut parts = Vec::new();
    for (segment, own) in bins.iter().enumerate() {
        if every <= 1 {
            parts.push((segment, 0..own.len()));
            continue;
        }
        let runs = (0..own.len()).step_by(every * RUN);
        parts.extend(runs.map(|from| (segment, from..own.len().min(from + RUN))));
    }
    parts
}

/// Precision of each parameter before the data: a mean link is as wrong as it is heavy, a base leans by some degrees; friction is free.
pub(crate) fn prior(robot: &Robot) -> Vec<f64> {
    let bodies = robot.bodies().len();
    let parameters: Vec<[f64; 10]> = (0..bodies).map(|b| robot.parameters_of_body(b)).collect();
    let mass: f64 = parameters.iter().map(|p| p[0]).sum();
    let trace: f64 = parameters.iter().map(|p| p[4] + p[7] + p[9]).sum();
    let mean = (mass / bodies.max(1) as f64).max(1e-3);
    // The trace of a tensor is twice the mass times the mean square distance.
    let square = (0.5 * trace / mass.max(1e-3)).max(1e-4);
    let precision = |k: usize| match k {
        0 => mean.powi(-2),
        1..=3 => (mean * mean * square).recip(),
        _ => (mean * square).powi(-2),
    };
    let inertial = (0..bodies).flat_map(|_| (0..10).map(precision));
    inertial
        .chain([LEAN.powi(-2); GRAVITY])
        .chain(std::iter::repeat_n(0.0, FRICTION * robot.dof()))
        .collect()
}
