//! The discrete Fourier transform of a length that is a power of two.
//!
//! Radix 2 in time with the turns of every stage side by side, products and sums rounded one by one: the same bytes on any
//! instruction set.

use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

/// What every length up to 2¹⁶ needs, once it was asked for: logs of one robot ask for the same few.
static KNOWN: [OnceLock<Arc<Fourier>>; 17] = [const { OnceLock::new() }; 17];

/// What a length needs.
#[derive(Debug)]
pub(crate) struct Fourier {
    size: usize,
    /// cos and sin of `−π k/half` for half = 2, 4, … and k < half, stage after stage.
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl Fourier {
    /// For a power of two, at least 4.
    pub(crate) fn new(size: usize) -> Arc<Self> {
        debug_assert!(size.is_power_of_two() && size >= 4, "length {size}");
        let new = || Arc::new(Self::turns(size));
        match KNOWN.get(size.trailing_zeros() as usize) {
            Some(known) => known.get_or_init(new).clone(),
            None => new(),
        }
    }

    fn turns(size: usize) -> Self {
        let halves = std::iter::successors(Some(2), |half| Some(2 * half));
        let (cos, sin) = halves
            .take_while(|half| *half < size)
            .flat_map(|half| (0..half).map(move |k| -PI * k as f64 / half as f64))
            .map(|angle| (angle.cos(), angle.sin()))
            .unzip();
        Self { size, cos, sin }
    }

    /// `X_k = Σ_n x_n e^{−2πi kn/size}` in place.
    pub(crate) fn forward(&self, re: &mut [f64], im: &mut [f64]) {
        Arch::new().dispatch(Forward {
            plan: self,
            re: &mut re[..self.size],
            im: &mut im[..self.size],
        });
    }

    /// `x_n = Σ_k X_k e^{2πi kn/size}` in place: `size` times the inverse of [`Fourier::forward`].
    pub(crate) fn backward(&self, re: &mut [f64], im: &mut [f64]) {
        self.forward(im, re); // swapping parts conjugates before and after
    }
}

struct Forward<'a> {
    plan: &'a Fourier,
    re: &'a mut [f64],
    im: &'a mut [f64],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { plan, re, im } = self;
        let size = plan.size;
        let bits = size.trailing_zeros();
        for i in 0..size {
            let j = i.reverse_bits() >> (usize::BITS - bits);
            if i < j {
                re.swap(i, j);
                im.swap(i, j);
            }
        }
        for (re, im) in re
            .as_chunks_mut::<2>()
            .0
            .iter_mut()
            .zip(im.as_chunks_mut::<2>().0)
        {
            *re = [re[0] + re[1], re[0] - re[1]];
            *im = [im[0] + im[1], im[0] - im[1]];
        }
        let mut half = 2;
        while half < size {
            // The tables of the stages before this one have 2 + 4 + … + half/2 entries.
            let (cos, sin) = (&plan.cos[half - 2..][..half], &plan.sin[half - 2..][..half]);
            for (re, im) in re
                .chunks_exact_mut(2 * half)
                .zip(im.chunks_exact_mut(2 * half))
            {
                let (re_a, re_b) = re.split_at_mut(half);
                let (im_a, im_b) = im.split_at_mut(half);
                let (re_b, im_a, im_b) = (&mut re_b[..half], &mut im_a[..half], &mut im_b[..half]);
                for k in 0..half {
                    let x = re_b[k] * cos[k] - im_b[k] * sin[k];
                    let y = re_b[k] * sin[k] + im_b[k] * cos[k];
                    re_b[k] = re_a[k] - x;
                    im_b[k] = im_a[k] - y;
                    re_a[k] += x;
                    im_a[k] += y;
                }
            }
            half *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the definition, and back again.
    #[test]
    fn the_transform_is_its_definition() {
        for size in [4, 8, 64, 256] {
            let wave = |n: usize, a: f64| (n as f64 * a + 0.3).sin() + 0.1 * n as f64;
            let (x, y): (Vec<f64>, Vec<f64>) =
                (0..size).map(|n| (wave(n, 0.7), wave(n, 1.9))).unzip();
            let (mut re, mut im) = (x.clone(), y.clone());
            let plan = Fourier::new(size);
            plan.forward(&mut re, &mut im);
            for k in 0..size {
                let (mut sum_re, mut sum_im) = (0.0, 0.0);
                for n in 0..size {
                    let (sin, cos) = (-2.0 * PI * ((k * n) % size) as f64 / size as f64).sin_cos();
                    sum_re += x[n] * cos - y[n] * sin;
                    sum_im += x[n] * sin + y[n] * cos;
                }
                let off = (re[k] - sum_re).abs().max((im[k] - sum_im).abs());
                assert!(off < 1e-10, "{size}: {k} off by {off}");
            }
            plan.backward(&mut re, &mut im);
            for n in 0..size {
                let size = size as f64;
                assert!((re[n] / size - x[n]).abs() < 1e-12 && (im[n] / size - y[n]).abs() < 1e-12);
            }
        }
    }
}
