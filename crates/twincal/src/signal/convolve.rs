//! Applying a kernel: every sample (motion) or only the kept ones (rows), eight lanes at a time.
//!
//! Lanes are multiplied and added in one fixed order with one rounding each, so an output depends only on its own
//! window of input: not on the instruction set, the chunk it was computed in or the thread.

use crate::lanes::LANES;
use pulp::{Arch, Simd, WithSimd};

/// `Σ_k kernel_k x_k` over slices of one length.
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
    let mut rest = 0.0;
    for (h, v) in kernel_rest.iter().zip(x_rest) {
        rest += h * v;
    }
    let mut total = rest;
    for lane in 0..LANES {
        total += sums[0][lane] + sums[1][lane];
    }
    total
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
