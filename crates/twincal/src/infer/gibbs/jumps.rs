//! Jumps between models far apart: Gibbs steps over a fixed list of models.
//!
//! Two stories that say almost the same (a payload, or the last link's mass moments and tensor) are many flips apart, and
//! what lies between is worse than both. A search knows both. Given that the chain is in one of the listed models, which
//! one is drawn anew in proportion to their weights: an update of the structure on that list, which keeps the posterior
//! whatever the list is.

use crate::infer::approximate;
use crate::infer::search::{Care, Set};
use crate::infer::standard::{Reduced, Standard};
use crate::infer::walker::Walker;
use crate::posterior::Problem;
use pulp::{Simd, WithSimd};
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
    /// Running sum of the weights, the last one 1.
    cumulative: Vec<f64>,
    /// P(z = 1 | list) by component.
    inclusion: Vec<f64>,
}

impl Jumps {
    /// No list: the chain stays where flips and exchanges lead it.
    pub(super) fn none() -> Self {
        Self {
            places: BTreeSet::new(),
            models: Vec::new(),
            cumulative: Vec::new(),
            inclusion: Vec::new(),
        }
    }

    /// What a search finds.
    pub(super) fn of(reduced: &Reduced<'_>, problem: &Problem) -> Self {
        let found = approximate::search(reduced, problem, None, BUDGET, Care::Loop);
        let models = found.models.into_iter().map(|(_, set)| set);
        Self::heaviest(models.take(MODELS).collect(), &reduced.open, problem)
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
        Self::heaviest(all.into_iter().collect(), &reduced.open, problem)
    }

    /// The list of the heaviest of these models, weighed as the chain weighs them.
    fn heaviest(mut models: Vec<Set>, standard: &Standard, problem: &Problem) -> Self {
        // Neighbours in this order differ by few components; a piece has its own walk, whatever the threads.
        models.sort_unstable();
        let mut weighed: Vec<(f64, Set)> = models
            .par_chunks(PIECE)
            .flat_map_iter(|models| {
                let weights = pulp::Arch::new().dispatch(Weights {
                    standard,
                    problem,
                    models,
                });
                weights.into_iter().zip(models.iter().cloned())
            })
            .collect();
        weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        weighed.truncate(MODELS);
        if weighed.len() < 2 {
            return Self::none();
        }
        let largest = weighed[0].0;
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = weighed
            .iter()
            .map(|(weight, _)| {
                sum += (weight - largest).exp();
                sum
            })
            .collect();
        cumulative.iter_mut().for_each(|value| *value /= sum);
        let models: Vec<Set> = weighed.into_iter().map(|(_, set)| set).collect();
        let mut jumps = Self {
            places: models.iter().cloned().collect(),
            models,
            cumulative,
            inclusion: Vec::new(),
        };
        jumps.inclusion = jumps.means(standard.blocks.len());
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

    /// The model to go to from `now`, with a uniform number, and P(z = 1 | list) of every component; `None` if `now` is not
    /// listed.
    pub(super) fn from(&self, now: &[u64], uniform: f64) -> Option<(&Set, &[f64])> {
        if !self.lists(now) {
            return None;
        }
        let last = self.models.len() - 1;
        let there = self
            .cumulative
            .partition_point(|&sum| sum <= uniform)
            .min(last);
        Some((&self.models[there], &self.inclusion))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.models.is_empty()
    }
}

/// ln weight of every model as the chain counts it.
struct Weights<'a> {
    standard: &'a Standard,
    problem: &'a Problem,
    models: &'a [Set],
}

impl WithSimd for Weights<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f64> {
        let mut walker = Walker::new(self.standard, &self.problem.prior);
        self.models
            .iter()
            .map(|set| {
                for block in 0..self.standard.blocks.len() {
                    if walker.tableau.holds(block) != (set[block / 64] >> (block % 64) & 1 == 1) {
                        walker.flip(simd, block);
                    }
                }
                walker.log_weight()
            })
            .collect()
    }
}
