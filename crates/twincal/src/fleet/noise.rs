//! Noise of a fleet: how much one row of each joint says, measured in a few units by the fit of a calibration.

use super::hierarchy::factored;
use super::logs::KeptLog;
use crate::calibrate::CalibrationSettings;
use crate::error::{Error, Result};
use crate::gram::{Gram, JointGram};
use crate::likelihood::Columns;
use crate::likelihood::NoiseModel;
use crate::plug_in::{Fit, FitSettings, Moving, fit, fit_tempered, start};
use crate::prior::Prior;
use crate::statistics::{Purpose, Runs, Sums, of_joint, residual_form};
use rayon::prelude::*;

/// A unit with more residual than this many times the median's counts that much less: its drives or sensors are noisier.
const NOISIER: f64 = 1.5;

/// What the units measured say, as medians.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    /// Factor on the statistics of each joint: w_j / (max(τ_j, λ_j) φ), 1/(N·m)².
    pub(super) factor: Vec<f64>,
    /// ρ_j; 0 unless `ar1`.
    rho: Vec<f64>,
    /// d_k: slab variance of each column.
    pub(super) slab: Vec<f64>,
    /// Structure of the prior over components.
    pub(super) prior: Prior,
}

/// Measures noise in the units whose sums are kept; `zero` columns are left out.
///
/// # Errors
/// Those of a fit.
pub(super) fn measure(
    logs: &[KeptLog],
    zero: &[usize],
    columns: &Columns,
    settings: &CalibrationSettings,
) -> Result<Noise> {
    let mut units: Vec<Vec<&KeptLog>> = Vec::new();
    for log in logs.iter().filter(|log| log.measured) {
        match units.last_mut() {
            Some(unit) if unit[0].robot == log.robot => unit.push(log),
            _ => units.push(vec![log]),
        }
    }
    if units.is_empty() {
        return Err(Error::Statistics {
            problem: "no robot is left whose noise was to be measured".into(),
            remedy: "give the files of the robots that count alone: see left_out of the others"
                .into(),
        });
    }
    let fits: Vec<Fit> = (units.par_iter())
        .map(|unit| fitted(unit, zero, columns, settings))
        .collect::<Result<_>>()?;
    let joints = fits[0].plug_in.weight.len();
    let of_joint = |value: &dyn Fn(&Fit, usize) -> f64| -> Vec<f64> {
        let of = |joint: usize| median(fits.iter().map(|fit| value(fit, joint)).collect());
        (0..joints).map(of).collect()
    };
    // Sizes of payloads are the units': the type has the slab that any may have.
    let prior = |fit: &Fit| (fit.plug_in.payload).undone(&fit.problem.prior, columns);
    let priors: Vec<Prior> = fits.iter().map(prior).collect();
    let slab = |k: usize| {
        let own = |(fit, prior): (&Fit, &Prior)| prior.slab[k] * fit.posterior.noise;
        median(fits.iter().zip(&priors).map(own).collect())
    };
    Ok(Noise {
        factor: of_joint(&|fit, joint| fit.plug_in.factor(joint) / fit.posterior.noise),
        rho: of_joint(&|fit, joint| fit.plug_in.rho[joint]),
        slab: (0..columns.names.len()).map(slab).collect(),
        prior: priors[0].clone(),
    })
}

fn fitted(
    unit: &[&KeptLog],
    zero: &[usize],
    columns: &Columns,
    settings: &CalibrationSettings,
) -> Result<Fit> {
    let runs = match settings.noise.model {
        NoiseModel::Ar1 => Runs::Joined,
        NoiseModel::Iid | NoiseModel::Tempered => Runs::Apart,
    };
    let mut sums = Sums::empty(runs, (unit.len(), Purpose::Fit));
    for own in unit.iter().filter_map(|log| log.statistics.as_ref()) {
        sums.add(&own.sums.without(zero));
    }
    let own = FitSettings {
        noise: settings.noise,
        prior: &settings.prior,
    };
    if settings.noise.model == NoiseModel::Tempered {
        return Ok(fit_tempered(&sums, &[], columns, own)?.0);
    }
    let start = start(&sums, columns, &settings.prior);
    fit(&sums, columns, own, &start, Moving::All, None)
}

impl Noise {
    /// Σ_j f_j G_j(ρ_j) and its torque column, in units of √d_k: precision K × K and score.
    pub(super) fn normal_sums(&self, gram: &Gram, factor: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let size = self.slab.len();
        let root: Vec<f64> = self.slab.iter().map(|d| d.sqrt()).collect();
        let (mut precision, mut score) = (vec![0.0; size * size], vec![0.0; size]);
        for (joint, own) in gram.joints.iter().enumerate() {
            let sums = own.stationary(self.rho[joint]);
            let last = sums.size - 1;
            for (a, &i) in own.columns.iter().enumerate() {
                let (i, scale) = (i as usize, factor[joint] * root[i as usize]);
                for (b, &k) in own.columns.iter().enumerate() {
                    precision[i * size + k as usize] += scale * root[k as usize] * sums.at(a, b);
                }
                score[i] += scale * sums.at(a, last);
            }
        }
        (precision, score)
    }

    /// The factor of each joint and unit: where a unit leaves more residual than most, that much less.
    pub(super) fn of_units(&self, units: &[Gram]) -> Vec<Vec<f64>> {
        let variance: Vec<Vec<f64>> = (units.par_iter())
            .map(|gram| self.variances(gram))
            .collect();
        let joints = self.factor.len();
        let usual: Vec<f64> = (0..joints)
            .map(|joint| median(variance.iter().map(|own| own[joint]).collect()))
            .collect();
        let of = |own: &Vec<f64>| -> Vec<f64> {
            let of_joint = |joint: usize| {
                let ratio = own[joint] / usual[joint];
                let noisier = if ratio > NOISIER { ratio } else { 1.0 };
                self.factor[joint] / noisier
            };
            (0..joints).map(of_joint).collect()
        };
        variance.iter().map(of).collect()
    }

    /// Residual variance of each joint at the unit's own ridge estimate, (N·m)².
    fn variances(&self, gram: &Gram) -> Vec<f64> {
        let size = self.slab.len();
        let (mut precision, mut beta) = self.normal_sums(gram, &self.factor);
        (0..size).for_each(|k| precision[k * size + k] += 1.0);
        factored(precision, size).solve(&mut beta);
        (beta.iter_mut().zip(&self.slab)).for_each(|(beta, d)| *beta *= d.sqrt());
        let of = |own: &JointGram| {
            let left = residual_form(&own.s0, &of_joint(own, &beta));
            (left / own.n.max(1.0)).max(f64::MIN_POSITIVE)
        };
        gram.joints.iter().map(of).collect()
    }
}

/// Median; of an even number the upper one.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
