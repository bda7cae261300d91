//! The problem in its natural units: unit-diagonal matrix, torque in units of the full model's misfit, origin at the
//! full model's coefficients. Nothing after this depends on the units of columns or torque.
//!
//! With `δ = β − β̂` (β̂ the full model's posterior mean, excluded columns have `δ_k = −β̂_k`)
//!
//! ```text
//! b_z = b0 + RSS_z/2 = b̂ (1 + c_z),    c_z = min over δ_z of 2 hᵀδ + δᵀA δ,    h = A β̂ − r ≈ 0,    c_z ≥ 0
//! ```
//!
//! so that neither `yy − rᵀA⁻¹r` nor `E[β²] − E[β]²` is ever a difference of large numbers.

use super::check::check;
use crate::error::{Error, Result};
use crate::linear_algebra::{Cholesky, NotPositiveDefinite, dot};
use crate::posterior::{Model, Problem};
use crate::prior::{HalfSpace, Prior};
use statrs::function::erf::erfc;
use statrs::function::gamma::ln_gamma;
use std::ops::Range;

/// One component: its columns lie together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Block {
    /// Its own number.
    pub(super) component: usize,
    pub(super) family: usize,
    /// First position.
    pub(super) start: usize,
    /// Columns.
    pub(super) len: usize,
    /// Factor on the weight of every model that holds it: 1 over the slab's mass within the bounds.
    pub(super) factor: f64,
}

impl Block {
    /// Positions.
    pub(super) fn range(&self) -> Range<usize> {
        self.start..self.start + self.len
    }
}

/// A [`Problem`] in natural units. Position d stands for column `order[d]`; the columns of a component lie together.
#[derive(Debug, Clone)]
pub(super) struct Standard {
    /// Column of each position.
    pub(super) order: Vec<usize>,
    /// Its name.
    pub(super) names: Vec<String>,
    /// Component of each column.
    pub(super) component: Vec<usize>,
    /// Components in the order of their positions.
    pub(super) blocks: Vec<Block>,
    /// Components of each family that are in every model without a position here, see [`super::reduced::Reduced`].
    pub(super) held: Vec<usize>,
    /// Their `Σ ln factor − ½ ln |A| Π v`.
    pub(super) log_held: f64,
    /// `√(G_kk + 1/v_k)` of each position: `β = β_natural · unit / scale`.
    pub(super) scale: Vec<f64>,
    /// `√(2 b̂)`, N·m.
    pub(super) unit: f64,
    /// `A`, unit diagonal, K × K.
    pub(super) matrix: Vec<f64>,
    /// `β̂`.
    pub(super) center: Vec<f64>,
    /// `h = A β̂ − r`: rounding only.
    pub(super) offset: Vec<f64>,
    /// `1/v_k`, the smallest value that a pivot can have.
    pub(super) precision: Vec<f64>,
    /// Bounds, −∞ where free.
    pub(super) lower: Vec<f64>,
    /// Bounds on sums, columns being positions and factors those of natural units; `lower` in its own.
    pub(super) halves: Vec<HalfSpace>,
    /// Some coefficient or sum has a bound.
    pub(super) bounded: bool,
    /// `a_n = a0 + n/2`.
    pub(super) shape: f64,
    /// `b̂ = b0 + RSS/2` of the full model, (N·m)².
    pub(super) full_scale: f64,
    /// All of ln p(y, z) that does not depend on z, the power of b̂ included.
    pub(super) log_constant: f64,
}

impl Standard {
    /// Components of several columns first, each kind in the order of families.
    ///
    /// # Errors
    /// [`Error::NotFinite`] naming the column, [`Error::Setting`] for an impossible prior.
    pub(super) fn new(problem: &Problem) -> Result<Self> {
        let mut components: Vec<usize> = (0..problem.prior.components()).collect();
        let wide = problem.prior.columns();
        components.sort_by_key(|&c| (wide.get(c).map_or(0, Vec::len) < 2, problem.prior.family[c]));
        Self::in_order(problem, &components)
    }

    /// The same with the components in a given order.
    ///
    /// # Errors
    /// As [`Standard::new`].
    pub(super) fn in_order(problem: &Problem, components: &[usize]) -> Result<Self> {
        check(problem)?;
        let (size, prior) = (problem.xy.len(), &problem.prior);
        let columns = prior.columns();
        let order: Vec<usize> = components
            .iter()
            .flat_map(|&c| columns[c].iter().copied())
            .collect();
        let Scaled {
            scale,
            matrix,
            precision,
            xy,
        } = Scaled::new(problem, &order);
        let names: Vec<String> = order.iter().map(|&k| problem.names[k].clone()).collect();
        let center = full_model(&matrix, &xy, &names)?;
        let product = multiply(&matrix, &center);
        let offset: Vec<f64> = product
            .iter()
            .zip(&xy)
            .map(|(product, xy)| product - xy)
            .collect();
        // yy − 2 rᵀβ̂ + β̂ᵀAβ̂ = yy + Σ (h − r) β̂
        let misfit = problem.yy
            + (0..size)
                .map(|k| (offset[k] - xy[k]) * center[k])
                .sum::<f64>();
        let noise = Noise::new(problem, misfit);
        let unit = (2.0 * noise.full_scale).sqrt();
        let lower: Vec<f64> = order
            .iter()
            .zip(&scale)
            .map(|(&k, scale)| prior.lower[k] * scale / unit)
            .collect();
        let halves = halves_in(&prior.halves, &order, |d| unit / scale[d]);
        let mass = |d: usize| slab_mass(lower[d], precision[d], 2.0 * noise.shape);
        Ok(Self {
            order,
            names,
            component: prior.component.clone(),
            blocks: blocks_of(prior, components, mass),
            held: vec![0; prior.families()],
            log_held: 0.0,
            bounded: lower.iter().any(|&l| l > f64::NEG_INFINITY) || !halves.is_empty(),
            lower,
            halves,
            scale,
            unit,
            matrix,
            center: center.iter().map(|x| x / unit).collect(),
            offset: offset.iter().map(|x| x / unit).collect(),
            precision,
            shape: noise.shape,
            full_scale: noise.full_scale,
            log_constant: noise.log_constant,
        })
    }

    /// K.
    pub(super) fn size(&self) -> usize {
        self.order.len()
    }

    /// Place in `blocks` of each position.
    pub(super) fn block_of(&self) -> Vec<usize> {
        self.blocks
            .iter()
            .enumerate()
            .flat_map(|(b, block)| std::iter::repeat_n(b, block.len))
            .collect()
    }

    /// (columns ascending, positions) of a set of components, bit b of word b/64 the component at place b in `blocks`.
    pub(super) fn members(&self, set: &[u64]) -> (Vec<u32>, Vec<usize>) {
        let positions: Vec<usize> = self
            .blocks
            .iter()
            .enumerate()
            .filter(|(b, _)| set[b / 64] >> (b % 64) & 1 == 1)
            .flat_map(|(_, block)| block.range())
            .collect();
        let mut members: Vec<u32> = positions.iter().map(|&d| self.order[d] as u32).collect();
        members.sort_unstable();
        (members, positions)
    }

    /// `E[φ | z, y]` per `(1 + c_z)` in natural units; infinite where the data leave φ without a mean.
    pub(super) fn noise_factor(&self) -> f64 {
        if self.shape > 1.0 {
            0.5 / (self.shape - 1.0)
        } else {
            f64::INFINITY
        }
    }

    /// `ln Σ_z p(y, z)` from `ln Σ_z p(z) Π (v_k p_k)^−½ (1 + c_z)^−a_n`.
    pub(super) fn log_evidence(&self, log_sum: f64) -> f64 {
        self.log_constant + log_sum
    }

    /// `1 + c` of a model from its b_z.
    pub(super) fn misfit(&self, scale: f64) -> f64 {
        (scale / self.full_scale).max(1.0)
    }

    /// b_z of a model from its `1 + c`.
    pub(super) fn scale_of(&self, misfit: f64) -> f64 {
        self.full_scale * misfit
    }

    /// Natural units per unit of the coefficient.
    pub(super) fn natural(&self, d: usize) -> f64 {
        self.scale[d] / self.unit
    }

    /// Natural units of `(A⁻¹)_dd` per unit of the columns'.
    pub(super) fn precision_unit(&self, d: usize) -> f64 {
        self.scale[d] * self.scale[d]
    }

    /// What to say when a model has no factor because of the column at a position.
    pub(super) fn singular(&self, d: usize) -> Error {
        Error::NotFinite {
            what: "Cholesky factor of a model".into(),
            column: self.names[d].clone(),
            remedy: "remove one of the columns that are equal on these data".into(),
        }
    }

    /// Variance φ in (N·m)² from natural units.
    pub(super) fn noise(&self, natural: f64) -> f64 {
        natural * self.unit * self.unit
    }

    /// Values per position back in the columns' order and units.
    pub(super) fn coefficients(&self, natural: impl Fn(usize) -> f64) -> Vec<f64> {
        self.in_columns(|d| natural(d) * self.unit / self.scale[d])
    }

    /// Unit-free values per position back in the columns' order.
    pub(super) fn in_columns(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut out = vec![0.0; self.size()];
        for (d, &k) in self.order.iter().enumerate() {
            out[k] = value(d);
        }
        out
    }

    /// One model refactored on its own: mean, factor and scale in the columns' units. `members` are positions.
    pub(super) fn model(&self, members: &[usize], weight: f64) -> Result<Model> {
        let mut members = members.to_vec();
        members.sort_unstable_by_key(|&d| self.order[d]);
        let (size, count) = (self.size(), members.len());
        let mut block = Vec::with_capacity(count * count);
        for &i in &members {
            let row = &self.matrix[i * size..(i + 1) * size];
            block.extend(members.iter().map(|&j| row[j]));
        }
        let factor = nudged(&block, count).map_err(|error| self.singular(members[error.pivot]))?;
        // min over δ_z of 2hᵀδ + δᵀAδ with δ = −β̂ outside z: A_zz δ_z = A_ze β̂_e − h_z.
        let mut delta: Vec<f64> = self.center.iter().map(|x| -x).collect();
        members.iter().for_each(|&d| delta[d] = 0.0);
        let outside = multiply(&self.matrix, &delta);
        let mut inside: Vec<f64> = members
            .iter()
            .map(|&d| -outside[d] - self.offset[d])
            .collect();
        factor.solve(&mut inside);
        members
            .iter()
            .zip(&inside)
            .for_each(|(&d, x)| delta[d] = *x);
        let product = multiply(&self.matrix, &delta);
        let excess: f64 = (0..size)
            .map(|d| delta[d] * (product[d] + 2.0 * self.offset[d]))
            .sum();
        let mut lower = factor.into_lower();
        for i in 0..count {
            for j in 0..=i {
                lower[i * count + j] *= self.scale[members[i]];
            }
        }
        Ok(Model {
            members: members.iter().map(|&d| self.order[d] as u32).collect(),
            weight,
            scale: self.full_scale * (1.0 + excess.max(0.0)),
            mean: members
                .iter()
                .zip(&inside)
                .map(|(&d, delta)| (self.center[d] + delta) * self.unit / self.scale[d])
                .collect(),
            factor: lower,
            sites: Vec::new(),
        })
    }
}

/// Columns in a given order, scaled to a unit diagonal of `G + V⁻¹`.
struct Scaled {
    /// `√(G_kk + 1/v_k)`.
    scale: Vec<f64>,
    /// `A`.
    matrix: Vec<f64>,
    /// `1/v_k` in these units.
    precision: Vec<f64>,
    /// `r` in these units.
    xy: Vec<f64>,
}

impl Scaled {
    fn new(problem: &Problem, order: &[usize]) -> Self {
        let size = order.len();
        // A column that is zero everywhere has no unit of its own: any will do.
        let slab = |k: usize| {
            if problem.gram[k * size + k] == 0.0 {
                1.0
            } else {
                problem.prior.slab[k]
            }
        };
        let scale: Vec<f64> = order
            .iter()
            .map(|&k| (problem.gram[k * size + k] + 1.0 / slab(k)).sqrt())
            .collect();
        let mut matrix = vec![0.0; size * size];
        for (i, &ki) in order.iter().enumerate() {
            matrix[i * size + i] = 1.0;
            for (j, &kj) in order.iter().enumerate().take(i) {
                let value = problem.gram[ki * size + kj] / (scale[i] * scale[j]);
                matrix[i * size + j] = value;
                matrix[j * size + i] = value;
            }
        }
        let precision = order
            .iter()
            .zip(&scale)
            .map(|(&k, scale)| 1.0 / slab(k) / (scale * scale))
            .collect();
        let xy = order
            .iter()
            .zip(&scale)
            .map(|(&k, scale)| problem.xy[k] / scale)
            .collect();
        Self {
            scale,
            matrix,
            precision,
            xy,
        }
    }
}

/// What models share of the noise's posterior, see [`Standard`].
struct Noise {
    shape: f64,
    full_scale: f64,
    log_constant: f64,
}

impl Noise {
    /// `misfit`: that of the full model, (N·m)².
    fn new(problem: &Problem, misfit: f64) -> Self {
        let prior = &problem.prior;
        // A perfect model without prior scale has no unit; the smallest one keeps every formula finite.
        let b0 = if problem.yy > 0.0 {
            prior.scale
        } else {
            prior.scale.max(f64::MIN_POSITIVE)
        };
        let full_scale = b0 + 0.5 * misfit.max(0.0);
        let shape = prior.shape + 0.5 * problem.n;
        let log_constant = problem.log_constant
            - prior.log_admissible()
            - 0.5 * problem.n * (2.0 * std::f64::consts::PI).ln()
            + prior.shape * b0.ln()
            - ln_gamma(prior.shape)
            + ln_gamma(shape)
            - shape * full_scale.ln();
        Self {
            shape,
            full_scale,
            log_constant,
        }
    }
}

/// Blocks of the components in a given order; `mass`: that of a position's slab within its bound.
fn blocks_of(prior: &Prior, components: &[usize], mass: impl Fn(usize) -> f64) -> Vec<Block> {
    let columns = prior.columns();
    let mut start = 0;
    components
        .iter()
        .map(|&c| {
            let block = Block {
                component: c,
                family: prior.family[c],
                start,
                len: columns[c].len(),
                factor: 1.0,
            };
            start += block.len;
            let mass: f64 = block.range().map(&mass).product();
            Block {
                factor: 1.0 / mass,
                ..block
            }
        })
        .collect()
}

/// Bounds on sums with columns by position in `order`, and factors times `unit` there; those with a column that has no position are
/// left out.
pub(super) fn halves_in(
    halves: &[HalfSpace],
    order: &[usize],
    unit: impl Fn(usize) -> f64,
) -> Vec<HalfSpace> {
    let place = |k: usize| order.iter().position(|&own| own == k);
    let set = |own: &Vec<usize>| own.iter().map(|&k| place(k)).collect::<Option<Vec<_>>>();
    let moved = |half: &HalfSpace| {
        let term = |&(k, factor): &(usize, f64)| place(k).map(|d| (d, factor * unit(d)));
        Some(HalfSpace {
            terms: half.terms.iter().map(term).collect::<Option<_>>()?,
            with: half.with.iter().map(set).collect::<Option<_>>()?,
            replaces: half.replaces.and_then(place),
            ..half.clone()
        })
    };
    halves.iter().filter_map(moved).collect()
}

/// `P(x ≥ lower)` of the slab: `x ~ N(0, φ/precision)` with `1/φ = weight`.
pub(super) fn slab_mass(lower: f64, precision: f64, weight: f64) -> f64 {
    if lower == f64::NEG_INFINITY {
        return 1.0;
    }
    0.5 * erfc(lower * (0.5 * weight * precision).sqrt())
}

/// Shares that a diagonal grows by until there is a factor: far below what data can tell.
const NUDGES: [f64; 4] = [0.0, 1e-14, 1e-12, 1e-10];

/// Factor of a matrix that is positive definite but for rounding: columns that agree to the last digit have none, and
/// the least nudge of the diagonal that makes one is taken.
///
/// # Errors
/// [`NotPositiveDefinite`] with the last nudge.
pub(super) fn nudged(
    matrix: &[f64],
    size: usize,
) -> std::result::Result<Cholesky, NotPositiveDefinite> {
    let mut nudged = matrix.to_vec();
    let mut failed = NotPositiveDefinite { pivot: 0 };
    for nudge in NUDGES {
        (0..size).for_each(|k| nudged[k * size + k] = matrix[k * size + k] * (1.0 + nudge));
        match Cholesky::new(&nudged, size) {
            Ok(factor) => return Ok(factor),
            Err(error) => failed = error,
        }
    }
    Err(failed)
}

/// Posterior mean of the full model; `h` accounts for a nudge.
fn full_model(matrix: &[f64], xy: &[f64], names: &[String]) -> Result<Vec<f64>> {
    let factor = nudged(matrix, xy.len()).map_err(|error| Error::NotFinite {
        what: "Cholesky factor of the Gram matrix".into(),
        column: names[error.pivot].clone(),
        remedy: "the statistics are not those of any data: a Gram matrix is positive semidefinite"
            .into(),
    })?;
    let mut center = xy.to_vec();
    factor.solve(&mut center);
    // One step of refinement; with a nudge it also removes most of it.
    let mut rest: Vec<f64> = multiply(matrix, &center)
        .iter()
        .zip(xy)
        .map(|(p, xy)| xy - p)
        .collect();
    factor.solve(&mut rest);
    center
        .iter_mut()
        .zip(&rest)
        .for_each(|(x, step)| *x += step);
    Ok(center)
}

/// `A x`.
fn multiply(matrix: &[f64], x: &[f64]) -> Vec<f64> {
    if x.is_empty() {
        return Vec::new();
    }
    matrix
        .chunks_exact(x.len())
        .map(|row| dot(row, x))
        .collect()
}
