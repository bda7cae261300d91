//! Natural logarithm, exponential and hyperbolic tangent of a whole vector at once.

use pulp::{Simd, bytemuck};

/// ln 2 in two pieces; `k · LN2[0]` is exact for |k| < 2²⁰.
const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// log₂ e.
const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// Adding it rounds to an integer, which then stands in the low bits (1.5 · 2⁵²).
const ROUND: f64 = 6_755_399_441_055_744.0;
/// 2⁵², whose bits take an unsigned integer below 2⁵² as they are.
const TWO_52: f64 = 4_503_599_627_370_496.0;
/// Bits of 1, of the double below √½ that the reduction cuts at, and of a mantissa.
const ONE: u64 = 0x3ff0_0000_0000_0000;
const SQRT_HALF: u64 = 0x3fe6_a09e_0000_0000;
const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
/// Below this `exp` is 0 (the true value is smaller than the smallest normal number).
const EXP_MIN: f64 = -708.0;
/// Above this `exp` stays at e^709.
const EXP_MAX: f64 = 709.0;
/// Above this tanh is 1.
const TANH_ONE: f64 = 20.0;
/// ln(1 + f) = f − f²/2 + s (f²/2 + L₁ s² + …), s = f/(2 + f).
const LOG: [f64; 7] = [
    6.666_666_666_666_735e-1,
    3.999_999_999_940_942e-1,
    2.857_142_874_366_239e-1,
    2.222_219_843_214_978_4e-1,
    1.818_357_216_161_805e-1,
    1.531_383_769_920_937_3e-1,
    1.479_819_860_511_658_6e-1,
];
/// 1/k!, k = 2…13: |r| ≤ ½ ln 2 leaves 4e-18.
const FACTORIALS: [f64; 12] = [
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

/// ln x of positive, normal, finite numbers (others give numbers without meaning), at most 1 ulp off.
///
/// # Source
/// Reduction to [√½, √2) and polynomial of FreeBSD's msun (fdlibm) `e_log.c`.
#[inline(always)]
pub fn ln<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    // x = 2^k m, √½ ≤ m < √2; k is made a floating number by writing it into the bits of 2⁵².
    let (mut k, mut m) = ([x], [x]);
    for (k, m) in lanes_mut(&mut k).iter_mut().zip(lanes_mut(&mut m)) {
        let shifted = k.wrapping_add(ONE - SQRT_HALF);
        *k = (shifted >> 52) | TWO_52.to_bits();
        *m = (shifted & MANTISSA).wrapping_add(SQRT_HALF);
    }
    let k = simd.sub_f64s(k[0], simd.splat_f64s(TWO_52 + 1023.0));
    let f = simd.sub_f64s(m[0], simd.splat_f64s(1.0));
    let s = simd.div_f64s(f, simd.add_f64s(f, simd.splat_f64s(2.0)));
    let z = simd.mul_f64s(s, s);
    let w = simd.mul_f64s(z, z);
    let even = simd.mul_f64s(w, horner(simd, w, [LOG[1], LOG[3], LOG[5], 0.0]));
    let odd = simd.mul_f64s(z, horner(simd, w, [LOG[0], LOG[2], LOG[4], LOG[6]]));
    let half = simd.mul_f64s(simd.mul_f64s(f, simd.splat_f64s(0.5)), f);
    // k ln2 − ((f²/2 − (s (f²/2 + R) + k ln2_low)) − f)
    let rest = simd.add_f64s(half, simd.add_f64s(even, odd));
    let low = simd.mul_add_e_f64s(s, rest, simd.mul_f64s(k, simd.splat_f64s(LN2[1])));
    let inner = simd.sub_f64s(simd.sub_f64s(half, low), f);
    simd.sub_f64s(simd.mul_f64s(k, simd.splat_f64s(LN2[0])), inner)
}

/// e^x, at most 1 ulp off for −708 ≤ x ≤ 709; 0 below, e^709 above.
///
/// # Source
/// Reduction by multiples of ln 2 (Cody and Waite), Taylor polynomial of degree 13.
#[inline(always)]
pub fn exp<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    let (least, most) = (simd.splat_f64s(EXP_MIN), simd.splat_f64s(EXP_MAX));
    let inside = simd.min_f64s(simd.max_f64s(x, least), most);
    let (power, rest) = power_and_rest(simd, inside);
    let value = simd.mul_f64s(simd.add_f64s(rest, simd.splat_f64s(1.0)), power);
    simd.select_f64s(simd.less_than_f64s(x, least), simd.splat_f64s(0.0), value)
}

/// tanh x, within 4 ulp of the standard library's; NaN of NaN.
///
/// # Source
/// `−m/(m + 2)`, `m = e^(−2|x|) − 1 = (2^k − 1) + 2^k (e^r − 1)`: nothing of m is lost, neither near 0 nor far from it.
#[inline(always)]
pub fn tanh<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    let (one, two) = (simd.splat_f64s(1.0), simd.splat_f64s(2.0));
    let size = simd.abs_f64s(x);
    // From here on tanh is 1 to the last bit; the smaller of NaN and a number is the number.
    let inside = simd.min_f64s(size, simd.splat_f64s(TANH_ONE));
    let (power, rest) = power_and_rest(simd, simd.mul_f64s(inside, simd.splat_f64s(-2.0)));
    let m = simd.mul_add_e_f64s(power, rest, simd.sub_f64s(power, one));
    let value = simd.div_f64s(m, simd.add_f64s(m, two));
    let negative = simd.less_than_f64s(simd.splat_f64s(0.0), x);
    let value = simd.select_f64s(negative, simd.neg_f64s(value), value);
    simd.select_f64s(simd.equal_f64s(x, x), value, x)
}

/// `(2^k, e^r − 1)` of x = k ln 2 + r between [`EXP_MIN`] and [`EXP_MAX`].
#[inline(always)]
fn power_and_rest<S: Simd>(simd: S, inside: S::f64s) -> (S::f64s, S::f64s) {
    let round = simd.splat_f64s(ROUND);
    let rounded = simd.mul_add_e_f64s(inside, simd.splat_f64s(LOG2_E), round);
    let k = simd.sub_f64s(rounded, round);
    let r = simd.mul_add_e_f64s(k, simd.splat_f64s(-LN2[0]), inside);
    let r = simd.mul_add_e_f64s(k, simd.splat_f64s(-LN2[1]), r);
    let r2 = simd.mul_f64s(r, r);
    let r4 = simd.mul_f64s(r2, r2);
    let (low, middle, high) = (
        four(simd, r, r2, 0),
        four(simd, r, r2, 4),
        four(simd, r, r2, 8),
    );
    let tail = simd.mul_add_e_f64s(r4, simd.mul_add_e_f64s(r4, high, middle), low);
    let rest = simd.mul_add_e_f64s(r2, tail, r);
    // k + 1023 ∈ [2, 2046]: a normal power of two.
    let mut power = [rounded];
    for power in lanes_mut(&mut power) {
        *power = power.wrapping_add(1023) << 52;
    }
    (power[0], rest)
}

/// The bits of a vector's lanes.
#[inline(always)]
fn lanes_mut<V: bytemuck::Pod>(vector: &mut [V; 1]) -> &mut [u64] {
    bytemuck::cast_slice_mut(vector)
}

/// c₀ + x (c₁ + x (c₂ + x c₃)).
#[inline(always)]
fn horner<S: Simd>(simd: S, x: S::f64s, c: [f64; 4]) -> S::f64s {
    let p = simd.mul_add_e_f64s(x, simd.splat_f64s(c[3]), simd.splat_f64s(c[2]));
    let p = simd.mul_add_e_f64s(x, p, simd.splat_f64s(c[1]));
    simd.mul_add_e_f64s(x, p, simd.splat_f64s(c[0]))
}

/// Four terms of the exponential's series from coefficient i on: (a + r b) + r² (c + r d).
#[inline(always)]
fn four<S: Simd>(simd: S, r: S::f64s, r2: S::f64s, i: usize) -> S::f64s {
    let low = simd.mul_add_e_f64s(
        r,
        simd.splat_f64s(FACTORIALS[i + 1]),
        simd.splat_f64s(FACTORIALS[i]),
    );
    let high = simd.mul_add_e_f64s(
        r,
        simd.splat_f64s(FACTORIALS[i + 3]),
        simd.splat_f64s(FACTORIALS[i + 2]),
    );
    simd.mul_add_e_f64s(r2, high, low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{LANES, Lane};
    use pulp::WithSimd;

    struct Both(Lane);

    impl WithSimd for Both {
        type Output = [Lane; 3];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let (mut l, mut e, mut t) = (self.0, self.0, self.0);
            S::as_mut_simd_f64s(&mut l)
                .0
                .iter_mut()
                .for_each(|x| *x = super::ln(simd, *x));
            S::as_mut_simd_f64s(&mut e)
                .0
                .iter_mut()
                .for_each(|x| *x = super::exp(simd, *x));
            S::as_mut_simd_f64s(&mut t)
                .0
                .iter_mut()
                .for_each(|x| *x = super::tanh(simd, *x));
            [l, e, t]
        }
    }

    fn ln(x: &Lane) -> Lane {
        pulp::Arch::new().dispatch(Both(*x))[0]
    }

    fn exp(x: &Lane) -> Lane {
        pulp::Arch::new().dispatch(Both(*x))[1]
    }

    fn tanh(x: &Lane) -> Lane {
        pulp::Arch::new().dispatch(Both(*x))[2]
    }

    #[test]
    fn hyperbolic_tangent_is_accurate_near_zero_and_far_from_it() {
        let mut worst = 0.0f64;
        for i in -200_000..200_000i32 {
            let x = f64::from(i) * 1e-4;
            for x in [x, x * 1e-3, x * 1e-9] {
                worst = worst.max(ulps(tanh(&[x; LANES])[6], x.tanh()));
            }
        }
        assert!(worst <= 4.0, "{worst} ulp");
        let out = tanh(&[
            0.0,
            -0.0,
            f64::INFINITY,
            f64::NEG_INFINITY,
            19.9,
            -1e9,
            1e-300,
            f64::NAN,
        ]);
        assert_eq!(out[..7], [0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1e-300]);
        assert!(out[7].is_nan());
    }

    /// Distance in units of the last place of `b`.
    fn ulps(a: f64, b: f64) -> f64 {
        (a - b).abs() / (b.abs().max(f64::MIN_POSITIVE) * f64::EPSILON)
    }

    /// The standard library's functions are within 1 ulp themselves, so 2 is what can be promised against them.
    #[test]
    fn logarithm_is_accurate_over_the_whole_range() {
        let mut worst = 0.0f64;
        for i in 0..400_000i32 {
            let x = 10f64.powf(f64::from(i) / 400_000.0 * 600.0 - 300.0)
                * (1.0 + f64::from(i % 97) / 97.0);
            let near_one = 1.0 + f64::from(i - 200_000) * 1e-6;
            for x in [x, near_one] {
                worst = worst.max(ulps(ln(&[x; LANES])[3], x.ln()));
            }
        }
        assert!(worst <= 2.0, "{worst} ulp");
        assert_eq!(ln(&[1.0; LANES]), [0.0; LANES]);
    }

    #[test]
    fn exponential_is_accurate_and_never_overflows() {
        let mut worst = 0.0f64;
        for i in 0..400_000i32 {
            let x = -708.0 + 1417.0 * f64::from(i) / 400_000.0;
            for x in [x, x * 1e-3, x * 1e-9] {
                worst = worst.max(ulps(exp(&[x; LANES])[5], x.exp()));
            }
        }
        assert!(worst <= 2.0, "{worst} ulp");
        let out = exp(&[
            -1e300,
            f64::NEG_INFINITY,
            -708.1,
            0.0,
            709.0,
            1e9,
            f64::INFINITY,
            1.0,
        ]);
        assert_eq!(out[..4], [0.0, 0.0, 0.0, 1.0]);
        assert!(out[4].is_finite() && out[5] == out[4] && out[6] == out[4]);
        assert!(ulps(out[7], std::f64::consts::E) <= 1.0);
    }
}
