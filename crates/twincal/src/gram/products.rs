//! Running sums of the inner products of all pairs of columns, as tiles leave them.

use crate::lanes::Aligned;
use pulp::Simd;

/// Running sums of `Σ_t x_i(t) x_j(t)` over all pairs of columns.
#[derive(Debug)]
pub(super) struct Products {
    width: usize,
    /// Tile after tile on and below the diagonal, each as [`keep`] leaves it; empty before the first block.
    sums: Aligned,
}

impl Products {
    /// Zero for `width` columns.
    pub(super) fn new(width: usize) -> Self {
        Self {
            width,
            sums: Aligned::default(),
        }
    }

    /// Adds to the sums of a tile of `R` columns with `C` others.
    #[inline(always)]
    pub(super) fn add<S: Simd, const R: usize, const C: usize, const T: usize>(
        &mut self,
        s: S,
        tile: Tile,
        sum: [[S::f64s; C]; R],
    ) {
        let size = size::<S, T>();
        if self.sums.is_empty() {
            self.sums = Aligned::zeros(above(self.width.div_ceil(T)) * size);
        }
        keep(s, sum, &mut self.sums[tile.number() * size..][..size]);
    }

    /// The full symmetric matrix, row-major.
    #[inline(always)]
    pub(super) fn matrix<S: Simd, const T: usize>(&self, s: S) -> Vec<f64> {
        let (width, size) = (self.width, size::<S, T>());
        let mut matrix = vec![0.0; width * width];
        if self.sums.is_empty() {
            return matrix;
        }
        let owners = owners(s);
        for i in 0..width {
            for j in 0..=i {
                let [(row, i_own), (column, j_own)] = [i, j].map(|k| place::<T>(k, width));
                let tile = &self.sums[Tile { row, column }.number() * size..][..size];
                let columns = if column == 0 {
                    first_tile::<T>(width)
                } else {
                    T
                };
                let sum = i_own * columns + j_own;
                let lanes = &tile[sum / fold::<S>() * S::F64_LANES..][..S::F64_LANES];
                let own = lanes.iter().zip(&owners);
                let own = own.filter(|(_, owner)| **owner == sum % fold::<S>());
                let total = own.map(|(lane, _)| lane).sum();
                matrix[i * width + j] = total;
                matrix[j * width + i] = total;
            }
        }
        matrix
    }
}

/// A tile on or below the diagonal, counted in tiles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tile {
    pub(super) row: usize,
    pub(super) column: usize,
}

impl Tile {
    #[inline(always)]
    fn number(self) -> usize {
        above(self.row) + self.column
    }
}

/// Columns of the first tile out of `width`: what whole tiles leave.
#[inline(always)]
pub(super) const fn first_tile<const T: usize>(width: usize) -> usize {
    width - (width.div_ceil(T) - 1) * T
}

/// The tile of a column out of `width`, and its place there.
#[inline(always)]
fn place<const T: usize>(column: usize, width: usize) -> (usize, usize) {
    let first = first_tile::<T>(width);
    match column.checked_sub(first) {
        None => (0, column),
        Some(behind) => (behind / T + 1, behind % T),
    }
}

/// Tiles in the rows of tiles above one.
#[inline(always)]
fn above(row: usize) -> usize {
    row * (row + 1) / 2
}

/// How many sums share a vector in memory. Lanes are added up in part only: all the way down would take several times as long,
/// and not at all would take four times the memory, more than the caches have.
const fn fold<S: Simd>() -> usize {
    if S::F64_LANES.is_multiple_of(4) { 4 } else { 1 }
}

/// Length of a tile's sums in memory.
const fn size<S: Simd, const T: usize>() -> usize {
    (T * T).div_ceil(fold::<S>()) * S::F64_LANES
}

/// Adds a tile's sums to those in memory.
#[inline(always)]
fn keep<S: Simd, const R: usize, const C: usize>(s: S, sum: [[S::f64s; C]; R], kept: &mut [f64]) {
    let (kept, sum) = (S::as_mut_simd_f64s(kept).0, sum.as_flattened());
    if fold::<S>() == 1 {
        for (kept, sum) in kept.iter_mut().zip(sum) {
            *kept = s.add_f64s(*kept, *sum);
        }
        return;
    }
    let (fours, rest) = sum.as_chunks::<4>();
    for (kept, four) in kept.iter_mut().zip(fours) {
        *kept = s.add_f64s(*kept, folded(s, *four));
    }
    if !rest.is_empty() {
        let mut four = [s.splat_f64s(0.0); 4];
        four[..rest.len()].copy_from_slice(rest);
        let kept = &mut kept[fours.len()];
        *kept = s.add_f64s(*kept, folded(s, four));
    }
}

/// Sums of four neighbouring lanes each, in the order of [`owners`].
#[inline(always)]
fn folded<S: Simd>(s: S, four: [S::f64s; 4]) -> S::f64s {
    let [a, b, c, d] = s.deinterleave_shfl_f64s(four);
    s.add_f64s(s.add_f64s(a, b), s.add_f64s(c, d))
}

/// Which of the sums that share a vector each of its lanes belongs to: the order is that of the instruction set.
#[inline(always)]
fn owners<S: Simd>(s: S) -> Vec<usize> {
    if fold::<S>() == 1 {
        return vec![0; S::F64_LANES];
    }
    let quarters = [0.0, 0.25, 0.5, 0.75].map(|x| s.splat_f64s(x));
    let owners = [folded(s, quarters)];
    let lanes: &[f64] = pulp::bytemuck::cast_slice(&owners);
    lanes.iter().map(|owner| *owner as usize).collect()
}
