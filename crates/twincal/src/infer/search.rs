//! A deterministic search for the models that hold the mass: fast enough for loops.
//!
//! From a good model the heaviest known one is expanded again and again: all its neighbours (one component in or out,
//! one exchanged) are weighed in the tableau, and every model that was ever weighed counts in probabilities and moments.
//! Expansion ends when what a further one would add is negligible, or at a fixed number of models. No random numbers,
//! one thread: the same bytes everywhere.

use super::MANY_COLUMNS;
use super::bounds::{Weights, truncate};
use super::exchanges::{Exchange, exchanges};
use super::moments::{Moments, Sums, after_exchange, after_flip, present};
use super::reduced::Reduced;
use super::standard::Standard;
use super::walker::Walker;
use crate::posterior::{Model, Posterior, Problem};
use crate::prior::Prior;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

/// ln of the weight, relative to the heaviest model, below which a model is not kept.
const NEGLIGIBLE: f64 = -28.0;
/// The same for loops, where a third digit decides nothing.
const NEGLIGIBLE_IN_LOOPS: f64 = -14.0;
/// ln of the weight, relative to the heaviest model, above which exchanges are tried as well.
const EXCHANGED: f64 = -4.6;
/// Nats that bounds cost a model from which on they are worth a closer look.
const ACTING: f64 = 0.5;
/// Such looks at most: without a limit they took a third of the time of the UR10's fit.
const LOOKS: usize = 48;
/// Nats by which the guide may rate a model too high before that is said.
const OVERRATED: f64 = 3.0;
/// Share of the mass that may be missing.
const MISSING: f64 = 1e-6;
/// The same for loops.
const MISSING_IN_LOOPS: f64 = 1e-3;
/// Weight of the last expansion beside the one after it, in the estimate of what is missing.
const FORGET: f64 = 0.8;
/// Models that are expanded at least: an estimate of what is missing needs a few.
const LEAST_EXPANDED: usize = 4;

/// A set of components, one bit each.
pub(super) type Set = Vec<u64>;

/// What a search found, by component and position of [`Reduced::open`].
pub(super) struct Found {
    /// Sums over all weighed models.
    pub(super) sums: Sums,
    /// (ln weight, components) of all of them, heaviest first.
    pub(super) models: Vec<(f64, Set)>,
    /// Estimated share of the mass that was not found.
    pub(super) missing: f64,
    /// The guide rated some model far too high: others matter, however light they seem beside it.
    pub(super) overrated: bool,
}

/// What a search is told.
pub(super) struct Start<'a> {
    /// Components of models to start from; none: the empty and the full one, see [`Search::begin`].
    pub(super) warm: &'a [Vec<usize>],
    /// Models that are expanded at most.
    pub(super) budget: usize,
    /// How well the mass must be known.
    pub(super) care: Care,
}

/// How well a search must know the mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Care {
    /// For a reported answer.
    Full,
    /// For fixed points and folds over many components.
    Loop,
}

impl Care {
    fn negligible(self) -> f64 {
        match self {
            Self::Full => NEGLIGIBLE,
            Self::Loop => NEGLIGIBLE_IN_LOOPS,
        }
    }

    fn missing(self) -> f64 {
        match self {
            Self::Full => MISSING,
            Self::Loop => MISSING_IN_LOOPS,
        }
    }
}

/// Runs a search.
fn run(reduced: &Reduced<'_>, prior: &Prior, start: &Start<'_>) -> Found {
    let standard = &reduced.open;
    let exchanges = exchanges(standard, prior, &reduced.active, true);
    let mut walker = Walker::new(standard, prior);
    reduced.certain.iter().for_each(|&b| walker.flip(b));
    let mut search = Search {
        known: BTreeMap::new(),
        queue: BinaryHeap::new(),
        sums: Sums::new(standard, reduced.shrinks()),
        best: f64::NEG_INFINITY,
        overrated: false,
        looked: 0,
        walker,
        reduced,
        active: &reduced.active,
        exchanges: &exchanges,
        care: start.care,
    };
    search.begin(start.warm);
    search.expand(start.budget)
}

/// Runs the search on a problem from the first two of the given models; without any, from the empty one and, of up to [`MANY_COLUMNS`], the full one.
pub(super) fn from_models(
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
    run(
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

/// Steepest ascent by flips of `active` components, then by exchanges, until neither helps.
pub(super) fn climb(walker: &mut Walker<'_>, active: &[usize], exchanges: &[Exchange]) {
    for _ in 0..4 * active.len() + 4 {
        let best = active
            .iter()
            .map(|&block| (walker.flip_gain(block).0, block))
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        if let Some((gain, block)) = best
            && gain > 1e-9
        {
            walker.flip(block);
            continue;
        }
        let step = exchanges
            .iter()
            .filter_map(|exchange| exchange.step(walker))
            .map(|step| (walker.exchange_gain(&step).0, step))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match step {
            Some((gain, step)) if gain > 1e-9 => walker.take(&step),
            _ => return,
        }
    }
}

/// A model in the queue, heaviest first; of equal ones the smaller set.
#[derive(PartialEq)]
struct Candidate {
    log_weight: f64,
    set: Set,
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.log_weight
            .total_cmp(&other.log_weight)
            .then_with(|| other.set.cmp(&self.set))
    }
}

struct Search<'a> {
    walker: Walker<'a>,
    reduced: &'a Reduced<'a>,
    active: &'a [usize],
    exchanges: &'a [Exchange],
    /// ln weight of every model that was weighed and is not negligible.
    known: BTreeMap<Set, f64>,
    queue: BinaryHeap<Candidate>,
    sums: Sums,
    best: f64,
    overrated: bool,
    /// Closer looks that were taken at what bounds leave of a model.
    looked: usize,
    care: Care,
}

impl Search<'_> {
    /// The components of the present model.
    fn set(&self) -> Set {
        let count = self.walker.standard.blocks.len();
        let mut set = vec![0; count.div_ceil(64)];
        (0..count)
            .filter(|&b| self.walker.tableau.holds(b))
            .for_each(|b| set[b / 64] |= 1 << (b % 64));
        set
    }

    /// Walks to a model.
    fn go(&mut self, set: &[u64]) {
        for index in 0..self.active.len() {
            let block = self.active[index];
            if self.walker.tableau.holds(block) != (set[block / 64] >> (block % 64) & 1 == 1) {
                self.walker.flip(block);
            }
        }
    }

    /// Climbs from the given models, or from the empty one and, where the columns are not very many, the full one.
    fn begin(&mut self, warm: &[Vec<usize>]) {
        let words = self.walker.standard.blocks.len().div_ceil(64);
        let bits = |blocks: &[usize]| {
            let mut set = vec![0u64; words];
            blocks.iter().for_each(|&b| set[b / 64] |= 1 << (b % 64));
            set
        };
        let mut starts: Vec<Set> = warm.iter().map(|blocks| bits(blocks)).collect();
        if starts.is_empty() {
            starts.push(bits(&[]));
            if self.walker.standard.size() <= MANY_COLUMNS {
                starts.push(bits(self.active));
            }
        }
        let mut found: Vec<(f64, Set)> = Vec::new();
        for set in starts {
            self.go(&set);
            climb(&mut self.walker, self.active, self.exchanges);
            found.push((self.walker.log_weight(), self.set()));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        self.sums.reference = f64::NEG_INFINITY;
        for (_, set) in found {
            self.go(&set);
            self.add_present();
        }
    }

    /// Counts the present model unless it is known.
    fn add_present(&mut self) {
        let set = self.set();
        if !self.known.contains_key(&set) {
            let moments = present(&self.walker, self.reduced.shrinks());
            let bounds = -moments.log_mass(self.walker.standard);
            let log_weight = self.walker.log_weight() - bounds;
            self.sums.add(self.walker.standard, log_weight, &moments);
            self.keep(set, log_weight, bounds);
        }
    }

    /// `bounds`: what they cost, as the guide has it.
    fn keep(&mut self, set: Set, log_weight: f64, bounds: f64) {
        self.raise(&set, log_weight, bounds);
        self.queue.push(Candidate {
            log_weight,
            set: set.clone(),
        });
        self.known.insert(set, log_weight);
    }

    /// All models one component away from the present one, which is `set`.
    fn neighbours(&mut self, set: &[u64]) {
        let now = self.walker.log_weight();
        for index in 0..self.active.len() {
            let block = self.active[index];
            let (gain, excess) = self.walker.flip_gain(block);
            // The bounds can only take weight away.
            if now + gain < self.best + self.care.negligible() {
                continue;
            }
            let mut other = set.to_vec();
            other[block / 64] ^= 1 << (block % 64);
            if self.known.contains_key(&other) {
                continue;
            }
            let moments = after_flip(&self.walker, block, excess, self.reduced.shrinks());
            self.add(other, now + gain, &moments);
        }
    }

    /// Counts a model that is not known by its weight without bounds, unless with them it is negligible.
    fn add(&mut self, set: Set, free: f64, moments: &Moments) {
        let log_weight = free + moments.log_mass(self.walker.standard);
        if log_weight >= self.best + self.care.negligible() {
            self.sums.add(self.walker.standard, log_weight, moments);
            self.keep(set, log_weight, free - log_weight);
        }
    }

    /// The heaviest model sets what is negligible. Where bounds act, coefficients are no longer independent and the guide may
    /// rate a model far too high: it counts with what the bounds really leave of it.
    fn raise(&mut self, set: &[u64], log_weight: f64, bounds: f64) {
        if log_weight <= self.best {
            return;
        }
        let mut own = log_weight;
        if bounds > ACTING {
            // What is negligible beside a lighter model than the heaviest is no loss: more is kept.
            if self.looked == LOOKS {
                return;
            }
            self.looked += 1;
            let standard = self.reduced.full;
            let (_, mut positions) = self.reduced.members(set);
            positions.sort_unstable_by_key(|&d| standard.order[d]);
            let truncated = standard
                .model(&positions, 1.0)
                .and_then(|mut model| truncate(standard, &mut model, &positions, Weights::Guided));
            let log_ratio = truncated.map_or(f64::NEG_INFINITY, |log_ratio| log_ratio.min(0.0));
            self.overrated |= log_ratio < -OVERRATED;
            own += log_ratio;
        }
        self.best = self.best.max(own);
    }

    /// All models one exchange away from the present one, which is `set`.
    fn exchanged(&mut self, set: &[u64]) {
        let now = self.walker.log_weight();
        for index in 0..self.exchanges.len() {
            let Some(step) = self.exchanges[index].step(&self.walker) else {
                continue;
            };
            let mut other = set.to_vec();
            for &block in step.leaving.iter().chain(&step.entering) {
                other[block / 64] ^= 1 << (block % 64);
            }
            if self.known.contains_key(&other) {
                continue;
            }
            let (gain, excess, pivot) = self.walker.exchange_gain(&step);
            if now + gain >= self.best + self.care.negligible() {
                let moments =
                    after_exchange(&self.walker, &step, &pivot, excess, self.reduced.shrinks());
                self.add(other, now + gain, &moments);
            }
        }
    }

    fn expand(mut self, budget: usize) -> Found {
        // Mass that was expanded, in all and lately, and what it brought lately.
        let (mut expanded, mut recent, mut brought) = (0.0, 0.0, 0.0);
        let mut missing = 0.0;
        for step in 0..budget {
            let Some(next) = self.queue.pop() else {
                missing = 0.0;
                break;
            };
            self.go(&next.set);
            let (mut before, reference) = (self.sums.total(), self.sums.reference);
            self.neighbours(&next.set);
            if next.log_weight > self.best + EXCHANGED {
                self.exchanged(&next.set);
            }
            self.sums.leave(&self.walker);
            if self.sums.reference > reference {
                // far heavier models than any before: everything so far in the new unit
                let unit = (reference - self.sums.reference).exp();
                for sum in [&mut before, &mut expanded, &mut recent, &mut brought] {
                    *sum *= unit;
                }
            }
            let own = self.sums.weight(next.log_weight);
            expanded += own;
            recent = FORGET * recent + own;
            brought = FORGET * brought + self.sums.total() - before;
            // What waits brings as much per mass as what was expanded lately.
            let waiting = (self.sums.total() - expanded).max(0.0);
            let rate = if recent > 0.0 {
                (brought / recent).min(1.0)
            } else {
                1.0
            };
            missing = (waiting * rate / self.sums.total()).min(0.5);
            if missing < self.care.missing() && step >= LEAST_EXPANDED {
                break;
            }
        }
        let mut models: Vec<(f64, Set)> = self
            .known
            .into_iter()
            .map(|(set, log_weight)| (log_weight, set))
            .collect();
        models.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        Found {
            sums: self.sums,
            models,
            missing,
            overrated: self.overrated,
        }
    }
}

#[cfg(test)]
mod tests;
