//! Inner products of a few columns with a few others: sums that stay in registers while a block of samples comes by.

use crate::lanes::LANES;
use pulp::Simd;

/// Samples per block: enough that what a tile costs once does not count, few enough that a tile's columns and their differences stay in
/// the first-level cache (25 of 32 KiB) while others come by, and a block's signals of all joints in the second (256 instead: 2 % slower).
pub(super) const BLOCK: usize = 320;

/// A column's samples.
pub(super) type Column = [f64; BLOCK];

/// Differences of a column's first samples, from each other and from what stands before the block.
pub(super) type Head = [f64; LANES];

/// Columns, a vector of samples of each at a time.
pub(super) trait Vectors<const N: usize>: Copy {
    /// The first vector of each.
    fn first<S: Simd>(self, s: S) -> [S::f64s; N];

    /// The k-th vector of each, k > 0.
    fn at<S: Simd>(self, s: S, k: usize) -> [S::f64s; N];
}

/// Columns as they are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Samples<'a, const N: usize>(pub(super) [&'a Column; N]);

impl<const N: usize> Vectors<N> for Samples<'_, N> {
    #[inline(always)]
    fn first<S: Simd>(self, s: S) -> [S::f64s; N] {
        self.at(s, 0)
    }

    #[inline(always)]
    fn at<S: Simd>(self, _: S, k: usize) -> [S::f64s; N] {
        self.0.map(|column| vector::<S>(column, k * S::F64_LANES))
    }
}

/// First differences of columns, taken again for every tile: subtractions have units of their own beside the multiply-adds, and
/// to write the differences of all columns and to read them again costs more than the two loads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps<'a, const N: usize> {
    pub(super) columns: [&'a Column; N],
    /// Their first samples' differences: what stands before the block is no part of the column.
    pub(super) heads: &'a [Head; N],
}

impl<const N: usize> Vectors<N> for Steps<'_, N> {
    #[inline(always)]
    fn first<S: Simd>(self, _: S) -> [S::f64s; N] {
        std::array::from_fn(|i| vector::<S>(&self.heads[i], 0))
    }

    #[inline(always)]
    fn at<S: Simd>(self, s: S, k: usize) -> [S::f64s; N] {
        std::array::from_fn(|i| difference(s, self.columns[i], k))
    }
}

/// A vector of samples.
#[inline(always)]
fn vector<S: Simd>(samples: &[f64], from: usize) -> S::f64s {
    S::as_simd_f64s(&samples[from..from + S::F64_LANES]).0[0]
}

/// What the k-th vector, k > 0, differs by from the samples before it.
#[inline(always)]
fn difference<S: Simd>(s: S, column: &Column, k: usize) -> S::f64s {
    let from = k * S::F64_LANES;
    s.sub_f64s(vector::<S>(column, from), vector::<S>(column, from - 1))
}

/// All products of `R` columns with `T` others.
#[inline(always)]
pub(super) fn rectangle<S: Simd, const R: usize, const T: usize>(
    s: S,
    left: impl Vectors<R>,
    right: impl Vectors<T>,
    vectors: usize,
) -> [[S::f64s; T]; R] {
    let mut sum = [[s.splat_f64s(0.0); T]; R];
    let (a, b) = (left.first(s), right.first(s));
    for i in 0..R {
        for j in 0..T {
            sum[i][j] = s.mul_f64s(a[i], b[j]);
        }
    }
    // Said once more, so that no index is checked in the loop.
    for k in 1..vectors.min(BLOCK / S::F64_LANES) {
        let b = right.at(s, k);
        let a = left.at(s, k);
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
pub(super) fn triangle<S: Simd, const R: usize>(
    s: S,
    columns: [&Column; R],
    vectors: usize,
) -> [[S::f64s; R]; R] {
    let mut sum = [[s.splat_f64s(0.0); R]; R];
    for k in 0..vectors.min(BLOCK / S::F64_LANES) {
        add_triangle(s, Samples(columns).at(s, k), &mut sum);
    }
    sum
}

/// The products of `R` columns among themselves; their differences are written along the way, since a loop of its own would wait
/// for the columns a second time.
#[inline(always)]
pub(super) fn triangle_and_steps<S: Simd, const R: usize>(
    s: S,
    columns: [&Column; R],
    before: &[f64; R],
    steps: &mut [Column; R],
    vectors: usize,
) -> [[S::f64s; R]; R] {
    let mut sum = [[s.splat_f64s(0.0); R]; R];
    for i in 0..R {
        let mut last = before[i];
        for k in 0..LANES {
            steps[i][k] = columns[i][k] - last;
            last = columns[i][k];
        }
    }
    let head = LANES / S::F64_LANES;
    for k in 0..vectors.min(head) {
        add_triangle(s, Samples(columns).at(s, k), &mut sum);
    }
    for k in head..vectors.min(BLOCK / S::F64_LANES) {
        let samples = k * S::F64_LANES..(k + 1) * S::F64_LANES;
        // All is read before anything is written: else it would be read twice.
        let a = Samples(columns).at(s, k);
        let differences: [_; R] = std::array::from_fn(|i| difference(s, columns[i], k));
        for i in 0..R {
            S::as_mut_simd_f64s(&mut steps[i][samples.clone()]).0[0] = differences[i];
        }
        add_triangle(s, a, &mut sum);
    }
    sum
}

#[inline(always)]
fn add_triangle<S: Simd, const R: usize>(s: S, a: [S::f64s; R], sum: &mut [[S::f64s; R]; R]) {
    for i in 0..R {
        for j in 0..=i {
            sum[i][j] = s.mul_add_e_f64s(a[i], a[j], sum[i][j]);
        }
    }
}
