//! Misfit: what no candidate describes is a function of the state that comes again with the motion. More rows of the same motion do
//! not average it out, so it has to count as noise.

use super::Fit;
use crate::error::Result;
use crate::gram::{Gram, JointGram};
use crate::likelihood::{Columns, assemble};
use crate::linear_algebra::Cholesky;
use crate::prior::PriorSettings;
use crate::statistics::{Unit, of_joint, residual_form};

/// Columns that are in with this probability at least may have taken something from the decoys.
const IN_SOME_MODEL: f64 = 0.05;
/// Share of a decoy's squares that the columns have to leave.
const LEFT: f64 = 0.05;

/// What the noise of a fit is made of, per joint.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Misfit {
    /// σ_j², (N·m)²: residual squares over the rows that no column took.
    pub(super) variance: Vec<f64>,
    /// λ¹_j, at least 1.
    pub(super) within: Vec<f64>,
    /// λ²_j, at least 1.
    pub(super) left_out: Vec<f64>,
}

impl Misfit {
    /// max(λ¹_j, λ²_j).
    pub(super) fn largest(&self) -> Vec<f64> {
        let both = self.within.iter().zip(&self.left_out);
        both.map(|(within, left_out)| within.max(*left_out))
            .collect()
    }
}

/// Measures the residual along the decoys, in the training rows and in left-out units; `kept` has, unit by unit, the sums of all others.
///
/// ```text
/// λ¹_j = Σ_k (φ_kᵀr_j)² / (σ_j² Σ_k v_k)      v_k = φ_kᵀφ_k − f_j g_kᵀA⁻¹g_k,   g_k = X_jᵀφ_k
/// λ²_j = the same over left-out units,        v_k = φ_kᵀφ_k + f_j g_kᵀA⁻¹g_k,   A of the other units
/// ```
/// r_j is the residual at the posterior mean (of a unit: at the mean of the others with every column in that acts in some model), k
/// runs over the decoys whose squares the columns do not explain, f_j = w_j/max(τ_j, λ_j) of the fit is the joint's factor in A = Σ f_j G_j + V⁻¹. v_k σ_j² is
/// what independent noise leaves along φ_k, so that such noise gives 1. Sums are divided and not ratios averaged: a decoy that the columns
/// nearly explain says next to nothing.
///
/// # Errors
/// Those of [`assemble`].
pub(super) fn misfit(
    (total, units, kept): (&Unit, &[Unit], &[Gram]),
    prior: (&Columns, &PriorSettings),
    fit: &Fit,
) -> Result<Misfit> {
    let gram = &total.gram;
    let joints = gram.joints.len();
    let mut found = Misfit {
        variance: vec![0.0; joints],
        within: vec![1.0; joints],
        left_out: vec![1.0; joints],
    };
    let Some(whole) = Acting::new(gram, prior, fit)? else {
        return Ok(found);
    };
    let others: Vec<Option<Acting>> = (kept.iter())
        .map(|kept| Acting::new(kept, prior, fit))
        .collect::<Result<_>>()?;
    for (joint, own) in gram.joints.iter().enumerate() {
        let factor = fit.plug_in.factor(joint);
        let mean = of_joint(own, &fit.posterior.mean);
        let free = own.n - factor * whole.trace(own);
        let variance = residual_form(&own.s0, &mean) / free;
        if !(free > 0.0 && variance > 0.0) {
            continue;
        }
        let (mut within, mut left_out) = (Ratio::default(), Ratio::default());
        let all = &total.joints[joint].decoys;
        let mut unexplained = vec![false; all.count()];
        for (k, unexplained) in unexplained.iter_mut().enumerate() {
            let left = all.square(k) - factor * whole.form(own, all.columns(k));
            *unexplained = left > LEFT * all.square(k);
            if *unexplained {
                within.add(all.residual(k, &mean).powi(2), left);
            }
        }
        for (unit, acting) in units.iter().zip(&others) {
            let (Some(acting), out) = (acting, &unit.joints[joint].decoys) else {
                continue;
            };
            let beta = of_joint(own, &acting.beta);
            for k in (0..out.count()).filter(|&k| unexplained[k]) {
                let expected = out.square(k) + factor * acting.form(own, out.columns(k));
                left_out.add(out.residual(k, &beta).powi(2), expected);
            }
        }
        found.variance[joint] = variance;
        found.within[joint] = within.over(variance);
        found.left_out[joint] = left_out.over(variance);
    }
    Ok(found)
}

/// Squares that were found and those that noise of variance 1 gives.
#[derive(Debug, Default)]
struct Ratio {
    found: f64,
    expected: f64,
}

impl Ratio {
    fn add(&mut self, found: f64, expected: f64) {
        self.found += found;
        self.expected += expected;
    }

    /// At least 1; 1 where nothing was added.
    fn over(&self, variance: f64) -> f64 {
        let ratio = self.found / (self.expected * variance);
        if ratio.is_finite() {
            ratio.max(1.0)
        } else {
            1.0
        }
    }
}

/// Columns that act in some model, with their normal equations.
struct Acting {
    /// Place of each column of the library among those that act.
    place: Vec<Option<usize>>,
    count: usize,
    /// Of A = Σ_j f_j G_j + V⁻¹.
    factor: Cholesky,
    inverse: Vec<f64>,
    /// A⁻¹ Σ_j f_j X_jᵀy_j, 0 for all other columns.
    beta: Vec<f64>,
}

impl Acting {
    /// `None` where rounding leaves no positive definite matrix.
    fn new(
        gram: &Gram,
        (columns, prior): (&Columns, &PriorSettings),
        fit: &Fit,
    ) -> Result<Option<Self>> {
        let problem = assemble(gram, columns, &fit.plug_in, prior)?;
        let all = columns.names.len();
        let in_some_model = |k: &usize| fit.posterior.inclusion[*k] >= IN_SOME_MODEL;
        let acting: Vec<usize> = (0..all).filter(in_some_model).collect();
        let mut matrix = Vec::with_capacity(acting.len() * acting.len());
        for i in &acting {
            matrix.extend(acting.iter().map(|k| problem.gram[i * all + k]));
        }
        let mut beta = vec![0.0; all];
        let mut place = vec![None; all];
        for (a, &k) in acting.iter().enumerate() {
            matrix[a * acting.len() + a] += 1.0 / problem.prior.slab[k];
            place[k] = Some(a);
        }
        let Ok(factor) = Cholesky::new(&matrix, acting.len()) else {
            return Ok(None);
        };
        let mut solved: Vec<f64> = acting.iter().map(|&k| problem.xy[k]).collect();
        factor.solve(&mut solved);
        for (&k, value) in acting.iter().zip(solved) {
            beta[k] = value;
        }
        Ok(Some(Self {
            place,
            count: acting.len(),
            inverse: factor.inverse(),
            factor,
            beta,
        }))
    }

    /// (place among the columns of a joint, place among the acting ones).
    fn places(&self, joint: &JointGram) -> Vec<(usize, usize)> {
        let columns = joint.columns.iter().enumerate();
        columns
            .filter_map(|(own, &column)| Some((own, self.place[column as usize]?)))
            .collect()
    }

    /// gᵀA⁻¹g of a number for each column of the joint.
    fn form(&self, joint: &JointGram, g: &[f64]) -> f64 {
        let mut x = vec![0.0; self.count];
        for (own, at) in self.places(joint) {
            x[at] = g.get(own).copied().unwrap_or(0.0);
        }
        self.factor.solve_lower(&mut x);
        x.iter().map(|x| x * x).sum()
    }

    /// tr(G_j A⁻¹).
    fn trace(&self, joint: &JointGram) -> f64 {
        let places = self.places(joint);
        let row = |&(i, a): &(usize, usize)| -> f64 {
            let places = places.iter();
            places
                .map(|&(k, b)| joint.s0.at(i, k) * self.inverse[a * self.count + b])
                .sum()
        };
        places.iter().map(row).sum()
    }
}

#[cfg(test)]
mod tests;
