//! Sine and cosine of eight samples at once.

use super::{LANES, Lane, Line, fuses};

/// Largest |x| of the vector path; larger and non-finite samples take the standard library's road, one by one.
const VECTOR_LIMIT: f64 = 1.0e6;

/// 2/π.
const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
/// Adding it rounds to an integer, which then stands in the low bits (1.5 · 2⁵²).
const ROUND: f64 = 6_755_399_441_055_744.0;
/// π/2 in three pieces of 33 bits and a tail: `k · piece` is exact for k < 2²⁰.
const HALF_PI: [f64; 4] = [
    1.570_796_326_734_125_6,
    6.077_100_506_303_966e-11,
    2.022_266_248_711_166_5e-21,
    8.478_427_660_368_9e-32,
];
/// π/2 in three pieces of 53 bits, for fused multiply-add.
const HALF_PI_WIDE: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    6.123_233_995_736_766e-17,
    -1.497_384_904_859_169_8e-33,
];
/// sin(r) = r + r³ (S₀ + S₁ r² + …) on |r| ≤ π/4.
const SIN: [f64; 6] = [
    -0.166_666_666_666_666_32,
    0.008_333_333_333_322_49,
    -0.000_198_412_698_298_579_5,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
/// cos(r) = 1 − r²/2 + r⁴ (C₀ + C₁ r² + …) on |r| ≤ π/4.
const COS: [f64; 6] = [
    0.041_666_666_666_666_6,
    -0.001_388_888_888_887_411,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine and cosine of eight angles, rad.
///
/// At most 2 ulp from the exact value for |x| ≤ 10⁶ (measured: 1); beyond that, and for NaN and ±∞, exactly what
/// [`f64::sin_cos`] gives. The same bytes on every instruction set.
///
/// # Source
/// Argument reduction after Cody and Waite, polynomials of FreeBSD's msun (fdlibm) `k_sin.c`, `k_cos.c`.
#[inline(always)]
pub fn sin_cos(x: &Lane) -> (Lane, Lane) {
    on_lanes(x, reduced)
}

/// [`sin_cos`] with fused multiply-add inside code compiled for vectors that have it: a quarter fewer operations, at most 2 ulp as well,
/// but not the bytes of the other; without such vectors the same as [`sin_cos`].
#[inline(always)]
pub fn sin_cos_fused<S: pulp::Simd>(_simd: S, x: &Lane) -> (Lane, Lane) {
    if fuses::<S>() {
        on_lanes(x, reduced_fused)
    } else {
        on_lanes(x, reduced)
    }
}

#[inline(always)]
fn on_lanes(x: &Lane, reduced: impl Fn(f64) -> (f64, f64)) -> (Lane, Lane) {
    let [mut sin, mut cos] = [Line([0.0; LANES]); 2];
    let mut inside = true;
    for lane in 0..LANES {
        inside &= x[lane].abs() <= VECTOR_LIMIT; // false for NaN
    }
    for lane in 0..LANES {
        (sin.0[lane], cos.0[lane]) = reduced(x[lane]);
    }
    if !inside {
        patch(x, &mut sin.0, &mut cos.0);
    }
    (sin.0, cos.0)
}

/// The samples that the vector path cannot do.
#[cold]
#[inline(never)]
fn patch(x: &Lane, sin: &mut Lane, cos: &mut Lane) {
    for lane in 0..LANES {
        let inside = x[lane].abs() <= VECTOR_LIMIT;
        if !inside {
            (sin[lane], cos[lane]) = x[lane].sin_cos();
        }
    }
}

/// a + b = s + e exactly (Knuth).
#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

/// One sample, free of branches so that eight of them become vector instructions.
#[inline(always)]
fn reduced(x: f64) -> (f64, f64) {
    // x = k π/2 + (r + tail), |r| ≤ π/4
    let shifted = x * TWO_OVER_PI + ROUND;
    let quadrant = shifted.to_bits();
    let k = shifted - ROUND;
    let (r, e1) = two_sum(x - k * HALF_PI[0], -(k * HALF_PI[1]));
    let (r, e2) = two_sum(r, -(k * HALF_PI[2]));
    let (r, tail) = two_sum(r, (e1 + e2) - k * HALF_PI[3]);

    let z = r * r;
    let cube = z * r;
    let odd = SIN[1] + z * (SIN[2] + z * (SIN[3] + z * (SIN[4] + z * SIN[5])));
    let sin = r - ((z * (0.5 * tail - cube * odd) - tail) - cube * SIN[0]);
    let even = z * (COS[0] + z * (COS[1] + z * COS[2]))
        + (z * z) * (z * z) * (COS[3] + z * (COS[4] + z * COS[5]));
    let half = 0.5 * z;
    let one = 1.0 - half;
    let cos = one + (((1.0 - one) - half) + (z * even - r * tail));

    turned(quadrant, sin, cos)
}

/// [`reduced`] with fused multiply-add.
#[inline(always)]
fn reduced_fused(x: f64) -> (f64, f64) {
    let shifted = x.mul_add(TWO_OVER_PI, ROUND);
    let quadrant = shifted.to_bits();
    let k = shifted - ROUND;
    // x − k P₀ is exact: a multiple of 2⁻⁵³ below 1. k P₁ is product + error.
    let near = (-k).mul_add(HALF_PI_WIDE[0], x);
    let product = k * HALF_PI_WIDE[1];
    let error = k.mul_add(HALF_PI_WIDE[1], -product);
    let (r, rest) = two_sum(near, -product);
    let tail = (-k).mul_add(HALF_PI_WIDE[2], rest - error);

    let z = r * r;
    let cube = z * r;
    let odd = z.mul_add(SIN[5], SIN[4]);
    let odd = z.mul_add(odd, SIN[3]);
    let odd = z.mul_add(odd, SIN[2]);
    let odd = z.mul_add(odd, SIN[1]);
    let inner = z.mul_add((-cube).mul_add(odd, 0.5 * tail), -tail);
    let sin = r - (-cube).mul_add(SIN[0], inner);
    let even = z.mul_add(COS[5], COS[4]);
    let even = z.mul_add(even, COS[3]);
    let even = z.mul_add(even, COS[2]);
    let even = z.mul_add(even, COS[1]);
    let even = z * z.mul_add(even, COS[0]);
    let one = z.mul_add(-0.5, 1.0);
    let lost = z.mul_add(-0.5, 1.0 - one);
    let cos = one + (lost + z.mul_add(even, -(r * tail)));
    turned(quadrant, sin, cos)
}

/// Sine and cosine of an angle from those of what is left of it beyond `quadrant` quarter turns.
#[inline(always)]
fn turned(quadrant: u64, sin: f64, cos: f64) -> (f64, f64) {
    // odd quadrants exchange the two, quadrants 2, 3 negate the sine, 1, 2 the cosine
    let exchange = 0_u64.wrapping_sub(quadrant & 1);
    let (s, c) = (sin.to_bits(), cos.to_bits());
    let difference = (s ^ c) & exchange;
    let sign_sin = (quadrant & 2) << 62;
    let sign_cos = (quadrant.wrapping_add(1) & 2) << 62;
    (
        f64::from_bits((s ^ difference) ^ sign_sin),
        f64::from_bits((c ^ difference) ^ sign_cos),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs one lane group through the run-time dispatch.
    struct SinCos<'a>(&'a Lane);

    impl pulp::WithSimd for SinCos<'_> {
        type Output = (Lane, Lane);
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, _simd: S) -> Self::Output {
            sin_cos(self.0)
        }
    }

    fn ulps(a: f64, b: f64) -> u64 {
        if a == b {
            return 0;
        }
        let key = |v: f64| {
            let bits = v.to_bits() as i64;
            if bits < 0 { i64::MIN - bits } else { bits }
        };
        key(a).abs_diff(key(b))
    }

    /// The same with fused multiply-add where the machine has it.
    struct Fused<'a>(&'a Lane);

    impl pulp::WithSimd for Fused<'_> {
        type Output = (Lane, Lane);
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, simd: S) -> Self::Output {
            sin_cos_fused(simd, self.0)
        }
    }

    /// Largest distance from the platform's libm (below 1 ulp itself), in both outputs, with and without dispatch, fused and not.
    fn worst(points: &[f64]) -> u64 {
        let mut worst = 0;
        for chunk in points.chunks(LANES) {
            let mut x = [0.0; LANES];
            x[..chunk.len()].copy_from_slice(chunk);
            let plain = sin_cos(&x);
            let dispatched = pulp::Arch::new().dispatch(SinCos(&x));
            let fused = pulp::Arch::new().dispatch(Fused(&x));
            for lane in 0..LANES {
                assert_eq!(
                    plain.0[lane].to_bits(),
                    dispatched.0[lane].to_bits(),
                    "sin {:e}",
                    x[lane]
                );
                assert_eq!(
                    plain.1[lane].to_bits(),
                    dispatched.1[lane].to_bits(),
                    "cos {:e}",
                    x[lane]
                );
                let (s, c) = x[lane].sin_cos();
                for (sin, cos) in [&plain, &fused].map(|(sin, cos)| (sin[lane], cos[lane])) {
                    worst = worst.max(ulps(sin, s)).max(ulps(cos, c));
                }
            }
        }
        worst
    }

    #[test]
    fn two_ulp_over_the_whole_vector_range() {
        // a Weyl sequence over ± each magnitude
        for magnitude in [1e-300, 1e-8, 0.7, 0.79, 1.6, 7.0, 100.0, 1e4, 1e6] {
            let points: Vec<f64> = (0..40_000)
                .map(|i| {
                    (f64::from(i) * 0.618_033_988_749_894_9).fract() * 2.0 * magnitude - magnitude
                })
                .collect();
            let worst = worst(&points);
            assert!(worst <= 2, "{worst} ulp below {magnitude:e}");
        }
    }

    #[test]
    fn two_ulp_beside_every_multiple_of_a_quarter_turn() {
        let mut points = Vec::new();
        for k in (-636_000..636_000_i32).step_by(17) {
            let x = f64::from(k) * std::f64::consts::FRAC_PI_2;
            points.extend([x.next_down(), x, x.next_up()]);
        }
        let worst = worst(&points);
        assert!(worst <= 2, "{worst} ulp");
    }

    #[test]
    fn closest_double_to_a_quarter_turn_below_the_limit_keeps_its_digits() {
        // (k, x) where x is nearest to kπ/2 relative to its spacing: cos or sin there is tiny, cancellation is worst.
        let points: Vec<f64> = (1..600_000_i32)
            .map(|k| f64::from(k) * std::f64::consts::FRAC_PI_2)
            .filter(|x| x.sin().abs().min(x.cos().abs()) < 1e-15)
            .collect();
        assert!(!points.is_empty());
        assert!(worst(&points) <= 2);
    }

    #[test]
    fn large_and_non_finite_samples_are_the_standard_ones() {
        let x = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            1.1e6,
            -1e300,
            0.5,
            2e22,
            0.0,
        ];
        let (sin, cos) = sin_cos(&x);
        for lane in [3, 4, 6] {
            assert_eq!((sin[lane], cos[lane]), x[lane].sin_cos());
        }
        assert!((0..3).all(|lane| sin[lane].is_nan() && cos[lane].is_nan()));
        assert!(ulps(sin[5], 0.5_f64.sin()) <= 2 && cos[7] == 1.0);
    }
}
