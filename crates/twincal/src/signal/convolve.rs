//! Applying a kernel: every sample (motion) or only the kept ones (rows), eight lanes at a time.
//!
//! Lanes are multiplied and added in one fixed order with one rounding each, so an output depends only on its own
//! window of input: not on the instruction set, the chunk it was computed in or the thread.

use crate::lanes::LANES;
use pulp::{Arch, Simd, WithSimd};

/// Neighbouring outputs that are summed side by side.
const BLOCK: usize = 4 * LANES;

/// `Σ_k kernel_k x_k` over slices of one length: lanes along the kernel.
#[inline(always)]
fn dot(kernel: &[f64], x: &[f64]) -> f64 {
    // Two groups of eight sums hide the latency of the addition.
    let mut sums = [[0.0; LANES]; 2];
    let (kernel_pairs, kernel_rest) = kernel.as_chunks::<{ 2 * LANES }>();
    let (x_pairs, x_rest) = x.as_chunks::<{ 2 * LANES }>();
    for (h, v) in kernel_pairs.iter().zip(x_pairs) {
        for lane in 0..LANES {
            sums[0][lane] += h[lane] * v[lane];
            sums[1][lane] += h[LANES + lane] * v[LANES + lane];
        }
    }
    let (kernel_lanes, kernel_rest) = kernel_rest.as_chunks::<LANES>();
    let (x_lanes, x_rest) = x_rest.as_chunks::<LANES>();
    for (h, v) in kernel_lanes.iter().zip(x_lanes) {
        for lane in 0..LANES {
            sums[0][lane] += h[lane] * v[lane];
        }
    }
    let mut total = 0.0;
    for (h, v) in kernel_rest.iter().zip(x_rest) {
        total += h * v;
    }
    for lane in 0..LANES {
        total += sums[0][lane] + sums[1][lane];
    }
    total
}

/// Every sample: lanes along the outputs, each the plain sum in the order of the kernel.
#[inline(always)]
fn every(kernel: &[f64], x: &[f64], out: &mut [f64]) {
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let done = blocks.len() * BLOCK;
    for (b, block) in blocks.iter_mut().enumerate() {
        let mut sums = [0.0; BLOCK];
        for (h, window) in kernel.iter().zip(x[b * BLOCK..].windows(BLOCK)) {
            for lane in 0..BLOCK {
                sums[lane] += h * window[lane];
            }
        }
        *block = sums;
    }
    for (i, out) in rest.iter_mut().enumerate() {
        let mut sum = 0.0;
        for (h, v) in kernel.iter().zip(&x[done + i..]) {
            sum += h * v;
        }
        *out = sum;
    }
}

/// See [`correlate`].
struct Correlate<'a> {
    kernel: &'a [f64],
    x: &'a [f64],
    step: usize,
    out: &'a mut [f64],
}

impl WithSimd for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        if self.step == 1 {
            every(self.kernel, self.x, self.out);
            return;
        }
        let taps = self.kernel.len();
        for (i, out) in self.out.iter_mut().enumerate() {
            let start = i * self.step;
            *out = dot(self.kernel, &self.x[start..start + taps]);
        }
    }
}

/// `out_i = Σ_k kernel_k x_{i·step + k}`: a symmetric kernel centred on sample `i·step + half` of `x`, every `step`-th sample.
///
/// # Panics
/// If `x` is shorter than `(out.len() − 1)·step + kernel.len()`.
pub(crate) fn correlate(kernel: &[f64], x: &[f64], step: usize, out: &mut [f64]) {
    let needed = out
        .len()
        .checked_sub(1)
        .map_or(0, |last| last * step + kernel.len());
    assert!(
        x.len() >= needed,
        "{} samples for a kernel that needs {needed}",
        x.len()
    );
    Arch::new().dispatch(Correlate {
        kernel,
        x,
        step,
        out,
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kept_sample_is_the_brute_force_sum() {
        let x: Vec<f64> = (0..301).map(|i| (f64::from(i) * 0.37).sin()).collect();
        for taps in [1, 7, 16, 17, 33, 75] {
            let kernel: Vec<f64> = (0..taps).map(|k| 1.0 / (1.0 + k as f64)).collect();
            for step in [1, 3, 80] {
                let n = (x.len() - taps) / step + 1;
                let mut out = vec![0.0; n];
                correlate(&kernel, &x, step, &mut out);
                for (i, value) in out.iter().enumerate() {
                    let mut expected = 0.0;
                    for k in 0..taps {
                        expected += kernel[k] * x[i * step + k];
                    }
                    assert!((value - expected).abs() < 1e-14);
                }
            }
        }
    }
}
