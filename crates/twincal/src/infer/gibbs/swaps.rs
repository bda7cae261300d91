//! Proposals to exchange an included column for an excluded one that resembles it.
//!
//! A proposal draws one of E fixed pairs uniformly and is void unless exactly one of the two is included: the same
//! probability there and back. The chance that a proposal is accepted is the mean of the acceptance probabilities over
//! all pairs, which is computed once per state.

use super::chain::{LAZY, to_the};
use super::tableau::Tableau;
use crate::infer::standard::Standard;
use crate::lanes::LANES;
use pulp::Simd;

/// Columns less alike than this (cosine) are no pair: two flips do the same.
const ALIKE: f64 = 0.3;
/// Pairs per column, the most alike first.
const PAIRS_PER_COLUMN: usize = 6;

/// See the module's text.
#[derive(Debug)]
pub(super) struct Swaps {
    pairs: Vec<(u32, u32)>,
    /// State of the chain that the rest belongs to.
    pub(super) version: u64,
    /// Pairs that are no void proposals: (included, excluded).
    live: Vec<(u32, u32)>,
    /// Running sums of their acceptance probabilities.
    sums: Vec<f64>,
    /// Σ of acceptance probabilities / E.
    pub(super) accepted: f64,
}

impl Swaps {
    pub(super) fn new(standard: &Standard) -> Self {
        let size = standard.size();
        let mut pairs = Vec::new();
        for i in 0..size {
            let alike = |j: usize| standard.matrix[i * size + j].abs();
            let mut others: Vec<usize> =
                (0..size).filter(|&j| j != i && alike(j) > ALIKE).collect();
            others.sort_by(|&a, &b| alike(b).total_cmp(&alike(a)));
            others.truncate(PAIRS_PER_COLUMN);
            pairs.extend(
                others
                    .into_iter()
                    .map(|j| (i.min(j) as u32, i.max(j) as u32)),
            );
        }
        pairs.sort_unstable();
        pairs.dedup();
        Self {
            pairs,
            version: 0,
            live: Vec::new(),
            sums: Vec::new(),
            accepted: 0.0,
        }
    }

    /// As many as there are pairs: each is proposed once per scan on average. They cost nothing unless accepted.
    pub(super) fn proposals_per_scan(&self) -> i32 {
        self.pairs.len() as i32
    }

    /// The pair (out, in) at share `uniform` of the accepted ones.
    pub(super) fn pick(&self, uniform: f64) -> (usize, usize) {
        let target = uniform * self.sums.last().copied().unwrap_or(0.0);
        let index = self
            .sums
            .partition_point(|&sum| sum <= target)
            .min(self.live.len() - 1);
        let (i, j) = self.live[index];
        (i as usize, j as usize)
    }

    /// Acceptance probabilities of all pairs in the present state; `odds` are those of single flips.
    #[inline(always)]
    pub(super) fn evaluate<S: Simd>(
        &mut self,
        simd: S,
        tableau: &Tableau<'_>,
        standard: &Standard,
        odds: &[f64],
        family: &[usize],
        version: u64,
    ) {
        self.live.clear();
        self.sums.clear();
        for &(a, b) in &self.pairs {
            match (tableau.includes(a as usize), tableau.includes(b as usize)) {
                (true, false) => self.live.push((a, b)),
                (false, true) => self.live.push((b, a)),
                _ => {}
            }
        }
        let misfit = 1.0 + tableau.excess;
        let mut total = 0.0;
        for pairs in self.live.chunks(LANES) {
            let (mut change, mut ratio) = ([1.0; LANES], [0.0; LANES]);
            for (lane, &(i, j)) in pairs.iter().enumerate() {
                let (i, j) = (i as usize, j as usize);
                // Without i: s_j grows by t²/C_i, u_j by t β_i/C_i.
                let (t, inverse, beta) = (
                    tableau.row(i)[j],
                    tableau.diagonal[i].max(1.0),
                    tableau.gradient[i],
                );
                let schur = (tableau.diagonal[j] + t * t / inverse).max(standard.precision[j]);
                let gradient = tableau.gradient[j] + t * beta / inverse;
                let swapped = misfit + beta * beta / inverse - gradient * gradient / schur;
                change[lane] = (swapped / misfit).max(f64::MIN_POSITIVE);
                // Within one family the number of members stays: only the slabs' part of the odds remains.
                let prior = if family[i] == family[j] {
                    (standard.precision[j] / standard.precision[i]).sqrt()
                } else {
                    odds[i] * odds[j]
                };
                ratio[lane] = prior / (inverse * schur).sqrt();
            }
            let power = to_the(simd, change, -standard.shape);
            for lane in 0..pairs.len() {
                total += (ratio[lane] * power[lane]).min(1.0);
                self.sums.push(total);
            }
        }
        self.accepted = if self.pairs.is_empty() {
            0.0
        } else {
            total / self.pairs.len() as f64
        };
        debug_assert!(LAZY * self.accepted < 1.0);
        self.version = version;
    }
}
