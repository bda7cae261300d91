//! The multiplier c of the tempered likelihood, and the width of intervals, from left-out parts of the training data.
//!
//! The residual of a real robot is mostly model error: slow, repeatable on one trajectory, different on the next. An
//! in-sample noise level cannot see that; predicting parts that were left out can.

use super::{Fit, FitSettings, Moving, fit_gram, residual_correlation_time, start, total};
use crate::error::Result;
use crate::gram::Gram;
use crate::infer::approximate;
use crate::likelihood::{Columns, PlugIn, assemble};
use crate::observations::{Observations, Part, QuadraticForm};
use crate::posterior::Posterior;
use rayon::prelude::*;

/// The multipliers that compete.
const MULTIPLIERS: [f64; 3] = [1.0, 3.0, 10.0];
/// A larger c must predict better by this many nats (residual autocorrelation counted) to be preferred.
const MARGIN: f64 = 2.0;
/// Parts that one or two logs are cut into; three logs or more are left out one by one.
const PARTS: usize = 5;
/// Degrees of freedom of the t likelihood that robust rows have.
const FREEDOM: f64 = 4.0;
/// 1.96².
const NORMAL95: f64 = 3.841_458_820_694_124;
/// Left-out logs at most; more are grouped.
const MOST_FOLDS: usize = 6;

/// What predicting left-out training data says.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// `(c, log score)` of each multiplier that leaves rows enough to predict.
    pub scores: Vec<(f64, f64)>,
    /// Factor per joint on the noise sd of an interval so that left-out residuals have the stated variance.
    pub interval_factor: Vec<f64>,
}

/// What the left-out moving rows of one joint add up to: of a long log they are too many to be kept for every multiplier.
#[derive(Debug, Default)]
struct LeftOutJoint {
    /// Log predictive density.
    density: f64,
    /// `Σ (squared error − epistemic variance)`, (N·m)².
    excess: f64,
    /// Sum of the relative noise variances.
    spread: f64,
    /// With robust noise, of every row the relative variance that 1.96 sd of it would need beyond the epistemic one, (N·m)².
    needed: Vec<f64>,
}

/// One prediction of a left-out part.
struct Prediction {
    joints: Vec<LeftOutJoint>,
    /// E[φ] of the fold that predicted.
    noise: f64,
}

/// Measures the noise with independent rows, lets the multipliers compete on left-out parts, and keeps the winner.
///
/// Weights and τ come from the residual of the untempered fit and stay: iterated under tempering they feed on
/// themselves (fewer effective rows → fewer effects → a longer correlated residual → fewer effective rows) until
/// nothing is left.
///
/// # Errors
/// Those of [`super::fit`].
pub fn fit_tempered(
    training: &[Part<'_>],
    columns: &Columns,
    settings: FitSettings<'_>,
) -> Result<(Fit, LeftOut)> {
    let gram = total(training);
    let white = fit_gram(
        training,
        &gram,
        columns,
        settings,
        &start(training, columns, settings.prior),
        Moving::All,
        None,
    )?;
    let known = Some(&white.posterior);
    let correlated = PlugIn {
        autocorrelation_time: (0..white.plug_in.weight.len())
            .map(|joint| {
                residual_correlation_time(training, joint, &white.posterior.mean)
                    * weighing(training, joint, settings.noise.robust)
            })
            .collect(),
        ..white.plug_in.clone()
    };
    let folds = folds(training);
    let weigh = |c: f64| -> Result<(Fit, Vec<Prediction>, f64)> {
        let plug_in = PlugIn {
            tempering: c,
            ..correlated.clone()
        };
        let fitted = fit_gram(
            training,
            &gram,
            columns,
            settings,
            &plug_in,
            Moving::SlabScaleRoughly,
            known,
        )?;
        let predicted = predict_left_out(&folds, columns, settings, &fitted)?;
        let score = score(&predicted, &fitted.plug_in);
        Ok((fitted, predicted, score))
    };
    let weighed: Vec<_> = MULTIPLIERS.into_par_iter().map(weigh).collect();
    let mut candidates = Vec::new();
    for candidate in weighed {
        let candidate = candidate?;
        // Where c leaves two rows or fewer the noise has no mean: it predicts nothing, and larger ones do not either.
        if !candidate.2.is_finite() && !candidates.is_empty() {
            break;
        }
        candidates.push(candidate);
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
    let fitted = fit_gram(
        training,
        &gram,
        columns,
        settings,
        &rough.plug_in,
        Moving::SlabScale,
        Some(&rough.posterior),
    )?;
    let interval_factor = if settings.noise.robust {
        robust_factors(&predicted, &fitted.plug_in)
    } else {
        interval_factors(&predicted, &fitted.plug_in)
    };
    // With so few rows that even c = 1 predicts nothing there is no score to tell.
    let scores = scores.into_iter().filter(|s| s.1.is_finite()).collect();
    Ok((
        fitted,
        LeftOut {
            scores,
            interval_factor,
        },
    ))
}

/// What weighing rows costs: the variance of the t likelihood's estimate over the one that known weights would give, from
/// the weights alone (t² = (ν+1)/u − ν); 1 without weights. With ψ = u t (Huber 1981, eq. 4.6.11)
///
/// ```text
/// κ = E[ψ²]/E[ψ']² · E[u]/E[u t²],     ψ' = u² (ν − t²)/(ν + 1)
/// ```
fn weighing(training: &[Part<'_>], joint: usize, robust: bool) -> f64 {
    if !robust {
        return 1.0;
    }
    let (mut score, mut slope, mut known, mut square) = (0.0, 0.0, 0.0, 0.0);
    let mut count = 0.0;
    for part in training {
        let rows = &part.observations.joints[joint];
        let Some(weights) = rows.weight.get(part.rows.clone()) else {
            continue;
        };
        for (row, weight) in part.rows.clone().zip(weights) {
            if !rows.standstill[row] {
                let u = weight * rows.spread.get(row).copied().unwrap_or(1.0);
                let t2 = (FREEDOM + 1.0) / u - FREEDOM;
                score += u * u * t2;
                slope += u * u * (FREEDOM - t2) / (FREEDOM + 1.0);
                known += u;
                square += u * t2;
                count += 1.0;
            }
        }
    }
    let cost = score * count / (slope * slope) * known / square;
    if cost.is_finite() { cost.max(1.0) } else { 1.0 }
}

/// What one fold knows, and what it predicts.
struct LeaveOut<'a> {
    /// Statistics of the kept pieces, added up fold by fold: no subtraction, no rounding but that of a sum.
    kept: Gram,
    out: Vec<Part<'a>>,
}

/// Whole logs are left out when there are three or more, otherwise equal parts of each log. Every piece is gone through
/// once, however often its statistics count.
fn folds<'a>(training: &[Part<'a>]) -> Vec<LeaveOut<'a>> {
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
    let out: Vec<Vec<Part<'a>>> = (0..count)
        .map(|fold| pieces.iter().skip(fold).step_by(count).cloned().collect())
        .collect();
    let grams: Vec<Gram> = out.par_iter().map(|out| total(out)).collect();
    let folds = out.into_iter().enumerate();
    folds
        .map(|(fold, out)| {
            let mut kept = Gram::default();
            let others = grams.iter().enumerate();
            others
                .filter(|(other, _)| *other != fold)
                .for_each(|(_, gram)| kept += gram);
            LeaveOut { kept, out }
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
    folds: &[LeaveOut<'_>],
    columns: &Columns,
    settings: FitSettings<'_>,
    whole: &Fit,
) -> Result<Vec<Prediction>> {
    let plug_in = &whole.plug_in;
    folds
        .par_iter()
        .map(|LeaveOut { kept, out }| {
            let problem = assemble(kept, columns, plug_in, settings.prior)?;
            let posterior = approximate(&problem, Some(&whole.posterior))?;
            let covariance = posterior.covariance();
            let robust = settings.noise.robust;
            let joint = |joint: usize| {
                let noise = posterior.noise / plug_in.weight[joint];
                let mut sums = LeftOutJoint::default();
                let mut form: Option<QuadraticForm> = None;
                for part in out {
                    if !form.as_ref().is_some_and(|form| part.has_form(joint, form)) {
                        let count = posterior.mean.len();
                        form = Some(part.quadratic_form(joint, &covariance, count));
                    }
                    if let Some(form) = &form {
                        sums.add(part, joint, (&posterior, form), (noise, robust));
                    }
                }
                sums
            };
            Ok(Prediction {
                joints: (0..plug_in.weight.len()).map(joint).collect(),
                noise: posterior.noise,
            })
        })
        .collect()
}

impl LeftOutJoint {
    /// Every moving row of a joint; the density is normal or, with robust noise, Student-t.
    fn add(
        &mut self,
        part: &Part<'_>,
        joint: usize,
        (posterior, form): (&Posterior, &QuadraticForm),
        (noise, robust): (f64, bool),
    ) {
        let rows = &part.observations.joints[joint];
        let residual = part.residual(joint, &posterior.mean, part.rows.clone());
        let epistemic = part.forms(joint, form);
        for (row, (r, epistemic)) in part.rows.clone().zip(residual.iter().zip(epistemic)) {
            if rows.standstill[row] {
                continue;
            }
            let (square, epistemic) = (r * r, epistemic.max(0.0));
            let spread = rows.spread.get(row).copied().unwrap_or(1.0);
            let variance = (spread * noise + epistemic).max(f64::MIN_POSITIVE);
            let tail = if robust {
                (FREEDOM + 1.0) * (square / (FREEDOM * variance)).ln_1p()
            } else {
                square / variance
            };
            self.density += -0.5 * (std::f64::consts::TAU * variance).ln() - 0.5 * tail;
            self.excess += square - epistemic;
            self.spread += spread;
            if robust {
                self.needed.push((square / NORMAL95 - epistemic) / spread);
            }
        }
    }
}

/// Log predictive density of the left-out rows, each joint's sum divided by its autocorrelation time.
fn score(predictions: &[Prediction], plug_in: &PlugIn) -> f64 {
    let joints = predictions.iter().flat_map(|prediction| {
        let joints = prediction.joints.iter();
        joints.zip(&plug_in.autocorrelation_time)
    });
    joints.map(|(joint, time)| joint.density / time).sum()
}

/// Factor that lets the 95 % interval of a normal distribution hold 95 % of the left-out rows, at least 1.
fn robust_factors(predictions: &[Prediction], plug_in: &PlugIn) -> Vec<f64> {
    (0..plug_in.weight.len())
        .map(|joint| {
            // |error| ≤ 1.96 √(f² noise + epistemic) where f² ≥ (error²/1.96² − epistemic)/noise.
            let mut needed: Vec<f64> = predictions
                .iter()
                .flat_map(|prediction| {
                    let noise = prediction.noise / plug_in.weight[joint];
                    let rows = prediction.joints[joint].needed.iter();
                    rows.map(move |needed| needed / noise)
                })
                .filter(|factor| factor.is_finite())
                .collect();
            needed.sort_by(f64::total_cmp);
            let enough = (0.95 * needed.len() as f64).ceil() as usize;
            let factor = needed.get(enough.saturating_sub(1)).copied();
            factor.unwrap_or(1.0).max(1.0).sqrt()
        })
        .collect()
}

/// `f_j² = Σ (squared error − epistemic variance) / Σ noise variance`, at least 1: left-out data may say that the noise
/// on the training data was too small, never that it was too large (with few effective rows E[φ] is wide for a reason).
fn interval_factors(predictions: &[Prediction], plug_in: &PlugIn) -> Vec<f64> {
    (0..plug_in.weight.len())
        .map(|joint| {
            let (mut excess, mut noise) = (0.0, 0.0);
            for prediction in predictions {
                let sums = &prediction.joints[joint];
                excess += sums.excess;
                noise += sums.spread * prediction.noise / plug_in.weight[joint];
            }
            if noise > 0.0 {
                (excess / noise).max(1.0).sqrt()
            } else {
                1.0
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observations::JointObservations;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    /// t rows: the Fisher information is (ν+1)/(ν+3) of what known weights would give, κ = 7/5.
    #[test]
    fn weighing_costs_what_the_information_says() {
        let t = StudentsT::new(0.0, 1.0, FREEDOM).unwrap();
        let count = 40_000;
        let weight = (0..count)
            .map(|i| t.inverse_cdf((i as f64 + 0.5) / count as f64))
            .map(|r| (FREEDOM + 1.0) / (FREEDOM + r * r))
            .collect();
        let mut observations = Observations {
            joints: vec![JointObservations {
                standstill: vec![false; count],
                weight,
                ..JointObservations::default()
            }],
            time: vec![0.0; count],
            ..Observations::default()
        };
        let kappa = weighing(&[observations.whole()], 0, true);
        assert!((kappa - 1.4).abs() < 2e-3, "{kappa}");
        observations.joints[0].weight.clear();
        assert_eq!(weighing(&[observations.whole()], 0, true), 1.0);
    }
}
