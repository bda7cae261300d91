//! Power of a joint's columns and torque over all logs: of any residual the autocorrelation follows, without its rows.
//!
//! With P_b the power of columns and torque in band b ([`Bands`]),
//!
//! ```text
//! r_k ∝ Σ_b p_b ⟨cos 2π f k⟩_b,   p_b = [−β, 1]ᵀ P_b [−β, 1]
//! ```

use super::bands::{Bands, edges};
use super::log_sums::JointSums;
use super::unit::residual_form;
use crate::diagnostics::initial_positive_sequence;
use crate::term::Recipes;
use std::f64::consts::TAU;
use std::ops::AddAssign;
use std::sync::Arc;

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

impl Spectrum {
    /// Adds the rows of one log, or of several.
    pub(super) fn add(&mut self, log: &JointSums) {
        self.add_kind(&log.recipes, &log.columns, &log.bands);
    }

    fn add_kind(&mut self, recipes: &Option<Arc<Recipes>>, columns: &[usize], bands: &Bands) {
        match self.sums.iter_mut().find(|own| own.recipes == *recipes) {
            Some(known) => known.bands += bands,
            None => self.sums.push(Kind {
                columns: columns.to_vec(),
                recipes: recipes.clone(),
                bands: bands.clone(),
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

impl AddAssign<&Spectrum> for Spectrum {
    /// # Panics
    /// If the two belong to different signals.
    fn add_assign(&mut self, other: &Spectrum) {
        for own in &other.sums {
            self.add_kind(&own.recipes, &own.columns, &own.bands);
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostics::integrated_autocorrelation_time;
    use crate::gram::Symmetric;
    use crate::linear_algebra::dot;
    use crate::observations::{JointObservations, Observations, Part};
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
