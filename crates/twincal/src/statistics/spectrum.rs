//! Power of a joint's columns and torque by frequency: of any residual the autocorrelation follows, without its rows.
//!
//! With X_m the discrete Fourier transform of a run of rows `x = [columns, y]`, padded to M ≥ 2n, and bands of frequencies f (cycles per row),
//!
//! ```text
//! P_b = Σ_{m: f_m ∈ b} Re(X_m X_m*) / M,     Σ_b P_b = Σ x xᵀ,     r_k ∝ Σ_b p_b ⟨cos 2π f k⟩_b,   p_b = [−β, 1]ᵀ P_b [−β, 1]
//! ```
//! Bands grow by a quarter with frequency: a lag at which noise of some memory still correlates is short beside 1 over the width of the
//! bands in which that noise has its power. Sums of runs, parts and logs add.

use super::log_sums::JointSums;
use super::residual_form;
use crate::diagnostics::initial_positive_sequence;
use crate::gram::Symmetric;
use crate::linear_algebra::dot;
use crate::observations::Part;
use crate::term::Recipes;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::ops::{AddAssign, Range};
use std::sync::Arc;

/// Upper end of the lowest band, cycles per row, and how much higher that of the next one is.
const LOWEST: f64 = 1.0 / 512.0;
const GROWTH: f64 = 1.25;
/// Rows that are transformed at a time.
const LONGEST: usize = 4096;
/// A short run is padded to eight times its length, but to no more than this: its power between bins is what says which band it is in.
const PADDED: usize = 1024;

/// Of one joint over all logs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectrum {
    /// One for all rows whose columns follow alike from what is kept: two where a payload acts in some logs only.
    sums: Vec<Kind>,
}

/// Power of signals, and the columns that follow from them.
#[derive(Debug, Clone)]
struct Kind {
    columns: Vec<usize>,
    recipes: Option<Arc<Recipes>>,
    bands: Bands,
}

/// P_b of the signals of one joint and y, band by band.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Bands {
    pub(crate) power: Vec<Symmetric>,
    /// Rows of the longest run, at most [`LONGEST`].
    pub(crate) longest: usize,
}

impl Bands {
    /// Number of bands.
    pub(crate) const COUNT: usize = 26;

    /// Of the moving rows of a joint, as the fit weighs them.
    pub(super) fn of(part: &Part<'_>, joint: usize) -> Self {
        let (all, rows) = (part.observations, &part.observations.joints[joint]);
        let signals = rows.signals();
        let mut bands = Self {
            power: vec![Symmetric::zeros(signals + 1); edges().len() - 1],
            longest: 0,
        };
        let mut run = Run {
            values: vec![Vec::new(); signals + 1],
            planner: RealFftPlanner::new(),
        };
        for range in part.runs_between_starts() {
            rows.visit_signals(all.len(), range, &mut |range, columns| {
                let moving = |row: &usize| !rows.standstill[*row];
                let mut from = range.start;
                while from < range.end {
                    if !moving(&from) {
                        bands.end(&mut run);
                        from += 1;
                        continue;
                    }
                    let most = (range.end - from).min(LONGEST - run.len());
                    let to = from + (from..from + most).take_while(moving).count();
                    for (i, values) in run.values[..signals].iter_mut().enumerate() {
                        values.extend_from_slice(columns.of(i, from - range.start, to - from));
                    }
                    run.values[signals].extend_from_slice(&rows.y[from..to]);
                    run.weigh(&rows.weight, from..to);
                    if run.len() == LONGEST {
                        bands.end(&mut run);
                    }
                    from = to;
                }
            });
            bands.end(&mut run);
        }
        bands
    }

    /// Of some of the signals.
    pub(super) fn of_signals(&self, signals: &[usize]) -> Self {
        let of = |sums: &Symmetric| {
            let rows: Vec<usize> = signals.iter().copied().chain([sums.size - 1]).collect();
            sums.of(&rows)
        };
        Self {
            power: self.power.iter().map(of).collect(),
            longest: self.longest,
        }
    }

    fn end(&mut self, run: &mut Run) {
        self.longest = self.longest.max(run.len());
        run.add_to(&mut self.power);
    }
}

impl AddAssign<&Bands> for Bands {
    /// # Panics
    /// If the two belong to different signals.
    fn add_assign(&mut self, other: &Bands) {
        self.longest = self.longest.max(other.longest);
        for (sum, own) in self.power.iter_mut().zip(&other.power) {
            *sum += own;
        }
    }
}

impl Spectrum {
    /// Adds the rows of one log.
    pub(super) fn add(&mut self, log: &JointSums) {
        let known = self.sums.iter_mut().find(|own| own.recipes == log.recipes);
        match known {
            Some(known) => known.bands += &log.bands,
            None => self.sums.push(Kind {
                columns: log.columns.clone(),
                recipes: log.recipes.clone(),
                bands: log.bands.clone(),
            }),
        }
    }

    /// Power of `y − Xβ` in each band.
    fn power(&self, beta: &[f64]) -> Vec<f64> {
        let mut power = vec![0.0; edges().len() - 1];
        for own in &self.sums {
            let mut beta: Vec<f64> = own.columns.iter().map(|&column| beta[column]).collect();
            if let Some(recipes) = &own.recipes {
                beta = recipes.of_parts(&beta);
            }
            let forms = own.bands.power.iter();
            let forms = forms.map(|sums| residual_form(sums, &beta));
            (power.iter_mut().zip(forms)).for_each(|(sum, form)| *sum += form.max(0.0));
        }
        power
    }

    /// Autocorrelation of `y − Xβ` at the lags 0, 1, … rows; `None` where there is no power.
    fn correlation(&self, beta: &[f64]) -> Option<impl Fn(usize) -> f64> {
        let (edges, power) = (edges(), self.power(beta));
        let total: f64 = power.iter().sum();
        (total > 0.0 && total.is_finite()).then_some(move |lag: usize| {
            let bands = edges.windows(2).zip(&power);
            bands.map(|(band, p)| p * cosine(band, lag)).sum::<f64>() / total
        })
    }

    /// Autocorrelation of `y − Xβ` at the lags below `lags`, in rows; zeros where there is no power.
    pub(crate) fn autocorrelation(&self, beta: &[f64], lags: usize) -> Vec<f64> {
        match self.correlation(beta) {
            Some(correlation) => (0..lags).map(correlation).collect(),
            None => vec![0.0; lags],
        }
    }

    /// Integrated autocorrelation time of `y − Xβ` in rows, as Geyer's initial positive sequence has it; 1 where there is no power.
    pub(crate) fn autocorrelation_time(&self, beta: &[f64]) -> f64 {
        let Some(correlation) = self.correlation(beta) else {
            return 1.0;
        };
        let longest = self.sums.iter().map(|own| own.bands.longest);
        initial_positive_sequence(longest.max().unwrap_or(0), correlation).max(1.0)
    }
}

/// Mean of cos 2π f k over a band.
fn cosine(band: &[f64], lag: usize) -> f64 {
    if lag == 0 {
        return 1.0;
    }
    let k = TAU * lag as f64;
    ((k * band[1]).sin() - (k * band[0]).sin()) / (k * (band[1] - band[0]))
}

/// Ends of the bands, cycles per row.
fn edges() -> Vec<f64> {
    let grown = std::iter::successors(Some(LOWEST), |edge| Some(edge * GROWTH));
    let below = grown.take_while(|edge| *edge * GROWTH.sqrt() < 0.5);
    std::iter::once(0.0).chain(below).chain([0.5]).collect()
}

/// Rows of one run: signals and y.
struct Run {
    values: Vec<Vec<f64>>,
    planner: RealFftPlanner<f64>,
}

impl Run {
    fn len(&self) -> usize {
        self.values.last().map_or(0, Vec::len)
    }

    /// Multiplies the rows that came last with the roots of what they count.
    fn weigh(&mut self, weight: &[f64], rows: Range<usize>) {
        let Some(weight) = weight.get(rows) else {
            return;
        };
        let from = self.len() - weight.len();
        for values in &mut self.values {
            let own = values[from..].iter_mut().zip(weight);
            own.for_each(|(value, u)| *value *= u.sqrt());
        }
    }

    /// Adds the power of the run, which begins anew.
    fn add_to(&mut self, power: &mut [Symmetric]) {
        let rows = self.len();
        if rows == 0 {
            return;
        }
        let padded = (8 * rows).min(PADDED).max(2 * rows).next_power_of_two();
        let transform = self.planner.plan_fft_forward(padded);
        let mut scratch = transform.make_scratch_vec();
        let bins = padded / 2 + 1;
        // Real and imaginary parts by turns: a band is a stretch of them.
        let transformed: Vec<Vec<f64>> = (self.values.iter_mut())
            .map(|values| {
                let mut input = std::mem::take(values);
                input.resize(padded, 0.0);
                let mut output = vec![Complex::new(0.0, 0.0); bins];
                let done = transform.process_with_scratch(&mut input, &mut output, &mut scratch);
                debug_assert!(done.is_ok(), "lengths are the plan's");
                let scaled = output.iter().enumerate().flat_map(|(m, x)| {
                    let twice = if m == 0 || m == bins - 1 { 1.0 } else { 2.0 };
                    let root = f64::sqrt(twice / padded as f64);
                    [x.re * root, x.im * root]
                });
                scaled.collect()
            })
            .collect();
        let bin = |edge: f64| (edge * padded as f64).ceil() as usize;
        let edges = edges();
        for (band, sums) in edges.windows(2).zip(power) {
            let last = band[1] >= 0.5;
            let stretch = 2 * bin(band[0])..2 * if last { bins } else { bin(band[1]) };
            if stretch.is_empty() {
                continue;
            }
            for i in 0..sums.size {
                for j in 0..=i {
                    let pair = [i, j].map(|signal| &transformed[signal][stretch.clone()]);
                    let product = dot(pair[0], pair[1]);
                    sums.values[i * sums.size + j] += product;
                    if i != j {
                        sums.values[j * sums.size + i] += product;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostics::integrated_autocorrelation_time;
    use crate::observations::{JointObservations, Observations};
    use crate::random::Random;
    use crate::signal::fir::column_kernel;
    use crate::statistics::{Purpose, Runs, Sums};

    /// Rows of one column and of noise with a memory of `time` rows behind the default filter, `y = 2 x + noise`, and what a pause
    /// of one row every `every` rows leaves of them.
    fn log(seed: u64, rows: usize, time: f64, every: usize) -> Observations {
        let mut random = Random::new(seed, 0);
        let taps = column_kernel(5.0, 1.0 / 100.0);
        let step = 8;
        let rho = if time > 0.0 {
            (-1.0 / (time * step as f64)).exp()
        } else {
            0.0
        };
        let mut state = random.normal() / f64::sqrt(1.0 - rho * rho);
        let fine: Vec<f64> = (0..rows * step + taps.len())
            .map(|_| {
                state = rho * state + random.normal();
                state
            })
            .collect();
        let noise = |row: usize| dot(&taps, &fine[row * step..row * step + taps.len()]);
        let x: Vec<f64> = (0..rows).map(|row| (0.31 * row as f64).sin()).collect();
        let y: Vec<f64> = (0..rows).map(|row| 2.0 * x[row] + noise(row)).collect();
        Observations {
            log: "log".into(),
            time: (0..rows).map(|row| row as f64).collect(),
            starts: vec![0],
            q: vec![vec![0.0; rows].into()],
            qd: vec![vec![1.0; rows].into()],
            joints: vec![JointObservations {
                columns: vec![0],
                x,
                measured: y.clone().into(),
                nominal: vec![0.0; rows].into(),
                y,
                standstill: (0..rows).map(|row| row % every == every - 1).collect(),
                ..JointObservations::default()
            }],
            ..Observations::default()
        }
    }

    fn spectrum(parts: &[Part<'_>]) -> Spectrum {
        Sums::of(parts, Runs::Apart, Purpose::Result)
            .spectra
            .swap_remove(0)
    }

    /// The time from bands beside that from rows, white noise to a memory of 19 rows, in one run and in runs of 99 rows: each of twelve
    /// within the share that stands beside it, 0.05 to 0.15, and their mean within 0.6 of that.
    #[test]
    fn bands_have_the_time_of_rows() {
        for (time, every, most) in [
            (0.0, usize::MAX, 0.05),
            (0.3, 100, 0.05),
            (1.1, usize::MAX, 0.1),
            (3.0, usize::MAX, 0.1),
            (3.0, 100, 0.1),
            (9.0, usize::MAX, 0.1),
            (9.0, 100, 0.15),
            (19.0, usize::MAX, 0.12),
        ] {
            let mut mean = 0.0;
            for seed in 0..12 {
                let log = log(seed, 3000, time, every);
                let part = log.whole();
                let runs = part.weighted_runs(0, &[2.0]);
                let runs: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
                let by_rows = integrated_autocorrelation_time(&runs);
                let by_bands = spectrum(&[part]).autocorrelation_time(&[2.0]);
                let off = by_bands / by_rows - 1.0;
                mean += off / 12.0;
                assert!(off.abs() < most, "{time} {every}: {by_bands} {by_rows}");
            }
            assert!(mean.abs() < 0.6 * most, "{time} {every}: {mean}");
        }
    }

    #[test]
    fn there_are_as_many_bands_as_files_hold() {
        assert_eq!(edges().len() - 1, Bands::COUNT);
    }

    /// All power is that of the rows, wherever they are cut, weighed or not.
    #[test]
    fn bands_hold_all_power() {
        let mut log = log(1, 1000, 1.0, 37);
        log.joints[0].weight = (0..1000).map(|row| 0.5 + (row % 3) as f64).collect();
        for parts in [log.cut(1), log.cut(3)] {
            let spectrum = spectrum(&parts);
            let (mut gram, mut sum) = (Symmetric::zeros(2), Symmetric::zeros(2));
            parts
                .iter()
                .for_each(|part| gram += &part.gram().joints[0].s0);
            spectrum.sums[0]
                .bands
                .power
                .iter()
                .for_each(|own| sum += own);
            for (a, b) in sum.values.iter().zip(&gram.values) {
                assert!((a / b - 1.0).abs() < 1e-10, "{a} {b}");
            }
        }
        assert_eq!(Spectrum::default().autocorrelation_time(&[]), 1.0);
    }
}
