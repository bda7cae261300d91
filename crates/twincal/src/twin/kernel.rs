//! Eight rows of one joint at a time: moments and quantiles of their mixtures of Student-t.

use super::components::{Components, ROWS};
use crate::lanes::{LANES, Lane, fuses};
use crate::posterior::mixture::{Level, accuracy};
use crate::posterior::student::StudentT;

/// What does not change from row to row.
pub(super) struct Constants<'a> {
    pub(super) student: &'a StudentT,
    /// Standard quantiles at 2.5 and 97.5 %.
    pub(super) levels: [Level; 2],
    pub(super) joint: &'a Components,
    /// `f²/(w_j (1−ρ_j²))`, times φ the variance of the noise.
    pub(super) noise_factor: f64,
    /// Variance outside the filter's band, (N·m)²; 0 for filtered torque.
    pub(super) out_of_band: f64,
    /// E[φ | z, y]/(b_n/a_n) = a_n/(a_n − 1).
    pub(super) mean_over_rate: f64,
}

/// Scratch memory for one thread.
#[derive(Default)]
pub(super) struct Scratch {
    /// The columns of one geometry.
    own: Vec<Lane>,
    /// Location and q of each geometry.
    locations: Vec<Lane>,
    spreads: Vec<Lane>,
    /// Scale of each component and its inverse.
    scales: Vec<Lane>,
    inverses: Vec<Lane>,
}

/// One group of rows; results are relative to the nominal torque.
pub(super) struct Group<'a> {
    pub(super) constants: &'a Constants<'a>,
    pub(super) scratch: &'a mut Scratch,
    /// The joint's columns.
    pub(super) x: &'a [Lane],
    /// Measured minus nominal, where measured.
    pub(super) residual: Option<&'a Lane>,
    /// Relative noise variance.
    pub(super) spread: &'a Lane,
    /// Half width of the Coulomb band of rows that stand still; 0 elsewhere.
    pub(super) band: &'a Lane,
}

/// Results of one group, relative to the nominal torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bands {
    pub(super) low: Lane,
    pub(super) high: Lane,
    /// Variance of xᵀβ over models and coefficients.
    pub(super) epistemic: Lane,
    /// P(Y ≤ measured); NaN without measurement.
    pub(super) pit: Lane,
    /// Density at the same place, 1/(N·m); NaN without measurement.
    pub(super) density: Lane,
}

impl pulp::WithSimd for Group<'_> {
    type Output = Bands;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Bands {
        if fuses::<S>() {
            self.bands::<true>()
        } else {
            self.bands::<false>()
        }
    }
}

impl Group<'_> {
    #[inline(always)]
    fn bands<const FUSED: bool>(self) -> Bands {
        let Group {
            constants,
            scratch,
            x,
            residual,
            spread,
            band,
        } = self;
        locate::<FUSED>(constants, scratch, x, spread);
        let epistemic = epistemic(constants, scratch);
        let [mut low, mut high] = [
            quantile(constants, scratch, constants.levels[0]),
            quantile(constants, scratch, constants.levels[1]),
        ];
        for lane in 0..LANES {
            low[lane] -= band[lane];
            high[lane] += band[lane];
        }
        let (mut pit, mut density) = ([f64::NAN; LANES], [f64::NAN; LANES]);
        if let Some(residual) = residual {
            let mut at = *residual;
            if band.iter().any(|&half| half > 0.0) {
                // Stiction may hold the torque anywhere in ±band: the part it can explain is taken off first.
                let median = quantile(
                    constants,
                    scratch,
                    Level {
                        probability: 0.5,
                        standard: 0.0,
                    },
                );
                for lane in 0..LANES {
                    at[lane] -= (at[lane] - median[lane]).clamp(-band[lane], band[lane]);
                }
            }
            [pit, density, _] = evaluate(constants, scratch, &at);
        }
        Bands {
            low,
            high,
            epistemic,
            pit,
            density,
        }
    }
}

/// Location `xᵀμ` and `q = |R x|²` of each geometry, scale of each component.
#[inline(always)]
fn locate<const FUSED: bool>(
    constants: &Constants<'_>,
    scratch: &mut Scratch,
    x: &[Lane],
    noise: &Lane,
) {
    scratch.locations.clear();
    scratch.spreads.clear();
    scratch.scales.clear();
    scratch.inverses.clear();
    for geometry in &constants.joint.geometries {
        scratch.own.clear();
        (scratch.own).extend(geometry.places.iter().map(|&place| x[place as usize]));
        let (mut location, mut spread) = ([0.0; LANES], [0.0; LANES]);
        let mut root = &geometry.root[..];
        for first in (0..=scratch.own.len()).step_by(ROWS) {
            let own = &scratch.own[first.saturating_sub(1)..];
            let (block, rest) = root.split_at(own.len());
            root = rest;
            let products = multiply::<FUSED>(block, own);
            for (row, product) in products.iter().enumerate() {
                if first + row == 0 {
                    location = *product;
                    continue;
                }
                for lane in 0..LANES {
                    spread[lane] =
                        multiply_add::<FUSED>(product[lane], product[lane], spread[lane]);
                }
            }
        }
        scratch.locations.push(location);
        scratch.spreads.push(spread);
    }
    for component in &constants.joint.components {
        let spread = &scratch.spreads[component.geometry];
        let (mut scale, mut inverse) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let own = constants.noise_factor * noise[lane];
            let variance = component.rate * (own + spread[lane]) + constants.out_of_band;
            // A point stays finite.
            scale[lane] = variance.max(1e-300).sqrt();
            inverse[lane] = 1.0 / scale[lane];
        }
        scratch.scales.push(scale);
        scratch.inverses.push(inverse);
    }
}

/// `Σ_k r_k x_k` of several rows side by side, so that no sum waits for itself.
#[inline(always)]
fn multiply<const FUSED: bool>(rows: &[[f64; ROWS]], x: &[Lane]) -> [Lane; ROWS] {
    let mut sums = [[0.0; LANES]; ROWS];
    for (entries, x) in rows.iter().zip(x) {
        for (sum, &entry) in sums.iter_mut().zip(entries) {
            for lane in 0..LANES {
                sum[lane] = multiply_add::<FUSED>(entry, x[lane], sum[lane]);
            }
        }
    }
    sums
}

/// a b + c, fused where that is one instruction.
#[inline(always)]
fn multiply_add<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Var[xᵀβ | y] = E[φ q] + Var over components of xᵀμ.
#[inline(always)]
fn epistemic(constants: &Constants<'_>, scratch: &Scratch) -> Lane {
    let (mut within, mut mean, mut square) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let anchor = &scratch.locations[constants.joint.components[0].geometry];
    for component in &constants.joint.components {
        let (location, spread) = (
            &scratch.locations[component.geometry],
            &scratch.spreads[component.geometry],
        );
        let mean_noise = component.rate * constants.mean_over_rate;
        for lane in 0..LANES {
            let shift = location[lane] - anchor[lane];
            within[lane] += component.weight
                * if spread[lane] > 0.0 {
                    mean_noise * spread[lane]
                } else {
                    0.0
                };
            mean[lane] += component.weight * shift;
            square[lane] += component.weight * shift * shift;
        }
    }
    let mut variance = [0.0; LANES];
    for lane in 0..LANES {
        variance[lane] = within[lane] + (square[lane] - mean[lane] * mean[lane]).max(0.0);
    }
    variance
}

/// F, f and f' of the mixture at `y`.
#[inline(always)]
fn evaluate(constants: &Constants<'_>, scratch: &Scratch, y: &Lane) -> [Lane; 3] {
    let mut sums = [[0.0; LANES]; 3];
    for (component, inverse) in constants.joint.components.iter().zip(&scratch.inverses) {
        let location = &scratch.locations[component.geometry];
        let mut t = [0.0; LANES];
        for lane in 0..LANES {
            t[lane] = (y[lane] - location[lane]) * inverse[lane];
        }
        let [cdf, density, slope] = constants.student.lanes(&t);
        for lane in 0..LANES {
            let per_unit = component.weight * inverse[lane];
            sums[0][lane] += component.weight * cdf[lane];
            sums[1][lane] += per_unit * density[lane];
            sums[2][lane] += per_unit * inverse[lane] * slope[lane];
        }
    }
    sums
}

/// Quantile of the mixture in each lane: Halley's method between the components' own quantiles, as in
/// [`crate::posterior::mixture`].
#[inline(always)]
fn quantile(constants: &Constants<'_>, scratch: &Scratch, level: Level) -> Lane {
    let components = &constants.joint.components;
    let anchor = &scratch.locations[components[0].geometry];
    let Bracket {
        mut low,
        mut high,
        narrowest,
        widest,
        mean,
        square,
    } = Bracket::of(constants, scratch, level, anchor);
    if components.len() == 1 {
        return low;
    }
    let tail = level.probability.min(1.0 - level.probability);
    let (mut y, mut done) = ([0.0; LANES], [false; LANES]);
    for lane in 0..LANES {
        let spread = (square[lane] - mean[lane] * mean[lane]).max(0.0).sqrt();
        y[lane] = (anchor[lane] + mean[lane] + spread * level.standard)
            .max(low[lane])
            .min(high[lane]);
        done[lane] = low[lane] >= high[lane];
    }
    for _ in 0..200 {
        let [below, density, slope] = evaluate(constants, scratch, &y);
        for lane in 0..LANES {
            if done[lane] {
                continue;
            }
            let excess = below[lane] - level.probability;
            if excess > 0.0 {
                high[lane] = y[lane];
            } else {
                low[lane] = y[lane];
            }
            let newton = excess / density[lane];
            let bend = (0.5 * newton * slope[lane] / density[lane]).clamp(-0.5, 0.5);
            let halley = y[lane] - newton / (1.0 - bend);
            let inside = halley > low[lane] && halley < high[lane];
            let next = if inside {
                halley
            } else {
                0.5 * (low[lane] + high[lane])
            };
            let step = (next - y[lane]).abs();
            y[lane] = next;
            let accepted = tail * accuracy(narrowest[lane], widest[lane]);
            done[lane] =
                (inside && excess.abs() <= accepted) || step <= 4.0 * f64::EPSILON * next.abs();
        }
        if done.iter().all(|&done| done) {
            break;
        }
    }
    y
}

/// Where the quantile of a mixture lies, lane by lane.
struct Bracket {
    /// The components' own quantiles: the least and the largest.
    low: Lane,
    high: Lane,
    /// Scales of the components: the least and the largest.
    narrowest: Lane,
    widest: Lane,
    /// Moments of the mixture about the anchor.
    mean: Lane,
    square: Lane,
}

impl Bracket {
    #[inline(always)]
    fn of(constants: &Constants<'_>, scratch: &Scratch, level: Level, anchor: &Lane) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        let (mut narrowest, mut widest) = ([f64::INFINITY; LANES], [0.0_f64; LANES]);
        let (mut mean, mut square) = ([0.0; LANES], [0.0; LANES]);
        for (component, scale) in constants.joint.components.iter().zip(&scratch.scales) {
            let location = &scratch.locations[component.geometry];
            for lane in 0..LANES {
                let own = location[lane] + scale[lane] * level.standard;
                low[lane] = low[lane].min(own);
                high[lane] = high[lane].max(own);
                narrowest[lane] = narrowest[lane].min(scale[lane]);
                widest[lane] = widest[lane].max(scale[lane]);
                let shift = location[lane] - anchor[lane];
                mean[lane] += component.weight * shift;
                square[lane] += component.weight * (shift * shift + scale[lane] * scale[lane]);
            }
        }
        Self {
            low,
            high,
            narrowest,
            widest,
            mean,
            square,
        }
    }
}
