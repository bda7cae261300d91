//! Columns of samples side by side in memory that starts at a cache line: the widest vectors never cross one.

/// Samples per buffer: enough that what a tile costs once does not count, few enough that columns stay in the cache.
pub(super) const BLOCK: usize = 256;
/// Distance of two columns in a buffer, whole cache lines; not a power of two, or the columns fall into the same cache set.
const STRIDE: usize = BLOCK + LANES;
/// Numbers in the widest vector, which is a cache line.
pub(super) const LANES: usize = 8;

/// Up to [`BLOCK`] samples of some columns, and before them the sample that came before.
#[derive(Debug)]
pub(super) struct Buffer {
    values: Vec<f64>,
    /// First sample of the first column: it stands at the start of a cache line.
    start: usize,
}

impl Buffer {
    /// Zeros.
    pub(super) fn new(columns: usize) -> Self {
        let values = vec![0.0; columns * STRIDE + 2 * LANES];
        // Alignment is a matter of speed alone: where it cannot be told, any start is right.
        let to_line = values.as_ptr().align_offset(LANES * size_of::<f64>());
        Self {
            values,
            start: LANES + if to_line < LANES { to_line } else { 0 },
        }
    }

    /// All samples of a column.
    #[inline(always)]
    pub(super) fn column(&self, column: usize) -> &[f64] {
        &self.values[self.start + column * STRIDE..][..BLOCK]
    }

    /// The same, to be written.
    #[inline(always)]
    pub(super) fn column_mut(&mut self, column: usize) -> &mut [f64] {
        &mut self.values[self.start + column * STRIDE..][..BLOCK]
    }

    /// The sample before, then all samples of a column.
    #[inline(always)]
    pub(super) fn with_before(&self, column: usize) -> &[f64] {
        &self.values[self.start + column * STRIDE - 1..][..=BLOCK]
    }

    /// Where the sample before stands.
    pub(super) fn before_mut(&mut self, column: usize) -> &mut f64 {
        &mut self.values[self.start + column * STRIDE - 1]
    }
}
