//! Covariance of the coefficients over all models: what we do not know about β, structure included.

use super::Posterior;
use crate::linear_algebra::Cholesky;

impl Posterior {
    /// Cov[β | y], K × K row-major, from the kept models.
    ///
    /// ```text
    /// Cov = Σ_z p(z | y) (μ_z μ_zᵀ + b_z/(a_n − 1) A_z⁻¹) − β̄ β̄ᵀ,    β̄ = Σ_z p(z | y) μ_z
    /// ```
    pub fn covariance(&self) -> Vec<f64> {
        let count = self.inclusion.len();
        let mut mean = vec![0.0; count];
        let mut covariance = vec![0.0; count * count];
        for model in &self.models {
            let noise = model.scale / (self.shape - 1.0).max(f64::MIN_POSITIVE);
            let inverse = Cholesky::from_lower(model.factor.clone(), model.members.len()).inverse();
            for (i, &a) in model.members.iter().enumerate() {
                mean[a as usize] += model.weight * model.mean[i];
                for (k, &b) in model.members.iter().enumerate() {
                    let second = model.mean[i] * model.mean[k]
                        + noise * inverse[i * model.members.len() + k];
                    covariance[a as usize * count + b as usize] += model.weight * second;
                }
            }
        }
        for a in 0..count {
            for b in 0..count {
                covariance[a * count + b] -= mean[a] * mean[b];
            }
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    use crate::posterior::{Method, Model, Posterior};

    /// One model with A = [[4,2],[2,10]] = L Lᵀ, L = [[2,0],[1,3]]: Cov = b/(a−1) A⁻¹ with A⁻¹ = [[10,−2],[−2,4]]/36.
    #[test]
    fn covariance_of_a_single_model_is_the_scaled_inverse() {
        let model = Model {
            members: vec![0, 2],
            weight: 1.0,
            scale: 6.0,
            mean: vec![0.5, -1.0],
            factor: vec![2.0, 0.0, 1.0, 3.0],
            sites: Vec::new(),
        };
        let posterior = Posterior {
            component: vec![0, 1, 2],
            inclusion: vec![1.0, 0.0, 1.0],
            inclusion_mcse: vec![0.0; 3],
            mean: vec![0.5, 0.0, -1.0],
            sd: vec![0.0; 3],
            shape: 4.0,
            noise: 2.0,
            models: vec![model],
            models_mass: 1.0,
            log_evidence: Some(0.0),
            method: Method::Exact { models: 8 },
        };
        let expected = [20.0, 0.0, -4.0, 0.0, 0.0, 0.0, -4.0, 0.0, 8.0].map(|v: f64| v / 36.0);
        for (a, b) in posterior.covariance().iter().zip(expected) {
            assert!((a - b).abs() < 1e-14);
        }
    }
}
