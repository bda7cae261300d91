//! The compact twin: the median-probability model (Barbieri & Berger 2004) refitted jointly, and what it costs.

use super::heredity;
use crate::error::Result;
use crate::gram::{Gram, JointGram};
use crate::infer::approximate;
use crate::posterior::{Posterior, Problem};
use crate::statistics::{of_joint, residual_form};
use crate::term::Library;
use crate::validate::nan_if_null;
use serde::{Deserialize, Serialize};

/// A component is in the compact twin from this probability on.
const MEDIAN: f64 = 0.5;

/// The median-probability model (PIP ≥ 0.5) refitted jointly (Barbieri & Berger 2004); its held-out loss stands in
/// [`Validation::compact`](crate::validate::Validation::compact).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compact {
    /// Names of its components.
    pub components: Vec<String>,
    /// Its coefficients.
    pub terms: Vec<CompactTerm>,
    /// RMSE over the moving training rows of all joints, N·m: of the model average, and of the compact twin.
    pub training_rmse: [f64; 2],
}

/// One coefficient of the compact twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompactTerm {
    /// Term.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// E[β | y, the compact twin's structure].
    pub mean: f64,
    /// Its sd.
    #[serde(deserialize_with = "nan_if_null")]
    pub sd: f64,
}

/// Which components are in the median-probability model.
pub(in crate::calibrate) fn members(problem: &Problem, posterior: &Posterior) -> Vec<bool> {
    let mut inside = vec![false; problem.prior.components()];
    for (&component, &pip) in problem.prior.component.iter().zip(&posterior.inclusion) {
        inside[component] = pip >= MEDIAN;
    }
    // Near the median, sampled probabilities of a child and its parent may lie on either side of it.
    heredity::force_parents(&problem.prior.parent, &mut inside);
    inside
}

/// Posterior of coefficients and noise with the structure settled: one model.
pub(in crate::calibrate) fn refit(
    problem: &Problem,
    inside: &[bool],
    warm: &Posterior,
) -> Result<Posterior> {
    let settled = Problem {
        prior: problem.prior.settled(inside),
        ..problem.clone()
    };
    let mut posterior = approximate(&settled, Some(warm))?;
    // The other models weigh e^-690: what is left of them is rounding.
    posterior.models.truncate(1);
    if let Some(model) = posterior.models.first_mut() {
        model.weight = 1.0;
    }
    Ok(posterior)
}

/// What the compact twin holds, with its training error beside that of the model average.
pub(in crate::calibrate) fn summary(
    library: &Library,
    problem: &Problem,
    average: &Posterior,
    compact: &Posterior,
    gram: &Gram,
) -> Compact {
    let inside = members(problem, average);
    let component = |k: usize| &library.components()[library.terms()[k].component].name;
    let mut components: Vec<String> = Vec::new();
    let mut terms = Vec::new();
    for (k, &term) in library.columns().iter().enumerate() {
        if !inside[problem.prior.component[k]] {
            continue;
        }
        if components.last() != Some(component(term)) {
            components.push(component(term).clone());
        }
        terms.push(CompactTerm {
            name: library.terms()[term].name.clone(),
            unit: library.terms()[term].unit.clone(),
            mean: compact.mean[k],
            sd: compact.sd[k],
        });
    }
    Compact {
        components,
        terms,
        training_rmse: [average, compact].map(|posterior| rmse(gram, &posterior.mean)),
    }
}

/// RMSE over the moving training rows of all joints, as the fit weighs them.
fn rmse(gram: &Gram, beta: &[f64]) -> f64 {
    let of_joint = |gram: &JointGram| residual_form(&gram.s0, &of_joint(gram, beta)).max(0.0);
    let squares: f64 = gram.joints.iter().map(of_joint).sum();
    (squares / gram.joints.iter().map(|gram| gram.n).sum::<f64>()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testing::{Regression, part};
    use crate::linear_algebra::Cholesky;

    /// One column in, whatever the data say of it: μ = r/(G + 1/v), sd² = φ/(G + 1/v), φ = b_n/(a_n − 1).
    #[test]
    fn a_settled_structure_has_the_conjugate_posterior() {
        let mut random = Regression::new(2, 80);
        let log = random.log(&[1.0, 0.5], 1.0);
        let (fit, _) = random.fitted(&[part(&log)]);
        for inside in [[true, true], [false, true], [true, false], [false, false]] {
            let compact = refit(&fit.problem, &inside, &fit.posterior).unwrap();
            let problem = &fit.problem;
            let members: Vec<usize> = (0..2).filter(|&k| inside[k]).collect();
            assert_eq!(
                compact.models[0].members,
                members.iter().map(|&k| k as u32).collect::<Vec<_>>()
            );
            let size = members.len();
            let mut matrix = vec![0.0; size * size];
            for (i, &a) in members.iter().enumerate() {
                for (j, &b) in members.iter().enumerate() {
                    matrix[i * size + j] = problem.gram[a * 2 + b];
                }
                matrix[i * size + i] += 1.0 / problem.prior.slab[a];
            }
            let factor = Cholesky::new(&matrix, size).unwrap();
            let r: Vec<f64> = members.iter().map(|&k| problem.xy[k]).collect();
            let mut mean = r.clone();
            factor.solve(&mut mean);
            let inverse = factor.inverse();
            let left = problem.yy - r.iter().zip(&mean).map(|(r, m)| r * m).sum::<f64>();
            let shape = problem.prior.shape + 0.5 * problem.n;
            let phi = (problem.prior.scale + 0.5 * left) / (shape - 1.0);
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a} {b}");
            for (i, &k) in members.iter().enumerate() {
                near(compact.mean[k], mean[i]);
                near(compact.sd[k], (phi * inverse[i * size + i]).sqrt());
            }
            for k in (0..2).filter(|&k| !inside[k]) {
                near(compact.mean[k], 0.0);
                near(compact.sd[k], 0.0);
            }
            near(compact.noise, phi);
        }
    }
}
