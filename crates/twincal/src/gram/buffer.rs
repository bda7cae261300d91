//! Columns of samples side by side, each from a cache line on.

use crate::lanes::{Aligned, LANES};

/// Samples per buffer: enough that what a tile costs once does not count, few enough that columns stay in the cache.
pub(super) const BLOCK: usize = 256;
/// Distance of two columns in a buffer, whole cache lines; not a power of two, or the columns fall into the same cache set.
const STRIDE: usize = BLOCK + LANES;

/// Up to [`BLOCK`] samples of some columns, and before them the sample that came before.
#[derive(Debug)]
pub(super) struct Buffer {
    /// One line before the first column, so that there is room for the sample before.
    values: Aligned,
}

impl Buffer {
    /// Zeros.
    pub(super) fn new(columns: usize) -> Self {
        Self {
            values: Aligned::zeros(LANES + columns * STRIDE),
        }
    }

    /// All samples of a column.
    #[inline(always)]
    pub(super) fn column(&self, column: usize) -> &[f64] {
        &self.values[LANES + column * STRIDE..][..BLOCK]
    }

    /// The same, to be written.
    #[inline(always)]
    pub(super) fn column_mut(&mut self, column: usize) -> &mut [f64] {
        &mut self.values[LANES + column * STRIDE..][..BLOCK]
    }

    /// The sample before, then all samples of a column.
    #[inline(always)]
    pub(super) fn with_before(&self, column: usize) -> &[f64] {
        &self.values[LANES + column * STRIDE - 1..][..=BLOCK]
    }

    /// Where the sample before stands.
    pub(super) fn before_mut(&mut self, column: usize) -> &mut f64 {
        &mut self.values[LANES + column * STRIDE - 1]
    }
}
