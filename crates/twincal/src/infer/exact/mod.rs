//! All 2^K models, none stored: an elimination tree that shares Schur complements (method section 7).
//!
//! A node decides one column. Excluding it costs one row operation, including it one rank-1 Schur complement; a leaf is
//! one logarithm and one exponential. Sums of weights, inclusions, means and second moments come back up the tree, so
//! the work is O(2^K) in all. The first three columns are the lanes, the next ones the tasks of the thread pool, in an
//! order that depends on K only: any number of threads gives the same bytes. Columns that no model worth counting leaves
//! out ([`certain`]) are not branched on: what is not visited is below one ulp of the sum.

mod certain;
mod heaviest;
mod subtree;
mod sums;
mod tree;

use super::standard::Standard;
use crate::error::Result;
use crate::posterior::{Method, Posterior, Problem};
use heaviest::Heaviest;
use sums::Layout;

/// Share of the mass that the list of models holds, unless it is full before.
pub(super) const LISTED_MASS: f64 = 1.0 - 1e-6;
/// Most models in the list.
pub(super) const LISTED_MODELS: usize = 1000;

/// The posterior by summing over all models.
///
/// # Errors
/// Those of [`super::infer`].
pub(super) fn enumerate(problem: &Problem) -> Result<Posterior> {
    let mut standard = Standard::new(problem)?;
    let size = standard.size();
    let certain = certain::columns(&standard, &problem.prior);
    if certain.contains(&true) {
        standard = Standard::in_order(problem, certain::order(&problem.prior, &certain))?;
    }
    let (sums, heaviest) = tree::sum_all_models(&standard, &problem.prior, &certain);
    let layout = Layout::new(size);
    let weight = sums[layout.weight()];
    let share = |d: usize| (sums[layout.inclusion(d)] / weight).clamp(0.0, 1.0);
    let shift = |d: usize| sums[layout.shift(d)] / weight;
    let variance = |d: usize| (sums[layout.moment(d, d)] / weight - shift(d) * shift(d)).max(0.0);
    // With a_n ≤ 1 the noise has no mean, and an included coefficient no variance.
    let finite = standard.noise_factor().is_finite();
    let (models, models_mass) = list(&standard, heaviest, weight)?;
    Ok(Posterior {
        component: standard.component.clone(),
        inclusion: standard.in_columns(share),
        inclusion_mcse: vec![0.0; size],
        mean: standard.coefficients(|d| standard.center[d] + shift(d)),
        sd: standard.coefficients(|d| match share(d) > 0.0 {
            true if finite => variance(d).sqrt(),
            true => f64::INFINITY,
            false => 0.0,
        }),
        shape: standard.shape,
        noise: if finite {
            standard.noise(sums[layout.noise()] / weight)
        } else {
            f64::INFINITY
        },
        models,
        models_mass,
        log_evidence: Some(standard.log_evidence(weight.ln() - tree::LOG_REFERENCE)),
        method: Method::Exact { models: 1 << size },
    })
}

/// The heaviest models up to [`LISTED_MASS`], refactored one by one.
fn list(
    standard: &Standard,
    heaviest: Heaviest,
    total: f64,
) -> Result<(Vec<crate::posterior::Model>, f64)> {
    let mut found: Vec<(f64, Vec<u32>, Vec<usize>)> = heaviest
        .into_models()
        .into_iter()
        .map(|(weight, mask)| {
            let positions: Vec<usize> = (0..standard.size())
                .filter(|d| mask >> d & 1 == 1)
                .collect();
            let mut members: Vec<u32> = positions
                .iter()
                .map(|&d| standard.order[d] as u32)
                .collect();
            members.sort_unstable();
            (weight / total, members, positions)
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    let mut mass = 0.0;
    let count = found
        .iter()
        .position(|(weight, ..)| {
            mass += weight;
            mass >= LISTED_MASS
        })
        .map_or(found.len(), |last| last + 1);
    found.truncate(count);
    let listed: f64 = found.iter().map(|(weight, ..)| weight).sum();
    let models: Result<Vec<_>> = found
        .iter()
        .map(|(weight, _, positions)| standard.model(positions, weight / listed))
        .collect();
    Ok((models?, listed.min(1.0)))
}

#[cfg(test)]
mod tests;
