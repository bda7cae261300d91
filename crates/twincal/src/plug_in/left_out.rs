//! What predicting left-out training data says of the noise: how wide intervals have to be.

use super::usual::at_least_usual;
use super::{Fit, FitSettings};
use crate::error::Result;
use crate::gram::{Gram, JointGram};
use crate::infer::approximate;
use crate::likelihood::{Columns, PlugIn, assemble};
use crate::observations::Part;
use crate::posterior::Posterior;
use crate::statistics::{Training, of_joint, residual_form, rows_of_units};
use rayon::prelude::*;

/// 1.96².
const NORMAL95: f64 = 3.841_458_820_694_124;

/// Factor on the noise sd of each joint's intervals so that left-out residuals have the stated variance, or with robust noise the stated
/// coverage; `kept` has, unit by unit, the sums of all others, and `rows` are those of all units.
///
/// # Errors
/// Those of [`assemble`] and [`approximate`].
pub(super) fn interval_factors(
    (training, kept, rows): (&Training, &[Gram], &[Part<'_>]),
    columns: &Columns,
    settings: FitSettings<'_>,
    whole: &Fit,
) -> Result<Vec<f64>> {
    let plug_in = &whole.plug_in;
    let predict = |kept: &Gram| {
        let problem = assemble(kept, columns, plug_in, settings.prior)?;
        approximate(&problem, Some(&whole.posterior))
    };
    let posteriors: Vec<Posterior> = kept.par_iter().map(predict).collect::<Result<_>>()?;
    let own = if settings.noise.robust {
        factors_of_coverage(&posteriors, rows, plug_in)
    } else {
        factors_of_variance(&posteriors, training, plug_in)
    };
    Ok(at_least_usual(&own))
}

/// Factor that lets the 95 % interval of a normal distribution hold 95 % of the left-out rows, at least 1; `None` without such rows.
fn factors_of_coverage(
    posteriors: &[Posterior],
    rows: &[Part<'_>],
    plug_in: &PlugIn,
) -> Vec<Option<f64>> {
    let units = rows_of_units(rows);
    let joints = (0..plug_in.weight.len()).into_par_iter();
    let factor = |joint: usize| {
        let mut needed: Vec<f64> = Vec::new();
        for (posterior, parts) in posteriors.iter().zip(&units) {
            let noise = posterior.noise / plug_in.weight[joint];
            let covariance = posterior.covariance();
            for part in parts {
                let own = needed_by_rows(part, joint, (posterior, &covariance));
                needed.extend(own.map(|needed| needed / noise).filter(|f| f.is_finite()));
            }
        }
        needed.sort_by(f64::total_cmp);
        let enough = (0.95 * needed.len() as f64).ceil() as usize;
        let factor = needed.get(enough.saturating_sub(1)).copied();
        factor.map(|factor| factor.max(1.0).sqrt())
    };
    joints.map(factor).collect()
}

/// Of every moving row the relative variance that 1.96 sd of it need beyond the epistemic one, (N·m)²:
/// |error| ≤ 1.96 √(f² noise + epistemic) where f² ≥ (error²/1.96² − epistemic)/noise.
fn needed_by_rows<'r>(
    part: &'r Part<'_>,
    joint: usize,
    (posterior, covariance): (&Posterior, &[f64]),
) -> impl Iterator<Item = f64> + use<'r> {
    let rows = &part.observations.joints[joint];
    let residual = part.residual(joint, &posterior.mean, part.rows.clone());
    let epistemic = part.quadratic_forms(joint, covariance, posterior.mean.len());
    let of_row = part.rows.clone().zip(residual.into_iter().zip(epistemic));
    of_row
        .filter(|(row, _)| !rows.standstill[*row])
        .map(|(row, (r, epistemic))| {
            let spread = rows.spread.get(row).copied().unwrap_or(1.0);
            (r * r / NORMAL95 - epistemic.max(0.0)) / spread
        })
}

/// `f_j² = Σ u (squared error − epistemic variance) / Σ noise variance`, u what a row counts, at least 1: left-out data may say that the noise
/// on the training data was too small, never that it was too large (with few effective rows E[φ] is wide for a reason). `None` without
/// left-out rows.
fn factors_of_variance(
    posteriors: &[Posterior],
    training: &Training,
    plug_in: &PlugIn,
) -> Vec<Option<f64>> {
    let covariances: Vec<Vec<f64>> = posteriors.par_iter().map(Posterior::covariance).collect();
    (0..plug_in.weight.len())
        .map(|joint| {
            let (mut excess, mut noise) = (0.0, 0.0);
            let units = training
                .units
                .iter()
                .zip(posteriors.iter().zip(&covariances));
            for (unit, (posterior, covariance)) in units {
                let gram = &unit.gram.joints[joint];
                let mean = of_joint(gram, &posterior.mean);
                excess += residual_form(&gram.s0, &mean) - epistemic(gram, posterior, covariance);
                noise += gram.n * posterior.noise / plug_in.weight[joint];
            }
            (noise > 0.0).then(|| (excess / noise).max(1.0).sqrt())
        })
        .collect()
}

/// Σ xᵀ C x over the rows of a joint: tr(C XᵀX).
fn epistemic(gram: &JointGram, posterior: &Posterior, covariance: &[f64]) -> f64 {
    let (count, columns) = (posterior.mean.len(), &gram.columns);
    let row = |(i, &a): (usize, &u32)| -> f64 {
        let pairs = columns.iter().enumerate();
        pairs
            .map(|(k, &b)| covariance[a as usize * count + b as usize] * gram.s0.at(i, k))
            .sum()
    };
    columns.iter().enumerate().map(row).sum()
}
