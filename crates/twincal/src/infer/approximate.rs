//! A posterior without random numbers in milliseconds, for comparing settings: fixed points, folds, sensitivities.
//!
//! What is reported at the end comes from [`super::infer`].

use super::answer::{Averages, Listed, posterior};
use super::reduced::Reduced;
use super::search::{self, Care, Found, models_of, shares};
use super::standard::Standard;
use super::{EXACT_LIMIT, bounds, certain};
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
    let mut found =
        search::from_models(&reduced, problem, models_of(warm, &standard), budget, care);
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
    let mut averages = averages(&reduced, &mut found);
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

/// Averages over all models found.
pub(super) fn averages(reduced: &Reduced<'_>, found: &mut Found) -> Averages {
    let products = found.sums.products();
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
    reduced.widen(averages, &products)
}
