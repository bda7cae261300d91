//! Inner products of all pairs of columns: 3 × 3 register tiles on the CPU's widest vectors.

use pulp::{Simd, WithSimd};

/// Samples per buffer: small enough that the columns stay in the cache.
pub(super) const BLOCK: usize = 128;
/// Distance of two columns in a buffer; not a power of two, or the columns fall into the same cache set.
pub(super) const STRIDE: usize = BLOCK + 8;
/// Numbers in the widest vector.
pub(super) const LANES: usize = 8;
/// Columns per side of a tile: nine sums and six factors fit into the sixteen registers of AVX2, and nine independent sums
/// hide the latency of a multiply-add on two units.
const TILE: usize = 3;
/// Numbers that one tile keeps.
const TILE_SUMS: usize = TILE * TILE;
/// Rows of tiles that share what was loaded of a column of tiles: their columns stay in the first-level cache.
const GROUP: usize = 4;

/// Running sums of `Σ_t x_i(t) x_j(t)` over all pairs of columns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Products {
    tiles: usize,
    sums: Vec<f64>,
}

impl Products {
    /// Zero for `width` columns.
    pub(super) fn new(width: usize) -> Self {
        let tiles = width.div_ceil(TILE);
        Self {
            tiles,
            sums: vec![0.0; tiles * (tiles + 1) / 2 * TILE_SUMS],
        }
    }

    /// Length of a buffer for `width` columns: whole tiles, so that no tile has a ragged edge.
    pub(super) fn buffer_len(width: usize) -> usize {
        width.div_ceil(TILE) * TILE * STRIDE
    }

    /// Adds the products of the first `samples` of a buffer, a multiple of [`LANES`]; sample s of column i is
    /// `buffer[i * STRIDE + s]`.
    pub(super) fn add(&mut self, arch: pulp::Arch, buffer: &[f64], samples: usize) {
        arch.dispatch(Kernel {
            tiles: self.tiles,
            sums: &mut self.sums,
            buffer,
            samples,
        });
    }

    /// The full symmetric matrix, row-major.
    pub(super) fn matrix(&self, width: usize) -> Vec<f64> {
        let mut out = vec![0.0; width * width];
        for i in 0..width {
            for j in 0..=i {
                let tile = place(i / TILE, j / TILE);
                let sum = self.sums[tile + i % TILE * TILE + j % TILE];
                out[i * width + j] = sum;
                out[j * width + i] = sum;
            }
        }
        out
    }
}

/// First sum of a tile on or below the diagonal.
fn place(row: usize, column: usize) -> usize {
    (row * (row + 1) / 2 + column) * TILE_SUMS
}

struct Kernel<'a> {
    tiles: usize,
    sums: &'a mut [f64],
    buffer: &'a [f64],
    samples: usize,
}

impl WithSimd for Kernel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let columns =
            |tile: usize| columns::<S>(&self.buffer[tile * TILE * STRIDE..], self.samples);
        for first in (0..self.tiles).step_by(GROUP) {
            let last = self.tiles.min(first + GROUP);
            for column in 0..last {
                let right = columns(column);
                for row in first.max(column)..last {
                    let at = place(row, column);
                    let sums = &mut self.sums[at..at + TILE_SUMS];
                    if row == column {
                        add_diagonal(simd, sums, right);
                    } else {
                        add_tile(simd, sums, columns(row), right);
                    }
                }
            }
        }
    }
}

/// All nine products of two times three columns.
#[inline(always)]
fn add_tile<S: Simd>(
    simd: S,
    sums: &mut [f64],
    left: [&[S::f64s]; TILE],
    right: [&[S::f64s]; TILE],
) {
    let mut sum = [[simd.splat_f64s(0.0); TILE]; TILE];
    // Said once more, so that no index is checked in the loop.
    let samples = right[0].len();
    let (left, right) = (left.map(|c| &c[..samples]), right.map(|c| &c[..samples]));
    for s in 0..samples {
        let a = left.map(|column| column[s]);
        let b = right.map(|column| column[s]);
        for i in 0..TILE {
            for j in 0..TILE {
                sum[i][j] = simd.mul_add_e_f64s(a[i], b[j], sum[i][j]);
            }
        }
    }
    for (total, lanes) in sums.iter_mut().zip(sum.iter().flatten()) {
        *total += simd.reduce_sum_f64s(*lanes);
    }
}

/// The six products of three columns among themselves; what stands above the diagonal stays zero.
#[inline(always)]
fn add_diagonal<S: Simd>(simd: S, sums: &mut [f64], columns: [&[S::f64s]; TILE]) {
    let mut sum = [[simd.splat_f64s(0.0); TILE]; TILE];
    let samples = columns[0].len();
    let columns = columns.map(|c| &c[..samples]);
    for s in 0..samples {
        let a = columns.map(|column| column[s]);
        for i in 0..TILE {
            for j in 0..=i {
                sum[i][j] = simd.mul_add_e_f64s(a[i], a[j], sum[i][j]);
            }
        }
    }
    for i in 0..TILE {
        for j in 0..=i {
            sums[i * TILE + j] += simd.reduce_sum_f64s(sum[i][j]);
        }
    }
}

/// The columns of one tile as vectors.
#[inline(always)]
fn columns<S: Simd>(buffer: &[f64], samples: usize) -> [&[S::f64s]; TILE] {
    std::array::from_fn(|i| S::as_simd_f64s(&buffer[i * STRIDE..i * STRIDE + samples]).0)
}
