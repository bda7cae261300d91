//! Does an effect lower the error of data that were left out? Algebra on Grams of contiguous blocks of rows.

use crate::gram::Gram;
use crate::linear_algebra::{Cholesky, dot};
use crate::plug_in::Fit;
use crate::posterior::student::StudentT;
use crate::statistics::{BLOCKS, Sums};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Parts of each log of which one is left out.
const FIFTHS: usize = 5;
/// Rows of a tenth at least, on average.
const LEAST_ROWS: usize = 8;
/// Folds of logs at most; more logs are grouped.
const MOST_FOLDS: usize = 6;
/// Probability below two standard deviations of a normal distribution.
const TWO_SD: f64 = 0.977_249_868_051_820_8;
/// Prior variance of a coefficient over that of its estimate from a fold alone, from which the fold shows it.
const SHOWN: f64 = 1.0;
/// Standard errors beyond which the number says nothing more; also where the blocks agree exactly.
const MOST_SDS: f64 = 1e6;

/// What was left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOutData {
    /// One log after the other (many in six groups).
    Logs,
    /// One contiguous fifth of each log after the other.
    Fifths,
}

/// How much an effect lowers the error of left-out data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOutError {
    /// What was left out.
    pub left_out: LeftOutData,
    /// Blocks of rows that were compared.
    pub blocks: usize,
    /// Share of the weighted square error without the effect that the effect takes away; negative where it adds to it.
    pub lowered: f64,
    /// Mean difference over blocks in its standard errors.
    pub standard_errors: f64,
    /// Standard errors from which the difference is clear: 2, for few blocks as much of Student's t.
    pub needed: f64,
}

impl LeftOutError {
    /// Whether the error is lower beyond chance.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.standard_errors > self.needed
    }
}

/// Sums of one contiguous block of rows.
#[derive(Debug)]
struct Block {
    log: usize,
    fifth: usize,
    /// Weighted Gram of the columns and y, (p+1)².
    sums: Vec<f64>,
}

/// Grams of blocks, over the columns of the components that may be in.
#[derive(Debug)]
pub(in crate::calibrate) struct LeftOut {
    /// Component of the prior of each column, p.
    component: Vec<usize>,
    slab: Vec<f64>,
    lower: Vec<f64>,
    blocks: Vec<Block>,
    folds: Vec<Folds>,
}

/// One way to leave data out.
#[derive(Debug)]
struct Folds {
    kind: LeftOutData,
    /// Fold of each block.
    of_block: Vec<usize>,
    /// Sums of the blocks outside each fold.
    kept: Vec<Vec<f64>>,
    /// Prior variance of each column over that of its estimate, fold by fold.
    shown: Vec<Vec<f64>>,
    needed: f64,
}

impl Folds {
    /// From what the error of every block falls by, and the error without what is judged.
    fn judged(&self, gained: &[f64], error: f64) -> LeftOutError {
        let count = gained.len() as f64;
        let mean = gained.iter().sum::<f64>() / count;
        let square: f64 = gained.iter().map(|g| (g - mean) * (g - mean)).sum();
        let sds = mean / (square / (count - 1.0) / count).sqrt();
        LeftOutError {
            left_out: self.kind,
            blocks: gained.len(),
            lowered: if error > 0.0 {
                count * mean / error
            } else {
                0.0
            },
            standard_errors: if sds.is_nan() {
                0.0
            } else {
                sds.clamp(-MOST_SDS, MOST_SDS)
            },
            needed: self.needed,
        }
    }
}

impl LeftOut {
    /// Grams of stretches of the logs over the columns of the components `inside`, weighted as in the likelihood of `fit`:
    ///
    /// ```text
    /// G = Σ_j w_j/max(τ_j, λ_j) G_j(ρ_j)
    /// ```
    pub(in crate::calibrate) fn new(training: &Sums, fit: &Fit, inside: &[bool]) -> Self {
        let prior = &fit.problem.prior;
        let columns: Vec<usize> = (0..prior.component.len())
            .filter(|&k| inside[prior.component[k]])
            .collect();
        let of = |numbers: &[f64]| columns.iter().map(|&k| numbers[k]).collect::<Vec<f64>>();
        let blocks: Vec<Block> = (places(training).into_par_iter())
            .map(|(log, fifth, stretches)| Block {
                log,
                fifth,
                sums: sums(&training.unit(&[(log, stretches)]).gram, fit, &columns),
            })
            .collect();
        let (slab, lower) = (of(&prior.slab), of(&prior.lower));
        let mut out = Self {
            component: columns.iter().map(|&k| prior.component[k]).collect(),
            slab,
            lower,
            blocks,
            folds: Vec::new(),
        };
        let logs = out.blocks.iter().map(|block| block.log + 1).max();
        let logs = logs.unwrap_or(0);
        if logs >= 2 {
            let count = logs.min(MOST_FOLDS);
            out.add_folds(LeftOutData::Logs, count, |block| block.log % count);
        }
        out.add_folds(LeftOutData::Fifths, FIFTHS, |block| block.fifth);
        out
    }

    fn add_folds(&mut self, kind: LeftOutData, count: usize, fold: impl Fn(&Block) -> usize) {
        if self.blocks.len() < 2 {
            return;
        }
        let size = self.slab.len() + 1;
        let of_block: Vec<usize> = self.blocks.iter().map(fold).collect();
        let sum = |takes: &dyn Fn(usize) -> bool| {
            let mut sum = vec![0.0; size * size];
            let blocks = self.blocks.iter().zip(&of_block);
            for (block, _) in blocks.filter(|(_, fold)| takes(**fold)) {
                let pairs = sum.iter_mut().zip(&block.sums);
                pairs.for_each(|(sum, own)| *sum += own);
            }
            sum
        };
        let shown = |fold: usize| {
            let own = sum(&|other| other == fold);
            let of = |(k, slab): (usize, &f64)| own[k * size + k] * slab;
            self.slab.iter().enumerate().map(of).collect()
        };
        let freedom = self.blocks.len() as f64 - 1.0;
        let folds = Folds {
            kind,
            kept: (0..count).map(|fold| sum(&|other| other != fold)).collect(),
            shown: (0..count).map(shown).collect(),
            needed: StudentT::new(freedom).quantile(TWO_SD),
            of_block,
        };
        self.folds.push(folds);
    }

    /// How much the components `own` lower the error of left-out data, everything else refitted: `rest` are the components that are in
    /// without them. Logs are left out where two folds of them show what is judged, else fifths. `None` with fewer than two blocks.
    ///
    /// ```text
    /// Δ_block = e(b₀) − e(b₁),   e(b) = yy − 2 b'xy + b'Gb of the block,   b = (G + V⁻¹)⁻¹ xy of what was kept, b ≥ lower
    /// ```
    /// What is in without the judged and the left-out fold alone shows has its coefficients of all data: no other fold can teach them, and without
    /// them the fold's error would be theirs.
    pub(in crate::calibrate) fn lowered(
        &self,
        rest: &[bool],
        own: &[usize],
    ) -> Option<LeftOutError> {
        let without: Vec<bool> = self.component.iter().map(|&c| rest[c]).collect();
        let judged: Vec<usize> = (0..without.len())
            .filter(|&k| own.contains(&self.component[k]))
            .collect();
        let shows = |shown: &&Vec<f64>| judged.iter().any(|&k| shown[k] >= SHOWN);
        let mut all = self.folds.iter();
        let folds = all.find(|folds| {
            folds.kind == LeftOutData::Fifths || folds.shown.iter().filter(shows).count() >= 2
        })?;
        let (with, nothing) = (vec![true; without.len()], vec![0.0; without.len()]);
        let alone = self.shown_by_one(folds, &without);
        let all = match alone.iter().all(Vec::is_empty) {
            true => [nothing.clone(), nothing.clone()],
            false => {
                let sums = self.total();
                [
                    self.coefficients(&sums, &with)?,
                    self.coefficients(&sums, &without)?,
                ]
            }
        };
        let (mut gained, mut error) = (vec![0.0; self.blocks.len()], 0.0);
        for (fold, kept) in folds.kept.iter().enumerate() {
            let own = |inside: &[bool], all: &[f64]| {
                let mut beta = self.coefficients(kept, inside)?;
                alone[fold].iter().for_each(|&k| beta[k] = all[k]);
                Some(beta)
            };
            let (b1, b0) = (own(&with, &all[0])?, own(&without, &all[1])?);
            let own = folds.of_block.iter().enumerate();
            for (block, _) in own.filter(|(_, own)| **own == fold) {
                let sums = &self.blocks[block].sums;
                gained[block] = difference(sums, &b1, &b0);
                // e(0) is yy.
                error += sums[sums.len() - 1] - difference(sums, &b0, &nothing);
            }
        }
        Some(folds.judged(&gained, error))
    }

    /// Fold by fold, the columns `inside` whose component it alone shows.
    fn shown_by_one(&self, folds: &Folds, inside: &[bool]) -> Vec<Vec<usize>> {
        let mut alone = vec![Vec::new(); folds.shown.len()];
        let count = self.component.len();
        for k in (0..count).filter(|&k| inside[k]) {
            let together = |i: &usize| self.component[*i] == self.component[k];
            let shows = |shown: &[f64]| (0..count).filter(together).any(|i| shown[i] >= SHOWN);
            let mut those = (0..alone.len()).filter(|&fold| shows(&folds.shown[fold]));
            if let (Some(fold), None) = (those.next(), those.next()) {
                alone[fold].push(k);
            }
        }
        alone
    }

    /// Sums of all blocks.
    fn total(&self) -> Vec<f64> {
        let size = self.slab.len() + 1;
        let mut total = vec![0.0; size * size];
        for block in &self.blocks {
            let pairs = total.iter_mut().zip(&block.sums);
            pairs.for_each(|(sum, own)| *sum += own);
        }
        total
    }

    /// The likeliest coefficients of the columns `inside` given these sums; a bound that is passed on the way is kept.
    fn coefficients(&self, sums: &[f64], inside: &[bool]) -> Option<Vec<f64>> {
        let count = self.slab.len();
        let at = |i: usize, j: usize| sums[i * (count + 1) + j];
        let mut free: Vec<usize> = (0..count).filter(|&k| inside[k]).collect();
        let mut beta = vec![0.0; count];
        loop {
            let size = free.len();
            let mut normal = Vec::with_capacity(size * size);
            for &i in &free {
                normal.extend(free.iter().map(|&j| at(i, j)));
            }
            for (place, &k) in free.iter().enumerate() {
                normal[place * size + place] += 1.0 / self.slab[k];
            }
            // What stands at its bound is given.
            let given = |k: usize| {
                (0..count)
                    .filter(|i| !free.contains(i))
                    .map(|i| at(k, i) * beta[i])
                    .sum::<f64>()
            };
            let mut mean: Vec<f64> = free.iter().map(|&k| at(k, count) - given(k)).collect();
            Cholesky::new(&normal, size).ok()?.solve(&mut mean);
            let below = |place: &usize| self.lower[free[*place]] - mean[*place];
            let worst = (0..size).max_by(|a, b| below(a).total_cmp(&below(b)));
            match worst.filter(|place| below(place) > 0.0) {
                Some(place) => {
                    let k = free.remove(place);
                    beta[k] = self.lower[k];
                }
                None => {
                    free.iter()
                        .zip(&mean)
                        .for_each(|(&k, mean)| beta[k] = *mean);
                    return Some(beta);
                }
            }
        }
    }
}

/// `e(b₀) − e(b₁) = (b₁ − b₀)' (2 xy − G (b₁ + b₀))`.
fn difference(sums: &[f64], b1: &[f64], b0: &[f64]) -> f64 {
    let count = b1.len();
    let both: Vec<f64> = b1.iter().zip(b0).map(|(a, b)| a + b).collect();
    let rows = sums.chunks_exact(count + 1).zip(b1.iter().zip(b0));
    rows.map(|(row, (b1, b0))| (b1 - b0) * (2.0 * row[count] - dot(&row[..count], &both)))
        .sum()
}

/// Which stretches of which group of logs are compared as one block: `(group, fifth, stretches)`. Tenths of each of a few logs, if they
/// have [`LEAST_ROWS`] rows or more, else fifths.
fn places(sums: &Sums) -> Vec<(usize, usize, Range<usize>)> {
    let groups = sums.groups();
    let tenths = groups * BLOCKS;
    let long = sums.rows() >= LEAST_ROWS * tenths;
    let each = if long { sums.stretches() } else { FIFTHS };
    let cut = |i: usize| i * BLOCKS / each;
    let of_group =
        |group: usize| (0..each).map(move |i| (group, i * FIFTHS / each, cut(i)..cut(i + 1)));
    (0..groups).flat_map(of_group).collect()
}

/// The weighted sums of one block over these columns and y.
fn sums(gram: &Gram, fit: &Fit, columns: &[usize]) -> Vec<f64> {
    let size = columns.len() + 1;
    let mut sums = vec![0.0; size * size];
    for (j, joint) in gram.joints.iter().enumerate() {
        let factor = fit.plug_in.factor(j);
        let statistics = joint.stationary(fit.plug_in.rho[j]);
        let place = |k: &u32| columns.iter().position(|c| *c == *k as usize);
        let mut places: Vec<Option<usize>> = joint.columns.iter().map(place).collect();
        places.push(Some(size - 1));
        for (a, row) in places.iter().enumerate() {
            for (b, column) in places.iter().enumerate() {
                if let (Some(row), Some(column)) = (row, column) {
                    sums[row * size + column] += factor * statistics.at(a, b);
                }
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests;
