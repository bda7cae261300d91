//! Jumps between models far apart: Gibbs steps over a fixed list of models.
//!
//! Two stories that say almost the same (a payload, or the last link's mass moments and tensor) are many flips apart, and
//! what lies between is worse than both. A search knows both. Given that the chain is in one of the listed models, which
//! one is drawn anew in proportion to their weights: an update of the structure on that list, which keeps the posterior
//! whatever the list is.

use super::state::State;
use crate::infer::bounds;
use crate::infer::reduced::{Reduced, Response};
use crate::infer::search::{self, Care, Set};
use crate::infer::walker::Walker;
use crate::posterior::{Posterior, Problem};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Models in the list at most.
const MODELS: usize = 1000;
/// Models that the search expands.
const BUDGET: usize = 256;
/// Models that are weighed on one walk.
const PIECE: usize = 256;

/// Models with their share of the list's mass.
#[derive(Clone)]
pub(super) struct Jumps {
    places: BTreeSet<Set>,
    models: Vec<Set>,
    /// ln of each model's weight and of the part of it that is the bounds'.
    log_weights: Vec<f64>,
    bounds: Vec<f64>,
    /// Running sum of the weights, the last one 1.
    cumulative: Vec<f64>,
    /// P(z = 1 | list) by component.
    inclusion: Vec<f64>,
    /// Moments of each model.
    states: Vec<State>,
}

impl Jumps {
    /// No list: the chain stays where flips and exchanges lead it.
    pub(super) fn none() -> Self {
        Self {
            places: BTreeSet::new(),
            models: Vec::new(),
            log_weights: Vec::new(),
            bounds: Vec::new(),
            cumulative: Vec::new(),
            inclusion: Vec::new(),
            states: Vec::new(),
        }
    }

    /// What a search finds, from the models of a near posterior where there is one.
    pub(super) fn of(reduced: &Reduced<'_>, problem: &Problem, near: Option<&Posterior>) -> Self {
        let near = search::models_of(near, reduced.full);
        let found = search::from_models(reduced, problem, near, BUDGET, Care::Loop);
        let models = found.models.into_iter().map(|(_, set)| set);
        Self::heaviest(models.take(MODELS).collect(), reduced, problem)
    }

    /// The heaviest of these and of some more models.
    pub(super) fn joined(
        self,
        more: BTreeSet<Set>,
        reduced: &Reduced<'_>,
        problem: &Problem,
    ) -> Self {
        let mut all = more;
        all.extend(self.models);
        Self::heaviest(all.into_iter().collect(), reduced, problem)
    }

    /// The list of the heaviest of these models, weighed as the chain weighs them.
    fn heaviest(models: Vec<Set>, reduced: &Reduced<'_>, problem: &Problem) -> Self {
        let mut weighed: Vec<(f64, Set)> = walked(models, reduced, problem, false)
            .into_iter()
            .map(|(set, weight, ..)| (weight, set))
            .collect();
        weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        weighed.truncate(MODELS);
        if weighed.len() < 2 {
            return Self::none();
        }
        let kept = weighed.into_iter().map(|(_, set)| set).collect();
        let mut kept = walked(kept, reduced, problem, true);
        kept.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let largest = kept[0].1;
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = kept
            .iter()
            .map(|(_, weight, ..)| {
                sum += (weight - largest).exp();
                sum
            })
            .collect();
        cumulative.iter_mut().for_each(|value| *value /= sum);
        let log_weights = kept.iter().map(|(_, weight, ..)| *weight).collect();
        let bounds = kept.iter().map(|(_, _, bounds, _)| *bounds).collect();
        let pairs = kept.into_iter().map(|(set, _, _, state)| (set, state));
        let (models, states): (Vec<Set>, Vec<State>) = pairs.unzip();
        let mut jumps = Self {
            places: models.iter().cloned().collect(),
            models,
            log_weights,
            bounds,
            cumulative,
            inclusion: Vec::new(),
            states,
        };
        jumps.inclusion = jumps.means(reduced.open.blocks.len());
        jumps
    }

    /// P(z = 1 | list) of every component.
    fn means(&self, components: usize) -> Vec<f64> {
        let mut means = vec![0.0; components];
        for (set, weight) in self.weighted() {
            let inside = (0..components).filter(|b| set[b / 64] >> (b % 64) & 1 == 1);
            inside.for_each(|b| means[b] += weight);
        }
        means
    }

    /// Listed models with their shares of the list's mass.
    pub(super) fn weighted(&self) -> impl Iterator<Item = (&Set, f64)> {
        let before = std::iter::once(0.0).chain(self.cumulative.iter().copied());
        let shares = self.cumulative.iter().zip(before);
        let shares = shares.map(|(after, before)| after - before);
        self.models.iter().zip(shares)
    }

    pub(super) fn lists(&self, set: &[u64]) -> bool {
        self.places.contains(set)
    }

    /// A listed model, drawn by its weight with a uniform number.
    pub(super) fn draw(&self, uniform: f64) -> usize {
        let place = self.cumulative.partition_point(|&sum| sum <= uniform);
        place.min(self.models.len() - 1)
    }

    pub(super) fn set(&self, model: usize) -> &[u64] {
        &self.models[model]
    }

    /// ln of its weight, bounds included.
    pub(super) fn log_weight(&self, model: usize) -> f64 {
        self.log_weights[model]
    }

    /// ln of what bounds multiply its weight with.
    pub(super) fn bounds(&self, model: usize) -> f64 {
        self.bounds[model]
    }

    pub(super) fn state(&self, model: usize) -> &State {
        &self.states[model]
    }

    /// P(z = 1 | list).
    pub(super) fn inclusion(&self, component: usize) -> f64 {
        self.inclusion[component]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.models.is_empty()
    }
}

/// Models in another order, with ln weights as the chain counts them, ln of what bounds multiply them with and, if asked for, their
/// moments without bounds.
fn walked(
    mut models: Vec<Set>,
    reduced: &Reduced<'_>,
    problem: &Problem,
    moments: bool,
) -> Vec<(Set, f64, f64, State)> {
    // Neighbours in this order differ by few components; a piece has its own walk, whatever the threads.
    models.sort_unstable();
    models
        .par_chunks(PIECE)
        .flat_map_iter(|models| piece(models, reduced, problem, moments))
        .collect()
}

/// [`walked`], one piece.
fn piece(
    models: &[Set],
    reduced: &Reduced<'_>,
    problem: &Problem,
    moments: bool,
) -> Vec<(Set, f64, f64, State)> {
    let standard = &reduced.open;
    let mut walker = Walker::new(standard, &problem.prior);
    let mut response = Response::default();
    let mut masses = bounds::SlabMasses::default();
    let walked = models.iter().map(|set| {
        for block in 0..standard.blocks.len() {
            if walker.tableau.holds(block) != (set[block / 64] >> (block % 64) & 1 == 1) {
                walker.flip(block);
            }
        }
        let mut state = State::default();
        if moments {
            state.read(reduced, &walker.tableau, &mut response);
        }
        let log_ratio = match reduced.full.bounded {
            true => bounds::log_ratio(reduced, &walker.tableau, set, &mut masses),
            false => 0.0,
        };
        let log_weight = walker.log_weight() + log_ratio;
        (set.clone(), log_weight, log_ratio, state)
    });
    walked.collect()
}
