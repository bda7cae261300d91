//! The rows of one log, kept at the filtered rate: what residuals, blocks and held-out scores are computed from.

mod blocks;
mod columns;
mod room;
mod products;
mod sum;

pub(crate) use room::Room;
pub(crate) use sum::GramSum;

use crate::error::Result;
use crate::gram::{Gram, JointAccumulator, Workspace};
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, recipes_of_log, slices, visit_parts};
use crate::signal::{Numbers, Pipeline, Recording, Trajectory, known_temperatures, temperature_at};
use crate::term::{Library, Recipes};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Rows of one joint. A column, or part, lies contiguous over all rows: `x[i * len + row]`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointObservations {
    /// Regression columns that are structurally non-zero on this joint, ascending.
    pub columns: Vec<usize>,
    /// How they follow from what is in `x`; `None`: they are in `x` themselves.
    pub recipes: Option<Arc<Recipes>>,
    /// Their values, or those of the parts that they are made of, columns × len, N·m per unit of β; empty where they were put away
    /// (logs in chapters).
    pub x: Vec<f64>,
    /// Measured torque, len, N·m.
    pub measured: Numbers,
    /// Nominal torque, len, N·m.
    pub nominal: Numbers,
    /// Residual torque of eq. (1), len, N·m: measured less nominal, less that of products of effects.
    pub y: Vec<f64>,
    /// There are such products: else `y` is the difference of the two torques.
    pub has_products: bool,
    /// Rows at which the joint stands still; they are no observations of anything but stiction.
    pub standstill: Vec<bool>,
    /// Relative noise variance of a row, which `weight` contains already; empty: 1 each.
    pub spread: Vec<f64>,
    /// Temperature of the drive, len; empty where it was not logged.
    pub temperature: Vec<f64>,
    /// What a row counts: its column values and its y enter every sum multiplied by the square root; empty: 1 each.
    pub weight: Vec<f64>,
    /// The columns of a long log, which are not in `x` then.
    pub(crate) shelved: Option<columns::Shelved>,
}

/// Rows of one log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Observations {
    /// Name of the log.
    pub log: String,
    /// Cut-off of the filter that made the rows, cycles per row; 0 without a filter.
    pub cutoff: f64,
    /// Row times, s.
    pub time: Vec<f64>,
    /// First row of each segment, ascending, starting with 0.
    pub starts: Vec<usize>,
    /// Positions, joint × len.
    pub q: Vec<Numbers>,
    /// Velocities.
    pub qd: Vec<Numbers>,
    /// Accelerations.
    pub qdd: Vec<Numbers>,
    /// Per moving joint.
    pub joints: Vec<JointObservations>,
}

/// A range of rows of one log.
#[derive(Debug, Clone)]
pub struct Part<'a> {
    /// The log.
    pub observations: &'a Observations,
    /// Its rows.
    pub rows: Range<usize>,
}

/// Rows that one thread takes at a time; a few, or the samples that every slice evaluates for its first row add up.
const SLICE: usize = 1024;
/// Slices that are evaluated before they are put in place: rows are held twice for these alone.
const BATCH: usize = 8;

/// Filters and decimates one trajectory into rows.
///
/// # Errors
/// Those of [`visit_parts`].
pub fn observe(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
) -> Result<Observations> {
    let signal = RowSignal::Filtered;
    let slices = slices(pipeline, trajectory, signal, f64::NEG_INFINITY, SLICE);
    let len = slices.iter().map(|slice| slice.rows.len()).sum();
    let mut out = Observations::empty(library, trajectory, len);
    if let (Some(segment), false) = (trajectory.segments.first(), pipeline.is_off()) {
        out.cutoff = pipeline.cutoff_hz / pipeline.kept_rate(segment.interval);
    }
    for batch in slices.chunks(BATCH) {
        let blocks: Vec<Vec<Block>> = batch
            .par_iter()
            .map(|slice| {
                let mut blocks = Vec::new();
                let mut keep = |block: &RowBlock<'_>| {
                    blocks.push(Block::of(block));
                    Ok(())
                };
                let slice = std::slice::from_ref(slice);
                visit_parts(
                    robot, library, pipeline, trajectory, signal, slice, &mut keep,
                )?;
                Ok(blocks)
            })
            .collect::<Result<_>>()?;
        out.add(&blocks.into_iter().flatten().collect::<Vec<_>>())?;
    }
    Ok(out)
}

/// A [`RowBlock`] that is kept until those before it are in place.
struct Block {
    first: bool,
    time: Vec<f64>,
    /// q, q̇, q̈: `joint * len + row`.
    motion: [Vec<f64>; 3],
    joints: Vec<BlockJoint>,
}

/// Its rows of one joint.
struct BlockJoint {
    /// `i * len + row`.
    x: Vec<f64>,
    measured: Vec<f64>,
    nominal: Vec<f64>,
    products: Vec<f64>,
    standstill: Vec<bool>,
}

impl Block {
    fn of(block: &RowBlock<'_>) -> Self {
        let joints = block.joints.iter().map(|rows| BlockJoint {
            x: (rows.x.chunks(rows.stride.max(1)))
                .flat_map(|signal| &signal[..block.len])
                .copied()
                .collect(),
            measured: rows.measured.to_vec(),
            nominal: rows.nominal.to_vec(),
            products: rows.products.to_vec(),
            standstill: rows.standstill.to_vec(),
        });
        Self {
            first: block.first,
            time: block.time.to_vec(),
            motion: [block.q, block.qd, block.qdd].map(<[f64]>::to_vec),
            joints: joints.collect(),
        }
    }
}

impl Observations {
    /// Without rows yet, but with room for `len`. How columns follow from parts is said whether rows come or not: rows of other parts of the
    /// log are put behind these.
    fn empty(library: &Library, trajectory: &Trajectory, len: usize) -> Self {
        let dof = trajectory.dof;
        let room = || (0..dof).map(|_| Vec::with_capacity(len).into()).collect();
        let recipes = recipes_of_log(library, trajectory.payload_acts);
        let joint = |(joint, recipes): (usize, Arc<Recipes>)| {
            let columns = library.columns_of_joint(joint).to_vec();
            JointObservations {
                x: vec![0.0; recipes.parts() * len],
                columns,
                recipes: Some(recipes),
                measured: Vec::with_capacity(len).into(),
                nominal: Vec::with_capacity(len).into(),
                y: Vec::with_capacity(len),
                has_products: library.has_products(),
                standstill: Vec::with_capacity(len),
                ..JointObservations::default()
            }
        };
        Self {
            log: trajectory.name.clone(),
            cutoff: 0.0,
            time: Vec::with_capacity(len),
            starts: Vec::new(),
            q: room(),
            qd: room(),
            qdd: room(),
            joints: recipes.into_iter().enumerate().map(joint).collect(),
        }
    }

    /// Puts the next rows behind those there are.
    fn add(&mut self, blocks: &[Block]) -> Result<()> {
        let from = self.time.len();
        for block in blocks {
            let len = block.time.len();
            if block.first {
                self.starts.push(self.time.len());
            }
            self.time.extend_from_slice(&block.time);
            for (to, values) in [&mut self.q, &mut self.qd, &mut self.qdd]
                .into_iter()
                .zip(&block.motion)
            {
                for (to, joint) in to.iter_mut().zip(values.chunks_exact(len.max(1))) {
                    to.append(joint)?;
                }
            }
        }
        let joints = self.joints.par_iter_mut().enumerate();
        joints.try_for_each(|(joint, kept)| {
            let mut from = from;
            for block in blocks {
                kept.add(from, block.time.len(), &block.joints[joint])?;
                from += block.time.len();
            }
            Ok(())
        })
    }

    /// Takes over the temperatures of the log that these rows were made of: between its samples they are linear, and constant
    /// beyond them; samples without a number are skipped. A log whose stamps step back has none.
    pub fn set_temperatures(&mut self, log: &Recording) {
        for (rows, channels) in self.joints.iter_mut().zip(&log.joints) {
            if let Some(known) = known_temperatures(&log.time, &channels.temperature) {
                let at = |time: &f64| temperature_at(&known, *time);
                rows.temperature = self.time.iter().map(at).collect();
            }
        }
    }

    /// Takes the rows of some times (s, from and to) out of every fit: as standstill of all joints.
    pub(crate) fn leave_out(&mut self, times: &[[f64; 2]]) {
        for (row, time) in self.time.iter().enumerate() {
            if times.iter().any(|[from, to]| from <= time && time <= to) {
                for joint in &mut self.joints {
                    joint.standstill[row] = true;
                }
            }
        }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// The same rows with measured less nominal torque in the place of the residual; `None` where that is what they have.
    pub(crate) fn beyond_nominal(&self) -> Option<Self> {
        self.joints.iter().any(|joint| joint.has_products).then(|| {
            let mut rows = self.clone();
            for joint in &mut rows.joints {
                joint.y = joint.beyond_nominal(0..joint.y.len());
                joint.has_products = false;
            }
            rows
        })
    }

    /// All rows as a part.
    pub fn whole(&self) -> Part<'_> {
        Part {
            observations: self,
            rows: 0..self.len(),
        }
    }

    /// The log cut into `count` parts of equal length.
    pub fn cut(&self, count: usize) -> Vec<Part<'_>> {
        let cut = |i: usize| i * self.len() / count;
        (0..count)
            .map(|i| Part {
                observations: self,
                rows: cut(i)..cut(i + 1),
            })
            .collect()
    }

    /// Drops regression columns and renumbers the others, as [`Library::without_columns`] does.
    pub fn drop_columns(&mut self, dropped: &[usize]) {
        if dropped.is_empty() {
            return;
        }
        let len = self.len();
        for joint in &mut self.joints {
            let kept: Vec<usize> = (0..joint.columns.len())
                .filter(|&i| !dropped.contains(&joint.columns[i]))
                .collect();
            let mut signals = Cow::Borrowed(&kept);
            if let Some(recipes) = &mut joint.recipes {
                let (rest, needed) = recipes.some(&kept);
                *recipes = Arc::new(rest);
                signals = Cow::Owned(needed);
            }
            match &mut joint.shelved {
                Some(shelved) => shelved.keep(&signals),
                None => {
                    let signal = |i: &usize| joint.x[i * len..(i + 1) * len].iter().copied();
                    joint.x = signals.iter().flat_map(signal).collect();
                }
            }
            joint.columns = kept
                .iter()
                .map(|&i| {
                    let column = joint.columns[i];
                    column - dropped.iter().filter(|&&d| d < column).count()
                })
                .collect();
        }
    }
}

impl Part<'_> {
    /// Sufficient statistics of these rows; standstill rows are left out and end a run.
    pub fn gram(&self) -> Gram {
        [self].into_iter().collect()
    }

    /// Sums of the kind that [`Part::add_joint`] adds to.
    fn accumulator(&self, joint: usize) -> JointAccumulator {
        let rows = &self.observations.joints[joint];
        let columns: Vec<u32> = rows.columns.iter().map(|&c| c as u32).collect();
        match &rows.recipes {
            Some(recipes) => JointAccumulator::of_parts(columns, recipes),
            None => JointAccumulator::new(columns),
        }
    }

    /// Adds these rows of a joint, as runs of their own.
    fn add_joint(&self, joint: usize, accumulator: &mut JointAccumulator) {
        self.add_joint_on(joint, true, accumulator);
    }

    /// Adds these rows of a joint; unless `apart` the first of them goes on from the row before it.
    pub(crate) fn add_joint_on(
        &self,
        joint: usize,
        apart: bool,
        accumulator: &mut JointAccumulator,
    ) {
        let (all, rows) = (self.observations, &self.observations.joints[joint]);
        let signals = rows.signals();
        let mut workspace = Workspace::default();
        for range in self.runs_between_starts() {
            let start = range.start;
            let starts = apart || start > self.rows.start || all.starts.contains(&start);
            rows.visit_signals(all.len(), range, &mut |range, columns| {
                let still = &rows.standstill[range.clone()];
                let keep: Vec<bool> = still.iter().map(|still| !still).collect();
                let first = starts && range.start == start;
                let x = if signals == 0 { &[] } else { columns.x };
                if rows.weight.is_empty() {
                    let y = &rows.y[range];
                    accumulator.push_block(x, columns.stride, y, &keep, first, &mut workspace);
                    return;
                }
                let roots = rows.weight[range.clone()].iter().map(|u| u.sqrt());
                let root: Vec<f64> = roots.collect();
                let scaled = |values: &[f64]| -> Vec<f64> {
                    values.iter().zip(&root).map(|(v, u)| v * u).collect()
                };
                let count = range.len();
                let x: Vec<f64> = (0..signals)
                    .flat_map(|i| scaled(columns.of(i, 0, count)))
                    .collect();
                let y = scaled(&rows.y[range]);
                accumulator.push_block(&x, count, &y, &keep, first, &mut workspace);
            });
        }
    }

    /// The part's rows split at the starts of segments.
    pub(crate) fn runs_between_starts(&self) -> Vec<Range<usize>> {
        let mut edges = vec![self.rows.start];
        edges.extend(
            self.observations
                .starts
                .iter()
                .copied()
                .filter(|s| self.rows.start < *s && *s < self.rows.end),
        );
        edges.push(self.rows.end);
        edges
            .windows(2)
            .filter(|w| w[0] < w[1])
            .map(|w| w[0]..w[1])
            .collect()
    }

    /// Rows at which a joint moves: n of its [`Part::gram`].
    pub fn moving_rows(&self, joint: usize) -> f64 {
        let standstill = &self.observations.joints[joint].standstill[self.rows.clone()];
        standstill.iter().filter(|still| !**still).count() as f64
    }

    /// Residuals `y − Xβ` of a joint as runs of consecutive moving rows.
    pub fn residual_runs(&self, joint: usize, beta: &[f64]) -> Vec<Vec<f64>> {
        self.runs(joint, beta, &[])
    }

    /// The same, each multiplied by the square root of what its row counts.
    pub fn weighted_runs(&self, joint: usize, beta: &[f64]) -> Vec<Vec<f64>> {
        self.runs(joint, beta, &self.observations.joints[joint].weight)
    }

    fn runs(&self, joint: usize, beta: &[f64], weight: &[f64]) -> Vec<Vec<f64>> {
        let rows = &self.observations.joints[joint];
        let root = |row: usize| weight.get(row).map_or(1.0, |u| u.sqrt());
        let mut runs: Vec<Vec<f64>> = Vec::new();
        for range in self.runs_between_starts() {
            let residual = self.residual(joint, beta, range.clone());
            runs.push(Vec::new());
            for (row, value) in range.zip(residual) {
                match (rows.standstill[row], runs.last_mut()) {
                    (false, Some(run)) => run.push(root(row) * value),
                    _ => runs.push(Vec::new()),
                }
            }
        }
        runs.retain(|run| !run.is_empty());
        runs
    }

    /// `y − Xβ` of a joint over a range of the log's rows, standstill included.
    pub fn residual(&self, joint: usize, beta: &[f64], range: Range<usize>) -> Vec<f64> {
        let (len, rows) = (self.observations.len(), &self.observations.joints[joint]);
        let mut residual = rows.y[range.clone()].to_vec();
        let mut beta: Vec<f64> = rows.columns.iter().map(|&column| beta[column]).collect();
        if let Some(recipes) = &rows.recipes {
            beta = recipes.of_parts(&beta);
        }
        let first = range.start;
        rows.visit_signals(len, range, &mut |piece, columns| {
            let own = &mut residual[piece.start - first..piece.end - first];
            products::subtract(columns, &beta, own);
        });
        residual
    }

    /// `xᵀ C x` of every row of a joint; C: `covariance[a * count + b]` of columns a and b out of `count`.
    pub fn quadratic_forms(&self, joint: usize, covariance: &[f64], count: usize) -> Vec<f64> {
        let (len, rows) = (self.observations.len(), &self.observations.joints[joint]);
        let columns = || rows.columns.iter();
        let mut matrix: Vec<f64> = columns()
            .flat_map(|a| columns().map(move |b| covariance[a * count + b]))
            .collect();
        if let Some(recipes) = &rows.recipes {
            matrix = recipes.to_parts(&matrix);
        }
        let mut forms = vec![0.0; self.rows.len()];
        let first = self.rows.start;
        rows.visit_signals(len, self.rows.clone(), &mut |piece, columns| {
            let forms = &mut forms[piece.start - first..piece.end - first];
            products::quadratic(columns, &matrix, forms);
        });
        forms
    }
}

impl JointObservations {
    /// Measured less nominal torque of some rows, N·m.
    pub(crate) fn beyond_nominal(&self, rows: Range<usize>) -> Vec<f64> {
        if !self.has_products {
            return self.y[rows].to_vec();
        }
        let (measured, nominal) = (self.measured.some(rows.clone()), self.nominal.some(rows));
        measured
            .iter()
            .zip(nominal.iter())
            .map(|(m, n)| m - n)
            .collect()
    }

    /// Torque of products of effects at some rows, N·m; empty without.
    fn products(&self, rows: Range<usize>) -> Vec<f64> {
        if !self.has_products {
            return Vec::new();
        }
        let beyond = self.beyond_nominal(rows.clone());
        beyond
            .iter()
            .zip(&self.y[rows])
            .map(|(all, y)| all - y)
            .collect()
    }

    /// Columns, or parts of which they are made.
    pub(crate) fn signals(&self) -> usize {
        let parts = self.recipes.as_ref().map(|recipes| recipes.parts());
        parts.unwrap_or(self.columns.len())
    }

    /// The next `len` rows, from row `from` on.
    fn add(&mut self, from: usize, len: usize, rows: &BlockJoint) -> Result<()> {
        let total = self.x.len() / self.signals().max(1);
        for (i, column) in rows.x.chunks_exact(len.max(1)).enumerate() {
            self.x[i * total + from..][..len].copy_from_slice(column);
        }
        self.measured.append(&rows.measured)?;
        self.nominal.append(&rows.nominal)?;
        let residual = rows.measured.iter().zip(&rows.nominal);
        let from = self.y.len();
        self.y.extend(residual.map(|(m, n)| m - n));
        let residual = self.y[from..].iter_mut();
        residual.zip(&rows.products).for_each(|(y, p)| *y -= p);
        self.standstill.extend_from_slice(&rows.standstill);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
