//! Moves under bounds, in two stages (Christen & Fox 2005): a move that is accepted without them is admitted by what they
//! do to both models' weights.
//!
//! With π(z) the weight without bounds and ρ(z) what they multiply it with, a flip is accepted with
//! `f = 0.95 min(1, R g)` and then admitted with
//!
//! ```text
//! min(1, ρ(z') / (ρ(z) g))
//! ```
//!
//! where g, the guide, is about the growth of the mass above the bounds that the flipped coefficients take part in.
//! It is the inverse on the way back, so that any g keeps `π ρ`; a good one makes refusals rare. Swaps and exchanges have g = 1.

use super::Chain;
use crate::infer::bounds::{self, SlabMasses};
use crate::infer::moments::{FORBIDDEN, log_normal_mass};
use crate::infer::search::Set;
use crate::infer::standard::{Block, Standard};
use crate::infer::tableau::Tableau;
use crate::lanes::{LANES, Lane};
use crate::linear_algebra::Cholesky;
use crate::prior::HalfSpace;
use std::collections::BTreeMap;
use std::ops::Range;

/// The guide in nats is at most this: its exponential is a number.
const MOST: f64 = 600.0;
/// Models whose ρ is remembered at most.
const REMEMBERED: usize = 1 << 16;

/// What flipping a component does to sums of coefficients.
struct Turn<'a> {
    tableau: &'a Tableau<'a>,
    /// Positions of the component.
    own: Range<usize>,
    inside: bool,
    /// Of 1 + c.
    change: f64,
    square: Square,
}

/// `(A_zz⁻¹)_BB` of a component that is in, the Schur complement of one that is out; and the gradient over it.
enum Square {
    One { pivot: f64, step: f64 },
    Wide { factor: Cholesky, step: Vec<f64> },
}

impl Square {
    /// `(xᵀ step, xᵀ square⁻¹ x)`.
    fn forms(&self, x: &[f64]) -> (f64, f64) {
        match self {
            Self::One { pivot, step } => (x[0] * step, x[0] * x[0] / pivot),
            Self::Wide { factor, step } => {
                let mut half = x.to_vec();
                factor.solve_lower(&mut half);
                let along = x.iter().zip(step).map(|(x, b)| x * b).sum();
                (along, half.iter().map(|x| x * x).sum())
            }
        }
    }
}

/// Mean and variance/φ of a sum.
type Place = (f64, f64);

impl<'a> Turn<'a> {
    /// `None` where rounding leaves the square no factor.
    fn new(tableau: &'a Tableau<'a>, block: usize) -> Option<Self> {
        let own = tableau.standard.blocks[block].range();
        let (gradient, inside) = (&tableau.gradient[own.clone()], tableau.holds(block));
        let square = if own.len() == 1 {
            let pivot = tableau.diagonal[own.start];
            let step = gradient[0] / pivot;
            Square::One { pivot, step }
        } else {
            let factor = Cholesky::new(tableau.square(block), own.len()).ok()?;
            let mut step = gradient.to_vec();
            factor.solve(&mut step);
            Square::Wide { factor, step }
        };
        let (change, _) = square.forms(gradient);
        Some(Self {
            tableau,
            change: if inside { change } else { -change },
            own,
            inside,
            square,
        })
    }

    /// `Σ f β` over the terms that are in, with the component and without. With v = Σ f t of the others' rows towards it and its own
    /// factors g, the component entering adds `(g − v)ᵀ step` and `|g − v|²`; leaving, it takes `vᵀ step` and `|v|²` from what
    /// the others have.
    fn both(&self, terms: &[(usize, f64)]) -> (Place, Place) {
        let tableau = self.tableau;
        let mut own = vec![0.0; self.own.len()];
        let mut towards = vec![0.0; self.own.len()];
        let (mut mean, mut variance) = (0.0, 0.0);
        for &(d, f) in terms {
            if self.own.contains(&d) {
                own[d - self.own.start] = f;
            } else if tableau.includes(d) {
                let row = tableau.row(d);
                mean += f * tableau.gradient[d];
                let others = terms.iter().filter(|(e, _)| !self.own.contains(e));
                let inside = others.filter(|(e, _)| tableau.includes(*e));
                variance += inside.map(|(e, g)| f * g * row[*e]).sum::<f64>();
                let cross = row[self.own.clone()].iter();
                towards.iter_mut().zip(cross).for_each(|(v, t)| *v += f * t);
            }
        }
        if self.inside {
            let (along, square) = self.square.forms(&towards);
            let without = (mean - along, variance - square);
            for (place, f) in own.iter().enumerate().filter(|(_, f)| **f != 0.0) {
                let k = self.own.start + place;
                mean += f * tableau.gradient[k];
                let block = &tableau.row(k)[self.own.clone()];
                let among: f64 = block.iter().zip(&own).map(|(c, g)| c * g).sum();
                variance += f * (2.0 * towards[place] + among);
            }
            ((mean, variance), without)
        } else {
            let entering: Vec<f64> = own.iter().zip(&towards).map(|(g, v)| g - v).collect();
            let (along, square) = self.square.forms(&entering);
            ((mean + along, variance + square), (mean, variance))
        }
    }
}

/// See the module's text.
#[derive(Debug)]
pub(super) struct Admission {
    /// Positions of a component's coefficients with bounds of their own, by place in `standard.blocks`.
    single: Vec<Vec<usize>>,
    /// Places in `standard.halves` of the sums that one of its coefficients is part of, likewise.
    sums: Vec<Vec<usize>>,
    /// Growth of ln ρ by the slab's part beside the columns that these sums need, likewise: near enough for a guide.
    slab: Vec<f64>,
    masses: SlabMasses,
    /// ln ρ of models.
    known: BTreeMap<Set, f64>,
    /// ln ρ of the present one.
    present: f64,
}

impl Admission {
    pub(super) fn new(standard: &Standard) -> Self {
        let sums = |block: &Block| -> Vec<usize> {
            let own = |place: &usize| {
                let mut terms = standard.halves[*place].terms.iter();
                terms.any(|(d, _)| block.range().contains(d))
            };
            (0..standard.halves.len()).filter(own).collect()
        };
        let bounded = |d: &usize| standard.lower[*d] > f64::NEG_INFINITY;
        let single = |block: &Block| block.range().filter(bounded).collect();
        let sums: Vec<Vec<usize>> = standard.blocks.iter().map(sums).collect();
        let mut masses = SlabMasses::default();
        let mut slab = |(block, sums): (&Block, &Vec<usize>)| {
            // The columns without which none of these sums acts.
            let halves = sums.iter().map(|&place| &standard.halves[place]);
            let mut all: Vec<usize> = halves.filter_map(|half| half.replaces).collect();
            all.extend(block.range());
            all.sort_unstable();
            all.dedup();
            let with = bounds::slab_ratio(standard, &all, &mut masses);
            all.retain(|d| !block.range().contains(d));
            with - bounds::slab_ratio(standard, &all, &mut masses)
        };
        Self {
            single: standard.blocks.iter().map(single).collect(),
            slab: standard.blocks.iter().zip(&sums).map(&mut slab).collect(),
            sums,
            masses,
            known: BTreeMap::new(),
            present: 0.0,
        }
    }

    /// ln ρ of the present model.
    pub(super) fn present(&self) -> f64 {
        self.present
    }

    /// ln ρ of the model that the chain has come to otherwise.
    pub(super) fn set_present(&mut self, log_ratio: f64) {
        self.present = log_ratio;
    }

    fn remember(&mut self, set: Set, log_ratio: f64) {
        if self.known.len() == REMEMBERED {
            self.known.clear();
        }
        self.known.insert(set, log_ratio);
    }
}

impl Chain<'_> {
    /// ln ρ of the present model.
    pub(super) fn weigh_present(&mut self) {
        let set = self.set();
        if let Some(own) = &mut self.admission {
            let tableau = &self.walker.tableau;
            own.present = bounds::log_ratio(self.reduced, tableau, &set, &mut own.masses);
        }
    }

    /// Multiplies the odds of eight flips with the guide.
    #[inline(always)]
    pub(super) fn guide_odds(&self, index: usize, odds: &mut Lane) {
        if self.admission.is_some() {
            let blocks = self.active[index * LANES..].iter().take(LANES);
            for (odds, &block) in odds.iter_mut().zip(blocks) {
                *odds *= self.guide(block).exp();
            }
        }
    }

    /// ln g of flipping a component.
    pub(super) fn guide(&self, block: usize) -> f64 {
        let Some(admission) = &self.admission else {
            return 0.0;
        };
        let (single, sums) = (&admission.single[block], &admission.sums[block]);
        if single.is_empty() && sums.is_empty() {
            return 0.0;
        }
        let (standard, tableau) = (self.walker.standard, &self.walker.tableau);
        let Some(turn) = Turn::new(tableau, block) else {
            return 0.0;
        };
        let phi = |misfit: f64| 0.5 * misfit / standard.shape;
        let now = 1.0 + tableau.excess;
        let then = (now + turn.change).max(1.0);
        let (with, without) = match turn.inside {
            true => (phi(now), phi(then)),
            false => (phi(then), phi(now)),
        };
        let mass = |(mean, variance): Place, lower: f64, phi: f64| {
            log_normal_mass((mean - lower) / (phi * variance.max(f64::MIN_POSITIVE)).sqrt())
        };
        let mut log_growth = admission.slab[block];
        for &d in single {
            let (place, _) = turn.both(&[(d, 1.0)]);
            log_growth += mass(place, standard.lower[d], with);
        }
        // Sums of one component are much alike: the least mass above one of them is nearer to that above all than the product.
        let stays = |d: usize| !turn.own.contains(&d) && tableau.includes(d);
        let enters = |d: usize| turn.own.contains(&d) || stays(d);
        let of = |place: Place, half: &HalfSpace, phi: f64, inside: &dyn Fn(usize) -> bool| match (
            half.acts(inside),
            half.forbids(inside),
        ) {
            (false, _) => 0.0,
            (true, true) => FORBIDDEN,
            (true, false) => mass(place, half.lower, phi),
        };
        let (mut more, mut less) = (0.0f64, 0.0f64);
        for half in sums.iter().map(|&place| &standard.halves[place]) {
            let (then, before) = turn.both(&half.terms);
            more = more.min(of(then, half, with, &enters));
            less = less.min(of(before, half, without, &stays));
        }
        log_growth += more - less;
        let log_growth = log_growth.clamp(-MOST, MOST);
        if turn.inside { -log_growth } else { log_growth }
    }

    /// Moves components that the first stage accepted with this guide, if the bounds admit it.
    pub(super) fn attempt(&mut self, blocks: &[usize], guide: f64) {
        let Some(admission) = &self.admission else {
            self.move_all(blocks);
            return;
        };
        let uniform = self.source.uniform();
        let present = admission.present;
        let admits = |log_ratio: f64| uniform < (log_ratio - present - guide).exp();
        let mut set = self.set();
        for &block in blocks {
            set[block / 64] ^= 1 << (block % 64);
        }
        let known = admission.known.get(&set).copied();
        if known.is_some_and(|log_ratio| !admits(log_ratio)) {
            return;
        }
        self.move_all(blocks);
        let log_ratio = match (known, &mut self.admission) {
            (Some(log_ratio), _) => log_ratio,
            (None, Some(own)) => {
                bounds::log_ratio(self.reduced, &self.walker.tableau, &set, &mut own.masses)
            }
            (None, None) => 0.0,
        };
        let admitted = admits(log_ratio);
        if !admitted {
            self.move_all(blocks);
            self.moves -= 2;
        }
        if let Some(admission) = &mut self.admission {
            if known.is_none() {
                admission.remember(set, log_ratio);
            }
            if admitted {
                admission.present = log_ratio;
            }
        }
    }

    /// Moves components, as one move.
    fn move_all(&mut self, blocks: &[usize]) {
        for &block in blocks {
            self.flip(block);
        }
        self.moves -= blocks.len() as u64 - 1;
    }
}
