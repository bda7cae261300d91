//! Is a residual behind the row filter an autoregression of first order, and nothing else?
//!
//! AR(1) noise with the time constant T behind the filter H has the spectrum
//!
//! ```text
//! S(f) = σ² |H(f)|² / (1 + (2π f T)²)
//! ```
//! T and σ² are Whittle's (1953): they minimise Σ_k ln S(f_k) + I(f_k)/S(f_k) over the periodogram I of the residual below the
//! cut-off; against leakage that of e_t = r_t − ρ r_{t−1} is taken, whose spectrum is |1 − ρ e^{−iω}|² S. Then two things have to hold.
//!
//! 1. u_k = I(f_k)/S(f_k) is like the periodogram of white noise (Bartlett 1955): with the sums C_k = u_1 + … + u_k,
//!    `√m max_k |C_k/C_m − k/m|` has Kolmogorov's distribution for a known T. A fitted T makes it smaller, never larger.
//! 2. e_t has one variance at all speeds, as its mean squares s_b² in six bins of |q̇| with equal numbers of rows say (Bartlett 1937): with
//!    ν = n/6 rows each and s² = mean s_b²,
//!    `6 ν (ln s² − mean ln s_b²) / (1 + 7/(18 ν))` is χ² with five degrees of freedom. n counts what the filter
//!    leaves: 2 m (mean g)²/mean(g²), g the fitted spectrum of e at the m frequencies.
//!
//! Noise that is one is taken for something else on one joint in fifty at most: 1 % for either. Heavy tails fail the second.

use crate::signal::fir::filter_gains;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Largest deviation of the cumulated periodogram: Kolmogorov's distribution at 99 %.
pub(in crate::calibrate) const CUMULATED: f64 = 1.628;
/// Largest deviation of the variances: χ² with [`BINS`] − 1 degrees of freedom at 99 %.
pub(in crate::calibrate) const VARIANCES: f64 = 15.086;
/// Bins of speed.
const BINS: usize = 6;
/// Frequencies that are looked at, in cut-offs: the filter passes 0.8 of the amplitude there.
const HIGHEST: f64 = 0.9;
/// Fewest of them: a cumulated share is known to 0.16 then.
const FEWEST: usize = 100;
/// Rows of the shortest run that has a spectrum.
const SHORTEST: usize = 32;
/// T that are tried, in periods of the cut-off: 0, and from the first on each a tenth longer.
const SHORTEST_TIME: f64 = 0.02;
const TIMES: i32 = 100;
const NEXT_TIME: f64 = 1.1;

/// Consecutive moving rows of one joint.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::calibrate) struct Run {
    pub(in crate::calibrate) residual: Vec<f64>,
    /// q̇, rad/s or m/s.
    pub(in crate::calibrate) velocity: Vec<f64>,
    /// Cut-off of the filter, cycles per row.
    pub(in crate::calibrate) cutoff: f64,
}

/// What the tests say of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::calibrate) struct Judged {
    /// T, in periods of the cut-off.
    pub(in crate::calibrate) time: f64,
    /// Deviation of the cumulated periodogram, see [`CUMULATED`].
    pub(in crate::calibrate) cumulated: f64,
    /// Deviation of the variances, see [`VARIANCES`].
    pub(in crate::calibrate) variances: f64,
}

impl Judged {
    /// Nothing speaks against an autoregression.
    pub(in crate::calibrate) fn passes(&self) -> bool {
        self.cumulated <= CUMULATED && self.variances <= VARIANCES
    }
}

/// The tests on the runs of one joint; `None` where they are too few or too short to tell.
pub(in crate::calibrate) fn judge(runs: &[Run]) -> Option<Judged> {
    let runs: Vec<&Run> = runs
        .iter()
        .filter(|run| run.residual.len() > SHORTEST)
        .collect();
    let rho = coefficient(&runs);
    let mut ordinates = Vec::new();
    let mut innovations = Vec::new();
    for run in runs {
        let innovation: Vec<f64> = (run.residual.windows(2))
            .map(|pair| pair[1] - rho * pair[0])
            .collect();
        add_periodogram(&innovation, rho, run.cutoff, &mut ordinates);
        let speeds = run.velocity[1..].iter().map(|velocity| velocity.abs());
        innovations.extend(speeds.zip(innovation));
    }
    if ordinates.len() < FEWEST {
        return None;
    }
    ordinates.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    let (time, level) = whittle(&ordinates)?;
    let spectrum = ordinates.iter().map(|o| o.gain * autoregressive(o, time));
    let (sum, squares) = spectrum.fold((0.0, 0.0), |(s, q), g| (s + g, q + g * g));
    let judged = Judged {
        time,
        cumulated: cumulated(&ordinates, time, level),
        variances: variances(innovations, 2.0 * sum * sum / squares),
    };
    (judged.cumulated.is_finite() && judged.variances.is_finite()).then_some(judged)
}

/// One frequency of a periodogram.
#[derive(Debug, Clone, Copy)]
struct Ordinate {
    /// In cut-offs.
    frequency: f64,
    power: f64,
    /// |H|² |1 − ρ e^{−iω}|².
    gain: f64,
}

/// Correlation of neighbouring rows.
fn coefficient(runs: &[&Run]) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for run in runs {
        let pairs = run.residual.windows(2);
        product += pairs.map(|pair| pair[0] * pair[1]).sum::<f64>();
        square += run.residual.iter().map(|r| r * r).sum::<f64>();
    }
    if square > 0.0 { product / square } else { 0.0 }
}

/// I(f) = |Σ_t e_t e^{−iωt}|²/n at the frequencies of n rows that the filter passes.
fn add_periodogram(innovation: &[f64], rho: f64, cutoff: f64, to: &mut Vec<Ordinate>) {
    let rows = innovation.len() as f64;
    let count = (HIGHEST * cutoff.min(0.5) * rows) as usize;
    let frequencies: Vec<f64> = (1..=count).map(|k| k as f64 / rows / cutoff).collect();
    let gains = filter_gains(1.0, &frequencies);
    let ordinates = frequencies.par_iter().zip(gains);
    to.par_extend(ordinates.map(|(&frequency, passed)| {
        let (turn_sin, turn_cos) = (TAU * frequency * cutoff).sin_cos();
        let (mut sin, mut cos, mut re, mut im) = (0.0, 1.0, 0.0, 0.0);
        for e in innovation {
            re += e * cos;
            im += e * sin;
            (sin, cos) = (
                sin * turn_cos + cos * turn_sin,
                cos * turn_cos - sin * turn_sin,
            );
        }
        Ordinate {
            frequency,
            power: (re * re + im * im) / rows,
            gain: passed * passed * (1.0 + rho * rho - 2.0 * rho * turn_cos),
        }
    }));
}

/// 1/(1 + (2π f T)²).
fn autoregressive(ordinate: &Ordinate, time: f64) -> f64 {
    1.0 / (1.0 + (TAU * ordinate.frequency * time).powi(2))
}

/// T and σ² of the largest likelihood; `None` without power.
fn whittle(ordinates: &[Ordinate]) -> Option<(f64, f64)> {
    let times = (0..TIMES).map(|i| SHORTEST_TIME * NEXT_TIME.powi(i));
    let fits = std::iter::once(0.0).chain(times).map(|time| {
        let (mut logarithms, mut level) = (0.0, 0.0);
        for ordinate in ordinates {
            let spectrum = autoregressive(ordinate, time);
            logarithms += spectrum.ln();
            level += ordinate.power / (ordinate.gain * spectrum);
        }
        let count = ordinates.len() as f64;
        (
            logarithms + count * (level / count).ln(),
            time,
            level / count,
        )
    });
    let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(deviance, ..)| deviance.is_finite())
        .map(|(_, time, level)| (time, level))
}

/// Bartlett's largest deviation of the cumulated periodogram from a straight line; ordinates ascend in frequency.
fn cumulated(ordinates: &[Ordinate], time: f64, level: f64) -> f64 {
    let count = ordinates.len() as f64;
    let (mut sum, mut largest) = (0.0_f64, 0.0_f64);
    for (k, ordinate) in ordinates.iter().enumerate() {
        sum += ordinate.power / (level * ordinate.gain * autoregressive(ordinate, time));
        largest = largest.max(((sum - (k + 1) as f64) / count).abs());
    }
    largest * count.sqrt()
}

/// Bartlett's test of equal variances in bins of |q̇|; `rows` of the innovations (|q̇|, e) count as independent.
fn variances(mut innovations: Vec<(f64, f64)>, rows: f64) -> f64 {
    innovations.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cut = |bin: usize| bin * innovations.len() / BINS;
    let squares: Vec<f64> = (0..BINS)
        .map(|bin| {
            let own = &innovations[cut(bin)..cut(bin + 1)];
            own.iter().map(|(_, e)| e * e).sum::<f64>() / own.len() as f64
        })
        .collect();
    let bins = BINS as f64;
    let (each, mean) = (rows / bins, squares.iter().sum::<f64>() / bins);
    let logarithm = squares.iter().map(|square| square.ln()).sum::<f64>() / bins;
    rows * (mean.ln() - logarithm) / (1.0 + (bins + 1.0) / (3.0 * bins * each))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::signal::fir::column_kernel;

    /// Rows of the filter at 20 Hz, cycles per row.
    const CUTOFF: f64 = 0.4;
    /// Samples between two rows, at 1 kHz.
    const STEP: usize = 20;

    /// 20 s of noise at 1 kHz, 50 rows per second behind the filter at 20 Hz; `noise` maps (t, q̇, an AR(1) of `time` s with sd 1).
    fn rows(seed: u64, time: f64, noise: impl Fn(f64, f64, f64, f64) -> f64) -> Run {
        let mut random = Random::new(seed, 0);
        let rho = if time > 0.0 {
            (-1e-3 / time).exp()
        } else {
            0.0
        };
        let velocity = |t: f64| 0.8 * (0.9 * t).cos() + 0.5 * (2.3 * t + 1.0).cos();
        let mut slow = random.normal();
        let samples: Vec<f64> = (0..20_000)
            .map(|i| {
                slow = rho * slow + (1.0 - rho * rho).sqrt() * random.normal();
                let t = 1e-3 * f64::from(i);
                noise(t, velocity(t), slow, random.normal())
            })
            .collect();
        let taps = column_kernel(20.0, 1e-3);
        let starts = || (0..samples.len() - taps.len()).step_by(STEP);
        let filtered =
            |from: usize| -> f64 { taps.iter().zip(&samples[from..]).map(|(h, x)| h * x).sum() };
        let middle = |from: usize| 1e-3 * (from + taps.len() / 2) as f64;
        Run {
            residual: starts().map(filtered).collect(),
            velocity: starts().map(|from| velocity(middle(from))).collect(),
            cutoff: CUTOFF,
        }
    }

    fn judged(run: Run) -> Judged {
        judge(&[run]).expect("rows enough")
    }

    /// Of 300 logs 1 % at most fail each test: more than nine have a chance of 2e-3 for either. T of 100 ms is two
    /// periods of 20 Hz.
    #[test]
    fn an_autoregression_passes_with_its_own_time() {
        let mut failed = [0; 2];
        for (time, seeds) in [(0.0, 0..100), (0.02, 100..200), (0.1, 200..300)] {
            let mut mean = 0.0;
            for seed in seeds {
                let found = judged(rows(seed, time, |_, _, slow, _| 3.0 * slow));
                failed[0] += u32::from(found.cumulated > CUMULATED);
                failed[1] += u32::from(found.variances > VARIANCES);
                mean += found.time / 100.0;
            }
            let off = (mean - 20.0 * time).abs();
            assert!(off < 0.1 * (20.0 * time) + 0.05, "{time} s: {mean} periods");
        }
        assert!(failed.iter().all(|failed| *failed <= 9), "{failed:?}");
    }

    /// What is none fails in 20 of 20 logs: an unknown oscillation, white noise on a slow one, friction that turns round
    /// sharply, noise that is larger where the joint is slow, outliers.
    #[test]
    fn what_is_no_autoregression_fails() {
        type Noise = fn(f64, f64, f64, f64) -> f64;
        let worlds: [(&str, f64, Noise); 5] = [
            ("2 Hz", 0.0, |t, _, _, white| {
                white + 1.4 * (TAU * 2.0 * t).sin()
            }),
            ("white and slow", 1.0, |_, _, slow, white| {
                white + 0.5 * slow
            }),
            ("Stribeck", 0.0, |_, v, _, white| {
                white + 3.0 * (v / 0.02).tanh() * (-(v / 0.1).powi(2)).exp()
            }),
            ("louder when slow", 0.1, |_, v, slow, _| {
                slow * if v.abs() < 0.2 { 3.0 } else { 1.0 }
            }),
            ("blows", 0.1, |t, _, slow, _| {
                slow + if (t / 0.5).fract() < 0.02 { 4.0 } else { 0.0 }
            }),
        ];
        for (name, time, noise) in worlds {
            for seed in 0..20 {
                let found = judged(rows(seed, time, noise));
                assert!(!found.passes(), "{name}, seed {seed}: {found:?}");
            }
        }
    }

    /// Cut into runs it is the same noise; what cannot be judged is not.
    #[test]
    fn runs_are_taken_together_and_few_rows_say_nothing() {
        let whole = rows(1, 0.1, |_, _, slow, _| slow);
        let cut = |range: std::ops::Range<usize>| Run {
            residual: whole.residual[range.clone()].to_vec(),
            velocity: whole.velocity[range].to_vec(),
            cutoff: CUTOFF,
        };
        let pieces: Vec<Run> = (0..4).map(|i| cut(240 * i..240 * (i + 1))).collect();
        let found = judge(&pieces).expect("rows enough");
        assert!(
            found.passes() && (found.time / 2.0 - 1.0).abs() < 0.4,
            "{found:?}"
        );
        assert_eq!(judge(&pieces[..1]), None);
        let short: Vec<Run> = (0..40).map(|i| cut(20 * i..20 * (i + 1))).collect();
        assert_eq!(judge(&short), None);
        assert_eq!(judge(&[]), None);
        let nothing = Run {
            residual: vec![0.0; 900],
            velocity: vec![1.0; 900],
            cutoff: CUTOFF,
        };
        assert_eq!(judge(&[nothing]), None);
    }
}
