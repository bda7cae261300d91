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

    /// Adds to the sums of a tile: `R` columns from the `row * T`-th on, with the `T` from `column * T` on.
    #[inline(always)]
    pub(super) fn add<S: Simd, const R: usize, const T: usize>(
        &mut self,
        s: S,
        row: usize,
        column: usize,
        sum: [[S::f64s; T]; R],
    ) {
        let size = size::<S, T>();
        if self.sums.is_empty() {
            self.sums = Aligned::zeros(above(self.width.div_ceil(T)) * size);
        }
        let kept = &mut self.sums[(above(row) + column) * size..][..size];
        keep(s, sum, kept);
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
