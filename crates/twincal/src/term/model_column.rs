//! Columns that are made from the robot model: no expression, but exact torque images from the dynamics recursions.
//!
//! The Lagrangian of a robot is linear in the ten inertial parameters of every link, so the Euler–Lagrange image of
//! each is a column of the joint-torque regressor; gravity, gains and encoder zeros are first-order changes of the
//! nominal torque.

use super::expression::TapeScratch;
use crate::robot::{
    BLOCK, BlockWorkspace, Motion, Regressor, RegressorBlock, Robot, STRIDE, gravity_regressor,
    nominal_torque, position_derivative,
};
use pulp::{Simd, WithSimd};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// What a column of the robot model is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ModelColumn {
    /// Σ weight_p · (column of parameter p of `body` in the joint-torque regressor).
    Inertia {
        /// Index of the body.
        body: usize,
        /// In the regressor's order of parameters, body frame.
        weights: [f64; 10],
    },
    /// Torque per unit of gravity along an axis of the base.
    Gravity {
        /// 0, 1, 2: x, y, z.
        axis: usize,
    },
    /// Nominal torque of a joint, on that joint.
    Nominal {
        /// 0-based.
        joint: usize,
    },
    /// |nominal torque| in the direction of motion, on the same joint.
    LoadFriction {
        /// 0-based.
        joint: usize,
        /// v_s, rad/s or m/s.
        velocity: f64,
    },
    /// ∂τ_nom/∂q of a joint, on all joints.
    PositionDerivative {
        /// 0-based.
        joint: usize,
    },
}

impl ModelColumn {
    /// True if it comes from a recursion that works on blocks of samples.
    fn is_blockwise(&self) -> bool {
        !matches!(self, Self::Nominal { .. } | Self::LoadFriction { .. })
    }

    /// False on joints that it cannot act on by definition.
    fn acts_on(&self, other: usize) -> bool {
        match self {
            Self::Nominal { joint } | Self::LoadFriction { joint, .. } => *joint == other,
            _ => true,
        }
    }
}

/// A link's frame as the inertial families need it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinkFrame {
    /// Name of the link.
    pub(super) name: String,
    /// The body that it belongs to.
    pub(super) body: usize,
    /// Parameters in the body's frame = this × parameters in the link's frame.
    pub(super) to_body: [[f64; 10]; 10],
}

impl LinkFrame {
    /// The column of one parameter (mass, three first moments, six of the tensor) in the link's frame.
    pub(super) fn column(&self, parameter: usize) -> ModelColumn {
        ModelColumn::Inertia {
            body: self.body,
            weights: self.weights(parameter),
        }
    }

    /// The body's ten parameters per unit of one of the link's.
    pub(super) fn weights(&self, parameter: usize) -> [f64; 10] {
        std::array::from_fn(|row| self.to_body[row][parameter])
    }
}

/// Working memory that is kept between calls of [`super::Library::evaluate_with`].
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    pub(super) tape: TapeScratch,
    blocks: Option<Blocks>,
    /// Nominal torque of all joints.
    nominal: Vec<f64>,
}

/// Memory of the recursions that work block by block.
#[derive(Debug, Clone)]
struct Blocks {
    regressor: RegressorBlock,
    workspace: BlockWorkspace,
    /// Torque per unit of gravity, `(joint * 3 + axis) * STRIDE + sample`.
    gravity: Vec<f64>,
    /// Derivative to one position, `joint * STRIDE + sample`.
    derivative: Vec<f64>,
}

/// A column and where it goes: `(joint, row of that joint's table)`.
#[derive(Debug, Clone, PartialEq)]
struct Output {
    column: ModelColumn,
    slots: Vec<(usize, usize)>,
    /// Of an inertial column, per slot: pair, parameter, weight.
    entries: Vec<Vec<(usize, usize, f64)>>,
}

/// All model columns of a library, ready to be evaluated.
#[derive(Debug, Clone)]
pub(super) struct ModelColumns {
    robot: Arc<Robot>,
    regressor: Arc<Regressor>,
    outputs: Vec<Output>,
}

impl ModelColumns {
    pub(super) fn new(robot: Arc<Robot>) -> Self {
        let regressor = Arc::new(Regressor::new(&robot));
        Self {
            robot,
            regressor,
            outputs: Vec::new(),
        }
    }

    /// The same without columns.
    pub(super) fn emptied(&self) -> Self {
        Self {
            outputs: Vec::new(),
            ..self.clone()
        }
    }

    /// The same columns of a robot with other inertias.
    pub(super) fn on(&self, robot: &Robot) -> Self {
        self.of(&Self::new(Arc::new(robot.clone())))
    }

    /// The same columns of another's robot.
    pub(super) fn of(&self, other: &Self) -> Self {
        let mut all = other.emptied();
        for output in &self.outputs {
            all.push(output.column.clone(), output.slots.clone());
        }
        all
    }

    /// The same where the regressor computes nothing that no column asks for.
    pub(super) fn trimmed(mut self) -> Self {
        let asked: BTreeSet<(usize, usize)> = (self.outputs.iter())
            .flat_map(|output| output.entries.iter().flatten())
            .map(|&(pair, k, _)| (pair, k))
            .collect();
        let rest = self.regressor.only(&|pair, k| asked.contains(&(pair, k)));
        self.regressor = Arc::new(rest);
        self
    }

    /// The robot.
    pub(super) fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Whether parameter `k` of a body can act on a joint.
    pub(super) fn acts(&self, joint: usize, body: usize, k: usize) -> bool {
        self.pairs(joint, body).any(|(_, present)| present[k])
    }

    /// Pairs of a joint and a body: their index and which parameters can act.
    fn pairs(&self, joint: usize, body: usize) -> impl Iterator<Item = (usize, [bool; 10])> {
        let pairs = self.regressor.pairs().iter().enumerate();
        pairs
            .filter(move |(_, pair)| pair.body == body && pair.coordinate == joint)
            .map(|(index, pair)| (index, pair.present))
    }

    /// Adds a column.
    pub(super) fn push(&mut self, column: ModelColumn, slots: Vec<(usize, usize)>) {
        let entries = match &column {
            ModelColumn::Inertia { body, weights } => slots
                .iter()
                .map(|&(joint, _)| self.entries(*body, weights, joint))
                .collect(),
            _ => Vec::new(),
        };
        self.outputs.push(Output {
            column,
            slots,
            entries,
        });
    }

    /// `(pair, parameter, weight)` that make up an inertial column on a joint.
    fn entries(&self, body: usize, weights: &[f64; 10], joint: usize) -> Vec<(usize, usize, f64)> {
        self.pairs(joint, body)
            .flat_map(|(pair, present)| {
                (0..10)
                    .filter(move |&k| present[k] && weights[k] != 0.0)
                    .map(move |k| (pair, k, weights[k]))
            })
            .collect()
    }

    /// Writes every column: `out[joint][row * len + sample]`.
    pub(super) fn evaluate(&self, motion: Motion<'_>, out: &mut [Vec<f64>], scratch: &mut Scratch) {
        self.of_nominal_torque(motion, out, scratch);
        if !self
            .outputs
            .iter()
            .any(|output| output.column.is_blockwise())
        {
            return;
        }
        let blocks = scratch.blocks.get_or_insert_with(|| Blocks {
            regressor: self.regressor.block(&self.robot),
            workspace: BlockWorkspace::new(&self.robot),
            gravity: vec![0.0; 3 * self.robot.dof() * STRIDE],
            derivative: vec![0.0; self.robot.dof() * STRIDE],
        });
        let mut first = 0;
        while first < motion.len {
            let last = motion.len.min(first + BLOCK);
            self.block(motion, first..last, out, blocks);
            first = last;
        }
    }

    /// Columns that are made from the nominal torque itself.
    fn of_nominal_torque(&self, motion: Motion<'_>, out: &mut [Vec<f64>], scratch: &mut Scratch) {
        let len = motion.len;
        let mut ready = false;
        for Output { column, slots, .. } in &self.outputs {
            let friction = match column {
                ModelColumn::Nominal { .. } => None,
                ModelColumn::LoadFriction { velocity, .. } => Some(*velocity),
                _ => continue,
            };
            if !ready {
                scratch.nominal.resize(self.robot.dof() * len, 0.0);
                nominal_torque(&self.robot, motion, &mut scratch.nominal);
                ready = true;
            }
            for &(joint, row) in slots.iter().filter(|slot| column.acts_on(slot.0)) {
                let torque = &scratch.nominal[joint * len..(joint + 1) * len];
                let cells = &mut out[joint][row * len..(row + 1) * len];
                cells.copy_from_slice(torque);
                if let Some(velocity) = friction {
                    let rates = &motion.qd[joint * len..(joint + 1) * len];
                    for (cell, rate) in cells.iter_mut().zip(rates) {
                        *cell = cell.abs() * sense(*rate, velocity);
                    }
                }
            }
        }
    }

    /// Columns from the recursions, one block of samples: the regressor itself is never stored.
    fn block(
        &self,
        motion: Motion<'_>,
        samples: Range<usize>,
        out: &mut [Vec<f64>],
        blocks: &mut Blocks,
    ) {
        let robot = &*self.robot;
        let any = |test: fn(&ModelColumn) -> bool| self.outputs.iter().any(|o| test(&o.column));
        if any(|column| matches!(column, ModelColumn::Inertia { .. })) {
            let block = &mut blocks.regressor;
            self.regressor
                .evaluate(robot, motion, samples.clone(), block);
            pulp::Arch::new().dispatch(Combine {
                outputs: &self.outputs,
                block,
                out,
                len: motion.len,
                samples: samples.clone(),
            });
        }
        if any(|column| matches!(column, ModelColumn::Gravity { .. })) {
            let (workspace, gravity) = (&mut blocks.workspace, &mut blocks.gravity);
            gravity_regressor(robot, workspace, motion, samples.clone(), gravity);
        }
        let count = samples.len();
        for output in &self.outputs {
            let (column, slots) = (&output.column, &output.slots);
            if let ModelColumn::PositionDerivative { joint } = *column {
                let (workspace, change) = (&mut blocks.workspace, &mut blocks.derivative);
                position_derivative(robot, workspace, joint, motion, samples.clone(), change);
            }
            for &(joint, row) in slots {
                let cells = row * motion.len + samples.start..row * motion.len + samples.end;
                let cells = &mut out[joint][cells];
                match column {
                    ModelColumn::Gravity { axis } => {
                        let start = (joint * 3 + axis) * STRIDE;
                        cells.copy_from_slice(&blocks.gravity[start..start + count]);
                    }
                    ModelColumn::PositionDerivative { .. } => {
                        let start = joint * STRIDE;
                        cells.copy_from_slice(&blocks.derivative[start..start + count]);
                    }
                    // From the regressor above, and from the nominal torque.
                    ModelColumn::Inertia { .. }
                    | ModelColumn::Nominal { .. }
                    | ModelColumn::LoadFriction { .. } => {}
                }
            }
        }
    }
}

/// Vectors of a column that are summed side by side in registers.
const SIDE_BY_SIDE: usize = 4;

/// Writes the inertial columns of a block of samples: Σ weight · entry.
struct Combine<'a> {
    outputs: &'a [Output],
    block: &'a RegressorBlock,
    out: &'a mut [Vec<f64>],
    /// Of the motion, of which these are the samples of the block.
    len: usize,
    samples: Range<usize>,
}

impl WithSimd for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        for output in self.outputs {
            for (entries, &(joint, row)) in output.entries.iter().zip(&output.slots) {
                let first = row * self.len;
                let cells = first + self.samples.start..first + self.samples.end;
                let cells = &mut self.out[joint][cells];
                let step = SIDE_BY_SIDE * S::F64_LANES;
                for (i, cells) in cells.chunks_mut(step).enumerate() {
                    let sum = combined(s, self.block, entries, i * SIDE_BY_SIDE);
                    let (whole, rest) = S::as_mut_simd_f64s(cells);
                    for (cells, sum) in whole.iter_mut().zip(sum) {
                        *cells = sum;
                    }
                    if !rest.is_empty() {
                        s.partial_store_f64s(rest, sum[whole.len()]);
                    }
                }
            }
        }
    }
}

/// Σ weight · entry for vectors from `first` on.
#[inline(always)]
fn combined<S: Simd>(
    s: S,
    block: &RegressorBlock,
    entries: &[(usize, usize, f64)],
    first: usize,
) -> [S::f64s; SIDE_BY_SIDE] {
    let mut sum = [s.splat_f64s(0.0); SIDE_BY_SIDE];
    for &(pair, k, weight) in entries {
        let values = S::as_simd_f64s(block.column(pair, k)).0;
        let (values, weight) = (&values[first..][..SIDE_BY_SIDE], s.splat_f64s(weight));
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum = s.add_f64s(*sum, s.mul_f64s(weight, *value));
        }
    }
    sum
}

/// tanh(rate / v_s), or the sign for v_s = 0.
fn sense(rate: f64, velocity: f64) -> f64 {
    if velocity > 0.0 {
        (rate / velocity).tanh()
    } else if rate == 0.0 {
        0.0
    } else {
        rate.signum()
    }
}
