//! What is kept of a log, or of logs that are left out together: sums over ten stretches of their rows, of the signals that columns are made of.

use super::bands::Bands;
use super::decoys::JointDecoys;
use super::weighing::Weighing;
use crate::gram::{JointAccumulator, JointGram, OpenRun};
use crate::observations::Part;
use crate::term::Recipes;
use rayon::prelude::*;
use std::ops::{AddAssign, Range};
use std::sync::Arc;

/// Stretches of a log, of about the same number of rows.
pub(crate) const BLOCKS: usize = 10;

/// What is kept of consecutive rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Runs {
    /// Nothing: rows are independent, or tempered.
    #[default]
    Apart,
    /// First differences, first and last rows: the likelihood is autoregressive.
    Joined,
}

/// Sums over the rows of one log, of a part of it, or of several.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct LogSums {
    /// Of the filter that made the rows, cycles per row; 0 without a filter.
    pub(crate) cutoff: f64,
    /// Rows of each stretch, moving or not.
    pub(crate) rows: Vec<usize>,
    pub(crate) joints: Vec<JointSums>,
}

/// Those of one joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointSums {
    /// Columns of the library, ascending.
    pub(crate) columns: Vec<usize>,
    /// How they follow from the signals; `None`: they are the signals.
    pub(crate) recipes: Option<Arc<Recipes>>,
    /// Stretch by stretch.
    pub(crate) blocks: Vec<JointBlock>,
    pub(crate) bands: Bands,
}

/// Sums over some rows of one joint, over its signals.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct JointBlock {
    /// Its columns are the numbers of the signals.
    pub(crate) gram: JointGram,
    pub(crate) decoys: JointDecoys,
    /// Squares of the measured torque at all rows, (N·m)².
    pub(crate) torque: f64,
    pub(crate) weighing: Weighing,
}

/// Ends of the stretches of some rows.
pub(crate) fn stretch(rows: &Range<usize>, block: usize) -> Range<usize> {
    let cut = |block: usize| rows.start + block * rows.len() / BLOCKS;
    cut(block)..cut(block + 1)
}

impl LogSums {
    /// Sums over the rows of some parts, each of another log, as the fit weighs them; columns follow alike in all of them. With [`Runs::Joined`] runs of
    /// rows go on from one stretch to the next, so that all stretches together have the sums of the uncut part. Of fewer than ten `stretches` each stands
    /// in the place of its first tenth.
    pub(crate) fn of(parts: &[&Part<'_>], stretches: usize, runs: Runs) -> Self {
        let joints = parts
            .first()
            .map_or(0, |part| part.observations.joints.len());
        let rows = |block| {
            parts
                .iter()
                .map(move |part| stretch(&part.rows, block).len())
        };
        Self {
            cutoff: (parts.iter().map(|part| part.observations.cutoff)).fold(0.0, f64::max),
            rows: (0..BLOCKS).map(|block| rows(block).sum()).collect(),
            joints: (0..joints)
                .into_par_iter()
                .map(|joint| JointSums::of(parts, joint, stretches, runs))
                .collect(),
        }
    }
}

impl LogSums {
    /// Decoys by fifths, for what is left out together is never less; where runs are joined none of them, else nothing of runs.
    pub(crate) fn with_runs(mut self, runs: Runs) -> Self {
        for joint in &mut self.joints {
            for pair in joint.blocks.chunks_exact_mut(2) {
                let second = std::mem::take(&mut pair[1].decoys);
                pair[0].decoys += &second;
            }
            for own in &mut joint.blocks {
                match runs {
                    Runs::Joined => own.decoys = JointDecoys::default(),
                    Runs::Apart => own.gram.forget_runs(),
                }
            }
        }
        self
    }

    /// Fifths in the place of tenths: what a fit of one or two logs leaves out, and more than one of many does.
    pub(crate) fn coarse(&self) -> Self {
        let mut sums = self.clone();
        for joint in &mut sums.joints {
            for pair in joint.blocks.chunks_exact_mut(2) {
                let second = std::mem::take(&mut pair[1]);
                pair[0] += &second;
            }
        }
        sums
    }

    /// Without some columns, by their numbers; those behind move up.
    pub(crate) fn without(&self, dropped: &[usize]) -> Self {
        Self {
            cutoff: self.cutoff,
            rows: self.rows.clone(),
            joints: (self.joints.iter())
                .map(|joint| joint.without(dropped))
                .collect(),
        }
    }
}

impl JointSums {
    fn without(&self, dropped: &[usize]) -> Self {
        let kept: Vec<usize> = (0..self.columns.len())
            .filter(|&i| !dropped.contains(&self.columns[i]))
            .collect();
        let (recipes, needed) = match &self.recipes {
            Some(recipes) => {
                let (rest, needed) = recipes.some(&kept);
                (Some(Arc::new(rest)), needed)
            }
            None => (None, kept.clone()),
        };
        let moved = |&i: &usize| {
            let column = self.columns[i];
            column - dropped.iter().filter(|&&d| d < column).count()
        };
        Self {
            columns: kept.iter().map(moved).collect(),
            recipes,
            blocks: self.blocks.iter().map(|own| own.of(&needed)).collect(),
            bands: self.bands.of_signals(&needed),
        }
    }

    fn of(parts: &[&Part<'_>], joint: usize, stretches: usize, runs: Runs) -> Self {
        let rows = &parts[0].observations.joints[joint];
        let (blocks, bands) = rayon::join(
            || blocks(parts, joint, stretches, runs),
            || Bands::of(parts, joint),
        );
        Self {
            columns: rows.columns.clone(),
            recipes: rows.recipes.clone(),
            blocks,
            bands,
        }
    }
}

fn blocks(parts: &[&Part<'_>], joint: usize, stretches: usize, runs: Runs) -> Vec<JointBlock> {
    let mut open = vec![OpenRun::default(); parts.len()];
    let mut blocks = vec![JointBlock::default(); BLOCKS];
    let tenths = BLOCKS / stretches;
    for first in (0..BLOCKS).step_by(tenths) {
        let last = first + tenths - 1;
        let own = parts.iter().map(|part| Part {
            observations: part.observations,
            rows: stretch(&part.rows, first).start..stretch(&part.rows, last).end,
        });
        let own: Vec<Part<'_>> = own.collect();
        let block = &mut blocks[first];
        block.gram = match runs {
            Runs::Apart => gram(&own, joint),
            Runs::Joined => joined(&own, joint, &mut open, [first == 0, last + 1 == BLOCKS]),
        };
        for part in &own {
            block.decoys.add_rows(part, joint);
            block.add_torque(part, joint);
        }
    }
    blocks
}

fn signals(part: &Part<'_>, joint: usize) -> Vec<u32> {
    let signals = part.observations.joints[joint].signals() as u32;
    (0..signals).collect()
}

/// Over the signals of a joint, all rows together.
fn gram(parts: &[Part<'_>], joint: usize) -> JointGram {
    let mut sums = JointAccumulator::new(signals(&parts[0], joint));
    for part in parts {
        part.add_joint_on(joint, true, &mut sums);
    }
    sums.finish()
}

/// The same where runs go on from the stretch before, and are `open` for the next; whether it is the first and the last one.
fn joined(
    parts: &[Part<'_>],
    joint: usize,
    open: &mut [OpenRun],
    [first, last]: [bool; 2],
) -> JointGram {
    let mut gram = JointGram::default();
    for (part, open) in parts.iter().zip(open) {
        let mut sums = JointAccumulator::resume(signals(part, joint), std::mem::take(open));
        part.add_joint_on(joint, first, &mut sums);
        if last {
            gram += &sums.finish();
        } else {
            let (own, run) = sums.cut();
            gram += &own;
            *open = run;
        }
    }
    gram
}

impl JointBlock {
    /// Of some of the signals.
    fn of(&self, signals: &[usize]) -> Self {
        let mut gram = self.gram.clone();
        gram.keep(signals);
        Self {
            gram,
            decoys: self.decoys.keep(signals),
            torque: self.torque,
            weighing: self.weighing.clone(),
        }
    }

    /// The same over columns that follow from the signals.
    pub(crate) fn of_columns(&self, columns: &[usize], recipes: Option<&Recipes>) -> Self {
        let mut gram = match recipes {
            Some(recipes) => self.gram.combined(&recipes.and_one()),
            None => self.gram.clone(),
        };
        gram.columns = columns.iter().map(|&column| column as u32).collect();
        Self {
            gram,
            decoys: self.decoys.of_columns(recipes),
            torque: self.torque,
            weighing: self.weighing.clone(),
        }
    }

    fn add_torque(&mut self, part: &Part<'_>, joint: usize) {
        let rows = &part.observations.joints[joint];
        let measured = rows.measured.some(part.rows.clone());
        self.torque += measured.iter().map(|tau| tau * tau).sum::<f64>();
        if rows.weight.is_empty() {
            return;
        }
        for row in part.rows.clone().filter(|&row| !rows.standstill[row]) {
            let spread = rows.spread.get(row).copied().unwrap_or(1.0);
            self.weighing.add(rows.weight[row] * spread);
        }
    }
}

impl AddAssign<&JointBlock> for JointBlock {
    /// # Panics
    /// If the two belong to different signals (an empty default adopts the other's).
    fn add_assign(&mut self, other: &JointBlock) {
        self.gram += &other.gram;
        self.decoys += &other.decoys;
        self.torque += other.torque;
        self.weighing += &other.weighing;
    }
}
