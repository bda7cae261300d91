//! The list of a method that does not know the bounds, joined by the models that bounds favour.

use super::answer::{Averages, Listed};
use super::bounds::{Weights, apply, log_weight};
use super::reduced::Reduced;
use super::search::{self, Care};
use crate::error::Result;
use crate::posterior::{Model, Problem};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Models that the search beside another method expands.
const BUDGET: usize = 1024;
/// How many of its models join the list.
const JOINED: usize = 300;

/// [`apply`] for a method that does not know the bounds: where they act, its list is joined by what a search finds.
pub(super) fn settle(
    problem: &Problem,
    reduced: &Reduced<'_>,
    averages: &mut Averages,
    mut listed: Listed,
) -> Result<(Listed, f64)> {
    let standard = reduced.full;
    if !standard.bounded {
        return Ok((listed, 0.0));
    }
    let found = search::from_models(reduced, problem, &[], BUDGET, Care::Full);
    let known: BTreeSet<Vec<u32>> = listed
        .models
        .iter()
        .map(|model| model.members.clone())
        .collect();
    // Free weights of models that are not listed, relative to the heaviest listed one.
    let Some(heaviest) = listed.models.first() else {
        return Ok((listed, 0.0));
    };
    let reference = log_weight(problem, standard, heaviest) - heaviest.weight.ln();
    let mut log_weights: Vec<f64> = listed.models.iter().map(|m| m.weight.ln()).collect();
    let shares = search::shares(reduced, &found, found.sums.total(), JOINED);
    let joined: Vec<(Vec<usize>, Model, f64)> = shares
        .into_par_iter()
        .filter(|(_, members, _)| !known.contains(members))
        .map(|(_, _, mut positions)| {
            positions.sort_unstable_by_key(|&d| standard.order[d]);
            let mut model = standard.model(&positions, 1.0)?;
            let log_weight = log_weight(problem, standard, &model) - reference;
            model.weight = log_weight.exp();
            Ok((positions, model, log_weight))
        })
        .collect::<Result<_>>()?;
    for (positions, model, log_weight) in joined {
        log_weights.push(log_weight);
        listed.models.push(model);
        listed.positions.push(positions);
    }
    apply(standard, averages, listed, log_weights, Weights::Free)
}
