//! A posterior without random numbers in milliseconds, for comparing settings: fixed points, folds, sensitivities.
//!
//! What is reported at the end comes from [`super::infer`].

use super::EXACT_LIMIT;
use super::answer::{Averages, Listed, posterior};
use super::search::{self, Care, Found, Start};
use super::standard::{Reduced, Standard};
use super::{bounds, certain};
use crate::error::Result;
use crate::posterior::{Method, Model, Posterior, Problem};
use std::collections::BTreeMap;

/// Models that a search expands at most: many where the columns are few, so that the time is about the same.
const BUDGET: (usize, usize) = (12, 3000);
/// That many times K² between the two.
const WORK: usize = 1_000_000;
/// Share of the mass and most models in the list.
const LISTED_MASS: f64 = 0.9999;
const LISTED_MODELS: usize = 32;

/// See [`super::approximate`].
pub(super) fn approximate(problem: &Problem, warm: Option<&Posterior>) -> Result<Posterior> {
    let standard = Standard::new(problem)?;
    let size = standard.size().max(1);
    let budget = (WORK / (size * size)).clamp(BUDGET.0, BUDGET.1);
    let care = if standard.blocks.len() > EXACT_LIMIT {
        Care::Loop
    } else {
        Care::Full
    };
    let certain = certain::components(&standard, problem, warm);
    let reduced = Reduced::new(&standard, &certain);
    let found = search(&reduced, problem, models_of(warm, &standard), budget, care);
    let total = found.sums.total() / (1.0 - found.missing);
    let heaviest = shares(&reduced, &found, total, LISTED_MODELS);
    let all = total.ln() + found.sums.reference;
    let log_weights: BTreeMap<Vec<u32>, f64> = (heaviest.iter().zip(&found.models))
        .map(|((_, members, _), (log_weight, _))| (members.clone(), log_weight - all))
        .collect();
    let mass = if found.overrated {
        f64::INFINITY
    } else {
        LISTED_MASS
    };
    let listed = Listed::new(&standard, heaviest, mass, LISTED_MODELS)?;
    let mut averages = averages(&reduced, &found);
    let method = Method::Search {
        models: found.models.len() as u64,
        missing: found.missing,
    };
    let log_evidence = standard.log_evidence(total.ln() + found.sums.reference);
    let own = |model: &Model| log_weights.get(&model.members).copied();
    let log_weights = (listed.models.iter())
        .map(|model| own(model).unwrap_or_else(|| model.weight.ln()))
        .collect();
    let guided = bounds::Weights::Guided;
    let (listed, log_growth) =
        bounds::apply(&standard, &mut averages, listed, log_weights, guided)?;
    Ok(posterior(
        &standard,
        &averages,
        listed,
        Some(log_evidence + log_growth),
        method,
    ))
}

/// Runs the search on a problem from the first two of the given models; without any, from the empty one and, of up to [`MANY_COLUMNS`](super::MANY_COLUMNS), the full one.
pub(super) fn search(
    reduced: &Reduced<'_>,
    problem: &Problem,
    warm: &[Model],
    budget: usize,
    care: Care,
) -> Found {
    let standard = &reduced.open;
    let start = |model: &Model| -> Vec<usize> {
        let mut holds = vec![false; problem.prior.components()];
        let members = model.members.iter();
        members.for_each(|&k| holds[standard.component[k as usize]] = true);
        let active = reduced.active.iter().copied();
        active
            .filter(|&b| holds[standard.blocks[b].component])
            .collect()
    };
    let mut starts: Vec<Vec<usize>> = warm.iter().take(2).map(start).collect();
    starts.dedup();
    search::run(
        reduced,
        &problem.prior,
        &Start {
            warm: &starts,
            budget,
            care,
        },
    )
}

/// Models of a posterior of the same components.
pub(super) fn models_of<'a>(warm: Option<&'a Posterior>, standard: &Standard) -> &'a [Model] {
    warm.filter(|warm| warm.component == standard.component)
        .map_or(&[], |warm| &warm.models)
}

/// (share of `total`, columns, positions) of the heaviest models found.
pub(super) fn shares(
    reduced: &Reduced<'_>,
    found: &Found,
    total: f64,
    most: usize,
) -> Vec<(f64, Vec<u32>, Vec<usize>)> {
    found
        .models
        .iter()
        .take(most)
        .map(|(log_weight, set)| {
            let (members, positions) = reduced.members(set);
            (found.sums.weight(*log_weight) / total, members, positions)
        })
        .collect()
}

/// Averages over all models found.
pub(super) fn averages(reduced: &Reduced<'_>, found: &Found) -> Averages {
    let (sums, total, open) = (&found.sums, found.sums.total(), &reduced.open);
    let share = |values: &[f64]| -> Vec<f64> { values.iter().map(|x| x / total).collect() };
    let averages = Averages {
        inclusion: open
            .block_of()
            .iter()
            .map(|&b| sums.inclusion[b] / total)
            .collect(),
        mcse: vec![0.0; open.size()],
        shift: share(&sums.shift),
        moment: share(&sums.moment),
        misfit: sums.misfit / total,
    };
    reduced.widen(averages, &sums.products())
}
