//! One Markov chain over models: scans of flips, swaps of components that resemble each other, then φ | z and β | z, φ.
//!
//! A flip of component j is accepted with probability `f_j = 0.95 min(1, R_j)`, R_j the ratio of posterior probabilities
//! with β and φ integrated out (a metropolised Gibbs step; the factor keeps it aperiodic). As long as nothing flips, all
//! f stay what they are: eight are computed at a time and kept, and ONE uniform number, compared with the running
//! product Π(1 − f), says where the next flip is. A scan without flips is C/8 multiplications.
//! Columns that every model with weight holds are integrated out ([`Reduced`]) or, where a bound may act, in from the start.

mod admission;
mod ratios;

use super::acceptance::exchange_chance;
use super::jumps::Jumps;
use super::random::Source;
use super::state::State;
use super::swaps::Swaps;
use crate::infer::exchanges::Exchange;
use crate::infer::reduced::{Reduced, Response};
use crate::infer::walker::Walker;
use crate::lanes::LANES;
use crate::prior::Prior;
use admission::Admission;
use pulp::{Simd, WithSimd};
use ratios::Chunk;
use std::collections::BTreeMap;

/// Exchanges that a scan proposes; most are void.
const EXCHANGES: usize = 8;
/// Draws between two jumps: a walk to a model far away costs more than many scans. Draws from listed models are from the whole list
/// all the same.
const JUMP_EVERY: usize = 4;
/// How long a chain runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Length {
    pub(super) warm_up: usize,
    pub(super) draws: usize,
    pub(super) scans_per_draw: usize,
}

/// What chains are about.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub(super) reduced: &'a Reduced<'a>,
    pub(super) prior: &'a Prior,
    /// Exchanges in which a component of several columns takes part.
    pub(super) exchanges: &'a [Exchange],
    /// Models to jump between.
    pub(super) jumps: &'a Jumps,
}

/// What a chain found, natural units. `conditional`, `inclusion` and `visits` are about the components of
/// [`Reduced::open`], `beta`, `shift` and `moment` about all positions. Arrays are `[row * draws + draw]`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trace {
    /// P(z = 1 | all other z), mean over a draw's scans; with bounds only about that, and no part of a result.
    pub(super) conditional: Vec<f32>,
    /// z before the jump, or of a listed model P(z = 1 | list): what jumping from there would give on average.
    pub(super) jumped: Vec<f32>,
    /// Draws whose model is listed.
    pub(super) listed: u64,
    /// Draws of β_k given z, each from its own margin: their joint law is not needed to judge a chain.
    pub(super) beta: Vec<f32>,
    /// Σ over draws of E[δ | z].
    pub(super) shift: Vec<f64>,
    /// Σ over draws of E[δ² | z].
    pub(super) moment: Vec<f64>,
    /// Σ over draws of `conditional` and of `jumped`, by component.
    pub(super) inclusion: Vec<f64>,
    pub(super) jumped_inclusion: Vec<f64>,
    /// Σ over draws of (1 + c).
    pub(super) misfit: f64,
    /// How often each model (a set of components) that is not listed was the state of a draw.
    pub(super) visits: BTreeMap<Vec<u64>, u64>,
    /// Accepted moves.
    pub(super) moves: u64,
}

/// Numbers of `conditional`, of `jumped` and of `beta` in the [`Trace`] of so many draws.
fn lengths(reduced: &Reduced<'_>, draws: usize) -> [usize; 3] {
    let (count, size) = (reduced.open.blocks.len(), reduced.full.size());
    [count, count, size].map(|each| each.saturating_mul(draws))
}

/// Bytes that the draws of one chain take.
pub(super) fn bytes(reduced: &Reduced<'_>, draws: usize) -> u64 {
    let numbers = lengths(reduced, draws).into_iter();
    let numbers = numbers.fold(0_u64, |all, own| all.saturating_add(own as u64));
    numbers.saturating_mul(size_of::<f32>() as u64)
}

/// Runs one chain.
pub(super) fn run(target: Target<'_>, seed: u64, chain: usize, length: Length) -> Trace {
    let (size, count) = (target.reduced.full.size(), target.reduced.open.blocks.len());
    let mut state = Chain::new(target, Source::new(seed, chain as u64));
    state.start(chain);
    let [conditional, jumped, beta] =
        lengths(target.reduced, length.draws).map(|numbers| vec![0.0; numbers]);
    let mut trace = Trace {
        conditional,
        jumped,
        listed: 0,
        beta,
        shift: vec![0.0; size],
        moment: vec![0.0; size],
        inclusion: vec![0.0; count],
        jumped_inclusion: vec![0.0; count],
        misfit: 0.0,
        visits: BTreeMap::new(),
        moves: 0,
    };
    let instructions = pulp::Arch::new();
    for scan in 0..length.warm_up * length.scans_per_draw {
        instructions.dispatch(Scan(&mut state));
        if scan % (JUMP_EVERY * length.scans_per_draw) == 0 {
            state.settle_in(target.jumps);
            state.jump(target.jumps);
        }
    }
    state.moves = 0;
    for draw in 0..length.draws {
        state.sums.fill(0.0);
        for _ in 0..length.scans_per_draw {
            instructions.dispatch(Scan(&mut state));
        }
        state.record(&mut trace, draw, length, target.jumps);
        if draw % JUMP_EVERY == 0 {
            state.jump(target.jumps);
        }
    }
    trace.moves = state.moves;
    trace
}

/// One scan, with what the processor has.
struct Scan<'c, 'a>(&'c mut Chain<'a>);

impl WithSimd for Scan<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.scan(simd);
    }
}

/// A chain at work.
struct Chain<'a> {
    walker: Walker<'a>,
    swaps: Swaps,
    exchanges: &'a [Exchange],
    source: Source,
    /// Components that may flip, by place in `standard.blocks`: wide ones first.
    active: Vec<usize>,
    reduced: &'a Reduced<'a>,
    /// The present model's moments and whether it is listed, with the version of the chain that they belong to.
    present: State,
    read: u64,
    listed: bool,
    looked: u64,
    response: Response,
    /// Families of `active`.
    families: Vec<usize>,
    /// The slab's mass within the bounds and 1 over it, of each of them; 0 behind the last.
    factors: Vec<[f64; 2]>,
    /// See [`Walker::family_odds`].
    family_odds: Vec<[f64; 2]>,
    /// Prior ratio of flipping each of `active`, where heredity makes it more than that of its family.
    odds: Vec<f64>,
    /// The slabs' precisions by position and what they are 1 over, padded like the tableau's vectors.
    precision: Vec<f64>,
    slab: Vec<f64>,
    chunks: Vec<Chunk>,
    /// What bounds say of a move; `None` where there are none.
    admission: Option<Admission>,
    version: u64,
    /// Uniform number that the running product has not reached yet, and that product.
    target: f64,
    product: f64,
    /// Σ over scans of P(z = 1 | all other z), by place in `active`.
    sums: Vec<f64>,
    moves: u64,
}

impl<'a> Chain<'a> {
    fn new(target: Target<'a>, mut source: Source) -> Self {
        let standard = &target.reduced.open;
        let mut walker = Walker::new(standard, target.prior);
        let (certain, active) = (&target.reduced.certain, target.reduced.active.clone());
        certain.iter().for_each(|&block| walker.flip(block));
        let chunks: Vec<Chunk> = active
            .chunks(LANES)
            .map(|blocks| Chunk::new(standard, blocks))
            .collect();
        let uniform = source.uniform();
        let mut precision = standard.precision.clone();
        precision.resize(walker.tableau.width + LANES, 1.0);
        let mut families: Vec<usize> = (active.iter())
            .map(|&block| standard.blocks[block].family)
            .collect();
        families.resize(chunks.len() * LANES, 0);
        let factor = |&block: &usize| standard.blocks[block].factor;
        let mut factors: Vec<[f64; 2]> = (active.iter().map(factor))
            .map(|factor| [factor, 1.0 / factor])
            .collect();
        factors.resize(chunks.len() * LANES, [0.0; 2]);
        let mut chain = Self {
            families,
            factors,
            family_odds: (0..walker.families())
                .map(|family| walker.family_odds(family))
                .collect(),
            slab: precision.iter().map(|precision| 1.0 / precision).collect(),
            precision,
            swaps: Swaps::new(standard, &active),
            exchanges: target.exchanges,
            source,
            odds: vec![0.0; chunks.len() * LANES],
            sums: vec![0.0; chunks.len() * LANES],
            chunks,
            admission: (target.reduced.full.bounded).then(|| Admission::new(standard)),
            version: 1,
            target: uniform,
            product: 1.0,
            moves: 0,
            walker,
            active,
            reduced: target.reduced,
            present: State::default(),
            read: 0,
            listed: false,
            looked: 0,
            response: Response::default(),
        };
        chain.update_odds();
        chain
    }

    /// Over-dispersed starts: empty, nearly full, half, a few.
    fn start(&mut self, chain: usize) {
        let count = self.active.len();
        // More than 100 members at the start would only cost time: they leave within a scan.
        let share = [0.0, 0.9, 0.5, 0.1][chain % 4] * (100.0 / count as f64).min(1.0);
        for index in 0..count {
            // Odds of 0: a child whose parent is out.
            let block = self.active[index];
            if self.source.uniform() < share && self.walker.flip_odds(block) > 0.0 {
                self.flip(block);
            }
        }
        self.weigh_present();
    }

    /// `P(z_j flips)/P(z_j stays)` a priori, where heredity has a say.
    fn update_odds(&mut self) {
        if self.walker.has_kin() {
            for (odds, &block) in self.odds.iter_mut().zip(&self.active) {
                *odds = self.walker.flip_odds(block);
            }
        }
    }

    fn flip(&mut self, block: usize) {
        self.walker.flip(block);
        let family = self.walker.standard.blocks[block].family;
        self.family_odds[family] = self.walker.family_odds(family);
        self.update_odds();
        self.version += 1;
        self.moves += 1;
    }

    /// All components once, in order, then the swaps.
    #[inline(always)]
    fn scan<S: Simd>(&mut self, simd: S) {
        for index in 0..self.chunks.len() {
            let mut from = 0;
            // The product without what the lanes before `from` would make of it.
            let mut product = self.product;
            while from < LANES {
                if self.chunks[index].version != self.version {
                    self.evaluate(simd, index);
                }
                let chunk = &self.chunks[index];
                if from > 0 {
                    // f ≤ 0.95 keeps it positive.
                    product = self.product / chunk.stays[from - 1];
                }
                let sums = &mut self.sums[index * LANES..(index + 1) * LANES];
                let whole = product * chunk.stays[LANES - 1];
                if self.target < whole {
                    if from == 0 {
                        for (sum, conditional) in sums.iter_mut().zip(&chunk.conditional) {
                            *sum += conditional;
                        }
                    } else {
                        for (lane, sum) in sums.iter_mut().enumerate() {
                            *sum += if lane >= from {
                                chunk.conditional[lane]
                            } else {
                                0.0
                            };
                        }
                    }
                    self.product = whole;
                    break;
                }
                let mut lane = from;
                while lane < LANES - 1 && self.target < product * chunk.stays[lane] {
                    lane += 1;
                }
                for l in from..=lane {
                    sums[l] += chunk.conditional[l];
                }
                let block = self.active[index * LANES + lane];
                let guide = self.guide(block);
                self.attempt(&[block], guide);
                self.renew();
                from = lane + 1;
            }
        }
        for _ in 0..self.swaps.turns() {
            self.swap(simd);
        }
        if !self.exchanges.is_empty() {
            for _ in 0..EXCHANGES {
                self.exchange();
            }
        }
    }

    /// Proposes one exchange, drawn uniformly; void unless one side is wholly in and the other wholly out, which it is
    /// there and back with the same probability.
    fn exchange(&mut self) {
        let index = (self.source.uniform() * self.exchanges.len() as f64) as usize;
        let Some(step) = self.exchanges[index].step(&self.walker) else {
            return;
        };
        let (gain, ..) = self.walker.exchange_gain(&step);
        if self.source.uniform() < exchange_chance(gain) {
            let blocks = [step.leaving, step.entering].concat();
            self.attempt(&blocks, 0.0);
        }
    }

    /// The present model as a set of components, by place in `standard.blocks`.
    fn set(&self) -> Vec<u64> {
        let count = self.walker.standard.blocks.len();
        let mut set = vec![0u64; count.div_ceil(64)];
        for block in (0..count).filter(|&block| self.walker.tableau.holds(block)) {
            set[block / 64] |= 1 << (block % 64);
        }
        set
    }

    /// Whether the present model is listed.
    fn is_listed(&mut self, jumps: &Jumps) -> bool {
        if self.looked != self.version {
            self.listed = !jumps.is_empty() && jumps.lists(&self.set());
            self.looked = self.version;
        }
        self.listed
    }

    /// A Gibbs step over the listed models, see [`Jumps`].
    fn jump(&mut self, jumps: &Jumps) {
        if self.is_listed(jumps) {
            let model = jumps.draw(self.source.uniform());
            self.go(jumps, model);
        }
    }

    /// While a chain warms up: to a listed model that weighs more than an unlisted one where the chain may be caught between bounds.
    fn settle_in(&mut self, jumps: &Jumps) {
        if jumps.is_empty() || self.is_listed(jumps) {
            return;
        }
        let model = jumps.draw(self.source.uniform());
        let bounds = self.admission.as_ref().map_or(0.0, |own| own.present());
        if jumps.log_weight(model) > self.walker.log_weight() + bounds {
            self.go(jumps, model);
        }
    }

    /// To a listed model.
    fn go(&mut self, jumps: &Jumps, model: usize) {
        let goal = jumps.set(model);
        let mut changes = 0;
        for block in 0..self.walker.standard.blocks.len() {
            let inside = goal[block / 64] >> (block % 64) & 1 == 1;
            if self.walker.tableau.holds(block) != inside {
                self.flip(block);
                changes += 1;
            }
        }
        if changes > 0 {
            self.moves -= changes - 1;
            if let Some(admission) = &mut self.admission {
                admission.set_present(jumps.bounds(model));
            }
            self.renew();
        }
    }

    /// A new uniform number for the next flip.
    fn renew(&mut self) {
        self.target = self.source.uniform();
        self.product = 1.0;
    }

    /// Proposals of one group to exchange an included column for one that resembles it. Whether and when the next one is
    /// accepted is again one uniform number; which one, another.
    #[inline(always)]
    fn swap<S: Simd>(&mut self, simd: S) {
        let index = self.swaps.turn();
        let group = self.swaps.group(simd, index, &self.walker, self.version);
        let all = self.product * group.stays();
        if self.target < all {
            self.product = all;
            return;
        }
        let mut left = group.proposals();
        while left > 0 {
            let group = self.swaps.group(simd, index, &self.walker, self.version);
            let Some(proposal) = group.first(self.target / self.product, left) else {
                self.product *= group.stay().powi(left);
                return;
            };
            left -= proposal;
            let blocks = group.pick(self.source.uniform());
            self.attempt(&blocks, 0.0);
            self.renew();
        }
    }

    /// φ | z, then each β_k | z, φ; sums that need no draw use the conditional expectations. z is the present model, or where
    /// that is listed one drawn from the list: the chain need not go there.
    fn record(&mut self, trace: &mut Trace, draw: usize, length: Length, jumps: &Jumps) {
        let reduced = self.reduced;
        let listed = self.is_listed(jumps);
        for &block in &reduced.certain {
            trace.conditional[block * length.draws + draw] = 1.0;
            trace.jumped[block * length.draws + draw] = 1.0;
            trace.inclusion[block] += 1.0;
            trace.jumped_inclusion[block] += 1.0;
        }
        for (sum, &block) in self.sums.iter().zip(&self.active) {
            let conditional = sum / length.scans_per_draw as f64;
            trace.conditional[block * length.draws + draw] = conditional as f32;
            trace.inclusion[block] += conditional;
            let jumped = if listed {
                jumps.inclusion(block)
            } else {
                f64::from(u8::from(self.walker.tableau.holds(block)))
            };
            trace.jumped[block * length.draws + draw] = jumped as f32;
            trace.jumped_inclusion[block] += jumped;
        }
        let state = if listed {
            trace.listed += 1;
            jumps.state(jumps.draw(self.source.uniform()))
        } else {
            *trace.visits.entry(self.set()).or_default() += 1;
            if self.read != self.version {
                let tableau = &self.walker.tableau;
                self.present.read(reduced, tableau, &mut self.response);
                self.read = self.version;
            }
            &self.present
        };
        let standard = &reduced.open;
        let factor = standard.noise_factor();
        let phi = if factor.is_finite() {
            state.misfit * factor
        } else {
            0.0
        };
        // φ | z ~ InvGamma(a_n, (1 + c)/2), β_k | z, φ ~ N(β_k, φ (A_zz⁻¹)_kk)
        let root = (0.5 * state.misfit / self.source.gamma(standard.shape)).sqrt();
        let center = &reduced.full.center;
        for (d, (&delta, &variance)) in state.delta.iter().zip(&state.variance).enumerate() {
            trace.shift[d] += delta;
            trace.moment[d] += delta * delta + phi * variance;
            if variance > 0.0 {
                let noise = root * variance.sqrt() * self.source.normal();
                trace.beta[d * length.draws + draw] = (center[d] + delta + noise) as f32;
            }
        }
        trace.misfit += state.misfit;
    }
}
