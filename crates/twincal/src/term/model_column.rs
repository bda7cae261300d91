//! Columns that are made from the robot model: no expression, but exact torque images from the dynamics recursions.
//!
//! The Lagrangian of a robot is linear in the ten inertial parameters of every link, so the Euler–Lagrange image of
//! each is a column of the joint-torque regressor; gravity, gains and encoder zeros are first-order changes of the
//! nominal torque.

use super::expression::TapeScratch;
use super::table::Table;
use crate::robot::{
    BLOCK, BlockWorkspace, Motion, Regressor, RegressorBlock, Robot, STRIDE, gravity_regressor,
    nominal_torque, position_derivative,
};
use pulp::{Simd, WithSimd};
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
    /// Nominal torque of a joint, on that joint; of every joint for `None`.
    Nominal {
        /// 0-based.
        joint: Option<usize>,
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

    /// True if it comes from another recursion than the regressor's.
    fn is_other(&self) -> bool {
        matches!(self, Self::Gravity { .. } | Self::PositionDerivative { .. })
    }

    /// False on joints that it cannot act on by definition.
    fn acts_on(&self, other: usize) -> bool {
        match self {
            Self::Nominal { joint: Some(joint) } | Self::LoadFriction { joint, .. } => {
                *joint == other
            }
            _ => true,
        }
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
}

/// `(joint, row of that joint's table)`.
type Slot = (usize, usize);

/// Pair, parameter, weight: what an inertial column is made of.
type Entries = Vec<(usize, usize, f64)>;

/// How inertial columns follow from entries of the regressor.
#[derive(Debug, Clone, Default)]
struct Inertial {
    /// By `pair * 10 + parameter`: the only column that an entry is part of, if that is this entry and nothing else. The regressor
    /// writes it where it belongs.
    alone: Vec<Option<Slot>>,
    /// All others.
    sums: Vec<(Slot, Entries)>,
    /// Whether an entry is part of any column, in the same order.
    asked: Vec<bool>,
    /// Whose the rows of a joint's table are: by place in `alone` and, behind these, in `sums`.
    places: Vec<Vec<Option<usize>>>,
}

impl Inertial {
    fn new(pairs: usize) -> Self {
        Self {
            alone: vec![None; 10 * pairs],
            sums: Vec::new(),
            asked: vec![false; 10 * pairs],
            places: Vec::new(),
        }
    }

    fn is_empty(&self) -> bool {
        self.sums.is_empty() && self.alone.iter().all(Option::is_none)
    }

    /// Whose a row is.
    fn place(&mut self, (joint, row): Slot, place: usize) {
        if self.places.len() <= joint {
            self.places.resize(joint + 1, Vec::new());
        }
        let rows = &mut self.places[joint];
        if rows.len() <= row {
            rows.resize(row + 1, None);
        }
        rows[row] = Some(place);
    }

    /// A column that is a sum.
    fn sum(&mut self, slot: Slot, entries: Entries) {
        self.place(slot, self.alone.len() + self.sums.len());
        self.sums.push((slot, entries));
    }

    /// Adds a column.
    fn push(&mut self, slot: Slot, entries: Entries) {
        let mut alone = None;
        for &(pair, k, weight) in &entries {
            let entry = 10 * pair + k;
            // What stood alone is part of two columns now.
            if let Some(first) = self.alone[entry].take() {
                self.sum(first, vec![(pair, k, 1.0)]);
            } else if !self.asked[entry] && entries.len() == 1 && weight == 1.0 {
                alone = Some(entry);
            }
            self.asked[entry] = true;
        }
        match alone {
            Some(entry) => {
                self.alone[entry] = Some(slot);
                self.place(slot, entry);
            }
            None => self.sum(slot, entries),
        }
    }
}

/// All model columns of a library, ready to be evaluated.
#[derive(Debug, Clone)]
pub(super) struct ModelColumns {
    robot: Arc<Robot>,
    regressor: Arc<Regressor>,
    outputs: Vec<Output>,
    inertial: Inertial,
}

impl ModelColumns {
    pub(super) fn new(robot: Arc<Robot>) -> Self {
        let regressor = Arc::new(Regressor::new(&robot));
        Self {
            inertial: Inertial::new(regressor.pairs().len()),
            robot,
            regressor,
            outputs: Vec::new(),
        }
    }

    /// The same without columns.
    pub(super) fn emptied(&self) -> Self {
        Self {
            outputs: Vec::new(),
            inertial: Inertial::new(self.regressor.pairs().len()),
            robot: self.robot.clone(),
            regressor: self.regressor.clone(),
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
        let asked = &self.inertial.asked;
        let rest = self.regressor.only(&|pair, k| asked[10 * pair + k]);
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
        if let ModelColumn::Inertia { body, weights } = &column {
            for &(joint, row) in &slots {
                let entries = self.entries(*body, weights, joint);
                self.inertial.push((joint, row), entries);
            }
        }
        self.outputs.push(Output { column, slots });
    }

    /// `(pair, parameter, weight)` that make up an inertial column on a joint.
    fn entries(&self, body: usize, weights: &[f64; 10], joint: usize) -> Entries {
        self.pairs(joint, body)
            .flat_map(|(pair, present)| {
                (0..10)
                    .filter(move |&k| present[k] && weights[k] != 0.0)
                    .map(move |k| (pair, k, weights[k]))
            })
            .collect()
    }

    /// Writes every column: `out[joint][row * stride + sample]`.
    pub(super) fn evaluate<T: Table>(
        &self,
        motion: Motion<'_>,
        stride: usize,
        out: &mut [T],
        scratch: &mut Scratch,
    ) {
        self.of_nominal_torque(motion, stride, out, scratch);
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
        if !self.inertial.is_empty() {
            self.inertial(motion, stride, out, &mut blocks.regressor);
        }
        if self.outputs.iter().any(|output| output.column.is_other()) {
            for first in (0..motion.len).step_by(BLOCK) {
                let samples = first..motion.len.min(first + BLOCK);
                self.block(motion, samples, (stride, &mut *out), blocks);
            }
        }
    }

    /// Inertial columns: the regressor itself is never stored.
    fn inertial<T: Table>(
        &self,
        motion: Motion<'_>,
        stride: usize,
        out: &mut [T],
        block: &mut RegressorBlock,
    ) {
        let Inertial { alone, sums, .. } = &self.inertial;
        let mut places: Vec<&mut [f64]> = Vec::new();
        places.resize_with(alone.len() + sums.len(), Default::default);
        for (table, own) in out.iter_mut().zip(&self.inertial.places) {
            for (row, place) in table.chunks_mut(stride.max(1)).zip(own) {
                if let Some(place) = place {
                    places[*place] = row;
                }
            }
        }
        let (alone, cells) = places.split_at_mut(alone.len());
        for first in (0..motion.len).step_by(BLOCK) {
            let samples = first..motion.len.min(first + BLOCK);
            let (regressor, robot) = (&self.regressor, &*self.robot);
            regressor.evaluate_to(robot, motion, samples.clone(), block, alone);
            pulp::Arch::new().dispatch(Combine {
                sums,
                cells,
                block,
                samples,
            });
        }
    }

    /// Columns that are made from the nominal torque itself.
    fn of_nominal_torque<T: Table>(
        &self,
        motion: Motion<'_>,
        stride: usize,
        out: &mut [T],
        scratch: &mut Scratch,
    ) {
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
                let cells = &mut out[joint][row * stride..][..len];
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

    /// Columns from the other recursions, one block of samples.
    fn block<T: Table>(
        &self,
        motion: Motion<'_>,
        samples: Range<usize>,
        (stride, out): (usize, &mut [T]),
        blocks: &mut Blocks,
    ) {
        let robot = &*self.robot;
        let gravity = |output: &Output| matches!(output.column, ModelColumn::Gravity { .. });
        if self.outputs.iter().any(gravity) {
            let (workspace, gravity) = (&mut blocks.workspace, &mut blocks.gravity);
            gravity_regressor(robot, workspace, motion, samples.clone(), gravity);
        }
        let count = samples.len();
        for output in self.outputs.iter().filter(|o| o.column.is_other()) {
            let (column, slots) = (&output.column, &output.slots);
            if let ModelColumn::PositionDerivative { joint } = *column {
                let (workspace, change) = (&mut blocks.workspace, &mut blocks.derivative);
                position_derivative(robot, workspace, joint, motion, samples.clone(), change);
            }
            for &(joint, row) in slots {
                let cells = row * stride + samples.start..row * stride + samples.end;
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

/// Writes the inertial columns that are sums in a block of samples: Σ weight · entry.
struct Combine<'a, 'b> {
    sums: &'a [(Slot, Entries)],
    /// Of each of them, the samples of the motion.
    cells: &'a mut [&'b mut [f64]],
    block: &'a RegressorBlock,
    /// Of the block in the motion.
    samples: Range<usize>,
}

impl WithSimd for Combine<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        for ((_, entries), cells) in self.sums.iter().zip(self.cells) {
            let cells = &mut cells[self.samples.clone()];
            let step = SIDE_BY_SIDE * S::F64_LANES;
            for (i, cells) in cells.chunks_mut(step).enumerate() {
                let (whole, rest) = S::as_mut_simd_f64s(cells);
                let sum = || combined(s, self.block, entries, i * SIDE_BY_SIDE);
                // Sums that are picked by number are kept in memory: those of whole steps are not.
                if let Some(whole) = whole.first_chunk_mut() {
                    *whole = sum();
                    continue;
                }
                let sum = sum();
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

/// Σ weight · entry for vectors from `first` on.
#[inline(always)]
fn combined<S: Simd>(
    s: S,
    block: &RegressorBlock,
    entries: &Entries,
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
