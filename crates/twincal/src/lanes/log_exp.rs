//! Natural logarithm and exponential of eight numbers at once.

use super::{LANES, Lane};

/// ln 2 in two pieces; `k · LN2[0]` is exact for |k| < 2²⁰.
const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// log₂ e.
const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// Adding it rounds to an integer, which then stands in the low bits (1.5 · 2⁵²).
const ROUND: f64 = 6_755_399_441_055_744.0;
/// 2⁵², whose bits take an unsigned integer below 2⁵² as they are.
const TWO_52: f64 = 4_503_599_627_370_496.0;
/// Below this `exp` is 0 (the true value is smaller than the smallest normal number).
const EXP_MIN: f64 = -708.0;
/// Above this `exp` stays at e^709.
const EXP_MAX: f64 = 709.0;
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

/// ln x of eight positive, normal, finite numbers (others give numbers without meaning), at most 1 ulp off.
///
/// # Source
/// Reduction to [√½, √2) and polynomial of FreeBSD's msun (fdlibm) `e_log.c`.
#[inline(always)]
pub fn ln(x: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = ln_one(x[lane]);
    }
    out
}

/// e^x of eight numbers, at most 1 ulp off for −708 ≤ x ≤ 709; 0 below, e^709 above.
///
/// # Source
/// Reduction by multiples of ln 2 (Cody and Waite), Taylor polynomial of degree 13.
#[inline(always)]
pub fn exp(x: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = exp_one(x[lane]);
    }
    out
}

#[inline(always)]
fn ln_one(x: f64) -> f64 {
    // x = 2^k m, √½ ≤ m < √2; k is made a floating number by writing it into the bits of 2⁵².
    let bits = x.to_bits();
    let shifted = bits.wrapping_add(0x3ff0_0000_0000_0000 - 0x3fe6_a09e_0000_0000);
    let k = f64::from_bits((shifted >> 52) | TWO_52.to_bits()) - (TWO_52 + 1023.0);
    let m = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff).wrapping_add(0x3fe6_a09e_0000_0000));
    let f = m - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (LOG[1] + w * (LOG[3] + w * LOG[5]));
    let odd = z * (LOG[0] + w * (LOG[2] + w * (LOG[4] + w * LOG[6])));
    let half = 0.5 * f * f;
    k * LN2[0] - ((half - (s * (half + (even + odd)) + k * LN2[1])) - f)
}

#[inline(always)]
fn exp_one(x: f64) -> f64 {
    let raised = if x > EXP_MIN { x } else { EXP_MIN };
    let inside = if raised < EXP_MAX { raised } else { EXP_MAX };
    let rounded = inside * LOG2_E + ROUND;
    let k = rounded - ROUND;
    let r = (inside - k * LN2[0]) - k * LN2[1];
    let p = &FACTORIALS;
    let (r2, r4) = (r * r, (r * r) * (r * r));
    let low = (p[0] + r * p[1]) + r2 * (p[2] + r * p[3]);
    let middle = (p[4] + r * p[5]) + r2 * (p[6] + r * p[7]);
    let high = (p[8] + r * p[9]) + r2 * (p[10] + r * p[11]);
    let tail = low + r4 * (middle + r4 * high);
    let mantissa = 1.0 + (r + r2 * tail);
    // k + 1023 ∈ [2, 2046]: a normal power of two.
    let power = f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52);
    if x < EXP_MIN { 0.0 } else { mantissa * power }
}

#[cfg(test)]
mod tests {
    use super::*;

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
