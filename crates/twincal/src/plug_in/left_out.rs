//! What predicting left-out training data says of the noise: how wide intervals have to be.

use super::usual::at_least_usual;
use super::{Fit, FitSettings, total};
use crate::error::Result;
use crate::gram::Gram;
use crate::infer::approximate;
use crate::likelihood::{Columns, PlugIn, assemble};
use crate::observations::{Observations, Part, QuadraticForm};
use crate::posterior::Posterior;
use rayon::prelude::*;

/// Parts that one or two logs are cut into; three logs or more are left out one by one.
const PARTS: usize = 5;
/// 1.96².
const NORMAL95: f64 = 3.841_458_820_694_124;
/// Left-out logs at most; more are grouped.
const MOST_FOLDS: usize = 6;

/// What the left-out moving rows of one joint add up to: of a long log they are too many to be kept.
#[derive(Debug, Default)]
struct LeftOutJoint {
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

/// What one fold knows, and what it predicts.
pub(super) struct LeaveOut<'a> {
    /// Statistics of the kept pieces, added up fold by fold: no subtraction, no rounding but that of a sum.
    pub(super) kept: Gram,
    pub(super) out: Vec<Part<'a>>,
}

/// Whole logs are left out when there are three or more, otherwise equal parts of each log. Every piece is gone through
/// once, however often its statistics count.
pub(super) fn folds<'a>(training: &[Part<'a>]) -> Vec<LeaveOut<'a>> {
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

/// Factor on the noise sd of each joint's intervals so that left-out residuals have the stated variance, or with robust noise the stated
/// coverage.
///
/// # Errors
/// Those of [`assemble`] and [`approximate`].
pub(super) fn interval_factors(
    folds: &[LeaveOut<'_>],
    columns: &Columns,
    settings: FitSettings<'_>,
    whole: &Fit,
) -> Result<Vec<f64>> {
    let predicted = predict(folds, columns, settings, whole)?;
    let own = if settings.noise.robust {
        factors_of_coverage(&predicted, &whole.plug_in)
    } else {
        factors_of_variance(&predicted, &whole.plug_in)
    };
    Ok(at_least_usual(&own))
}

fn predict(
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
                let mut sums = LeftOutJoint::default();
                let mut form: Option<QuadraticForm> = None;
                for part in out {
                    if !form.as_ref().is_some_and(|form| part.has_form(joint, form)) {
                        let count = posterior.mean.len();
                        form = Some(part.quadratic_form(joint, &covariance, count));
                    }
                    if let Some(form) = &form {
                        sums.add(part, joint, (&posterior, form), robust);
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
    /// Every moving row of a joint.
    fn add(
        &mut self,
        part: &Part<'_>,
        joint: usize,
        (posterior, form): (&Posterior, &QuadraticForm),
        robust: bool,
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
            self.excess += square - epistemic;
            self.spread += spread;
            if robust {
                self.needed.push((square / NORMAL95 - epistemic) / spread);
            }
        }
    }
}

/// Factor that lets the 95 % interval of a normal distribution hold 95 % of the left-out rows, at least 1; `None` without such rows.
fn factors_of_coverage(predictions: &[Prediction], plug_in: &PlugIn) -> Vec<Option<f64>> {
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
            factor.map(|factor| factor.max(1.0).sqrt())
        })
        .collect()
}

/// `f_j² = Σ (squared error − epistemic variance) / Σ noise variance`, at least 1: left-out data may say that the noise
/// on the training data was too small, never that it was too large (with few effective rows E[φ] is wide for a reason). `None` without
/// left-out rows.
fn factors_of_variance(predictions: &[Prediction], plug_in: &PlugIn) -> Vec<Option<f64>> {
    (0..plug_in.weight.len())
        .map(|joint| {
            let (mut excess, mut noise) = (0.0, 0.0);
            for prediction in predictions {
                let sums = &prediction.joints[joint];
                excess += sums.excess;
                noise += sums.spread * prediction.noise / plug_in.weight[joint];
            }
            (noise > 0.0).then(|| (excess / noise).max(1.0).sqrt())
        })
        .collect()
}
