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

use crate::error::{Error, Result};
use crate::linear_algebra::Cholesky;
use crate::posterior::{Model, Problem};
use crate::prior::Inclusion;
use statrs::function::gamma::ln_gamma;

/// A [`Problem`] in natural units. Position d stands for column `order[d]`; families lie together.
#[derive(Debug, Clone)]
pub(super) struct Standard {
    /// Column of each position.
    pub(super) order: Vec<usize>,
    /// Component of each column.
    pub(super) component: Vec<usize>,
    /// `√(G_kk + 1/v_k)` of each position: `β = β_natural · unit / scale`.
    scale: Vec<f64>,
    /// `√(2 b̂)`, N·m.
    unit: f64,
    /// `A`, unit diagonal, K × K.
    pub(super) matrix: Vec<f64>,
    /// `β̂`.
    pub(super) center: Vec<f64>,
    /// `h = A β̂ − r`: rounding only.
    pub(super) offset: Vec<f64>,
    /// `1/v_k`, the smallest value that a pivot can have.
    pub(super) precision: Vec<f64>,
    /// `a_n = a0 + n/2`.
    pub(super) shape: f64,
    /// `b̂ = b0 + RSS/2` of the full model, (N·m)².
    full_scale: f64,
    /// All of ln p(y, z) that does not depend on z, the power of b̂ included.
    log_constant: f64,
}

impl Standard {
    /// Columns in the order of their families.
    ///
    /// # Errors
    /// [`Error::NotFinite`] naming the column, [`Error::Setting`] for an impossible prior.
    pub(super) fn new(problem: &Problem) -> Result<Self> {
        let mut order: Vec<usize> = (0..problem.xy.len()).collect();
        order.sort_by_key(|&k| (problem.prior.family_of(k), problem.prior.component[k]));
        Self::in_order(problem, order)
    }

    /// The same with the columns in a given order; families lie together in it.
    ///
    /// # Errors
    /// As [`Standard::new`].
    pub(super) fn in_order(problem: &Problem, order: Vec<usize>) -> Result<Self> {
        check(problem)?;
        let (size, prior) = (problem.xy.len(), &problem.prior);
        // A column that is zero everywhere has no unit of its own: any will do.
        let slab = |k: usize| {
            if problem.gram[k * size + k] == 0.0 {
                1.0
            } else {
                prior.slab[k]
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
        let precision: Vec<f64> = order
            .iter()
            .zip(&scale)
            .map(|(&k, scale)| 1.0 / slab(k) / (scale * scale))
            .collect();
        let xy: Vec<f64> = order
            .iter()
            .zip(&scale)
            .map(|(&k, scale)| problem.xy[k] / scale)
            .collect();
        let center = full_model(&matrix, &xy, problem)?;
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
        // A perfect model without prior scale has no unit; the smallest one keeps every formula finite.
        let b0 = if problem.yy > 0.0 {
            prior.scale
        } else {
            prior.scale.max(f64::MIN_POSITIVE)
        };
        let full_scale = b0 + 0.5 * misfit.max(0.0);
        let unit = (2.0 * full_scale).sqrt();
        let shape = prior.shape + 0.5 * problem.n;
        let log_constant = problem.log_constant
            - 0.5 * problem.n * (2.0 * std::f64::consts::PI).ln()
            + prior.shape * b0.ln()
            - ln_gamma(prior.shape)
            + ln_gamma(shape)
            - shape * full_scale.ln();
        Ok(Self {
            order,
            component: prior.component.clone(),
            scale,
            unit,
            matrix,
            center: center.iter().map(|x| x / unit).collect(),
            offset: offset.iter().map(|x| x / unit).collect(),
            precision,
            shape,
            full_scale,
            log_constant,
        })
    }

    /// K.
    pub(super) fn size(&self) -> usize {
        self.order.len()
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
        let block: Vec<f64> = members
            .iter()
            .flat_map(|&i| members.iter().map(move |&j| self.matrix[i * size + j]))
            .collect();
        let factor = Cholesky::new(&block, count).map_err(|error| Error::NotFinite {
            what: "Cholesky factor of a model".into(),
            column: format!("{}", self.order[members[error.pivot]]),
            remedy: "remove one of the columns that are equal on these data".into(),
        })?;
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

/// Posterior mean of the full model. Columns that agree to the last digit have no factor; a nudge of the diagonal far
/// below what the data can tell makes one, and `h` accounts for it.
fn full_model(matrix: &[f64], xy: &[f64], problem: &Problem) -> Result<Vec<f64>> {
    let size = xy.len();
    let mut nudged = matrix.to_vec();
    for nudge in [0.0, 1e-14, 1e-12, 1e-10] {
        for k in 0..size {
            nudged[k * size + k] = 1.0 + nudge;
        }
        if let Ok(factor) = Cholesky::new(&nudged, size) {
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
            return Ok(center);
        }
    }
    Err(Error::NotFinite {
        what: "Cholesky factor of the Gram matrix".into(),
        column: problem.names.first().cloned().unwrap_or_default(),
        remedy: "the statistics are not those of any data: a Gram matrix is positive semidefinite"
            .into(),
    })
}

/// `A x`.
fn multiply(matrix: &[f64], x: &[f64]) -> Vec<f64> {
    if x.is_empty() {
        return Vec::new();
    }
    matrix
        .chunks_exact(x.len())
        .map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum())
        .collect()
}

fn check(problem: &Problem) -> Result<()> {
    let (size, prior) = (problem.xy.len(), &problem.prior);
    let fits = problem.gram.len() == size * size
        && problem.names.len() == size
        && prior.slab.len() == size
        && prior.component.len() == size
        && prior.lower.len() == size;
    if !fits {
        return Err(Error::Setting {
            key: "problem".into(),
            problem: format!(
                "{size} right-hand sides, {} matrix entries, {} names, {} slabs, {} components, {} bounds",
                problem.gram.len(),
                problem.names.len(),
                prior.slab.len(),
                prior.component.len(),
                prior.lower.len()
            ),
            remedy: "all must belong to the same K columns".into(),
        });
    }
    let components = prior.components();
    let mut occurs = vec![false; components];
    let inside = prior
        .component
        .iter()
        .all(|&c| occurs.get_mut(c).map(|o| *o = true).is_some());
    if !inside || occurs.contains(&false) || prior.family.iter().any(|&f| f >= prior.families()) {
        return Err(Error::Setting {
            key: "problem".into(),
            problem: format!(
                "{components} components of {} families do not match the columns",
                prior.families()
            ),
            remedy: "every column needs a component, every component a column and a family".into(),
        });
    }
    if let Some(k) = (0..size).find(|&k| !(prior.lower[k] <= 0.0)) {
        return Err(Error::Setting {
            key: "prior.lower".into(),
            problem: format!(
                "`{}` must be at least {}, which forbids 0",
                problem.names[k], prior.lower[k]
            ),
            remedy: "give a bound that is not above 0: being out means exactly 0".into(),
        });
    }
    let not_finite = |what: &str, column: &str| Error::NotFinite {
        what: what.into(),
        column: column.into(),
        remedy: "look for samples that are not numbers, or columns that grow beyond 1e150".into(),
    };
    for k in 0..size {
        let diagonal = problem.gram[k * size + k];
        if diagonal < 0.0
            || problem.gram[k * size..(k + 1) * size]
                .iter()
                .any(|x| !x.is_finite())
        {
            return Err(not_finite("the Gram matrix", &problem.names[k]));
        }
        if !problem.xy[k].is_finite() {
            return Err(not_finite(
                "the product with the residual torque",
                &problem.names[k],
            ));
        }
        let slab = prior.slab[k];
        if diagonal > 0.0 && !(slab > 0.0 && slab.is_finite()) {
            return Err(not_finite("the slab variance", &problem.names[k]));
        }
    }
    if !(problem.yy >= 0.0 && problem.yy.is_finite() && problem.n >= 0.0 && problem.n.is_finite()) {
        return Err(not_finite(
            "the sum of squares or the number of rows",
            "torque",
        ));
    }
    if !problem.log_constant.is_finite() {
        return Err(not_finite(
            "the log-determinant of the noise weights",
            "torque",
        ));
    }
    let setting = |key: &str, problem: String, remedy: &str| Error::Setting {
        key: key.into(),
        problem,
        remedy: remedy.into(),
    };
    if !(prior.shape > 0.0 && prior.shape.is_finite()) {
        return Err(setting(
            "prior.noise.shape",
            format!("{} is not positive", prior.shape),
            "use 0.001 or more",
        ));
    }
    if !(prior.scale >= 0.0 && prior.scale.is_finite()) || (prior.scale == 0.0 && problem.yy > 0.0)
    {
        return Err(setting(
            "prior.noise.scale",
            format!("{} is not positive", prior.scale),
            "use 0.001 or more",
        ));
    }
    if let Some(r) = prior.odds.iter().find(|r| !(**r > 0.0 && r.is_finite())) {
        return Err(setting(
            "prior.odds",
            format!("{r} is not positive"),
            "use 1, or e.g. 0.1 for a family that should need more evidence",
        ));
    }
    match prior.inclusion {
        Inclusion::Probability(p) if !(p > 0.0 && p < 1.0) => Err(setting(
            "prior.inclusion.probability",
            format!("{p} is not between 0 and 1"),
            "use 0.2, or `expected_terms`",
        )),
        Inclusion::ExpectedTerms(m) if size > 0 && !(m > 0.0 && m < components as f64) => {
            Err(setting(
                "prior.inclusion.expected_terms",
                format!("{m} of {components} components"),
                "it must lie between 0 and the number of components",
            ))
        }
        _ => Ok(()),
    }
}
