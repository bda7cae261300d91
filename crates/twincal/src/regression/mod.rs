//! Spike-and-slab regression of any columns: the likelihood, prior and inference of a calibration without a robot.

mod rows;

use crate::diagnostics::integrated_autocorrelation_time;
use crate::error::{Error, Result};
use crate::gram::Gram;
use crate::infer::{InferenceSettings, infer};
use crate::likelihood::{Columns, NoiseModel, NoiseSettings};
use crate::plug_in::{FitSettings, Moving, count_misfit, first, fit_gram};
use crate::posterior::Posterior;
use crate::prior::PriorSettings;
use crate::statistics::decoys as at_state;
use crate::term::Family;
use rows::Rows;
use serde::{Deserialize, Serialize};

/// Data of a regression.
#[derive(Debug, Clone, Copy)]
pub struct Design<'a> {
    /// Columns, `x[column * rows + row]`.
    pub x: &'a [f64],
    /// What is explained, one number per row.
    pub y: &'a [f64],
    /// Rows, ascending, at which a new run begins: noise is not correlated across it. Row 0 begins one anyway.
    pub breaks: &'a [usize],
    /// Decoys, `decoys[k * rows + row]`: functions of the same state that no column is made of. What the columns leave along them comes
    /// again with the state, so that under `Tempered` it counts as noise beside the autocorrelation. May be empty.
    pub decoys: &'a [f64],
}

/// Everything that can be chosen.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Component of each column, 0..C without a gap: its columns are in or out together.
    pub groups: Vec<usize>,
    /// Likelihood; `Tempered` divides statistics by the autocorrelation time of the residual, or by its misfit along the decoys where that is more.
    pub noise: NoiseModel,
    /// A constant is in the model: columns and `y` are centred, which is a flat prior on it.
    pub intercept: bool,
    /// Prior.
    pub prior: PriorSettings,
    /// Inference.
    pub inference: InferenceSettings,
}

/// The posterior, and what a prediction needs beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Regressed {
    /// Posterior of models and coefficients.
    pub posterior: Posterior,
    /// Mean of each column, subtracted from it; 0 without intercept.
    pub offsets: Vec<f64>,
    /// E[constant | y]; 0 without intercept.
    pub intercept: f64,
    /// sd of one row around the model.
    pub sigma: f64,
    /// AR(1) coefficient; 0 unless `Ar1`.
    pub rho: f64,
    /// Rows that count as one; 1 unless `Tempered`.
    pub rows_per_independent: f64,
    /// Rows.
    pub rows: usize,
    covariance: Vec<f64>,
}

/// The posterior of `y = Xβ + ε` under a spike-and-slab prior: `β_k = 0` or `β_k ~ N(0, v φ / rms_k²)`, slab scale v and noise by the same fixed
/// point as in a calibration.
///
/// | value | shape |
/// |---|---|
/// | `design.x` | columns × rows |
/// | `design.y` | rows |
///
/// # Errors
/// [`Error::Setting`] for lengths that do not fit together, groups with a gap and numbers that are not finite; those of [`infer`].
/// # Source
/// paper eq. (5); method sections 5–7; misfit along decoys: [`crate::plug_in`].
///
/// # Example
/// `y` follows the first column. The second one is orthogonal to `y`: its probability is 1/(1 + √(1 + v n)) whatever the noise is.
/// ```
/// # use twincal::infer::{Choice, InferenceSettings};
/// use twincal::likelihood::NoiseModel;
/// # use twincal::prior::{Inclusion, PriorSettings};
/// use twincal::regression::{Design, Settings, regress};
/// # use twincal::signal::Auto;
///
/// # let inference = InferenceSettings { method: Choice::Exact, chains: 2, draws: 100, seed: 1, allow_disagreement: false };
/// let square = |period: usize| (0..64).map(move |row| if row % period < period / 2 { 1.0 } else { -1.0 });
/// let x: Vec<f64> = square(2).chain(square(4)).collect();
/// let y: Vec<f64> = square(2).zip(square(8)).map(|(x, rest)| 2.0 * x + 0.1 * rest).collect();
/// # let prior = PriorSettings {
/// #     scaled_variance: Auto::Value(100.0), inclusion: Some(Inclusion::Probability(0.5)), noise: Some((2.0, 0.5)),
/// #     families: Vec::new(), forced: Vec::new(), heredity: None,
/// # };
/// // v = 100, both columns with probability ½
/// let settings = Settings { groups: vec![0, 1], noise: NoiseModel::Iid, intercept: false, prior, inference };
/// let found = regress(Design { x: &x, y: &y, breaks: &[], decoys: &[] }, &settings)?;
/// assert!((found.posterior.mean[0] - 2.0).abs() < 0.001 && found.posterior.inclusion[0] > 0.99);
/// assert!((found.posterior.inclusion[1] - 1.0 / (1.0 + (1.0 + 100.0 * 64.0_f64).sqrt())).abs() < 1e-9);
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn regress(design: Design<'_>, settings: &Settings) -> Result<Regressed> {
    check(&design, settings)?;
    let rows = Rows::new(&design, settings.intercept);
    let gram = Gram {
        joints: vec![rows.statistics()],
    };
    let columns = columns(&settings.groups);
    let fit_settings = FitSettings {
        noise: NoiseSettings {
            model: settings.noise,
            per_joint: true,
            robust: false,
            varies_with_speed: false,
            varies_with_load: false,
        },
        prior: &settings.prior,
    };
    let start = first(1, &columns, &settings.prior);
    let mut fit = fit_gram(&gram, &columns, fit_settings, &start, Moving::All)?;
    if settings.noise == NoiseModel::Tempered {
        let runs = rows.residual(&fit.posterior.mean);
        let runs: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
        let times = vec![integrated_autocorrelation_time(&runs).max(1.0)];
        let training = rows.training();
        let measured = (&training, &training.total(), 0.0);
        fit = count_misfit(measured, times, &columns, fit_settings, fit)?;
    }
    let posterior = infer(&fit.problem, &settings.inference)?;
    let rho = fit.plug_in.rho[0];
    let products = posterior
        .mean
        .iter()
        .zip(&rows.offsets)
        .map(|(beta, x)| beta * x);
    Ok(Regressed {
        intercept: rows.centre - products.sum::<f64>(),
        sigma: (posterior.noise / (1.0 - rho * rho)).sqrt(),
        rho,
        rows_per_independent: fit.plug_in.autocorrelation_time[0].max(fit.plug_in.misfit[0]),
        rows: rows.y.len(),
        covariance: posterior.covariance(),
        offsets: rows.offsets,
        posterior,
    })
}

/// The decoys of a calibration for one joint, `decoys[k * rows + row]`: constant and harmonics of its position, each alone and times the direction of
/// motion.
///
/// ```text
/// {1, cos k q, sin k q; k = 1…8} × {1, tanh(q̇/v)},   v = 0.02 rad/s
/// ```
///
/// # Panics
/// If positions `q`, rad, and velocities `qd`, rad/s, are not equally many.
#[must_use]
pub fn decoys(q: &[f64], qd: &[f64]) -> Vec<f64> {
    assert_eq!(q.len(), qd.len(), "one velocity per position");
    let states: Vec<_> = q.iter().zip(qd).map(|(q, qd)| at_state(*q, *qd)).collect();
    let count = states.first().map_or(0, |own| own.len());
    (0..count)
        .flat_map(|k| states.iter().map(move |own| own[k]))
        .collect()
}

impl Regressed {
    /// Mean and sd of a new row of `y` given its columns, `x[row * columns + column]`: the sd holds noise, coefficients and constant.
    ///
    /// # Panics
    /// If `x` is no multiple of the columns.
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let count = self.offsets.len();
        assert!(count > 0 && x.len().is_multiple_of(count), "whole rows");
        // the constant is as uncertain as the mean of so many rows
        let constant = self.sigma * self.sigma * self.rows_per_independent / self.rows as f64;
        let of_row = |row: &[f64]| {
            let products = row
                .iter()
                .zip(&self.posterior.mean)
                .map(|(x, beta)| x * beta);
            let mean = self.intercept + products.sum::<f64>();
            let own: Vec<f64> = row.iter().zip(&self.offsets).map(|(x, o)| x - o).collect();
            let epistemic: f64 = (self.covariance.chunks_exact(count).zip(&own))
                .map(|(line, x)| x * line.iter().zip(&own).map(|(c, x)| c * x).sum::<f64>())
                .sum();
            let variance = epistemic.max(0.0) + constant + self.sigma * self.sigma;
            (mean, variance.sqrt())
        };
        x.chunks_exact(count).map(of_row).unzip()
    }
}

fn check(design: &Design<'_>, settings: &Settings) -> Result<()> {
    let refuse = |key: &str, problem: String, remedy: &str| {
        Err(Error::Setting {
            key: key.into(),
            problem,
            remedy: remedy.into(),
        })
    };
    let (rows, count) = (design.y.len(), settings.groups.len());
    if rows < 2 || count == 0 || design.x.len() != rows * count {
        let problem = format!(
            "{} numbers for {count} columns of {rows} rows",
            design.x.len()
        );
        return refuse("x", problem, "give one column of two rows or more");
    }
    if !design.decoys.len().is_multiple_of(rows) {
        let problem = format!("{} numbers for {rows} rows", design.decoys.len());
        return refuse("decoys", problem, "give one number for every row");
    }
    for (key, values) in [("x", design.x), ("y", design.y), ("decoys", design.decoys)] {
        if let Some(place) = values.iter().position(|value| !value.is_finite()) {
            let problem = format!("{} in row {}", values[place], place % rows);
            return refuse(key, problem, "leave out rows that are not known");
        }
    }
    let components = 1 + settings.groups.iter().max().copied().unwrap_or(0);
    if let Some(gap) = (0..components).find(|own| !settings.groups.contains(own)) {
        let problem = format!("no column of group {gap}");
        return refuse(
            "groups",
            problem,
            "number the groups 0, 1, 2 … without a gap",
        );
    }
    Ok(())
}

/// Columns without bounds, parents or physical priors.
fn columns(groups: &[usize]) -> Columns {
    let count = groups.len();
    let components = 1 + groups.iter().max().copied().unwrap_or(0);
    Columns {
        names: (0..count).map(|column| format!("x{column}")).collect(),
        component: groups.to_vec(),
        family: vec![0; components],
        families: vec![Family::User],
        prior_sd: vec![None; count],
        lower: vec![f64::NEG_INFINITY; count],
        forced: Vec::new(),
        parent: Vec::new(),
        second_choice: Vec::new(),
        one_motion: false,
        halves: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::Choice;
    use crate::prior::Inclusion;
    use crate::random::Random;
    use crate::signal::Auto;

    fn settings(noise: NoiseModel, intercept: bool) -> Settings {
        Settings {
            groups: vec![0, 1],
            noise,
            intercept,
            prior: PriorSettings {
                scaled_variance: Auto::Value(100.0),
                inclusion: Some(Inclusion::Probability(0.5)),
                noise: Some((2.0, 0.5)),
                families: Vec::new(),
                forced: Vec::new(),
                heredity: None,
            },
            inference: InferenceSettings {
                method: Choice::Exact,
                chains: 2,
                draws: 100,
                seed: 1,
                allow_disagreement: false,
            },
        }
    }

    /// Two orthogonal columns: the marginal likelihood of each of the four models in closed form.
    #[test]
    fn probabilities_are_those_of_the_closed_form() {
        let rows = 40;
        let mut random = Random::new(3, 0);
        let a: Vec<f64> = (0..rows)
            .map(|i| if i % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let b: Vec<f64> = (0..rows)
            .map(|i| if i % 4 < 2 { 1.0 } else { -1.0 })
            .collect();
        let y: Vec<f64> = (a.iter())
            .map(|a| 0.2 * a + 0.5 * random.normal())
            .collect();
        let x = [a.clone(), b.clone()].concat();
        let design = Design {
            x: &x,
            y: &y,
            breaks: &[],
            decoys: &[],
        };
        let found = regress(design, &settings(NoiseModel::Iid, false)).unwrap();
        // β ~ N(0, v φ) with rms 1, φ ~ InvGamma(a0, b0), each column in with probability ½
        let (n, v, a0, b0) = (rows as f64, 100.0, 2.0, 0.5);
        let dot = |p: &[f64], q: &[f64]| -> f64 { p.iter().zip(q).map(|(p, q)| p * q).sum() };
        let log = |inside: [bool; 2]| {
            let gain: f64 = [&a, &b]
                .iter()
                .zip(inside)
                .filter(|(_, inside)| *inside)
                .map(|(column, _)| dot(column, &y).powi(2) / (n + 1.0 / v))
                .sum();
            let size = inside.iter().filter(|inside| **inside).count() as f64;
            -0.5 * size * (1.0 + v * n).ln()
                - (a0 + 0.5 * n) * (b0 + 0.5 * (dot(&y, &y) - gain)).ln()
        };
        let models = [[false, false], [true, false], [false, true], [true, true]];
        let weights = models.map(|inside| log(inside).exp());
        let all: f64 = weights.iter().sum();
        let pip = [
            (weights[1] + weights[3]) / all,
            (weights[2] + weights[3]) / all,
        ];
        for k in 0..2 {
            let error = (found.posterior.inclusion[k] - pip[k]).abs();
            assert!(
                error < 1e-9,
                "{k}: {} and {}",
                found.posterior.inclusion[k],
                pip[k]
            );
        }
    }

    #[test]
    fn a_constant_moves_nothing_but_the_intercept() {
        let mut random = Random::new(4, 0);
        let x: Vec<f64> = (0..400).map(|_| 3.0 + random.normal()).collect();
        let y: Vec<f64> = (0..200)
            .map(|i| 2.0 * x[i] + 0.1 * random.normal())
            .collect();
        let moved: Vec<f64> = y.iter().map(|y| y + 7.0).collect();
        let of = |y: &[f64]| {
            let design = Design {
                x: &x,
                y,
                breaks: &[],
                decoys: &[],
            };
            regress(design, &settings(NoiseModel::Iid, true)).unwrap()
        };
        let (one, other) = (of(&y), of(&moved));
        assert!((other.intercept - one.intercept - 7.0).abs() < 1e-9);
        assert!((other.posterior.mean[0] - one.posterior.mean[0]).abs() < 1e-9);
        let error = |found: &Regressed| (found.predict(&x[..2]).0[0] - found.intercept).abs();
        assert!((error(&one) - error(&other)).abs() < 1e-9);
    }

    /// No column is in: rows count by what the decoys leave, by its definition over all rows and over left-out fifths.
    #[test]
    fn misfit_along_decoys_counts_as_noise() {
        let rows = 500;
        let mut random = Random::new(5, 0);
        let q: Vec<f64> = (0..rows).map(|i| (0.7 * i as f64).sin()).collect();
        let decoys: Vec<f64> = (1..4)
            .flat_map(|k| q.iter().map(move |q| (k as f64 * q).cos()))
            .collect();
        let mut noise = |_| random.normal();
        let y: Vec<f64> = q
            .iter()
            .map(|q| (2.0 * q).cos())
            .zip((0..rows).map(&mut noise))
            .map(|(a, b)| a + b)
            .collect();
        let x: Vec<f64> = (0..rows).chain(0..rows).map(noise).collect();
        let design = Design {
            x: &x,
            y: &y,
            breaks: &[],
            decoys: &decoys,
        };
        let mut hardly_in = settings(NoiseModel::Tempered, false);
        hardly_in.prior.inclusion = Some(Inclusion::Probability(1e-9));
        let found = regress(design, &hardly_in).unwrap();
        let dot = |p: &[f64], q: &[f64]| -> f64 { p.iter().zip(q).map(|(p, q)| p * q).sum() };
        let variance = dot(&y, &y) / rows as f64;
        let ratio = |pieces: usize| {
            let size = rows / pieces;
            let (mut squares, mut expected) = (0.0, 0.0);
            for phi in decoys.chunks_exact(rows) {
                for (phi, y) in phi.chunks_exact(size).zip(y.chunks_exact(size)) {
                    squares += dot(phi, y).powi(2);
                    expected += dot(phi, phi);
                }
            }
            squares / expected / variance
        };
        let misfit = ratio(1).max(ratio(5));
        assert!(misfit > 5.0, "{misfit}");
        let error = found.rows_per_independent / misfit - 1.0;
        assert!(
            error.abs() < 1e-6,
            "{} and {misfit}",
            found.rows_per_independent
        );
        let without = Design {
            decoys: &[],
            ..design
        };
        let without = regress(without, &hardly_in).unwrap();
        assert!(without.rows_per_independent < 2.0);
    }
}
