//! Inner products of all pairs of columns: 4 × 4 register tiles on the CPU's widest vectors.

use pulp::{Simd, WithSimd};

/// Samples per buffer: small enough that the columns stay in the cache.
pub(super) const BLOCK: usize = 64;
/// Distance of two columns in a buffer; not a power of two, or the columns fall into the same cache set.
pub(super) const STRIDE: usize = BLOCK + 8;
/// Columns per side of a tile.
const TILE: usize = 4;
/// Numbers that one tile keeps: 16 sums in up to 8 lanes.
const TILE_SUMS: usize = TILE * TILE * 8;

/// Running sums of `Σ_t x_i(t) x_j(t)` over all pairs of columns, lanes not yet added up.
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

    /// Adds the products of one buffer; sample s of column i is `buffer[i * STRIDE + s]`, unused samples are zero.
    pub(super) fn add(&mut self, arch: pulp::Arch, buffer: &[f64]) {
        arch.dispatch(Kernel {
            tiles: self.tiles,
            sums: &mut self.sums,
            buffer,
        });
    }

    /// The full symmetric matrix, row-major.
    pub(super) fn matrix(&self, width: usize) -> Vec<f64> {
        let mut out = vec![0.0; width * width];
        let mut tiles = self.sums.chunks_exact(TILE_SUMS);
        for row in 0..self.tiles {
            for column in 0..=row {
                let Some(tile) = tiles.next() else { return out };
                for entry in 0..TILE * TILE {
                    let (i, j) = (row * TILE + entry / TILE, column * TILE + entry % TILE);
                    if j <= i && i < width {
                        let lanes = &tile[entry * 8..entry * 8 + 8];
                        let sum = ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6]))
                            + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
                        out[i * width + j] = sum;
                        out[j * width + i] = sum;
                    }
                }
            }
        }
        out
    }
}

struct Kernel<'a> {
    tiles: usize,
    sums: &'a mut [f64],
    buffer: &'a [f64],
}

impl WithSimd for Kernel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut tiles = self.sums.chunks_exact_mut(TILE_SUMS);
        for row in 0..self.tiles {
            for column in 0..=row {
                let Some(tile) = tiles.next() else { return };
                let left = &self.buffer[row * TILE * STRIDE..(row + 1) * TILE * STRIDE];
                let right = &self.buffer[column * TILE * STRIDE..(column + 1) * TILE * STRIDE];
                add_tile(simd, tile, left, right);
            }
        }
    }
}

#[inline(always)]
fn add_tile<S: Simd>(simd: S, tile: &mut [f64], left: &[f64], right: &[f64]) {
    let l = columns::<S>(left);
    let r = columns::<S>(right);
    let mut sum = [[simd.splat_f64s(0.0); TILE]; TILE];
    for s in 0..BLOCK / S::F64_LANES {
        let a = [l[0][s], l[1][s], l[2][s], l[3][s]];
        let b = [r[0][s], r[1][s], r[2][s], r[3][s]];
        for i in 0..TILE {
            for j in 0..TILE {
                sum[i][j] = simd.mul_add_e_f64s(a[i], b[j], sum[i][j]);
            }
        }
    }
    for (lanes, value) in tile.chunks_exact_mut(8).zip(sum.iter().flatten()) {
        let (vectors, _) = S::as_mut_simd_f64s(lanes);
        vectors[0] = simd.add_f64s(vectors[0], *value);
    }
}

/// The four columns of one tile as vectors.
#[inline(always)]
fn columns<S: Simd>(buffer: &[f64]) -> [&[S::f64s]; TILE] {
    [
        S::as_simd_f64s(&buffer[..BLOCK]).0,
        S::as_simd_f64s(&buffer[STRIDE..STRIDE + BLOCK]).0,
        S::as_simd_f64s(&buffer[2 * STRIDE..2 * STRIDE + BLOCK]).0,
        S::as_simd_f64s(&buffer[3 * STRIDE..3 * STRIDE + BLOCK]).0,
    ]
}
