//! Filter and decimate many signals side by side: every sample is met once and added to all rows whose window holds it.
//!
//! A row is the plain sum `Σ_k kernel_k x_{row·step + k}` in the order of the samples, one rounding per product and per
//! sum: the same bytes however the samples were cut, on any instruction set and thread.

use pulp::{Arch, Simd, WithSimd};

/// Rows that are added to side by side.
const ROWS: usize = 16;

/// Sums of some signals over the same rows.
#[derive(Debug)]
pub(crate) struct Decimator<'a> {
    kernel: &'a [f64],
    step: usize,
    rows: usize,
    /// Rows, padded.
    stride: usize,
    /// `sums[signal * stride + row]`.
    sums: Vec<f64>,
    /// `weights[group][sample]`: the kernel as each row of a group of rows sees the samples at hand.
    weights: Vec<[f64; ROWS]>,
}

impl<'a> Decimator<'a> {
    /// For `rows` rows of some signals; row r is the sum over samples `r·step .. r·step + kernel.len()`.
    pub(crate) fn new(kernel: &'a [f64], step: usize, rows: usize, signals: usize) -> Self {
        let stride = (rows + ROWS).next_multiple_of(8);
        Self {
            kernel,
            step,
            rows,
            stride,
            sums: vec![0.0; signals * stride],
            weights: Vec::new(),
        }
    }

    /// Distance between signals in [`Decimator::sums`].
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// Rows of `count` signals from signal `first` on, `stride` apart.
    pub(crate) fn sums(&self, first: usize, count: usize) -> &[f64] {
        &self.sums[first * self.stride..(first + count) * self.stride]
    }

    /// Adds the next samples `from .. from + len` of every signal: those of each `(first, values)` are signals first,
    /// first + 1, …, signal after signal, `len` each. Samples must come in order.
    pub(crate) fn add(&mut self, from: usize, len: usize, signals: &[(usize, &[f64])]) {
        // rows whose window ends after `from` and begins before `from + len`
        let first = (from + 1)
            .saturating_sub(self.kernel.len())
            .div_ceil(self.step);
        let end = ((from + len).div_ceil(self.step)).min(self.rows);
        let mut row = first;
        while row < end {
            self.weigh(from, len, row);
            Arch::new().dispatch(Add {
                weights: &self.weights,
                signals,
                sums: &mut self.sums,
                stride: self.stride,
                row,
            });
            row += ROWS;
        }
    }

    /// What rows `row .. row + ROWS` multiply samples `from .. from + len` with.
    fn weigh(&mut self, from: usize, len: usize, row: usize) {
        self.weights.clear();
        self.weights.resize(len, [0.0; ROWS]);
        for lane in (0..ROWS).filter(|lane| row + lane < self.rows) {
            let start = (row + lane) * self.step;
            let (begin, end) = (start.max(from), (start + self.kernel.len()).min(from + len));
            for sample in begin..end {
                self.weights[sample - from][lane] = self.kernel[sample - start];
            }
        }
    }
}

/// See [`Decimator::add`].
struct Add<'a> {
    weights: &'a [[f64; ROWS]],
    signals: &'a [(usize, &'a [f64])],
    sums: &'a mut [f64],
    stride: usize,
    row: usize,
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let len = self.weights.len();
        for &(first, values) in self.signals {
            let mut signals = values.chunks_exact(len).enumerate();
            while let Some((i, x)) = signals.next() {
                let own = (first + i) * self.stride + self.row;
                match signals.next() {
                    Some((_, y)) => two(self.weights, x, y, self.sums, own, self.stride),
                    None => one(self.weights, x, self.sums, own),
                }
            }
        }
    }
}

/// One signal into the sums that start at `own`.
#[inline(always)]
fn one(weights: &[[f64; ROWS]], x: &[f64], sums: &mut [f64], own: usize) {
    let Some((sums, _)) = sums[own..].split_first_chunk_mut::<ROWS>() else {
        return;
    };
    let mut a = *sums;
    for (w, x) in weights.iter().zip(x) {
        for r in 0..ROWS {
            a[r] += w[r] * x;
        }
    }
    *sums = a;
}

/// Two signals, `stride` apart: the weights are loaded once.
#[inline(always)]
fn two(weights: &[[f64; ROWS]], x: &[f64], y: &[f64], sums: &mut [f64], own: usize, stride: usize) {
    let (left, right) = sums[own..].split_at_mut(stride);
    let (Some((left, _)), Some((right, _))) = (
        left.split_first_chunk_mut::<ROWS>(),
        right.split_first_chunk_mut::<ROWS>(),
    ) else {
        return;
    };
    let (mut a, mut b) = (*left, *right);
    for ((w, x), y) in weights.iter().zip(x).zip(y) {
        for r in 0..ROWS {
            a[r] += w[r] * x;
            b[r] += w[r] * y;
        }
    }
    (*left, *right) = (a, b);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any cut of the samples, any step: the plain sum, to the bit.
    #[test]
    fn every_row_is_the_plain_sum() {
        let (samples, signals) = (301, 5);
        let x: Vec<Vec<f64>> = (0..signals)
            .map(|s| {
                (0..samples)
                    .map(|i| (f64::from(i) * (0.37 + f64::from(s))).sin())
                    .collect()
            })
            .collect();
        for (taps, step, cut) in [
            (1, 1, 64),
            (7, 3, 10),
            (75, 1, 64),
            (75, 6, 13),
            (33, 80, 64),
        ] {
            let kernel: Vec<f64> = (0..taps).map(|k| 1.0 / (1.0 + k as f64)).collect();
            let rows = (samples as usize - taps) / step + 1;
            let mut decimator = Decimator::new(&kernel, step, rows, signals as usize);
            let mut from = 0;
            while from < samples as usize {
                let len = cut.min(samples as usize - from);
                let of = |s: usize| &x[s][from..from + len];
                let three: Vec<f64> = (0..3).flat_map(of).copied().collect();
                decimator.add(from, len, &[(0, &three), (3, of(3)), (4, of(4))]);
                from += len;
            }
            for (s, x) in x.iter().enumerate() {
                for (row, sum) in decimator.sums(s, 1)[..rows].iter().enumerate() {
                    let mut expected = 0.0;
                    for k in 0..taps {
                        expected += kernel[k] * x[row * step + k];
                    }
                    assert_eq!(*sum, expected, "{taps} taps, step {step}: row {row} of {s}");
                }
            }
        }
    }
}
