//! The multiplier c of the tempered likelihood, and the width of intervals, from left-out parts of the training data.
//!
//! The residual of a real robot is mostly model error: slow, repeatable on one trajectory, different on the next. An
//! in-sample noise level cannot see that; predicting parts that were left out can.

use super::{Fit, FitSettings, Moving, fit, residual_correlation_time, start, total};
use crate::error::Result;
use crate::infer::approximate;
use crate::likelihood::{Columns, PlugIn, assemble};
use crate::observations::{Observations, Part};
use crate::posterior::Posterior;

/// The multipliers that compete.
const MULTIPLIERS: [f64; 3] = [1.0, 3.0, 10.0];
/// A larger c must predict better by this many nats (residual autocorrelation counted) to be preferred.
const MARGIN: f64 = 2.0;
/// Parts that one or two logs are cut into; three logs or more are left out one by one.
const PARTS: usize = 5;
/// Left-out logs at most; more are grouped.
const MOST_FOLDS: usize = 6;

/// What predicting left-out training data says.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// `(c, log score)` of each multiplier tried.
    pub scores: Vec<(f64, f64)>,
    /// Factor per joint on the noise sd of an interval so that left-out residuals have the stated variance.
    pub interval_factor: Vec<f64>,
}

/// One prediction of a left-out part, joint by joint.
struct Prediction {
    /// Per joint: squared error and its epistemic variance, per moving row.
    rows: Vec<Vec<(f64, f64)>>,
    /// √(E[φ]) of the fold that predicted.
    noise: f64,
}

/// Measures the noise with independent rows, lets the multipliers compete on left-out parts, and keeps the winner.
///
/// Weights and τ come from the residual of the untempered fit and stay: iterated under tempering they feed on
/// themselves (fewer effective rows → fewer effects → a longer correlated residual → fewer effective rows) until
/// nothing is left.
///
/// # Errors
/// Those of [`fit`].
pub fn fit_tempered(
    training: &[Part<'_>],
    columns: &Columns,
    settings: FitSettings<'_>,
) -> Result<(Fit, LeftOut)> {
    let white = fit(
        training,
        columns,
        settings,
        &start(training, columns, settings.prior),
        Moving::All,
        None,
    )?;
    let known = Some(&white.posterior);
    let correlated = PlugIn {
        autocorrelation_time: (0..white.plug_in.weight.len())
            .map(|joint| residual_correlation_time(training, joint, &white.posterior.mean))
            .collect(),
        ..white.plug_in.clone()
    };
    let folds = folds(training);
    let mut candidates = Vec::new();
    for c in MULTIPLIERS {
        let plug_in = PlugIn {
            tempering: c,
            ..correlated.clone()
        };
        let fitted = fit(
            training,
            columns,
            settings,
            &plug_in,
            Moving::SlabScaleRoughly,
            known,
        )?;
        let predicted = predict_left_out(&folds, columns, settings, &fitted)?;
        let score = score(&predicted, &fitted.plug_in);
        candidates.push((fitted, predicted, score));
    }
    let scores: Vec<(f64, f64)> = MULTIPLIERS
        .iter()
        .copied()
        .zip(candidates.iter().map(|c| c.2))
        .collect();
    let best = scores.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
    let chosen = scores
        .iter()
        .position(|s| s.1 >= best - MARGIN)
        .unwrap_or(0);
    let (rough, predicted, _) = candidates.swap_remove(chosen);
    let fitted = fit(
        training,
        columns,
        settings,
        &rough.plug_in,
        Moving::SlabScale,
        Some(&rough.posterior),
    )?;
    let interval_factor = interval_factors(&predicted, &fitted.plug_in);
    Ok((
        fitted,
        LeftOut {
            scores,
            interval_factor,
        },
    ))
}

/// `(training, left out)` pairs: whole logs when there are three or more, otherwise equal parts of each log.
fn folds<'a>(training: &[Part<'a>]) -> Vec<(Vec<Part<'a>>, Vec<Part<'a>>)> {
    let pieces: Vec<Part<'a>> = if training.len() >= 3 {
        training.to_vec()
    } else {
        let count = PARTS.div_ceil(training.len().max(1));
        training
            .iter()
            .flat_map(|part| pieces_of(part, count))
            .collect()
    };
    let count = pieces.len().min(MOST_FOLDS);
    (0..count)
        .map(|fold| {
            let (out, kept): (Vec<_>, Vec<_>) = pieces
                .iter()
                .cloned()
                .enumerate()
                .partition(|(i, _)| i % count == fold);
            (
                kept.into_iter().map(|p| p.1).collect(),
                out.into_iter().map(|p| p.1).collect(),
            )
        })
        .collect()
}

fn pieces_of<'a>(part: &Part<'a>, count: usize) -> Vec<Part<'a>> {
    let observations: &'a Observations = part.observations;
    let cut = |i: usize| part.rows.start + i * part.rows.len() / count;
    (0..count)
        .map(|i| Part {
            observations,
            rows: cut(i)..cut(i + 1),
        })
        .collect()
}

fn predict_left_out(
    folds: &[(Vec<Part<'_>>, Vec<Part<'_>>)],
    columns: &Columns,
    settings: FitSettings<'_>,
    whole: &Fit,
) -> Result<Vec<Prediction>> {
    let plug_in = &whole.plug_in;
    let mut all = Vec::new();
    for (kept, out) in folds {
        let problem = assemble(&total(kept), columns, plug_in, settings.prior)?;
        let posterior = approximate(&problem, Some(&whole.posterior))?;
        let covariance = posterior.covariance();
        let joints = plug_in.weight.len();
        let mut rows = vec![Vec::new(); joints];
        for part in out {
            for (joint, rows) in rows.iter_mut().enumerate() {
                rows.extend(squared_errors(part, joint, &posterior, &covariance));
            }
        }
        all.push(Prediction {
            rows,
            noise: posterior.noise,
        });
    }
    Ok(all)
}

/// Squared error and epistemic variance `xᵀ Cov x` of every moving row of a joint.
fn squared_errors(
    part: &Part<'_>,
    joint: usize,
    posterior: &Posterior,
    covariance: &[f64],
) -> Vec<(f64, f64)> {
    let (len, rows) = (part.observations.len(), &part.observations.joints[joint]);
    let count = posterior.mean.len();
    let residual = part.residual(joint, &posterior.mean, part.rows.clone());
    let mut epistemic = vec![0.0; residual.len()];
    for (i, &a) in rows.columns.iter().enumerate() {
        for (k, &b) in rows.columns.iter().enumerate().take(i + 1) {
            let value = covariance[a * count + b] * if i == k { 1.0 } else { 2.0 };
            if value == 0.0 {
                continue;
            }
            let xa = &rows.x[i * len + part.rows.start..i * len + part.rows.end];
            let xb = &rows.x[k * len + part.rows.start..k * len + part.rows.end];
            for ((e, xa), xb) in epistemic.iter_mut().zip(xa).zip(xb) {
                *e += value * xa * xb;
            }
        }
    }
    let moving = part.rows.clone().map(|row| !rows.standstill[row]);
    residual
        .iter()
        .zip(epistemic)
        .zip(moving)
        .filter(|(_, moving)| *moving)
        .map(|((r, e), _)| (r * r, e.max(0.0)))
        .collect()
}

/// Log predictive density of the left-out rows, each joint's sum divided by its autocorrelation time.
fn score(predictions: &[Prediction], plug_in: &PlugIn) -> f64 {
    let mut sum = 0.0;
    for prediction in predictions {
        for (joint, rows) in prediction.rows.iter().enumerate() {
            let noise = prediction.noise / plug_in.weight[joint];
            let density: f64 = rows
                .iter()
                .map(|(square, epistemic)| {
                    let variance = (noise + epistemic).max(f64::MIN_POSITIVE);
                    -0.5 * (std::f64::consts::TAU * variance).ln() - 0.5 * square / variance
                })
                .sum();
            sum += density / plug_in.autocorrelation_time[joint];
        }
    }
    sum
}

/// `f_j² = Σ (squared error − epistemic variance) / Σ noise variance`, at least 1: left-out data may say that the noise
/// on the training data was too small, never that it was too large (with few effective rows E[φ] is wide for a reason).
fn interval_factors(predictions: &[Prediction], plug_in: &PlugIn) -> Vec<f64> {
    (0..plug_in.weight.len())
        .map(|joint| {
            let (mut excess, mut noise) = (0.0, 0.0);
            for prediction in predictions {
                for (square, epistemic) in &prediction.rows[joint] {
                    excess += square - epistemic;
                    noise += prediction.noise / plug_in.weight[joint];
                }
            }
            if noise > 0.0 {
                (excess / noise).max(1.0).sqrt()
            } else {
                1.0
            }
        })
        .collect()
}
