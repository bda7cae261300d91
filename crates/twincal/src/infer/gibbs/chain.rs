//! One Markov chain over models: scans of flips, swaps of columns that resemble each other, then φ | z and β | z, φ.
//!
//! A flip of position j is accepted with probability `f_j = 0.95 min(1, R_j)`, R_j the ratio of posterior probabilities
//! with β and φ integrated out (a metropolised Gibbs step; the factor keeps it aperiodic). As long as nothing flips, all
//! f stay what they are: eight are computed at a time and kept, and ONE uniform number, compared with the running
//! product Π(1 − f), says where the next flip is. A scan without flips is K/8 multiplications.

use super::random::Source;
use super::swaps::Swaps;
use super::tableau::Tableau;
use crate::infer::standard::Standard;
use crate::lanes::{LANES, Lane, exp, ln};
use crate::linear_algebra::Cholesky;
use crate::prior::Prior;
use pulp::{Simd, WithSimd};
use std::collections::BTreeMap;

/// Largest acceptance probability of a move: below 1, or a chain could alternate for ever.
pub(super) const LAZY: f64 = 0.95;
/// Ratios beyond this count as this.
const RATIO_MAX: f64 = 1e300;

/// How long a chain runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Length {
    pub(super) warm_up: usize,
    pub(super) draws: usize,
    pub(super) scans_per_draw: usize,
}

/// What a chain found. Arrays `[position * draws + draw]` or by position, natural units.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trace {
    /// P(z = 1 | all other z), mean over a draw's scans.
    pub(super) conditional: Vec<f32>,
    /// Draws of β.
    pub(super) beta: Vec<f32>,
    /// Σ over draws of E[δ | z].
    pub(super) shift: Vec<f64>,
    /// Σ over draws of E[δ² | z].
    pub(super) moment: Vec<f64>,
    /// Σ over draws of P(z = 1 | all other z).
    pub(super) inclusion: Vec<f64>,
    /// Σ over draws of (1 + c).
    pub(super) misfit: f64,
    /// How often each model was the state of a draw.
    pub(super) visits: BTreeMap<Vec<u64>, u64>,
    /// Accepted moves.
    pub(super) moves: u64,
}

/// Eight positions whose conditionals are known.
#[derive(Debug, Clone, Copy)]
struct Chunk {
    /// State of the chain that they belong to.
    version: u64,
    /// P(z = 1 | all other z).
    conditional: Lane,
    /// Π over the lanes up to this one of (1 − f).
    stays: Lane,
}

/// Runs one chain.
pub(super) fn run(
    standard: &Standard,
    prior: &Prior,
    seed: u64,
    chain: usize,
    length: Length,
) -> Trace {
    pulp::Arch::new().dispatch(Run {
        standard,
        prior,
        seed,
        chain,
        length,
    })
}

struct Run<'a> {
    standard: &'a Standard,
    prior: &'a Prior,
    seed: u64,
    chain: usize,
    length: Length,
}

impl WithSimd for Run<'_> {
    type Output = Trace;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Trace {
        self.run(simd)
    }
}

impl Run<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Trace {
        let Self {
            standard,
            prior,
            seed,
            chain,
            length,
        } = self;
        let size = standard.size();
        let mut state = Chain::new(standard, prior, Source::new(seed, chain as u64));
        state.start(simd, chain);
        let mut trace = Trace {
            conditional: vec![0.0; size * length.draws],
            beta: vec![0.0; size * length.draws],
            shift: vec![0.0; size],
            moment: vec![0.0; size],
            inclusion: vec![0.0; size],
            misfit: 0.0,
            visits: BTreeMap::new(),
            moves: 0,
        };
        for _ in 0..length.warm_up * length.scans_per_draw {
            state.scan(simd);
        }
        state.moves = 0;
        for draw in 0..length.draws {
            state.sums.fill(0.0);
            for _ in 0..length.scans_per_draw {
                state.scan(simd);
            }
            state.record(&mut trace, draw, length);
        }
        trace.moves = state.moves;
        trace
    }
}

/// A chain at work.
struct Chain<'a> {
    standard: &'a Standard,
    prior: &'a Prior,
    tableau: Tableau<'a>,
    swaps: Swaps,
    source: Source,
    /// Family of each position, its size, and its members in the present model.
    family: Vec<usize>,
    sizes: Vec<usize>,
    members: Vec<usize>,
    /// Prior ratio of flipping each position, times √(v_j) or √(1/v_j).
    odds: Vec<f64>,
    chunks: Vec<Chunk>,
    version: u64,
    /// Uniform number that the running product has not reached yet, and that product.
    target: f64,
    product: f64,
    /// Σ over scans of P(z = 1 | all other z).
    sums: Vec<f64>,
    moves: u64,
}

impl<'a> Chain<'a> {
    fn new(standard: &'a Standard, prior: &'a Prior, mut source: Source) -> Self {
        let tableau = Tableau::new(standard);
        let width = tableau.width;
        let target = source.uniform();
        let mut chain = Self {
            standard,
            prior,
            swaps: Swaps::new(standard),
            source,
            family: standard.order.iter().map(|&k| prior.family_of(k)).collect(),
            sizes: prior.family_sizes(),
            members: vec![0; prior.families()],
            odds: vec![0.0; width],
            chunks: vec![
                Chunk {
                    version: 0,
                    conditional: [0.0; LANES],
                    stays: [1.0; LANES]
                };
                width / LANES
            ],
            version: 1,
            target,
            product: 1.0,
            sums: vec![0.0; width],
            moves: 0,
            tableau,
        };
        (0..chain.members.len()).for_each(|family| chain.update_odds(family));
        chain
    }

    /// Over-dispersed starts: empty, nearly full, half, a few.
    #[inline(always)]
    fn start<S: Simd>(&mut self, simd: S, chain: usize) {
        let size = self.standard.size();
        // More than 100 members at the start would only cost time: they leave within a scan.
        let share = [0.0, 0.9, 0.5, 0.1][chain % 4] * (100.0 / size as f64).min(1.0);
        for j in 0..size {
            if self.source.uniform() < share {
                self.flip(simd, j);
            }
        }
    }

    /// `P(z_j flips)/P(z_j stays)` a priori, with the slab's part of the determinant.
    fn update_odds(&mut self, family: usize) {
        for j in (0..self.family.len()).filter(|&j| self.family[j] == family) {
            let root = self.standard.precision[j].sqrt();
            self.odds[j] = if self.tableau.includes(j) {
                1.0 / (self.prior_odds(family, self.members[family] - 1) * root)
            } else {
                self.prior_odds(family, self.members[family]) * root
            };
        }
    }

    /// Prior odds of one more member of a family that has `others` beside it.
    fn prior_odds(&self, family: usize, others: usize) -> f64 {
        let (inside, outside) = self.prior.next(family, others, self.sizes[family] - 1);
        inside / outside
    }

    #[inline(always)]
    fn flip<S: Simd>(&mut self, simd: S, j: usize) {
        self.tableau.flip(simd, j);
        let family = self.family[j];
        if self.tableau.includes(j) {
            self.members[family] += 1;
        } else {
            self.members[family] -= 1;
        }
        self.update_odds(family);
        self.version += 1;
        self.moves += 1;
    }

    /// All positions once, in order, then the swaps.
    #[inline(always)]
    fn scan<S: Simd>(&mut self, simd: S) {
        for index in 0..self.chunks.len() {
            let mut from = 0;
            while from < LANES {
                if self.chunks[index].version != self.version {
                    self.evaluate(simd, index);
                }
                let chunk = self.chunks[index];
                let before = if from == 0 {
                    1.0
                } else {
                    chunk.stays[from - 1]
                };
                let sums = &mut self.sums[index * LANES..(index + 1) * LANES];
                // No flip up to lane l with probability stays_l / before; f ≤ 0.95 keeps `before` positive.
                let whole = self.product * (chunk.stays[LANES - 1] / before);
                if self.target < whole {
                    for lane in 0..LANES {
                        sums[lane] += if lane >= from {
                            chunk.conditional[lane]
                        } else {
                            0.0
                        };
                    }
                    self.product = whole;
                    break;
                }
                let mut lane = from;
                while lane < LANES - 1 && self.target < self.product * (chunk.stays[lane] / before)
                {
                    lane += 1;
                }
                for l in from..=lane {
                    sums[l] += chunk.conditional[l];
                }
                self.flip(simd, index * LANES + lane);
                self.renew();
                from = lane + 1;
            }
        }
        self.swap(simd);
    }

    /// A new uniform number for the next flip.
    fn renew(&mut self) {
        self.target = self.source.uniform();
        self.product = 1.0;
    }

    /// The scan's proposals to exchange an included column for one that resembles it. Whether and when the next one is
    /// accepted is again one uniform number; which one, another.
    #[inline(always)]
    fn swap<S: Simd>(&mut self, simd: S) {
        let mut left = self.swaps.proposals_per_scan();
        while left > 0 {
            if self.swaps.version != self.version {
                self.swaps.evaluate(
                    simd,
                    &self.tableau,
                    self.standard,
                    &self.odds,
                    &self.family,
                    self.version,
                );
            }
            let stay = 1.0 - LAZY * self.swaps.accepted;
            let all = self.product * stay.powi(left);
            if self.target < all {
                self.product = all;
                return;
            }
            let proposal = ((self.target / self.product).ln() / stay.ln())
                .ceil()
                .clamp(1.0, f64::from(left));
            left -= proposal as i32;
            let (i, j) = self.swaps.pick(self.source.uniform());
            self.flip(simd, i);
            self.flip(simd, j);
            self.moves -= 1;
            self.renew();
        }
    }

    /// Ratios of eight flips.
    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, index: usize) {
        let range = index * LANES..(index + 1) * LANES;
        let tableau = &self.tableau;
        let (diagonal, gradient) = (
            &tableau.diagonal[range.clone()],
            &tableau.gradient[range.clone()],
        );
        let (sign, odds) = (&tableau.sign[range.clone()], &self.odds[range]);
        let misfit = 1.0 + tableau.excess;
        let (mut change, mut ratio) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let d = if diagonal[lane] > f64::MIN_POSITIVE {
                diagonal[lane]
            } else {
                f64::MIN_POSITIVE
            };
            let flipped = (misfit + sign[lane] * gradient[lane] * gradient[lane] / d) / misfit;
            change[lane] = if flipped > f64::MIN_POSITIVE {
                flipped
            } else {
                f64::MIN_POSITIVE
            };
            ratio[lane] = odds[lane] / d.sqrt();
        }
        let power = to_the(simd, change, -self.standard.shape);
        let chunk = &mut self.chunks[index];
        let mut product = 1.0;
        let mut stay = [0.0; LANES];
        for lane in 0..LANES {
            let r = ratio[lane] * power[lane];
            let r = if r < RATIO_MAX { r } else { RATIO_MAX };
            chunk.conditional[lane] = if sign[lane] > 0.0 { 1.0 } else { r } / (1.0 + r);
            stay[lane] = 1.0 - LAZY * if r < 1.0 { r } else { 1.0 };
        }
        for lane in 0..LANES {
            product *= stay[lane];
            chunk.stays[lane] = product;
        }
        chunk.version = self.version;
    }

    /// φ | z, then β | z, φ; sums that need no draw use the conditional expectations.
    fn record(&mut self, trace: &mut Trace, draw: usize, length: Length) {
        let size = self.standard.size();
        let misfit = 1.0 + self.tableau.excess;
        let factor = self.standard.noise_factor();
        let phi = if factor.is_finite() {
            misfit * factor
        } else {
            0.0
        };
        for k in 0..size {
            let conditional = self.sums[k] / length.scans_per_draw as f64;
            trace.conditional[k * length.draws + draw] = conditional as f32;
            trace.inclusion[k] += conditional;
            let center = self.standard.center[k];
            let (delta, variance) = if self.tableau.includes(k) {
                (
                    self.tableau.gradient[k] - center,
                    phi * self.tableau.diagonal[k],
                )
            } else {
                (-center, 0.0)
            };
            trace.shift[k] += delta;
            trace.moment[k] += delta * delta + variance;
        }
        trace.misfit += misfit;

        // φ | z ~ InvGamma(a_n, (1 + c)/2), β | z, φ ~ N(β_z, φ A_zz⁻¹)
        let members = &self.tableau.members;
        let count = members.len();
        let sampled = 0.5 * misfit / self.source.gamma(self.standard.shape);
        let covariance: Vec<f64> = members
            .iter()
            .flat_map(|&i| members.iter().map(move |&j| (i, j)))
            .map(|(i, j)| self.tableau.row(i)[j])
            .collect();
        let noise: Vec<f64> = (0..count).map(|_| self.source.normal()).collect();
        if let Ok(factor) = Cholesky::new(&covariance, count) {
            for (a, &k) in members.iter().enumerate() {
                let row = &factor.lower()[a * count..a * count + a + 1];
                let step: f64 = row.iter().zip(&noise).map(|(l, e)| l * e).sum();
                trace.beta[k * length.draws + draw] =
                    (self.tableau.gradient[k] + sampled.sqrt() * step) as f32;
            }
        }
        let mut set = vec![0u64; size.div_ceil(64)];
        members.iter().for_each(|&k| set[k / 64] |= 1 << (k % 64));
        *trace.visits.entry(set).or_default() += 1;
    }
}

/// x^power of eight positive numbers.
#[inline(always)]
pub(super) fn to_the<S: Simd>(simd: S, mut x: Lane, power: f64) -> Lane {
    for vector in S::as_mut_simd_f64s(&mut x).0 {
        *vector = exp(
            simd,
            simd.mul_f64s(simd.splat_f64s(power), ln(simd, *vector)),
        );
    }
    x
}
