//! The rows of one log, kept at the filtered rate: what residuals, blocks and held-out scores are computed from.

use crate::error::Result;
use crate::gram::{Gram, JointAccumulator};
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, slices, visit_slices};
use crate::signal::{Pipeline, Trajectory};
use crate::term::Library;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of one joint. A column lies contiguous over all rows: `x[i * len + row]`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointObservations {
    /// Regression columns that are structurally non-zero on this joint, ascending.
    pub columns: Vec<usize>,
    /// Their values, columns × len, N·m per unit of β.
    pub x: Vec<f64>,
    /// Measured torque, len, N·m.
    pub measured: Vec<f64>,
    /// Nominal torque, len, N·m.
    pub nominal: Vec<f64>,
    /// Residual torque of eq. (1), len, N·m.
    pub y: Vec<f64>,
    /// Rows at which the joint stands still; they are no observations of anything but stiction.
    pub standstill: Vec<bool>,
    /// Relative noise variance of a row, which `weight` contains already; empty: 1 each.
    pub spread: Vec<f64>,
    /// What a row counts: its column values and its y enter every sum multiplied by the square root; empty: 1 each.
    pub weight: Vec<f64>,
}

/// Rows of one log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Observations {
    /// Name of the log.
    pub log: String,
    /// Row times, s.
    pub time: Vec<f64>,
    /// First row of each segment, ascending, starting with 0.
    pub starts: Vec<usize>,
    /// Positions, joint × len.
    pub q: Vec<Vec<f64>>,
    /// Velocities.
    pub qd: Vec<Vec<f64>>,
    /// Accelerations.
    pub qdd: Vec<Vec<f64>>,
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

/// Filters and decimates one trajectory into rows.
///
/// # Errors
/// Those of [`visit_slices`].
pub fn observe(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
) -> Result<Observations> {
    let signal = RowSignal::Filtered;
    let slices = slices(pipeline, trajectory, signal, f64::NEG_INFINITY, SLICE);
    let pieces: Vec<Piece> = slices
        .into_par_iter()
        .map(|slice| {
            let mut piece = Piece::new(library, trajectory);
            let mut add = |block: &RowBlock<'_>| {
                piece.add(block);
                Ok(())
            };
            let slice = [slice];
            visit_slices(
                robot, library, pipeline, trajectory, signal, &slice, &mut add,
            )?;
            Ok(piece)
        })
        .collect::<Result<_>>()?;
    let mut out = Piece::new(library, trajectory);
    pieces.into_iter().for_each(|piece| out.append(piece));
    Ok(out.finish(library))
}

/// Rows while they are being collected: every column on its own.
struct Piece {
    rows: Observations,
    /// `columns[joint][i]`.
    columns: Vec<Vec<Vec<f64>>>,
}

impl Piece {
    fn new(library: &Library, trajectory: &Trajectory) -> Self {
        let dof = trajectory.dof;
        Self {
            rows: Observations {
                log: trajectory.name.clone(),
                q: vec![Vec::new(); dof],
                qd: vec![Vec::new(); dof],
                qdd: vec![Vec::new(); dof],
                joints: vec![JointObservations::default(); dof],
                ..Observations::default()
            },
            columns: (0..dof)
                .map(|joint| vec![Vec::new(); library.columns_of_joint(joint).len()])
                .collect(),
        }
    }

    fn add(&mut self, block: &RowBlock<'_>) {
        let (len, out) = (block.len, &mut self.rows);
        if block.first {
            out.starts.push(out.time.len());
        }
        out.time.extend_from_slice(block.time);
        for (joint, rows) in block.joints.iter().enumerate() {
            let own = joint * len..(joint + 1) * len;
            out.q[joint].extend_from_slice(&block.q[own.clone()]);
            out.qd[joint].extend_from_slice(&block.qd[own.clone()]);
            out.qdd[joint].extend_from_slice(&block.qdd[own]);
            for (i, column) in self.columns[joint].iter_mut().enumerate() {
                column.extend_from_slice(&rows.x[i * rows.stride..i * rows.stride + len]);
            }
            let kept = &mut out.joints[joint];
            kept.measured.extend_from_slice(rows.measured);
            kept.nominal.extend_from_slice(rows.nominal);
            kept.y
                .extend(rows.measured.iter().zip(rows.nominal).map(|(m, n)| m - n));
            kept.standstill.extend_from_slice(rows.standstill);
        }
    }

    /// Puts what follows behind.
    fn append(&mut self, next: Self) {
        let len = self.rows.time.len();
        let rows = &mut self.rows;
        rows.starts
            .extend(next.rows.starts.iter().map(|start| len + start));
        rows.time.extend(next.rows.time);
        for (to, from) in [
            (&mut rows.q, next.rows.q),
            (&mut rows.qd, next.rows.qd),
            (&mut rows.qdd, next.rows.qdd),
        ] {
            to.iter_mut()
                .zip(from)
                .for_each(|(to, from)| to.extend(from));
        }
        for (to, from) in rows.joints.iter_mut().zip(next.rows.joints) {
            to.measured.extend(from.measured);
            to.nominal.extend(from.nominal);
            to.y.extend(from.y);
            to.standstill.extend(from.standstill);
        }
        for (to, from) in self.columns.iter_mut().zip(next.columns) {
            to.iter_mut()
                .zip(from)
                .for_each(|(to, from)| to.extend(from));
        }
    }

    fn finish(mut self, library: &Library) -> Observations {
        for (joint, values) in self.columns.into_iter().enumerate() {
            self.rows.joints[joint].columns = library.columns_of_joint(joint).to_vec();
            self.rows.joints[joint].x = values.concat();
        }
        self.rows
    }
}

impl Observations {
    /// Rows.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
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
        let len = self.len();
        for joint in &mut self.joints {
            let kept: Vec<usize> = (0..joint.columns.len())
                .filter(|&i| !dropped.contains(&joint.columns[i]))
                .collect();
            joint.x = kept
                .iter()
                .flat_map(|&i| joint.x[i * len..(i + 1) * len].iter().copied())
                .collect();
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
        let joints = (0..self.observations.joints.len())
            .into_par_iter()
            .map(|joint| self.joint_gram(joint))
            .collect();
        Gram { joints }
    }

    fn joint_gram(&self, joint: usize) -> crate::gram::JointGram {
        let (all, rows) = (self.observations, &self.observations.joints[joint]);
        let columns: Vec<u32> = rows.columns.iter().map(|&c| c as u32).collect();
        let mut accumulator = JointAccumulator::new(columns);
        let keep: Vec<bool> = rows.standstill.iter().map(|still| !still).collect();
        for range in self.runs_between_starts() {
            let x = if rows.columns.is_empty() {
                &[][..]
            } else {
                &rows.x[range.start..]
            };
            let keep = &keep[range.clone()];
            if rows.weight.is_empty() {
                let y = &rows.y[range.clone()];
                accumulator.push_block(x, all.len(), y, keep, true);
            } else {
                let root: Vec<f64> = rows.weight[range.clone()]
                    .iter()
                    .map(|u| u.sqrt())
                    .collect();
                let scaled = |values: &[f64]| -> Vec<f64> {
                    values.iter().zip(&root).map(|(v, u)| v * u).collect()
                };
                let (count, len) = (range.len(), all.len());
                let x: Vec<f64> = (0..rows.columns.len())
                    .flat_map(|i| scaled(&x[i * len..i * len + count]))
                    .collect();
                accumulator.push_block(&x, count, &scaled(&rows.y[range]), keep, true);
            }
        }
        accumulator.finish()
    }

    /// The part's rows split at the starts of segments.
    fn runs_between_starts(&self) -> Vec<Range<usize>> {
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
        for (i, &column) in rows.columns.iter().enumerate() {
            let x = &rows.x[i * len + range.start..i * len + range.end];
            for (r, x) in residual.iter_mut().zip(x) {
                *r -= x * beta[column];
            }
        }
        residual
    }
}
