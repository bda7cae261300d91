//! Inner products of all pairs of columns: square register tiles on the CPU's widest vectors.

use super::block::{BLOCK, Column};
use crate::lanes::Aligned;
use pulp::Simd;
use std::ops::Range;

/// Columns that stay in the first-level cache while all columns before them come by.
pub(super) const GROUP: usize = 12;

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

    /// Adds the products of some columns, from the first one of a tile on, with themselves and all columns before them, over
    /// the first `vectors` vectors of samples. Columns that are left behind the last whole tile have narrower ones.
    #[inline(always)]
    pub(super) fn add<S: Simd, const T: usize>(
        &mut self,
        s: S,
        columns: &[Column],
        own: Range<usize>,
        vectors: usize,
    ) {
        let size = size::<S, T>();
        if self.sums.is_empty() {
            self.sums = Aligned::zeros(above(self.width.div_ceil(T)) * size);
        }
        let own = own.start / T..own.end.div_ceil(T);
        for column in 0..own.end {
            for row in own.start.max(column)..own.end {
                let sums = &mut self.sums[(above(row) + column) * size..][..size];
                let (left, right) = (&columns[row * T..], &columns[column * T..]);
                match self.width - row * T {
                    1 => block::<S, 1, T>(s, left, right, row == column, vectors, sums),
                    2 => block::<S, 2, T>(s, left, right, row == column, vectors, sums),
                    3 if T > 3 => block::<S, 3, T>(s, left, right, row == column, vectors, sums),
                    4 if T > 4 => block::<S, 4, T>(s, left, right, row == column, vectors, sums),
                    _ => block::<S, T, T>(s, left, right, row == column, vectors, sums),
                }
            }
        }
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
                let tile = &self.sums[(above(i / T) + j / T) * size..][..size];
                let sum = i % T * T + j % T;
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

/// Tiles in the rows of tiles above one.
#[inline(always)]
fn above(row: usize) -> usize {
    row * (row + 1) / 2
}

/// Products of `R` columns with the `T` of a whole tile, or on the diagonal with themselves.
#[inline(always)]
fn block<S: Simd, const R: usize, const T: usize>(
    s: S,
    left: &[Column],
    right: &[Column],
    diagonal: bool,
    vectors: usize,
    sums: &mut [f64],
) {
    let Some(left) = left.first_chunk::<R>() else {
        return;
    };
    if diagonal {
        keep(s, triangle::<S, R, T>(s, left, vectors), sums);
    } else if let Some(right) = right.first_chunk::<T>() {
        keep(s, rectangle::<S, R, T>(s, left, right, vectors), sums);
    }
}

/// All products of `R` columns with `T` others.
#[inline(always)]
fn rectangle<S: Simd, const R: usize, const T: usize>(
    s: S,
    left: &[Column; R],
    right: &[Column; T],
    vectors: usize,
) -> [[S::f64s; T]; R] {
    let mut sum = [[s.splat_f64s(0.0); T]; R];
    // Said once more, so that no index is checked in the loop.
    for k in 0..vectors.min(BLOCK / S::F64_LANES) {
        let b = vectors_at::<S, T>(right, k);
        let a = vectors_at::<S, R>(left, k);
        for i in 0..R {
            for j in 0..T {
                sum[i][j] = s.mul_add_e_f64s(a[i], b[j], sum[i][j]);
            }
        }
    }
    sum
}

/// The products of `R` columns among themselves.
#[inline(always)]
fn triangle<S: Simd, const R: usize, const T: usize>(
    s: S,
    columns: &[Column; R],
    vectors: usize,
) -> [[S::f64s; T]; R] {
    let mut sum = [[s.splat_f64s(0.0); T]; R];
    for k in 0..vectors.min(BLOCK / S::F64_LANES) {
        let a = vectors_at::<S, R>(columns, k);
        for i in 0..R {
            for j in 0..=i {
                sum[i][j] = s.mul_add_e_f64s(a[i], a[j], sum[i][j]);
            }
        }
    }
    sum
}

/// The k-th vector of each column.
#[inline(always)]
fn vectors_at<S: Simd, const N: usize>(columns: &[Column; N], k: usize) -> [S::f64s; N] {
    let samples = k * S::F64_LANES..(k + 1) * S::F64_LANES;
    std::array::from_fn(|i| S::as_simd_f64s(&columns[i][samples.clone()]).0[0])
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
fn keep<S: Simd, const R: usize, const T: usize>(s: S, sum: [[S::f64s; T]; R], kept: &mut [f64]) {
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
