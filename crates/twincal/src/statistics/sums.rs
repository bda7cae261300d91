//! The sums of all logs of a fit: as many cells as a fit needs to leave some out, however many logs there are.

use super::log_sums::{BLOCKS, JointBlock, LogSums, Runs};
use super::spectrum::Spectrum;
use super::unit::{JointUnit, Unit};
use crate::gram::Gram;
use crate::observations::Part;
use crate::term::Recipes;
use rayon::prelude::*;
use std::ops::{AddAssign, Range};
use std::sync::Arc;

/// Groups of logs at most, each with its stretches: seven for each of six units.
pub(crate) const GROUPS: usize = 42;
/// The same where nothing but the units is asked for.
const UNITS: usize = 6;
/// Logs up to which tenths of each are kept; of more fifths.
const FEW_LOGS: usize = 4;
/// Groups of logs that are added up at a time.
const BATCH: usize = 4;

/// Sums over the rows of some logs. Logs come in the order of their names; of more than 42, every 42nd is in one group.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sums {
    /// Group by group, stretch by stretch.
    cells: Vec<Vec<Cell>>,
    /// Of each joint over all rows.
    pub(crate) spectra: Vec<Spectrum>,
    /// Largest cut-off of the filters that made the rows, cycles per row; 0 without a filter.
    pub(crate) cutoff: f64,
    logs: usize,
    keep: Keep,
}

/// What sums are for: how finely logs are cut follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// A fit, its left-out errors and the scores of its stretches.
    Result,
    /// A fit alone.
    Fit,
}

/// What is kept of the rows of each log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Keep {
    runs: Runs,
    /// Stretches of a log that are apart: 10, 5 or 1.
    stretches: usize,
    /// Groups of logs at most.
    groups: usize,
}

impl Default for Keep {
    fn default() -> Self {
        Self::new(Runs::Apart, (1, Purpose::Result))
    }
}

impl Keep {
    fn new(runs: Runs, (logs, purpose): (usize, Purpose)) -> Self {
        let (stretches, groups) = match purpose {
            Purpose::Result if logs <= FEW_LOGS => (BLOCKS, GROUPS),
            Purpose::Result => (BLOCKS / 2, GROUPS),
            Purpose::Fit if logs < 3 => (BLOCKS / 2, UNITS),
            Purpose::Fit => (1, UNITS),
        };
        Self {
            runs,
            stretches,
            groups,
        }
    }
}

/// Sums over one stretch of one group of logs.
#[derive(Debug, Clone, Default)]
struct Cell {
    rows: usize,
    joints: Vec<JointCell>,
}

/// Of one joint: one or two, where a payload acts in some logs only, of which columns follow alike.
#[derive(Debug, Clone, Default)]
struct JointCell {
    columns: Vec<usize>,
    sums: Vec<(Option<Arc<Recipes>>, JointBlock)>,
}

impl JointCell {
    fn add(&mut self, columns: &[usize], recipes: &Option<Arc<Recipes>>, block: &JointBlock) {
        columns.clone_into(&mut self.columns);
        match self.sums.iter_mut().find(|(own, _)| own == recipes) {
            Some((_, sum)) => *sum += block,
            None => self.sums.push((recipes.clone(), block.clone())),
        }
    }
}

impl AddAssign<&Sums> for Sums {
    /// Group by group: groups of the same number are left out together.
    ///
    /// # Panics
    /// If the two belong to different robots or libraries.
    fn add_assign(&mut self, other: &Sums) {
        self.keep = other.keep;
        self.logs += other.logs;
        self.cutoff = self.cutoff.max(other.cutoff);
        let joints = self.spectra.len().max(other.spectra.len());
        self.spectra.resize_with(joints, Spectrum::default);
        for (spectrum, own) in self.spectra.iter_mut().zip(&other.spectra) {
            *spectrum += own;
        }
        for (group, cells) in other.cells.iter().enumerate() {
            for (sum, own) in self.group(group).iter_mut().zip(cells) {
                sum.rows += own.rows;
                let joints = sum.joints.len().max(own.joints.len());
                sum.joints.resize_with(joints, JointCell::default);
                for (sum, own) in sum.joints.iter_mut().zip(&own.joints) {
                    for (recipes, block) in &own.sums {
                        sum.add(&own.columns, recipes, block);
                    }
                }
            }
        }
    }
}

impl Sums {
    /// Without rows yet, for so many logs.
    pub(crate) fn empty(runs: Runs, logs: (usize, Purpose)) -> Self {
        Self {
            keep: Keep::new(runs, logs),
            ..Self::default()
        }
    }

    /// Of the rows of these parts, each of another log.
    pub(crate) fn of(parts: &[Part<'_>], runs: Runs, purpose: Purpose) -> Self {
        Self::of_some(parts, runs, (parts.len(), purpose))
    }

    /// Of the rows of some of so many logs.
    fn of_some(parts: &[Part<'_>], runs: Runs, logs: (usize, Purpose)) -> Self {
        let mut parts: Vec<&Part<'_>> = parts.iter().collect();
        parts.sort_by(|a, b| a.observations.log.cmp(&b.observations.log));
        let mut sums = Self::empty(runs, logs);
        let (stretches, groups) = (sums.keep.stretches, sums.keep.groups.min(parts.len()));
        let numbers: Vec<usize> = (0..groups).collect();
        for batch in numbers.chunks(BATCH) {
            let of_group = |group: &usize| -> Vec<LogSums> {
                let own = alike(parts.iter().copied().skip(*group).step_by(groups));
                let sums = own.iter().map(|own| LogSums::of(own, stretches, runs));
                sums.collect()
            };
            let logs: Vec<Vec<LogSums>> = batch.par_iter().map(of_group).collect();
            for (group, logs) in batch.iter().zip(logs) {
                logs.iter().for_each(|own| sums.add_to(*group, own));
            }
        }
        sums.logs = parts.len();
        sums
    }

    /// Of the rows of each set, as one of sets that are left out in turn ([`Self::without`]): rows are added up once.
    pub(crate) fn of_sets(sets: &[Vec<Part<'_>>], runs: Runs, purpose: Purpose) -> Vec<Self> {
        let logs = sets.iter().map(Vec::len).sum();
        let sums = sets.par_iter();
        let sums = sums.map(|set| Self::of_some(set, runs, (logs, purpose)));
        sums.collect()
    }

    /// All of `sets` but one.
    ///
    /// # Panics
    /// If they belong to different robots or libraries.
    pub(crate) fn without(sets: &[Self], left_out: usize) -> Self {
        let mut rest = Self::default();
        let others = sets.iter().enumerate();
        let others = others.filter(|(set, _)| *set != left_out);
        others.for_each(|(_, own)| rest += own);
        rest
    }

    /// Adds the log whose name is next.
    ///
    /// # Panics
    /// If it belongs to another robot or library than those before.
    pub(crate) fn add(&mut self, log: &LogSums) {
        self.add_to(self.logs % self.keep.groups, log);
        self.logs += 1;
    }

    /// Adds logs of a group.
    fn add_to(&mut self, group: usize, log: &LogSums) {
        let merged = BLOCKS / self.keep.stretches;
        self.cutoff = self.cutoff.max(log.cutoff);
        self.spectra
            .resize_with(log.joints.len(), Spectrum::default);
        for (spectrum, joint) in self.spectra.iter_mut().zip(&log.joints) {
            spectrum.add(joint);
        }
        let runs = self.keep.runs;
        let cells = self.group(group);
        for block in 0..BLOCKS {
            let cell = &mut cells[block / merged * merged];
            cell.rows += log.rows[block];
            cell.joints
                .resize_with(log.joints.len(), JointCell::default);
            for (sum, joint) in cell.joints.iter_mut().zip(&log.joints) {
                let mut own = joint.blocks[block].clone();
                if runs == Runs::Apart {
                    own.gram.forget_runs();
                }
                sum.add(&joint.columns, &joint.recipes, &own);
            }
        }
    }

    /// Cells of a group.
    fn group(&mut self, group: usize) -> &mut [Cell] {
        let groups = self.cells.len().max(group + 1);
        self.cells
            .resize_with(groups, || vec![Cell::default(); BLOCKS]);
        &mut self.cells[group]
    }

    /// Stretches of each log that can be told apart: 10, 5 or 1 of about equal length.
    pub(crate) fn stretches(&self) -> usize {
        self.keep.stretches
    }

    /// Number of groups of logs that can be left out: one per log up to [`GROUPS`].
    pub(crate) fn groups(&self) -> usize {
        self.cells.len()
    }

    /// Rows of all logs, moving or not.
    pub(crate) fn rows(&self) -> usize {
        self.cells.iter().flatten().map(|cell| cell.rows).sum()
    }

    /// Squares of the measured torque of each joint at all rows, (N·m)².
    pub(crate) fn torque_squares(&self) -> Vec<f64> {
        let of_joint = |joint: usize| -> f64 {
            let cells = self.cells.iter().flatten();
            let own = cells.filter_map(|cell| cell.joints.get(joint));
            let sums = own.flat_map(|own| &own.sums);
            sums.map(|(_, block)| block.torque).sum()
        };
        (0..self.joints()).map(of_joint).collect()
    }

    /// Number of moving joints; 0 without rows.
    pub(crate) fn joints(&self) -> usize {
        self.spectra.len()
    }

    /// Sums over columns and torque of some stretches of some groups.
    pub(crate) fn unit(&self, which: &[(usize, Range<usize>)]) -> Unit {
        let of_joint = |joint: usize| {
            let mut kinds: Vec<(&Option<Arc<Recipes>>, JointBlock)> = Vec::new();
            let mut columns: &[usize] = &[];
            let cells = which
                .iter()
                .flat_map(|(group, blocks)| &self.cells[*group][blocks.clone()]);
            for cell in cells {
                // Where fewer stretches are apart, the cells between hold nothing.
                let Some(own) = cell.joints.get(joint) else {
                    continue;
                };
                columns = &own.columns;
                for (recipes, sums) in &own.sums {
                    match kinds.iter_mut().find(|(known, _)| *known == recipes) {
                        Some((_, sum)) => *sum += sums,
                        None => kinds.push((recipes, sums.clone())),
                    }
                }
            }
            let mut sum = JointBlock::default();
            for (recipes, own) in kinds {
                sum += &own.of_columns(columns, recipes.as_deref());
            }
            sum
        };
        let joints = (0..self.joints()).into_par_iter().map(of_joint);
        let joints: Vec<JointBlock> = joints.collect();
        let (grams, rest) = joints.into_iter().map(JointUnit::split).unzip();
        Unit {
            gram: Gram { joints: grams },
            joints: rest,
        }
    }

    /// Sums over all rows.
    pub(crate) fn total(&self) -> Unit {
        let all: Vec<_> = (0..self.groups()).map(|group| (group, 0..BLOCKS)).collect();
        self.unit(&all)
    }
}

/// Logs whose columns follow alike from signals together, joint by joint: where a payload acts in some logs only, there are two such sets.
fn alike<'a, 'b>(logs: impl Iterator<Item = &'b Part<'a>>) -> Vec<Vec<&'b Part<'a>>> {
    let same = |a: &Part<'_>, b: &Part<'_>| {
        let pairs = a.observations.joints.iter().zip(&b.observations.joints);
        pairs.into_iter().all(|(a, b)| a.recipes == b.recipes)
    };
    let mut sets: Vec<Vec<&'b Part<'a>>> = Vec::new();
    for log in logs {
        match sets.iter_mut().find(|set| same(set[0], log)) {
            Some(set) => set.push(log),
            None => sets.push(vec![log]),
        }
    }
    sets
}
