//! Kernels over every sample: motion filters and their derivatives.
//!
//! Short kernels are summed as they stand, 32 outputs side by side. Long ones go through the Fourier transform in blocks
//! (overlap-save, Oppenheim & Schafer, section 8.7) of fixed length: a kernel of 300 taps costs a tenth. Neither depends
//! on instruction set or thread.

use super::fourier::Fourier;
use crate::lanes::LANES;
use pulp::{Arch, Simd, WithSimd};
use std::sync::Arc;

/// Neighbouring outputs that are summed side by side.
const BLOCK: usize = 4 * LANES;
/// Fewest taps, and fewest outputs per tap, from which the transform is faster.
const LONG: usize = 64;
const MANY: usize = 4;
/// Samples per tap that a transform takes at a time, at least.
const PER_TAP: usize = 4;

/// `out_i = Σ_k kernel_k x_{i+k}`: a symmetric kernel centred on sample `i + half` of `x`.
///
/// # Panics
/// If `x` is shorter than `out.len() − 1 + kernel.len()`.
pub(crate) fn correlate(kernel: &[f64], x: &[f64], out: &mut [f64]) {
    require(kernel, x, out);
    if is_long(kernel, out) {
        Blocks::new(kernel, None).run(x, out, None);
    } else {
        Arch::new().dispatch(Every { kernel, x, out });
    }
}

/// [`correlate`] with two kernels of one length, for less than twice the work.
///
/// # Panics
/// As [`correlate`], and if the lengths differ.
pub(crate) fn correlate_two(kernels: [&[f64]; 2], x: &[f64], outs: [&mut [f64]; 2]) {
    let [first, second] = outs;
    assert!(
        kernels[0].len() == kernels[1].len() && first.len() == second.len(),
        "kernels and outputs in pairs"
    );
    require(kernels[0], x, first);
    if is_long(kernels[0], first) {
        Blocks::new(kernels[0], Some(kernels[1])).run(x, first, Some(second));
    } else {
        correlate(kernels[0], x, first);
        correlate(kernels[1], x, second);
    }
}

fn require(kernel: &[f64], x: &[f64], out: &[f64]) {
    let needed = out
        .len()
        .checked_sub(1)
        .map_or(0, |last| last + kernel.len());
    assert!(
        x.len() >= needed,
        "{} samples for a kernel that needs {needed}",
        x.len()
    );
}

fn is_long(kernel: &[f64], out: &[f64]) -> bool {
    kernel.len() >= LONG && out.len() >= MANY * kernel.len()
}

/// The sum as it stands: lanes along the outputs, each in the order of the kernel.
struct Every<'a> {
    kernel: &'a [f64],
    x: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Every<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { kernel, x, out } = self;
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
}

/// One or two kernels, transformed: `k₁ + i k₂` over real samples gives both outputs at once, as real and imaginary part.
struct Blocks {
    fourier: Arc<Fourier>,
    size: usize,
    taps: usize,
    re: Vec<f64>,
    im: Vec<f64>,
    /// Σ of each kernel: what it makes of a constant.
    sums: [f64; 2],
}

impl Blocks {
    fn new(first: &[f64], second: Option<&[f64]>) -> Self {
        let taps = first.len();
        let size = (PER_TAP * taps).next_power_of_two();
        let fourier = Fourier::new(size);
        let reversed = |kernel: &[f64]| -> Vec<f64> {
            let mut values: Vec<f64> = kernel.iter().rev().map(|h| h / size as f64).collect();
            values.resize(size, 0.0);
            values
        };
        let mut re = reversed(first);
        let mut im = second.map_or_else(|| vec![0.0; size], reversed);
        fourier.forward(&mut re, &mut im);
        Self {
            fourier,
            size,
            taps,
            re,
            im,
            sums: [first, second.unwrap_or(&[])].map(|kernel| kernel.iter().sum()),
        }
    }

    fn run(&self, x: &[f64], first: &mut [f64], mut second: Option<&mut [f64]>) {
        let fresh = self.size - self.taps + 1;
        let (mut re, mut im) = (vec![0.0; self.size], vec![0.0; self.size]);
        for start in (0..first.len()).step_by(fresh) {
            let count = fresh.min(first.len() - start);
            let samples = &x[start..start + count + self.taps - 1];
            // An offset goes past the transform: rounding is then that of the motion, not of where it takes place.
            let offset = samples[0];
            for (re, x) in re.iter_mut().zip(samples) {
                *re = x - offset;
            }
            re[samples.len()..].fill(0.0);
            im.fill(0.0);
            self.fourier.forward(&mut re, &mut im);
            for (k, (re, im)) in re.iter_mut().zip(&mut im).enumerate() {
                (*re, *im) = (
                    *re * self.re[k] - *im * self.im[k],
                    *re * self.im[k] + *im * self.re[k],
                );
            }
            self.fourier.backward(&mut re, &mut im);
            let valid = self.taps - 1..self.taps - 1 + count;
            for (out, value) in first[start..].iter_mut().zip(&re[valid.clone()]) {
                *out = value + offset * self.sums[0];
            }
            if let Some(second) = &mut second {
                for (out, value) in second[start..].iter_mut().zip(&im[valid]) {
                    *out = value + offset * self.sums[1];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both ways against the brute-force sum, with an offset that would swamp the transform.
    #[test]
    fn every_sample_is_the_brute_force_sum() {
        let x: Vec<f64> = (0..9000)
            .map(|i| 1e3 + (f64::from(i) * 0.37).sin())
            .collect();
        for taps in [1, 7, 33, 75, 301] {
            let kernel = |a: f64| -> Vec<f64> {
                (0..taps)
                    .map(|k| (k as f64 * a).cos() / (1.0 + k as f64))
                    .collect()
            };
            let kernels = [kernel(0.0), kernel(0.9)];
            for count in [1, 40, 5000, x.len() - taps + 1] {
                let (mut a, mut b, mut c) = (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
                correlate(&kernels[0], &x, &mut a);
                correlate_two([&kernels[0], &kernels[1]], &x, [&mut b, &mut c]);
                for i in 0..count {
                    let sum = |kernel: &[f64]| -> f64 {
                        kernel.iter().zip(&x[i..]).map(|(h, x)| h * x).sum()
                    };
                    for (value, kernel) in [(a[i], 0), (b[i], 0), (c[i], 1)] {
                        let expected = sum(&kernels[kernel]);
                        let off = (value - expected).abs();
                        assert!(
                            off < 2e-11,
                            "{taps} taps, {count} outputs: {i} off by {off}"
                        );
                    }
                }
            }
        }
    }
}
