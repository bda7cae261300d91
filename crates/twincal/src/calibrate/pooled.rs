//! A calibration whose posterior comes from more than its own logs: that of a fleet for one of its robots, or for the type.

use super::checks::misfit;
use super::fit::fitted::{self, Fitted};
use super::settings::CalibrationSettings;
use crate::error::{Error, Finding, Result};
use crate::likelihood::Columns;
use crate::linear_algebra::Cholesky;
use crate::posterior::{Method, Model, Posterior};
use crate::robot::Robot;
use crate::statistics::Sums;

/// What is known of the coefficients, logs of other robots included: a normal distribution over all columns, with probabilities beside it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pooled {
    /// Columns of the proposed library that are left out.
    pub(crate) zero_columns: Vec<usize>,
    /// P(the column's effect is there), K.
    pub(crate) inclusion: Vec<f64>,
    /// E[β], K, in the coefficients' units.
    pub(crate) mean: Vec<f64>,
    /// Cov[β], K × K row-major.
    pub(crate) covariance: Vec<f64>,
    /// How it was sampled.
    pub(crate) method: Method,
}

impl Pooled {
    /// Noise by a fit to the robot's own logs, coefficients by the fleet.
    ///
    /// # Errors
    /// Those of a fit, and a covariance that is not positive definite.
    pub(super) fn fitted(
        &self,
        (robot, sums, columns): (&Robot, &Sums, &Columns),
        settings: &CalibrationSettings,
        findings: &mut Vec<Finding>,
    ) -> Result<Fitted> {
        let mut fitted = fitted::estimate(sums, &[], columns, settings)?;
        fitted.fit.posterior = self.posterior(&fitted)?;
        findings.extend(misfit::findings(robot, &fitted.fit.plug_in));
        Ok(fitted)
    }

    /// As the posterior of a fit to the robot's own logs, with the noise of that fit.
    ///
    /// # Errors
    /// A covariance that is not positive definite.
    fn posterior(&self, own: &Fitted) -> Result<Posterior> {
        let (size, of_fit) = (self.mean.len(), &own.fit.posterior);
        let columns: Vec<usize> = (0..size).collect();
        let precision = factored(&self.covariance, size)?.inverse();
        Ok(Posterior {
            component: own.fit.problem.prior.component.clone(),
            inclusion: self.inclusion.clone(),
            inclusion_mcse: vec![0.0; size],
            sd: (self.covariance.iter().step_by(size + 1))
                .map(|variance| variance.sqrt())
                .collect(),
            mean: self.mean.clone(),
            shape: of_fit.shape,
            noise: of_fit.noise,
            models: vec![self.model(&columns, &precision, of_fit)?],
            models_mass: 1.0,
            log_evidence: None,
            method: self.method.clone(),
        })
    }

    /// The same given that all columns but the `inside` ones are 0.
    ///
    /// # Errors
    /// As [`Pooled::posterior`].
    pub(super) fn compact(&self, inside: &[bool], own: &Posterior) -> Result<Posterior> {
        let size = self.mean.len();
        let precision = factored(&self.covariance, size)?.inverse();
        let columns: Vec<usize> = (0..size).filter(|&k| inside[own.component[k]]).collect();
        let model = self.model(&columns, &precision, own)?;
        let inverse = Cholesky::from_lower(model.factor.clone(), columns.len()).inverse();
        let mut compact = Posterior {
            mean: vec![0.0; size],
            sd: vec![0.0; size],
            ..own.clone()
        };
        for (i, &k) in columns.iter().enumerate() {
            compact.mean[k] = model.mean[i];
            compact.sd[k] = (own.noise * inverse[i * columns.len() + i]).sqrt();
        }
        compact.models = vec![model];
        Ok(compact)
    }

    /// `N(m + Λ_cc⁻¹ Λ_co m_o, Λ_cc⁻¹)`: the normal distribution of some columns with all others at 0; Λ is the precision.
    fn model(&self, columns: &[usize], precision: &[f64], own: &Posterior) -> Result<Model> {
        let (size, count) = (self.mean.len(), columns.len());
        let mut matrix = Vec::with_capacity(count * count);
        let mut mean = Vec::with_capacity(count);
        for &row in columns {
            let row = &precision[row * size..(row + 1) * size];
            matrix.extend(columns.iter().map(|&k| own.noise * row[k]));
            let all = row.iter().zip(&self.mean).map(|(p, m)| p * m);
            mean.push(own.noise * all.sum::<f64>());
        }
        let factor = factored(&matrix, count)?;
        factor.solve(&mut mean);
        Ok(Model {
            members: columns.iter().map(|&k| k as u32).collect(),
            weight: 1.0,
            scale: own.noise * (own.shape - 1.0),
            mean,
            factor: factor.lower().to_vec(),
            sites: Vec::new(),
        })
    }
}

fn factored(matrix: &[f64], size: usize) -> Result<Cholesky> {
    Cholesky::new(matrix, size).map_err(|error| Error::Statistics {
        problem: format!(
            "the fleet's covariance of the coefficients is not positive definite at {}",
            error.pivot
        ),
        remedy: "report this as a bug".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own() -> Posterior {
        Posterior {
            component: vec![0, 1, 1],
            inclusion: vec![0.9, 0.8, 0.8],
            inclusion_mcse: vec![0.0; 3],
            mean: vec![0.0; 3],
            sd: vec![0.0; 3],
            shape: 11.0,
            noise: 1.7,
            models: Vec::new(),
            models_mass: 1.0,
            log_evidence: None,
            method: Method::Exact { models: 4 },
        }
    }

    fn pooled() -> Pooled {
        Pooled {
            zero_columns: Vec::new(),
            inclusion: vec![0.9, 0.8, 0.8],
            mean: vec![1.0, -2.0, 0.5],
            covariance: vec![4.0, 1.0, 0.5, 1.0, 2.0, -0.3, 0.5, -0.3, 1.0],
            method: Method::Exact { models: 4 },
        }
    }

    /// m_c − Σ_co Σ_oo⁻¹ m_o and Σ_cc − Σ_co Σ_oo⁻¹ Σ_oc, by hand with c = {1, 2}, o = {0}.
    #[test]
    fn the_compact_one_is_the_conditional_normal_distribution() {
        let compact = pooled().compact(&[false, true], &own()).expect("compact");
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        assert_eq!(compact.models[0].members, [1, 2]);
        near(compact.mean[0], 0.0);
        near(compact.mean[1], -2.0 - 1.0 / 4.0);
        near(compact.mean[2], 0.5 - 0.5 / 4.0);
        near(compact.sd[1], (2.0_f64 - 1.0 / 4.0).sqrt());
        near(compact.sd[2], (1.0_f64 - 0.25 / 4.0).sqrt());
    }

    #[test]
    fn the_whole_one_has_the_moments_that_were_given() {
        let (given, own) = (pooled(), own());
        let columns = [0, 1, 2];
        let precision = factored(&given.covariance, 3).expect("positive").inverse();
        let model = given.model(&columns, &precision, &own).expect("a model");
        let posterior = Posterior {
            models: vec![model],
            ..own
        };
        let found = posterior.covariance();
        for (a, b) in found.iter().zip(&given.covariance) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
        for (a, b) in posterior.models[0].mean.iter().zip(&given.mean) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn a_covariance_without_an_inverse_is_refused() {
        let given = Pooled {
            covariance: vec![1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            ..pooled()
        };
        let error = given.compact(&[true, true], &own()).expect_err("singular");
        assert!(error.to_string().contains("positive definite"), "{error}");
    }
}
