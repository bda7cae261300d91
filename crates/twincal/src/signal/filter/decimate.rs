//! Filter and decimate many signals side by side: every sample is met once and added to all rows whose window holds it.
//!
//! A row is the plain sum `Σ_k kernel_k x_{row·step + k}` in the order of the samples: the same bytes however the samples
//! were cut and on any thread.

use crate::lanes::Line;
use pulp::{Arch, Simd, WithSimd};

/// Rows of a group: what the widest vector holds. Two groups are added to side by side.
const ROWS: usize = 8;

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
    weights: Weights,
}

/// The kernel as the rows of some groups see the samples at hand.
#[derive(Debug, Default)]
struct Weights {
    /// `values[group * len + sample]`, one for each row of the group.
    values: Vec<Line<[f64; ROWS]>>,
    /// How many samples lie between the start of the first row's window and the first sample at hand, how many samples and groups
    /// there are. Where that stays the same, so do the weights.
    made_for: Option<(isize, usize, usize)>,
}

impl<'a> Decimator<'a> {
    /// For `rows` rows of some signals; row r is the sum over samples `r·step .. r·step + kernel.len()`.
    pub(crate) fn new(kernel: &'a [f64], step: usize, rows: usize, signals: usize) -> Self {
        let stride = (rows + ROWS).next_multiple_of(ROWS);
        Self {
            kernel,
            step,
            rows,
            stride,
            sums: vec![0.0; signals * stride],
            weights: Weights::default(),
        }
    }

    /// Distance between signals in [`Decimator::sums`].
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// Rows of `count` signals from signal `first` on, `stride` apart; what stands behind the last row has no meaning.
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
        if first >= end {
            return;
        }
        let groups = (end - first).div_ceil(ROWS);
        let before = from as isize - (first * self.step) as isize;
        self.weights
            .make(self.kernel, self.step, before, len, groups);
        Arch::new().dispatch(Add {
            weights: &self.weights.values,
            len,
            signals,
            sums: &mut self.sums,
            stride: self.stride,
            row: first,
        });
    }
}

impl Weights {
    /// What rows multiply `len` samples with, the first of which is sample `before` of the first row's window.
    fn make(&mut self, kernel: &[f64], step: usize, before: isize, len: usize, groups: usize) {
        let wanted = Some((before, len, groups));
        if self.made_for == wanted {
            return;
        }
        self.made_for = wanted;
        self.values.clear();
        self.values.resize(groups * len, Line([0.0; ROWS]));
        for (group, values) in self.values.chunks_exact_mut(len).enumerate() {
            for (sample, weights) in values.iter_mut().enumerate() {
                for (lane, weight) in weights.0.iter_mut().enumerate() {
                    let row = group * ROWS + lane;
                    let tap = before + sample as isize - (row * step) as isize;
                    *weight = usize::try_from(tap)
                        .ok()
                        .and_then(|tap| kernel.get(tap))
                        .map_or(0.0, |value| *value);
                }
            }
        }
    }
}

/// See [`Decimator::add`].
struct Add<'a> {
    weights: &'a [Line<[f64; ROWS]>],
    len: usize,
    signals: &'a [(usize, &'a [f64])],
    sums: &'a mut [f64],
    stride: usize,
    row: usize,
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _simd: S) {
        let groups = self.weights.len() / self.len;
        for group in (0..groups).step_by(2) {
            if group + 1 < groups {
                self.groups::<S, 2>(group);
            } else {
                self.groups::<S, 1>(group);
            }
        }
    }
}

impl Add<'_> {
    /// All signals into `G` groups of rows: as many signals at a time as sums fit into the registers, each loaded weight serves all.
    #[inline(always)]
    fn groups<S: Simd, const G: usize>(&mut self, group: usize) {
        let len = self.len;
        for &(first, values) in self.signals {
            let count = values.len() / len;
            let mut i = 0;
            while S::REGISTER_COUNT >= 32 && S::F64_LANES >= ROWS && i + 4 <= count {
                self.some::<S, G, 4>(group, first + i, &values[i * len..]);
                i += 4;
            }
            while i + 2 <= count {
                self.some::<S, G, 2>(group, first + i, &values[i * len..]);
                i += 2;
            }
            if i < count {
                self.some::<S, G, 1>(group, first + i, &values[i * len..]);
            }
        }
    }

    /// `N` signals from `first` on into `G` groups of rows.
    #[inline(always)]
    fn some<S: Simd, const G: usize, const N: usize>(
        &mut self,
        group: usize,
        first: usize,
        values: &[f64],
    ) {
        let len = self.len;
        let weights: [&[Line<[f64; ROWS]>]; G] =
            std::array::from_fn(|g| &self.weights[(group + g) * len..][..len]);
        let signals: [&[f64]; N] = std::array::from_fn(|n| &values[n * len..][..len]);
        let own = first * self.stride + self.row + group * ROWS;
        let mut sums = [[[0.0; ROWS]; G]; N];
        for n in 0..N {
            for g in 0..G {
                let at = own + n * self.stride + g * ROWS;
                sums[n][g].copy_from_slice(&self.sums[at..at + ROWS]);
            }
        }
        for sample in 0..len {
            for n in 0..N {
                let x = signals[n][sample];
                for g in 0..G {
                    let weight = &weights[g][sample].0;
                    for r in 0..ROWS {
                        sums[n][g][r] = multiply_add::<S>(weight[r], x, sums[n][g][r]);
                    }
                }
            }
        }
        for n in 0..N {
            for g in 0..G {
                let at = own + n * self.stride + g * ROWS;
                self.sums[at..at + ROWS].copy_from_slice(&sums[n][g]);
            }
        }
    }
}

/// `a b + c`, rounded once on instructions with four lanes and more, which all can.
#[inline(always)]
fn multiply_add<S: Simd>(a: f64, b: f64, c: f64) -> f64 {
    if S::F64_LANES >= 4 {
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any cut of the samples, any step: the plain sum, the same to the bit however the samples were cut.
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
            let sums = |cut: usize| {
                let mut decimator = Decimator::new(&kernel, step, rows, signals as usize);
                for from in (0..samples as usize).step_by(cut) {
                    let len = cut.min(samples as usize - from);
                    let of = |s: usize| &x[s][from..from + len];
                    let three: Vec<f64> = (0..3).flat_map(of).copied().collect();
                    decimator.add(from, len, &[(0, &three), (3, of(3)), (4, of(4))]);
                }
                let rows = |s: usize| decimator.sums(s, 1)[..rows].to_vec();
                (0..signals as usize).map(rows).collect::<Vec<_>>()
            };
            let cut_up = sums(cut);
            assert_eq!(cut_up, sums(samples as usize), "{taps} taps, step {step}");
            for (s, x) in x.iter().enumerate() {
                for (row, sum) in cut_up[s].iter().enumerate() {
                    let window = kernel.iter().zip(&x[row * step..]);
                    let expected: f64 = window.map(|(h, x)| h * x).sum();
                    assert!(
                        (sum - expected).abs() < 1e-14,
                        "{taps} taps, step {step}: row {row} of {s}: {sum} instead of {expected}"
                    );
                }
            }
        }
    }
}
