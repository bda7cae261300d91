//! Proposals to exchange an included component of one column for an excluded one that resembles it.
//!
//! The pairs are dealt into fixed groups of eight, which have their turn scan after scan. A proposal draws one of the
//! group's pairs uniformly and is void unless exactly one of the two is included: the same probability there and back.
//! The chance that a proposal is accepted is the mean of the acceptance probabilities over the group, which is computed
//! once per state.

use super::acceptance::{LAZY, to_the};
use crate::infer::standard::Standard;
use crate::infer::walker::Walker;
use crate::lanes::{LANES, Lane};
use pulp::Simd;

/// Columns less alike than this (cosine) are no pair: two flips do the same.
const ALIKE: f64 = 0.3;
/// Pairs per column, the most alike first.
const PAIRS_PER_COLUMN: usize = 6;
/// Scans in which every group has its turn.
const SCANS_PER_ROUND: usize = 16;

/// See the module's text.
#[derive(Debug)]
pub(super) struct Swaps {
    groups: Vec<Group>,
    /// Groups that a scan turns to, and the first of the next scan.
    turns: usize,
    next: usize,
}

/// Up to eight pairs.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Components and their positions.
    pairs: Vec<Pair>,
    /// State of the chain that the rest belongs to.
    version: u64,
    /// Running sums of the acceptance probabilities; a void proposal has none.
    sums: Lane,
    /// Chance that none of its proposals is accepted.
    stays: f64,
}

/// Two components of one column.
#[derive(Debug, Clone, Copy)]
struct Pair {
    blocks: [usize; 2],
    positions: [usize; 2],
    /// Of the first out and the second in, then the other way round: ratio of the slabs' precisions.
    slabs: [f64; 2],
    /// Of the slabs' masses within the bounds; `None` where that is not all that the prior says.
    prior: Option<[f64; 2]>,
}

impl Pair {
    fn new(standard: &Standard, [a, b]: [usize; 2]) -> Self {
        let own = [&standard.blocks[a], &standard.blocks[b]];
        let both_ways = |ratio: f64| [ratio, 1.0 / ratio];
        let precision = own.map(|block| standard.precision[block.start]);
        let same = own[0].family == own[1].family;
        Self {
            blocks: [a, b],
            positions: own.map(|block| block.start),
            slabs: both_ways(precision[1] / precision[0]),
            prior: same.then(|| both_ways(own[1].factor / own[0].factor)),
        }
    }
}

/// What the ratios of the exchanges of a group's pairs are made of, i leaving and j entering.
struct Exchanges {
    /// Ratios a priori, and of the slabs' precisions.
    prior: Lane,
    slabs: Lane,
    /// The tableau's entry of i and j.
    t: Lane,
    /// Diagonal and gradient of i: C_i and β_i.
    inverse: Lane,
    beta: Lane,
    /// The same of j, s_j and u_j, and the least that s_j can be.
    schur: Lane,
    gradient: Lane,
    least: Lane,
}

impl Group {
    /// Proposals when it is its turn: each pair once on average. They cost nothing unless accepted.
    pub(super) fn proposals(&self) -> i32 {
        self.pairs.len() as i32
    }

    /// Chance that a proposal is not accepted.
    pub(super) fn stay(&self) -> f64 {
        1.0 - LAZY * (self.sums[LANES - 1] / self.pairs.len() as f64)
    }

    /// Chance that none of all its proposals is accepted.
    pub(super) fn stays(&self) -> f64 {
        self.stays
    }

    /// Proposals of `left` up to and with the first that is accepted, if one is: `uniform` is below that chance.
    pub(super) fn first(&self, uniform: f64, left: i32) -> Option<i32> {
        let stay = self.stay();
        if uniform < stay.powi(left) {
            return None;
        }
        let proposal = (uniform.ln() / stay.ln()).ceil();
        Some(proposal.clamp(1.0, f64::from(left)) as i32)
    }

    /// The components (out, in) at share `uniform` of the accepted ones.
    pub(super) fn pick(&self, uniform: f64) -> [usize; 2] {
        let target = uniform * self.sums[LANES - 1];
        let index = self.sums.partition_point(|&sum| sum <= target);
        self.pairs[index.min(self.pairs.len() - 1)].blocks
    }
}

impl Swaps {
    /// Pairs among `active` components.
    pub(super) fn new(standard: &Standard, active: &[usize]) -> Self {
        let size = standard.size();
        let single: Vec<usize> = active
            .iter()
            .copied()
            .filter(|&b| standard.blocks[b].len == 1)
            .collect();
        let mut pairs = Vec::new();
        for &a in &single {
            let row = standard.blocks[a].start * size;
            let alike = |b: usize| standard.matrix[row + standard.blocks[b].start].abs();
            let mut others: Vec<usize> = single
                .iter()
                .copied()
                .filter(|&b| b != a && alike(b) > ALIKE)
                .collect();
            others.sort_by(|&a, &b| alike(b).total_cmp(&alike(a)));
            others.truncate(PAIRS_PER_COLUMN);
            pairs.extend(others.into_iter().map(|b| (a.min(b), a.max(b))));
        }
        pairs.sort_unstable();
        pairs.dedup();
        let pair = |&(a, b): &(usize, usize)| Pair::new(standard, [a, b]);
        let groups: Vec<Group> = pairs
            .chunks(LANES)
            .map(|pairs| Group {
                pairs: pairs.iter().map(pair).collect(),
                version: 0,
                sums: [0.0; LANES],
                stays: 1.0,
            })
            .collect();
        Self {
            turns: groups.len().div_ceil(SCANS_PER_ROUND),
            groups,
            next: 0,
        }
    }

    /// Groups that a scan turns to.
    pub(super) fn turns(&self) -> usize {
        self.turns
    }

    /// The next group.
    pub(super) fn turn(&mut self) -> usize {
        let group = self.next;
        self.next = if group + 1 == self.groups.len() {
            0
        } else {
            group + 1
        };
        group
    }

    /// A group with the acceptance probabilities of the present state.
    #[inline(always)]
    pub(super) fn group<S: Simd>(
        &mut self,
        simd: S,
        index: usize,
        walker: &Walker<'_>,
        version: u64,
    ) -> &Group {
        let group = &mut self.groups[index];
        if group.version != version {
            group.evaluate(simd, walker);
            group.version = version;
        }
        group
    }
}

impl Group {
    /// Acceptance probabilities of all pairs in the present state.
    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, walker: &Walker<'_>) {
        let (standard, tableau) = (walker.standard, &walker.tableau);
        let misfit = 1.0 + tableau.excess;
        (self.sums, self.stays) = ([0.0; LANES], 1.0);
        let Some(Exchanges {
            prior,
            t,
            slabs,
            inverse,
            beta,
            schur,
            gradient,
            least,
        }) = self.exchanges(walker)
        else {
            return;
        };
        let (mut change, mut ratio) = ([1.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            // Without i: s_j grows by t²/C_i, u_j by t β_i/C_i.
            let c = if inverse[lane] > 1.0 {
                inverse[lane]
            } else {
                1.0
            };
            let without = t[lane] / c;
            let s = schur[lane] + t[lane] * without;
            let s = if s > least[lane] { s } else { least[lane] };
            let u = gradient[lane] + without * beta[lane];
            let swapped = misfit + beta[lane] * beta[lane] / c - u * u / s;
            let swapped = swapped / misfit;
            change[lane] = if swapped > f64::MIN_POSITIVE {
                swapped
            } else {
                f64::MIN_POSITIVE
            };
            ratio[lane] = prior[lane] * (slabs[lane] / (c * s)).sqrt();
        }
        let power = to_the(simd, change, -standard.shape);
        let mut total = 0.0;
        for lane in 0..LANES {
            let r = ratio[lane] * power[lane];
            total += if r < 1.0 { r } else { 1.0 };
            self.sums[lane] = total;
        }
        self.stays = self.stay().powi(self.proposals());
    }

    /// What the exchanges of all pairs are made of; turns pairs so that the first is in. `None` where none is in without the other.
    #[inline(always)]
    fn exchanges(&mut self, walker: &Walker<'_>) -> Option<Exchanges> {
        let (standard, tableau) = (walker.standard, &walker.tableau);
        // Of a void proposal the ratio is 0.
        let (mut prior, mut t, mut slabs) = ([0.0; LANES], [0.0; LANES], [1.0; LANES]);
        let (mut inverse, mut beta) = ([1.0; LANES], [0.0; LANES]);
        let (mut schur, mut gradient, mut least) = ([1.0; LANES], [0.0; LANES], [0.0; LANES]);
        let mut live = false;
        for (lane, pair) in self.pairs.iter_mut().enumerate() {
            let inside = pair.positions.map(|j| tableau.sign[j] > 0.0);
            if inside[0] == inside[1] {
                continue;
            }
            live = true;
            if inside[1] {
                pair.blocks.swap(0, 1);
                pair.positions.swap(0, 1);
                pair.slabs.swap(0, 1);
                if let Some(prior) = &mut pair.prior {
                    prior.swap(0, 1);
                }
            }
            let ([out, into], [i, j]) = (pair.blocks, pair.positions);
            prior[lane] = match pair.prior {
                Some([prior, _]) if !walker.has_kin() => prior,
                _ => walker.exchange_odds(out, into),
            };
            t[lane] = tableau.row(i)[j];
            (inverse[lane], beta[lane]) = (tableau.diagonal[i], tableau.gradient[i]);
            (schur[lane], gradient[lane]) = (tableau.diagonal[j], tableau.gradient[j]);
            least[lane] = standard.precision[j];
            slabs[lane] = pair.slabs[0];
        }
        live.then_some(Exchanges {
            prior,
            t,
            slabs,
            inverse,
            beta,
            schur,
            gradient,
            least,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::kin::Step;
    use crate::infer::testing::problem;
    use crate::prior::Inclusion;

    /// Metropolis: every exchange is accepted with the ratio of the two models' weights, slabs and families that differ included.
    /// The jumps between listed models hide what is wrong here from the posterior's own tests.
    #[test]
    fn an_exchange_is_accepted_by_the_ratio_of_the_weights() {
        let simd = pulp::Scalar::new();
        let problem = problem(3, 9, 40, 0.8, Inclusion::ExpectedTerms(3.0));
        let standard = Standard::new(&problem).unwrap();
        let mut walker = Walker::new(&standard, &problem.prior);
        let all: Vec<usize> = (0..standard.blocks.len()).collect();
        let mut swaps = Swaps::new(&standard, &all);
        let (mut compared, mut uncertain) = (0, 0);
        for scan in 0..40 {
            walker.flip((7 * scan + scan / 9) % all.len());
            let before = walker.log_weight();
            for index in 0..swaps.groups.len() {
                let group = swaps.group(simd, index, &walker, 1 + scan as u64).clone();
                let mut sum = 0.0;
                for (pair, &up_to) in group.pairs.iter().zip(&group.sums) {
                    let accepted = up_to - sum;
                    sum = up_to;
                    let [out, into] = pair.blocks;
                    if walker.tableau.holds(out) == walker.tableau.holds(into) {
                        assert_eq!(accepted, 0.0);
                        continue;
                    }
                    let there = Step {
                        leaving: vec![out],
                        entering: vec![into],
                    };
                    let back = Step {
                        leaving: there.entering.clone(),
                        entering: there.leaving.clone(),
                    };
                    walker.take(&there);
                    let ratio = (walker.log_weight() - before).exp().min(1.0);
                    walker.take(&back);
                    assert!((accepted - ratio).abs() < 1e-9, "{accepted} {ratio}");
                    compared += 1;
                    uncertain += usize::from(ratio > 1e-3 && ratio < 0.999);
                }
                // What a uniform number says of one proposal, and of all.
                let stay = 1.0 - LAZY * sum / group.pairs.len() as f64;
                let all = stay.powi(group.proposals());
                assert!((group.stays() - all).abs() < 1e-12);
                assert_eq!(group.first(0.999 * all, group.proposals()), None);
                if stay < 0.99 {
                    let first = |u: f64| group.first(u, group.proposals());
                    assert_eq!(first(stay + 1e-9), Some(1));
                    assert_eq!(first(stay - 1e-9), Some(2));
                }
            }
        }
        assert!(compared > 100 && uncertain > 30, "{compared} {uncertain}");
    }

    /// Every group has its turn within a round.
    #[test]
    fn every_pair_has_its_turn() {
        let problem = problem(3, 40, 60, 0.8, Inclusion::ExpectedTerms(3.0));
        let standard = Standard::new(&problem).unwrap();
        let all: Vec<usize> = (0..standard.blocks.len()).collect();
        let mut swaps = Swaps::new(&standard, &all);
        let groups = swaps.groups.len();
        assert!(groups > SCANS_PER_ROUND, "{groups}");
        let turned: std::collections::BTreeSet<usize> = (0..SCANS_PER_ROUND * swaps.turns())
            .map(|_| swaps.turn())
            .collect();
        assert_eq!(turned.len(), groups);
    }
}
