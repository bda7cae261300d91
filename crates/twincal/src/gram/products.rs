//! Inner products of all pairs of columns: square register tiles on the CPU's widest vectors.

use super::buffer::{BLOCK, Buffer};
use crate::lanes::LANES;
use pulp::{Simd, WithSimd};

/// Rows of tiles that share what was loaded of a column of tiles: their columns stay in the first-level cache.
const GROUP: usize = 4;

/// Running sums of `Σ_t x_i(t) x_j(t)` over all pairs of columns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Products {
    width: usize,
    /// Row-major; what stands above the diagonal stays zero.
    sums: Vec<f64>,
}

impl Products {
    /// Zero for `width` columns.
    pub(super) fn new(width: usize) -> Self {
        Self {
            width,
            sums: vec![0.0; width * width],
        }
    }

    /// Adds the products of the first `samples` of a buffer, a multiple of [`LANES`].
    pub(super) fn add(&mut self, arch: pulp::Arch, buffer: &Buffer, samples: usize) {
        debug_assert!(samples <= BLOCK && samples.is_multiple_of(LANES));
        arch.dispatch(Kernel {
            width: self.width,
            sums: &mut self.sums,
            buffer,
            samples,
        });
    }

    /// The full symmetric matrix, row-major.
    pub(super) fn into_matrix(mut self) -> Vec<f64> {
        for i in 0..self.width {
            for j in 0..i {
                self.sums[j * self.width + i] = self.sums[i * self.width + j];
            }
        }
        self.sums
    }
}

struct Kernel<'a> {
    width: usize,
    sums: &'a mut [f64],
    buffer: &'a Buffer,
    samples: usize,
}

impl WithSimd for Kernel<'_> {
    type Output = ();

    /// The sums and factors of a tile fit into the registers: 16 + 8 of 32, or 9 + 6 of 16. Nine independent sums hide the latency of
    /// a multiply-add on two units.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if S::REGISTER_COUNT >= 32 {
            self.tiles::<S, 4>(simd);
        } else {
            self.tiles::<S, 3>(simd);
        }
    }
}

impl Kernel<'_> {
    /// All tiles of `T` times `T` columns on and below the diagonal, then the columns that are left at the end.
    #[inline(always)]
    fn tiles<S: Simd, const T: usize>(mut self, simd: S) {
        let whole = self.width / T;
        for first in (0..whole).step_by(GROUP) {
            let last = whole.min(first + GROUP);
            for column in 0..last {
                for row in first.max(column)..last {
                    if row == column {
                        self.diagonal::<S, T>(simd, row * T);
                    } else {
                        self.tile::<S, T, T>(simd, row * T, column * T);
                    }
                }
            }
        }
        match self.width - whole * T {
            1 => self.edge::<S, 1, T>(simd, whole),
            2 => self.edge::<S, 2, T>(simd, whole),
            3 => self.edge::<S, 3, T>(simd, whole),
            _ => {}
        }
    }

    /// The last `R` columns, behind `whole` tiles.
    #[inline(always)]
    fn edge<S: Simd, const R: usize, const T: usize>(&mut self, simd: S, whole: usize) {
        for column in 0..whole {
            self.tile::<S, R, T>(simd, whole * T, column * T);
        }
        self.diagonal::<S, R>(simd, whole * T);
    }

    /// All products of `R` columns from `row` on with `C` columns from `column` on.
    #[inline(always)]
    fn tile<S: Simd, const R: usize, const C: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
    ) {
        let (left, right) = (self.columns::<S, R>(row), self.columns::<S, C>(column));
        let mut sum = [[simd.splat_f64s(0.0); C]; R];
        // Said once more, so that no index is checked in the loop.
        let samples = right[0].len();
        let (left, right) = (left.map(|c| &c[..samples]), right.map(|c| &c[..samples]));
        for s in 0..samples {
            let a = left.map(|column| column[s]);
            let b = right.map(|column| column[s]);
            for i in 0..R {
                for j in 0..C {
                    sum[i][j] = simd.mul_add_e_f64s(a[i], b[j], sum[i][j]);
                }
            }
        }
        for (i, sum) in sum.into_iter().enumerate() {
            let totals = &mut self.sums[(row + i) * self.width + column..][..C];
            for (total, lanes) in totals.iter_mut().zip(sum) {
                *total += simd.reduce_sum_f64s(lanes);
            }
        }
    }

    /// The products of `T` columns from `at` on among themselves.
    #[inline(always)]
    fn diagonal<S: Simd, const T: usize>(&mut self, simd: S, at: usize) {
        let columns = self.columns::<S, T>(at);
        let mut sum = [[simd.splat_f64s(0.0); T]; T];
        let samples = columns[0].len();
        let columns = columns.map(|c| &c[..samples]);
        for s in 0..samples {
            let a = columns.map(|column| column[s]);
            for i in 0..T {
                for j in 0..=i {
                    sum[i][j] = simd.mul_add_e_f64s(a[i], a[j], sum[i][j]);
                }
            }
        }
        for (i, sum) in sum.into_iter().enumerate() {
            let totals = &mut self.sums[(at + i) * self.width + at..][..=i];
            for (total, lanes) in totals.iter_mut().zip(sum) {
                *total += simd.reduce_sum_f64s(lanes);
            }
        }
    }

    /// `T` columns from `first` on as vectors.
    #[inline(always)]
    fn columns<S: Simd, const T: usize>(&self, first: usize) -> [&[S::f64s]; T] {
        std::array::from_fn(|i| S::as_simd_f64s(&self.buffer.column(first + i)[..self.samples]).0)
    }
}
