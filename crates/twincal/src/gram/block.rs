//! A block of rows and of their first differences, column by column.

use super::products::{GROUP, Products};
use crate::lanes::{Aligned, LANES};
use pulp::Simd;
use std::ops::Range;

/// Samples per block: enough that what a tile costs once does not count, few enough that the columns of [`GROUP`] tiles stay in
/// the first-level cache.
pub(super) const BLOCK: usize = 256;

/// A column's samples. Columns stand at a fixed distance, so that all those of a tile are found from two addresses: to count up
/// one for each of them took a fifth of the time of the multiplications.
pub(super) type Column = [f64; BLOCK];

/// Working memory of [`JointAccumulator::push_block`](super::JointAccumulator::push_block): that of all joints one after the
/// other, so that it stays in the cache. Holds nothing between calls.
#[derive(Debug, Default)]
pub struct Workspace(Aligned);

/// Memory of so many numbers (4 KiB) is one page: a load whose place in its page is that of a store just before waits for it.
const PAGE: usize = 512;

impl Workspace {
    /// Rows and differences, with room for `count` columns.
    pub(super) fn columns(&mut self, count: usize) -> [&mut [Column]; 2] {
        // Differences are written a quarter of a page behind where rows are read.
        let steps = (count * BLOCK).next_multiple_of(PAGE) + 3 * PAGE / 4;
        if self.0.len() < steps + count * BLOCK {
            self.0 = Aligned::zeros(steps + count * BLOCK);
        }
        let (rows, steps) = self.0.split_at_mut(steps);
        [rows, steps].map(|columns| columns.as_chunks_mut().0)
    }
}

/// Columns that start at cache lines.
#[derive(Debug, Default)]
pub(super) struct Columns(Aligned);

impl Columns {
    /// All columns, `count` or more.
    pub(super) fn at_least(&mut self, count: usize) -> &mut [Column] {
        if self.0.len() < count * BLOCK {
            self.0 = Aligned::zeros(count * BLOCK);
        }
        self.0.as_chunks_mut().0
    }
}

/// Consecutive rows, somewhere in memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows<'a> {
    /// All columns but the last one.
    pub(super) x: &'a [f64],
    /// From one column to the next in `x`.
    pub(super) stride: usize,
    /// The last column.
    pub(super) y: &'a [f64],
}

impl<'a> Rows<'a> {
    /// A column out of `count`.
    #[inline(always)]
    pub(super) fn column(&self, column: usize, count: usize) -> &'a [f64] {
        if column + 1 < count {
            &self.x[column * self.stride..][..self.y.len()]
        } else {
            self.y
        }
    }
}

/// A block on its way into the sums.
pub(super) struct Block<'a> {
    /// Where its rows must be copied from, unless they are in place.
    pub(super) from: Option<Rows<'a>>,
    pub(super) rows: &'a mut [Column],
    pub(super) steps: &'a mut [Column],
    pub(super) samples: usize,
    /// The row before the first.
    pub(super) before: &'a [f64],
    /// Samples that start a run.
    pub(super) starts: &'a [usize],
}

impl Block<'_> {
    /// Adds all products, of some columns after the other, which are in the first-level cache from being written.
    #[inline(always)]
    pub(super) fn add_to<S: Simd, const T: usize>(
        mut self,
        s: S,
        s0: &mut Products,
        d: &mut Products,
    ) {
        let count = self.before.len();
        let vectors = self.samples.div_ceil(S::F64_LANES);
        for first in (0..count).step_by(GROUP / T * T) {
            let columns = first..count.min(first + GROUP / T * T);
            self.copy(columns.clone(), vectors * S::F64_LANES);
            s0.add::<S, T>(s, self.rows, columns.clone(), vectors);
            self.subtract(s, columns.clone(), vectors * S::F64_LANES);
            d.add::<S, T>(s, self.steps, columns, vectors);
        }
    }

    /// Rows of some columns; zeros behind the last sample.
    #[inline(always)]
    fn copy(&mut self, columns: Range<usize>, end: usize) {
        for i in columns {
            let row = &mut self.rows[i];
            if let Some(from) = &self.from {
                row[..self.samples].copy_from_slice(from.column(i, self.before.len()));
            }
            row[self.samples..end].fill(0.0);
        }
    }

    /// Differences of some columns; zeros behind the last sample.
    #[inline(always)]
    fn subtract<S: Simd>(&mut self, s: S, columns: Range<usize>, end: usize) {
        for i in columns {
            let (row, step) = (&self.rows[i], &mut self.steps[i]);
            differences(s, self.before[i], &row[..end], &mut step[..end]);
            step[self.samples..end].fill(0.0);
            // What stands before a run is another one's: the difference from it is none.
            for &start in self.starts {
                step[start] = 0.0;
            }
        }
    }
}

/// Of whole vectors of samples.
#[inline(always)]
fn differences<S: Simd>(s: S, before: f64, row: &[f64], step: &mut [f64]) {
    let mut last = before;
    for (step, &sample) in step.iter_mut().zip(row).take(LANES) {
        *step = sample - last;
        last = sample;
    }
    if row.len() <= LANES {
        return;
    }
    let next = S::as_simd_f64s(&row[LANES..]).0;
    let previous = S::as_simd_f64s(&row[LANES - 1..]).0;
    let steps = S::as_mut_simd_f64s(&mut step[LANES..]).0;
    for (step, (&next, &previous)) in steps.iter_mut().zip(next.iter().zip(previous)) {
        *step = s.sub_f64s(next, previous);
    }
}
