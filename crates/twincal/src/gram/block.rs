//! A block of rows: the products of its columns, and of their first differences, tile by tile.
//!
//! What limits the work is not the multiply-adds but what comes into the first-level cache beside them: on a Zen 5 a line every
//! second cycle from the second level, while a tile of five by five wants ten lines in 12.5. So rows are read where they are,
//! differences of five columns are all that is ever written, and columns that come by are used for both sums. (A copy of the rows and
//! one of their differences, as it was before: 65 % of the peak for the parts of a Panda from the cache, 72 % now.)

use super::products::{Products, Tile, first_tile};
use super::tiles::{BLOCK, Column, Head, Samples, Steps, rectangle, triangle, triangle_and_steps};
use crate::lanes::{Aligned, LANES};
use pulp::Simd;

/// Working memory of [`JointAccumulator::push_block`](super::JointAccumulator::push_block): that of all joints one after the
/// other, so that it stays in the cache. Holds nothing between calls.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Rows that cannot be read where they are.
    pub(super) rows: Columns<BLOCK>,
    pub(super) steps: Differences,
}

/// First differences: of the columns of one tile at all samples, and of all columns before them at the first samples.
#[derive(Debug, Default)]
pub(super) struct Differences {
    own: Columns<BLOCK>,
    heads: Columns<LANES>,
}

/// Columns of `N` samples that start at cache lines.
#[derive(Debug, Default)]
pub(super) struct Columns<const N: usize>(Aligned);

impl<const N: usize> Columns<N> {
    /// The first `count` columns.
    pub(super) fn first(&mut self, count: usize) -> &mut [[f64; N]] {
        if self.0.len() < count * N {
            self.0 = Aligned::zeros(count * N);
        }
        &mut self.0.as_chunks_mut().0[..count]
    }
}

/// So many numbers (4 KiB) from one another, all columns are in the same places of the first-level cache.
const PAGE: usize = 512;

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
    /// Of columns one after the other.
    pub(super) fn of(columns: &'a [Column]) -> Self {
        Self {
            x: columns.as_flattened(),
            stride: BLOCK,
            y: columns.last().map_or(&[], |y| y),
        }
    }

    /// A column out of `count`.
    #[inline(always)]
    pub(super) fn column(&self, column: usize, count: usize) -> &'a [f64] {
        if column + 1 < count {
            &self.x[column * self.stride..][..self.y.len()]
        } else {
            self.y
        }
    }

    /// `N` columns out of `count`, of a whole block.
    #[inline(always)]
    fn columns<const N: usize>(&self, from: usize, count: usize) -> Option<[&'a Column; N]> {
        let mut columns = [self.column(from, count).first_chunk()?; N];
        for i in 1..N {
            columns[i] = self.column(from + i, count).first_chunk()?;
        }
        Some(columns)
    }

    /// Whether the columns drive one another out of the cache (a seventh of the speed with 78 of them).
    pub(super) fn collide(&self) -> bool {
        self.stride.is_multiple_of(PAGE)
    }

    /// The same rows in other memory, which has as many columns.
    pub(super) fn copied<'b>(&self, to: &'b mut [Column]) -> Rows<'b> {
        let count = to.len();
        for (i, column) in to.iter_mut().enumerate() {
            column.copy_from_slice(self.column(i, count));
        }
        Rows::of(to)
    }
}

/// A block on its way into the sums.
pub(super) struct Block<'a> {
    /// A whole block of them; what is behind the last sample is zero.
    pub(super) rows: Rows<'a>,
    pub(super) samples: usize,
    /// The row before the first.
    pub(super) before: &'a [f64],
    /// Samples that start a run.
    pub(super) starts: &'a [usize],
}

impl Block<'_> {
    /// Adds all products to those of rows and those of differences, `T` columns with themselves and with all columns before
    /// them. What whole tiles leave is the first tile and comes by all others: to let all others come by a few columns at the end
    /// would load each three times for few products.
    #[inline(always)]
    pub(super) fn add_to<S: Simd, const T: usize>(
        &self,
        s: S,
        sums: &mut [Products; 2],
        steps: &mut Differences,
    ) {
        let count = self.before.len();
        let (own, heads) = (steps.own.first(T), steps.heads.first(count));
        match first_tile::<T>(count) {
            1 => self.add_rows::<S, 1, T>(s, sums, own, heads),
            2 => self.add_rows::<S, 2, T>(s, sums, own, heads),
            3 if T > 3 => self.add_rows::<S, 3, T>(s, sums, own, heads),
            4 if T > 4 => self.add_rows::<S, 4, T>(s, sums, own, heads),
            _ => self.add_rows::<S, T, T>(s, sums, own, heads),
        };
    }

    /// With `N` columns in the first tile; `None` if there are fewer.
    #[inline(always)]
    fn add_rows<S: Simd, const N: usize, const T: usize>(
        &self,
        s: S,
        sums: &mut [Products; 2],
        own: &mut [Column],
        heads: &mut [Head],
    ) -> Option<()> {
        let tile = Tile { row: 0, column: 0 };
        self.add_own::<S, N, T>(s, 0, tile, sums, own, heads)?;
        for row in 1..self.before.len().div_ceil(T) {
            let from = N + (row - 1) * T;
            let tile = Tile { row, column: row };
            let (rows, steps) = self.add_own::<S, T, T>(s, from, tile, sums, own, heads)?;
            let (narrow, whole) = heads[..from].split_first_chunk::<N>()?;
            let tile = Tile { row, column: 0 };
            self.add_others(s, tile, 0, narrow, (rows, steps), sums)?;
            for (k, heads) in whole.as_chunks::<T>().0.iter().enumerate() {
                let (tile, from) = (Tile { row, column: k + 1 }, N + k * T);
                self.add_others(s, tile, from, heads, (rows, steps), sums)?;
            }
        }
        Some(())
    }

    /// Adds the products of `R` columns with themselves; gives them and their differences.
    #[inline(always)]
    fn add_own<'b, S: Simd, const R: usize, const T: usize>(
        &'b self,
        s: S,
        from: usize,
        tile: Tile,
        [s0, d]: &mut [Products; 2],
        steps: &'b mut [Column],
        heads: &mut [Head],
    ) -> Option<(Samples<'b, R>, Samples<'b, R>)> {
        let (count, vectors) = (self.before.len(), self.samples.div_ceil(S::F64_LANES));
        let own = self.rows.columns::<R>(from, count)?;
        let steps = steps.first_chunk_mut::<R>()?;
        let before = self.before[from..].first_chunk()?;
        let sum = triangle_and_steps(s, own, before, steps, vectors);
        s0.add::<S, R, R, T>(s, tile, sum);
        for (step, head) in steps.iter_mut().zip(&mut heads[from..]) {
            // Behind the last sample, and between runs, there is no difference. Here zero is enough: other columns' are taken
            // from the rows, whatever stands there, and only count as factors of these.
            step[self.samples..].fill(0.0);
            for &start in self.starts {
                step[start] = 0.0;
            }
            head.copy_from_slice(&step[..LANES]);
        }
        let steps = steps.each_ref();
        d.add::<S, R, R, T>(s, tile, triangle(s, steps, vectors));
        Some((Samples(own), Samples(steps)))
    }

    /// Adds the products of a whole tile's columns with `C` others, and of their differences.
    #[inline(always)]
    fn add_others<S: Simd, const C: usize, const T: usize>(
        &self,
        s: S,
        tile: Tile,
        from: usize,
        heads: &[Head; C],
        (rows, steps): (Samples<'_, T>, Samples<'_, T>),
        [s0, d]: &mut [Products; 2],
    ) -> Option<()> {
        let (count, vectors) = (self.before.len(), self.samples.div_ceil(S::F64_LANES));
        let columns = self.rows.columns::<C>(from, count)?;
        let others = Steps { columns, heads };
        s0.add::<S, T, C, T>(s, tile, rectangle(s, rows, Samples(columns), vectors));
        d.add::<S, T, C, T>(s, tile, rectangle(s, steps, others, vectors));
        Some(())
    }
}
