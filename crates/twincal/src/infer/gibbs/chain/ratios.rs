//! What every flip would do: acceptance ratios, eight at a time.

use super::Chain;
use crate::infer::gibbs::acceptance::LAZY;
use crate::infer::standard::Standard;
use crate::lanes::{LANES, Lane, exp, ln};
use pulp::Simd;

/// Ratios beyond this count as this.
const RATIO_MAX: f64 = 1e300;

/// Eight components whose conditionals are known.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chunk {
    /// Position of the first, where all eight are single columns one after the other.
    first: Option<usize>,
    /// Their family, where it is the same.
    family: Option<usize>,
    /// State of the chain that the rest belongs to.
    pub(super) version: u64,
    /// P(z = 1 | all other z).
    pub(super) conditional: Lane,
    /// Π over the lanes up to this one of (1 − f).
    pub(super) stays: Lane,
}

impl Chunk {
    pub(super) fn new(standard: &Standard, blocks: &[usize]) -> Self {
        let first = standard.blocks[blocks[0]].start;
        let next = |(lane, &block): (usize, &usize)| {
            let own = &standard.blocks[block];
            own.len == 1 && own.start == first + lane
        };
        let family = standard.blocks[blocks[0]].family;
        let same = |&block: &usize| standard.blocks[block].family == family;
        Self {
            first: blocks.iter().enumerate().all(next).then_some(first),
            family: blocks.iter().all(same).then_some(family),
            version: 0,
            conditional: [0.0; LANES],
            stays: [1.0; LANES],
        }
    }
}

/// What the ratios of eight flips are made of.
struct Flips {
    /// What the evidence is divided by, squared.
    d: Lane,
    /// What the misfit changes by, times `over`.
    square: Lane,
    over: Lane,
    /// +1 where a component is in, −1 where it is out.
    sign: Lane,
}

impl Chain<'_> {
    /// `P(z_j flips)/P(z_j stays)` a priori of the eight of a chunk, `sign` is +1 where they are in.
    #[inline(always)]
    fn chunk_odds(&self, index: usize, sign: &Lane) -> Lane {
        let own = index * LANES..(index + 1) * LANES;
        let mut odds = [0.0; LANES];
        if self.walker.has_kin() {
            odds.copy_from_slice(&self.odds[own]);
            return odds;
        }
        let (factors, families) = (&self.factors[own.clone()], &self.families[own]);
        let of = |[more, less]: [f64; 2], [factor, inverse]: [f64; 2], inside: bool| match inside {
            true => less * inverse,
            false => more * factor,
        };
        match self.chunks[index].family {
            Some(family) => {
                let all = self.family_odds[family];
                for lane in 0..LANES {
                    odds[lane] = of(all, factors[lane], sign[lane] > 0.0);
                }
            }
            None => {
                for lane in 0..LANES {
                    let own = self.family_odds[families[lane]];
                    odds[lane] = of(own, factors[lane], sign[lane] > 0.0);
                }
            }
        }
        odds
    }

    /// Ratios of eight flips.
    #[inline(always)]
    pub(super) fn evaluate<S: Simd>(&mut self, simd: S, index: usize) {
        let standard = self.walker.standard;
        let misfit = 1.0 + self.walker.tableau.excess;
        let Flips {
            d,
            square,
            over,
            sign,
        } = self.flips(index);
        let mut odds = self.chunk_odds(index, &sign);
        self.guide_odds(index, &mut odds);
        let chunk = &mut self.chunks[index];
        let mut stay = [0.0; LANES];
        let (odds, d) = (S::as_simd_f64s(&odds).0, S::as_simd_f64s(&d).0);
        let (square, over) = (S::as_simd_f64s(&square).0, S::as_simd_f64s(&over).0);
        let sign = S::as_simd_f64s(&sign).0;
        let conditional = S::as_mut_simd_f64s(&mut chunk.conditional).0;
        let stays = S::as_mut_simd_f64s(&mut stay).0;
        let (zero, one) = (simd.splat_f64s(0.0), simd.splat_f64s(1.0));
        let (least, most) = (
            simd.splat_f64s(f64::MIN_POSITIVE),
            simd.splat_f64s(RATIO_MAX),
        );
        let (misfit, power) = (simd.splat_f64s(misfit), simd.splat_f64s(-standard.shape));
        let lazy = simd.splat_f64s(-LAZY);
        for v in 0..odds.len() {
            let gain = simd.div_f64s(square[v], simd.mul_f64s(over[v], misfit));
            let change = simd.max_f64s(simd.mul_add_e_f64s(sign[v], gain, one), least);
            let weight = exp(simd, simd.mul_f64s(power, ln(simd, change)));
            let ratio = simd.div_f64s(odds[v], simd.sqrt_f64s(d[v]));
            let r = simd.min_f64s(simd.mul_f64s(ratio, weight), most);
            let inside = simd.select_f64s(simd.less_than_f64s(zero, sign[v]), one, r);
            conditional[v] = simd.div_f64s(inside, simd.add_f64s(one, r));
            stays[v] = simd.mul_add_e_f64s(lazy, simd.min_f64s(r, one), one);
        }
        chunk.stays = running_product(stay);
        chunk.version = self.version;
    }

    /// What the ratios of eight flips are made of.
    #[inline(always)]
    fn flips(&self, index: usize) -> Flips {
        let (tableau, standard) = (&self.walker.tableau, self.walker.standard);
        let (mut d, mut square, mut over) = ([1.0; LANES], [0.0; LANES], [1.0; LANES]);
        let mut sign = [-1.0; LANES];
        if let Some(first) = self.chunks[index].first {
            // All four are padded by a lane behind the last position (`Tableau`, `Chain::new`): eight can be read from any.
            macro_rules! eight {
                ($values:expr) => {{
                    let eight: Lane = *$values[first..].first_chunk().expect("padded");
                    eight
                }};
            }
            let (diagonal, gradient) = (eight!(tableau.diagonal), eight!(tableau.gradient));
            let (precision, slab) = (eight!(self.precision), eight!(self.slab));
            sign = eight!(tableau.sign);
            for lane in 0..LANES {
                let inside = sign[lane] > 0.0;
                let (least, unit) = if inside {
                    (1.0, precision[lane])
                } else {
                    (precision[lane], slab[lane])
                };
                over[lane] = if diagonal[lane] > least {
                    diagonal[lane]
                } else {
                    least
                };
                d[lane] = over[lane] * unit;
                square[lane] = gradient[lane] * gradient[lane];
            }
        } else {
            let blocks = self.active[index * LANES..].iter().take(LANES);
            for (lane, &block) in blocks.enumerate() {
                (d[lane], square[lane]) = tableau.block(block);
                sign[lane] = tableau.sign[standard.blocks[block].start];
            }
        }
        Flips {
            d,
            square,
            over,
            sign,
        }
    }
}

/// Π of the lanes up to each, in three steps instead of seven.
#[inline(always)]
fn running_product(mut x: Lane) -> Lane {
    for step in [1, 2, 4] {
        let before = x;
        for lane in step..LANES {
            x[lane] = before[lane] * before[lane - step];
        }
    }
    x
}
