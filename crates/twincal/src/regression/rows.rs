//! Rows of a regression, and sums over them.

use super::Design;
use crate::gram::{Gram, JointAccumulator, JointGram, Workspace};
use crate::statistics::{JointDecoys, JointUnit, Training, Unit};
use std::ops::Range;

/// Pieces that can be left out where there are fewer than three runs, and at most.
const PIECES: usize = 5;

/// Rows with their columns, centred where a constant is in the model.
pub(super) struct Rows {
    /// Columns, `x[column * rows + row]`.
    pub(super) x: Vec<f64>,
    /// What is explained.
    pub(super) y: Vec<f64>,
    /// Mean of each column; 0 without a constant.
    pub(super) offsets: Vec<f64>,
    /// Mean of `y`; 0 without a constant.
    pub(super) centre: f64,
    decoys: Vec<f64>,
    runs: Vec<Range<usize>>,
}

impl Rows {
    pub(super) fn new(design: &Design<'_>, intercept: bool) -> Self {
        let rows = design.y.len();
        let mean = |values: &[f64]| match intercept {
            true => values.iter().sum::<f64>() / rows as f64,
            false => 0.0,
        };
        let centre = mean(design.y);
        let offsets: Vec<f64> = design.x.chunks_exact(rows).map(mean).collect();
        let centred = |column: &[f64], mean: f64| -> Vec<f64> {
            column.iter().map(|value| value - mean).collect()
        };
        let columns = design.x.chunks_exact(rows).zip(&offsets);
        let decoys = design.decoys.chunks_exact(rows);
        Self {
            x: columns.flat_map(|(x, mean)| centred(x, *mean)).collect(),
            y: centred(design.y, centre),
            decoys: decoys.flat_map(|phi| centred(phi, mean(phi))).collect(),
            offsets,
            centre,
            runs: runs(rows, design.breaks),
        }
    }

    fn columns(&self, range: &Range<usize>) -> Vec<&[f64]> {
        let all = self.x.chunks_exact(self.y.len());
        all.map(|column| &column[range.clone()]).collect()
    }

    /// Sums over all rows.
    pub(super) fn statistics(&self) -> JointGram {
        self.sums(&self.runs)
    }

    fn sums(&self, runs: &[Range<usize>]) -> JointGram {
        let rows = self.y.len();
        let mut sums = JointAccumulator::new((0..self.offsets.len() as u32).collect());
        let mut workspace = Workspace::default();
        for run in runs {
            let (own, keep) = (&self.x[run.start..], vec![true; run.len()]);
            sums.push_block(own, rows, &self.y[run.clone()], &keep, true, &mut workspace);
        }
        sums.finish()
    }

    /// Sums over pieces that can be left out, with the decoys: the runs, in groups where there are many, or fifths of each of one or two.
    pub(super) fn training(&self) -> Training {
        let groups = PIECES.min(self.runs.len());
        let piece = |piece| -> Vec<Range<usize>> {
            let all = self.runs.iter();
            if self.runs.len() >= 3 {
                return all.skip(piece).step_by(groups).cloned().collect();
            }
            let end = |run: &Range<usize>, piece| run.start + piece * run.len() / PIECES;
            let own = all.map(|run| end(run, piece)..end(run, piece + 1));
            own.filter(|range| !range.is_empty()).collect()
        };
        let count = if self.runs.len() >= 3 { groups } else { PIECES };
        Training {
            units: (0..count).map(|own| self.unit(&piece(own))).collect(),
        }
    }

    fn unit(&self, runs: &[Range<usize>]) -> Unit {
        let (mut decoys, rows) = (JointDecoys::default(), self.y.len());
        for run in runs {
            let phi: Vec<&[f64]> = (self.decoys.chunks_exact(rows))
                .map(|decoy| &decoy[run.clone()])
                .collect();
            decoys += &JointDecoys::of_rows(&phi, &self.columns(run), &self.y[run.clone()]);
        }
        let gram = self.sums(runs);
        let last = gram.s0.size - 1;
        let own = JointUnit {
            decoys,
            torque: gram.s0.at(last, last),
            ..JointUnit::default()
        };
        Unit {
            joints: vec![own],
            gram: Gram { joints: vec![gram] },
        }
    }

    /// `y − Xβ`, run by run.
    pub(super) fn residual(&self, beta: &[f64]) -> Vec<Vec<f64>> {
        let mut left = self.y.clone();
        for (column, beta) in self.x.chunks_exact(left.len()).zip(beta) {
            let rows = left.iter_mut().zip(column);
            rows.for_each(|(y, x)| *y -= beta * x);
        }
        let runs = self.runs.iter();
        runs.map(|run| left[run.clone()].to_vec()).collect()
    }
}

/// Ranges of rows between breaks.
fn runs(rows: usize, breaks: &[usize]) -> Vec<Range<usize>> {
    let inner = breaks.iter().copied().filter(|row| (1..rows).contains(row));
    let mut ends: Vec<usize> = std::iter::once(0).chain(inner).chain([rows]).collect();
    ends.sort_unstable();
    ends.dedup();
    ends.windows(2).map(|pair| pair[0]..pair[1]).collect()
}
