//! Symmetric FIR kernels: Kaiser-windowed low-pass and its derivatives.
//!
//! A finite symmetric kernel has no phase and ends somewhere: borders are exact and a log can be filtered in pieces.
//! A Kaiser window spends its length near-optimally for a given stop band.
//!
//! Source: J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", ISCAS 1974.

use std::f64::consts::PI;

/// Half width of the transition band relative to the cut-off f: flat to 0.7 f, half amplitude at f, stopped from 1.3 f.
/// Rows kept at 2.5 f fold what lies above 1.25 f, so only the last 0.05 f of the transition folds.
const TRANSITION: f64 = 0.3;
/// Stop band of the column filter F, dB: 0.3 % of the torque noise outside is left.
const COLUMN_ATTENUATION: f64 = 50.0;
/// Stop band of the motion filter, dB. Its pass band multiplies into every coefficient, so it is finer.
const MOTION_ATTENUATION: f64 = 60.0;

/// Kaiser's length rule, half length in units of 1/f: `N dt = (A − 7.95) / (2.285 · 2π · Δf)`.
fn half_length_factor(attenuation: f64) -> f64 {
    0.5 * (attenuation - 7.95) / (2.285 * 2.0 * PI * 2.0 * TRANSITION)
}

/// Kaiser's shape parameter for a stop band in dB (> 21).
fn kaiser_beta(attenuation: f64) -> f64 {
    if attenuation > 50.0 {
        0.1102 * (attenuation - 8.7)
    } else {
        0.5842 * (attenuation - 21.0).powf(0.4) + 0.07886 * (attenuation - 21.0)
    }
}

/// Half length of the column filter F with cut-off `cutoff_hz`, s (2.44 / f).
pub(crate) fn column_half_seconds(cutoff_hz: f64) -> f64 {
    half_length_factor(COLUMN_ATTENUATION) / cutoff_hz
}

/// Half length of the motion filter with cut-off `cutoff_hz`, s (3.02 / f).
pub(crate) fn motion_half_seconds(cutoff_hz: f64) -> f64 {
    half_length_factor(MOTION_ATTENUATION) / cutoff_hz
}

/// Samples on either side of the motion filter's centre.
pub(crate) fn motion_half_samples(cutoff_hz: f64, interval: f64) -> usize {
    (motion_half_seconds(cutoff_hz) / interval).round().max(5.0) as usize
}

/// The column filter F as `2 half + 1` symmetric taps whose sum is exactly the DC gain 1 (to rounding).
///
/// ```text
/// h_k = w(k dt) · sin(2π f k dt) / (π k),   −half ≤ k ≤ half,   divided by Σ h
/// ```
pub(crate) fn column_kernel(cutoff_hz: f64, interval: f64) -> Vec<f64> {
    let half = (column_half_seconds(cutoff_hz) / interval).round().max(1.0) as usize;
    let window = Window::new(COLUMN_ATTENUATION, half, interval);
    let mut taps = sampled(half, interval, |t| {
        window.value(t) * sinc(cutoff_hz, t)[0] * interval
    });
    let sum: f64 = taps.iter().sum();
    for tap in &mut taps {
        *tap /= sum;
    }
    taps
}

/// Amplitudes that the column filter passes at `frequencies`, in the unit of its cut-off; sampled finely, so that nothing folds.
pub(crate) fn filter_gains(cutoff: f64, frequencies: &[f64]) -> Vec<f64> {
    let interval = 1.0 / (20.0 * cutoff);
    let taps = column_kernel(cutoff, interval);
    let half = taps.len() / 2;
    let gain = |frequency: &f64| {
        let turn = 2.0 * PI * frequency * interval;
        let sides = (1..=half).map(|k| 2.0 * taps[half + k] * (turn * k as f64).cos());
        taps[half] + sides.sum::<f64>()
    };
    frequencies.iter().map(gain).collect()
}

/// The motion filter and its derivatives, all `2 half + 1` long: `out_i = Σ_k kernel[half + k] · x_{i+k}`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MotionKernels {
    /// Samples on either side.
    pub(crate) half: usize,
    /// Low-pass.
    pub(crate) smooth: Vec<f64>,
    /// First derivative of the low-pass, 1/s.
    pub(crate) first: Vec<f64>,
    /// Second derivative of the low-pass, 1/s².
    pub(crate) second: Vec<f64>,
}

impl MotionKernels {
    /// The continuous kernel `h(t) = w(t) sin(2π f t)/(π t)` and its analytic derivatives, sampled.
    ///
    /// Each is then corrected by the window times a small even or odd polynomial so that polynomials pass exactly up to
    /// degree 9 (smooth), 10 (first) and 11 (second). Robots move far below the cut-off, where this is what counts: the gain of q, q̇ and q̈ is 1
    /// within 1e-4 up to f/4 = f_c and within 1e-7 up to f/10 (3e-3 and more without the correction).
    pub(crate) fn new(cutoff_hz: f64, interval: f64) -> Self {
        let half = motion_half_samples(cutoff_hz, interval);
        let window = Window::new(MOTION_ATTENUATION, half, interval);
        // A correlation sees h(−t), which turns the sign of the odd derivative.
        let low_pass = |t| windowed_sinc(&window, cutoff_hz, t);
        let mut smooth = sampled(half, interval, |t| low_pass(t)[0] * interval);
        let mut first = sampled(half, interval, |t| -low_pass(t)[1] * interval);
        let mut second = sampled(half, interval, |t| low_pass(t)[2] * interval);
        let span = half as f64 * interval;
        // Moments in u = t/span: what x = 1, t, t², … must give at the centre.
        correct_moments(
            &mut smooth,
            &window,
            interval,
            0,
            &[1.0, 0.0, 0.0, 0.0, 0.0],
        );
        let slope = 1.0 / span;
        correct_moments(
            &mut first,
            &window,
            interval,
            1,
            &[slope, 0.0, 0.0, 0.0, 0.0],
        );
        let quadratic = 2.0 / (span * span);
        correct_moments(
            &mut second,
            &window,
            interval,
            0,
            &[0.0, quadratic, 0.0, 0.0, 0.0, 0.0],
        );
        Self {
            half,
            smooth,
            first,
            second,
        }
    }
}

/// Stop band of the filter before a coarser clock, dB.
const THINNING_ATTENUATION: f64 = 120.0;
/// What a coarse clock has to keep, relative to the motion filter's cut-off: its stop band at the widest cut-off of a sweep.
pub(crate) const WIDEST: f64 = 1.4;

/// Half length of the filter before a coarser clock of `interval` s, s; motion is filtered at `cutoff_hz` afterwards.
pub(crate) fn thinning_half_seconds(cutoff_hz: f64, interval: f64) -> f64 {
    let pass = (1.0 + TRANSITION) * WIDEST * cutoff_hz;
    let transition = 1.0 / interval - 2.0 * pass;
    0.5 * (THINNING_ATTENUATION - 7.95) / (2.285 * 2.0 * PI * transition)
}

/// The filter before a coarser clock: flat up to `1.3 · 1.4 cutoff_hz`, stopped from as far below the coarse clock's rate.
///
/// Exact on polynomials up to degree 9: what lies far below the cut-off passes to rounding. `coarse` and `interval` in s.
pub(crate) fn thinning_kernel(cutoff_hz: f64, coarse: f64, interval: f64) -> Vec<f64> {
    let half = thinning_half_seconds(cutoff_hz, coarse) / interval;
    let half = half.round().max(5.0) as usize;
    let window = Window::new(THINNING_ATTENUATION, half, interval);
    let middle = 0.5 / coarse;
    let mut taps = sampled(half, interval, |t| {
        window.value(t) * sinc(middle, t)[0] * interval
    });
    let exact = [1.0, 0.0, 0.0, 0.0, 0.0];
    correct_moments(&mut taps, &window, interval, 0, &exact);
    taps
}

/// √Σ h²: standard deviation of filtered white noise of sd 1.
pub(crate) fn noise_gain(taps: &[f64]) -> f64 {
    taps.iter().map(|h| h * h).sum::<f64>().sqrt()
}

/// `f(k dt)` for −half ≤ k ≤ half.
fn sampled(half: usize, interval: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * half)
        .map(|i| f((i as f64 - half as f64) * interval))
        .collect()
}

/// `h = w g` and its first two derivatives at `t`.
fn windowed_sinc(window: &Window, cutoff_hz: f64, t: f64) -> [f64; 3] {
    let (w, g) = (window.derivatives(t), sinc(cutoff_hz, t));
    [
        w[0] * g[0],
        w[1] * g[0] + w[0] * g[1],
        w[2] * g[0] + 2.0 * w[1] * g[1] + w[0] * g[2],
    ]
}

/// `g(t) = sin(a t)/(π t)`, a = 2π f, with first and second derivative; by Taylor series near 0.
fn sinc(cutoff_hz: f64, t: f64) -> [f64; 3] {
    let a = 2.0 * PI * cutoff_hz;
    let x = a * t;
    let scale = a / PI;
    let x2 = x * x;
    if x.abs() < 0.05 {
        // sin x / x = 1 − x²/6 + x⁴/120 − x⁶/5040
        return [
            scale * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0))),
            scale * a * x * (-1.0 / 3.0 + x2 / 30.0 - x2 * x2 / 840.0),
            scale * a * a * (-1.0 / 3.0 + x2 / 10.0 - x2 * x2 / 168.0),
        ];
    }
    let (sin, cos) = x.sin_cos();
    [
        scale * sin / x,
        scale * a * (x * cos - sin) / x2,
        scale * a * a * ((2.0 - x2) * sin - 2.0 * x * cos) / (x2 * x),
    ]
}

/// The Kaiser window `I0(β √(1 − u²)) / I0(β)`, u = t / half, as a function of time.
struct Window {
    beta: f64,
    half: f64,
    /// 1 over I0(β).
    norm: f64,
}

impl Window {
    /// Half a sample wider than the kernel, so that its first and last taps count.
    fn new(attenuation: f64, half: usize, interval: f64) -> Self {
        let beta = kaiser_beta(attenuation);
        Self {
            beta,
            half: (half as f64 + 0.5) * interval,
            norm: 1.0 / bessel_ratio(0, beta * beta),
        }
    }

    /// Value at time `t`: the first of [`Window::derivatives`].
    fn value(&self, t: f64) -> f64 {
        let u = t / self.half;
        let z2 = self.beta * self.beta * (1.0 - u * u).max(0.0);
        bessel_ratio(0, z2) * self.norm
    }

    /// Value, first and second derivative at time `t`, |t| < half.
    ///
    /// With z = β√(1−u²): `w' = −β² u I1(z)/z`, `w'' = −β² (I1(z)/z − β² u² I2(z)/z²)`, all over I0(β).
    fn derivatives(&self, t: f64) -> [f64; 3] {
        let u = t / self.half;
        let b2 = self.beta * self.beta;
        let z2 = b2 * (1.0 - u * u).max(0.0);
        let norm = self.norm;
        let (i1, i2) = (bessel_ratio(1, z2), bessel_ratio(2, z2));
        [
            bessel_ratio(0, z2) * norm,
            -b2 * u * i1 * norm / self.half,
            -b2 * (i1 - b2 * u * u * i2) * norm / (self.half * self.half),
        ]
    }
}

/// `I_n(z) / zⁿ` from z² by its power series `2⁻ⁿ Σ_k (z²/4)^k / (k! (k+n)!)`.
fn bessel_ratio(n: u32, z2: f64) -> f64 {
    let mut term = 0.5_f64.powi(n as i32) / (1..=n).map(f64::from).product::<f64>();
    let mut sum = term;
    let mut k = 0.0;
    while term > sum * 1e-17 {
        k += 1.0;
        term *= z2 / 4.0 / (k * (k + f64::from(n)));
        sum += term;
    }
    sum
}

/// Adds `w(t) · Σ_m c_m u^(parity + 2m)` to the kernel so that its moments `Σ_k kernel_k u_k^(parity + 2m)` are `wanted`.
fn correct_moments(
    kernel: &mut [f64],
    window: &Window,
    interval: f64,
    parity: i32,
    wanted: &[f64],
) {
    let order = wanted.len();
    let half = (kernel.len() / 2) as f64;
    // Two rounds: the second removes what the first left by rounding.
    for _ in 0..2 {
        let mut system = vec![vec![0.0; order + 1]; order];
        for (i, &tap) in kernel.iter().enumerate() {
            let u = (i as f64 - half) / half;
            let w = window.value(u * half * interval);
            for r in 0..order {
                let ur = u.powi(parity + 2 * r as i32);
                for c in 0..order {
                    system[r][c] += ur * u.powi(parity + 2 * c as i32) * w;
                }
                system[r][order] -= tap * ur;
            }
        }
        for (r, &moment) in wanted.iter().enumerate() {
            system[r][order] += moment;
        }
        let c = solve(system);
        for (i, tap) in kernel.iter_mut().enumerate() {
            let u = (i as f64 - half) / half;
            let w = window.value(u * half * interval);
            *tap += w * c
                .iter()
                .enumerate()
                .map(|(m, c)| c * u.powi(parity + 2 * m as i32))
                .sum::<f64>();
        }
    }
}

/// Gaussian elimination with row pivoting on a small augmented system.
fn solve(mut system: Vec<Vec<f64>>) -> Vec<f64> {
    let n = system.len();
    for p in 0..n {
        let best = (p..n)
            .max_by(|&a, &b| system[a][p].abs().total_cmp(&system[b][p].abs()))
            .unwrap_or(p);
        system.swap(p, best);
        let pivot = system[p].clone();
        for row in system.iter_mut().skip(p + 1) {
            let factor = row[p] / pivot[p];
            for (value, above) in row.iter_mut().zip(&pivot) {
                *value -= factor * above;
            }
        }
    }
    let mut x = vec![0.0; n];
    for r in (0..n).rev() {
        let known: f64 = (r + 1..n).map(|c| system[r][c] * x[c]).sum();
        x[r] = (system[r][n] - known) / system[r][r];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `Σ_k kernel_k e^{iω k dt}`: real part for even, imaginary for odd kernels.
    fn response(kernel: &[f64], frequency: f64, interval: f64) -> (f64, f64) {
        let half = (kernel.len() / 2) as f64;
        kernel
            .iter()
            .enumerate()
            .fold((0.0, 0.0), |(re, im), (i, h)| {
                let (sin, cos) = (2.0 * PI * frequency * (i as f64 - half) * interval).sin_cos();
                (re + h * cos, im + h * sin)
            })
    }

    #[test]
    fn column_filter_has_its_promised_gain_and_no_phase() {
        for interval in [0.001, 0.002, 0.008] {
            let taps = column_kernel(5.0, interval);
            assert!(
                taps.iter()
                    .zip(taps.iter().rev())
                    .all(|(a, b)| (a - b).abs() < 1e-16)
            );
            assert!((taps.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            for i in 0..=70 {
                let (gain, phase) = response(&taps, 0.05 * f64::from(i), interval);
                assert!(
                    (gain - 1.0).abs() < 5e-3 && phase.abs() < 1e-13,
                    "pass band: {gain}"
                );
            }
            assert!((response(&taps, 5.0, interval).0 - 0.5).abs() < 0.01);
            let nyquist = 0.5 / interval;
            let mut frequency = 6.55;
            while frequency < nyquist {
                let gain = response(&taps, frequency, interval).0;
                assert!(gain.abs() < 4e-3, "stop band at {frequency} Hz: {gain}");
                frequency += 0.05;
            }
        }
    }

    #[test]
    fn motion_kernels_are_exact_on_polynomials() {
        for (cutoff, interval) in [(20.0, 0.001), (20.0, 0.01), (45.0, 0.01), (3.0, 0.002)] {
            let kernels = MotionKernels::new(cutoff, interval);
            let half = kernels.half as f64;
            let span = half * interval;
            for degree in 0..=10_i32 {
                // p(t) = (1 + t/span)^degree around the centre, where p = 1, p' = d/span, p'' = d(d−1)/span²
                let apply = |kernel: &[f64]| -> f64 {
                    kernel
                        .iter()
                        .enumerate()
                        .map(|(i, h)| h * (1.0 + (i as f64 - half) / half).powi(degree))
                        .sum()
                };
                let d = f64::from(degree);
                let check = |value: f64, expected: f64, size: f64, what: &str| {
                    assert!(
                        (value - expected).abs() < 1e-10 * size,
                        "{what} of degree {degree} at {cutoff} Hz, dt {interval}: {value} {expected}"
                    );
                };
                if degree <= 9 {
                    check(apply(&kernels.smooth), 1.0, 1.0, "value");
                }
                if degree <= 10 {
                    check(apply(&kernels.first), d / span, 10.0 / span, "slope");
                }
                let curvature = d * (d - 1.0) / (span * span);
                check(
                    apply(&kernels.second),
                    curvature,
                    50.0 / (span * span),
                    "curvature",
                );
            }
        }
    }

    #[test]
    fn a_coarser_clock_sees_the_motion_as_it_is_and_nothing_folds() {
        // cut-off 20 Hz, from 1 kHz to 200 and to 142 Hz
        for coarse in [0.005, 0.007] {
            let taps = thinning_kernel(20.0, coarse, 0.001);
            let gain = |frequency: f64| {
                let (gain, phase) = response(&taps, frequency, 0.001);
                assert!(phase.abs() < 1e-13);
                gain
            };
            for i in 0..=364 {
                let frequency = 0.1 * f64::from(i);
                // Beyond f_c a tenth of the motion filter's own ripple.
                let limit = if frequency <= 5.0 { 1e-9 } else { 1e-4 };
                let off = (gain(frequency) - 1.0).abs();
                assert!(off < limit, "{frequency} Hz: off by {off:e}");
            }
            // What folds below the motion filter's stop band.
            let first = 1.0 / coarse - 36.4;
            for i in 0..1000 {
                let frequency = first + 0.3 * f64::from(i);
                if frequency < 500.0 {
                    let left = gain(frequency).abs();
                    assert!(left < 1e-5, "{frequency} Hz: {left:e}");
                }
            }
        }
    }

    #[test]
    fn derivative_kernels_are_the_derivative_of_the_same_low_pass() {
        // d/dt of the filtered sinusoid: i ω H(ω), −ω² H(ω). In band and over the transition.
        for (cutoff, interval) in [(20.0, 0.001), (20.0, 0.002), (20.0, 0.01)] {
            let kernels = MotionKernels::new(cutoff, interval);
            for i in 1..=28 {
                let frequency = f64::from(i);
                let omega = 2.0 * PI * frequency;
                let gain = response(&kernels.smooth, frequency, interval).0;
                let first = response(&kernels.first, frequency, interval).1 / omega;
                let second = -response(&kernels.second, frequency, interval).0 / (omega * omega);
                assert!(
                    (first - gain).abs() < 3e-2,
                    "{frequency} Hz: {first} {gain}"
                );
                assert!(
                    (second - gain).abs() < 5e-2,
                    "{frequency} Hz: {second} {gain}"
                );
                if frequency <= cutoff / 4.0 {
                    // Up to f_c = f_q/4, where the motion is: promised 1e-4.
                    for (value, what) in [(gain, "q"), (first, "qd"), (second, "qdd")] {
                        assert!(
                            (value - 1.0).abs() < 1e-4,
                            "{what} at {frequency} Hz: {value}"
                        );
                    }
                }
                if frequency <= cutoff / 10.0 {
                    for value in [gain, first, second] {
                        assert!((value - 1.0).abs() < 1e-7, "{frequency} Hz: {value}");
                    }
                }
            }
        }
    }

    #[test]
    fn analytic_derivatives_are_those_of_the_kernel() {
        // Central differences over the whole kernel, its ends and the series at its centre included.
        let (cutoff, interval, step) = (20.0, 0.001, 1e-5);
        let window = Window::new(MOTION_ATTENUATION, 150, interval);
        let at = |t: f64| windowed_sinc(&window, cutoff, t);
        for i in -3000..=3000 {
            let t = f64::from(i) * 0.05 * interval;
            let (before, here, after) = (at(t - step), at(t), at(t + step));
            for order in 0..2 {
                let slope = (after[order] - before[order]) / (2.0 * step);
                // h⁽ⁿ⁾ is of size (2πf)ⁿ h(0); the difference is good to step² of the third derivative.
                let size = 2.0 * cutoff * (2.0 * PI * cutoff).powi(order as i32 + 1);
                assert!(
                    (slope - here[order + 1]).abs() < 1e-5 * size,
                    "derivative {} at {t}: {slope} {}",
                    order + 1,
                    here[order + 1]
                );
            }
        }
    }

    #[test]
    fn bessel_ratio_matches_tabulated_values() {
        // Abramowitz & Stegun table 9.8: e^-x I0(x), e^-x I1(x) at x = 2 and 5.
        for (n, x, scaled) in [
            (0, 2.0_f64, 0.308_508_322_5),
            (1, 2.0, 0.215_269_289_2),
            (0, 5.0, 0.183_540_812_6),
            (1, 5.0, 0.163_972_266_9),
        ] {
            let value = bessel_ratio(n, x * x) * x.powi(n as i32) * (-x).exp();
            assert!((value - scaled).abs() < 1e-9, "I{n}({x}): {value}");
        }
    }
}
