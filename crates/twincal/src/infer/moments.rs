//! Moments of one model's coefficients, read off the tableau, for the present model and for its neighbours; and their
//! weighted sums.

use super::kin::Step;
use super::pivot::Pivot;
use super::standard::Standard;
use super::walker::Walker;
use crate::linear_algebra::{Cholesky, NotPositiveDefinite};
use crate::prior::HalfSpace;
use statrs::function::erf::erfc;

/// `E[δ]` and `Var[β]/φ` of every position, c, and the components of one model.
pub(super) struct Moments {
    /// δ = β − β̂; −β̂ outside.
    pub(super) delta: Vec<f64>,
    /// `(A_zz⁻¹)_kk`, 0 outside.
    pub(super) variance: Vec<f64>,
    pub(super) excess: f64,
    /// By place in `standard.blocks`.
    pub(super) holds: Vec<bool>,
    /// Included positions, and their `(A_zz⁻¹)_kl`, row by row; both empty unless asked for.
    pub(super) inside: Vec<usize>,
    pub(super) covariance: Vec<f64>,
}

impl Moments {
    /// Covariances by place in `inside` and position, `entry(a, b, i, j)`; variances as they stand.
    fn fill(&mut self, entry: impl Fn(usize, usize, usize, usize) -> f64) {
        let count = self.inside.len();
        self.covariance = vec![0.0; count * count];
        for (a, &i) in self.inside.iter().enumerate() {
            for (b, &j) in self.inside.iter().enumerate().take(a) {
                let value = entry(a, b, i, j);
                self.covariance[a * count + b] = value;
                self.covariance[b * count + a] = value;
            }
            self.covariance[a * count + a] = self.variance[i];
        }
    }

    /// ln of the mass within the bounds if the coefficients were independent: guides the search, is no part of a result.
    pub(super) fn log_mass(&self, standard: &Standard) -> f64 {
        if !standard.bounded {
            return 0.0;
        }
        let phi = 0.5 * (1.0 + self.excess) / standard.shape;
        let single: f64 = (0..self.delta.len())
            .filter(|&k| self.variance[k] > 0.0 && standard.lower[k] > f64::NEG_INFINITY)
            .map(|k| {
                let beta = standard.center[k] + self.delta[k];
                log_normal_mass((beta - standard.lower[k]) / (phi * self.variance[k]).sqrt())
            })
            .sum();
        let inside = |d: usize| self.variance[d] > 0.0;
        let beta = |d: usize| standard.center[d] + self.delta[d];
        let sums = standard
            .halves
            .iter()
            .map(|half| half_mass(half, inside, beta, |d| phi * self.variance[d]));
        single + sums.sum::<f64>()
    }
}

/// ln of the probability of a model that a bound forbids.
pub(super) const FORBIDDEN: f64 = -1e4;

/// ln of the mass above a bound on a sum if the coefficients were independent, of mean `beta` and this variance; 0 where it does not act.
pub(super) fn half_mass(
    half: &HalfSpace,
    inside: impl Fn(usize) -> bool,
    beta: impl Fn(usize) -> f64,
    variance: impl Fn(usize) -> f64,
) -> f64 {
    if !half.acts(&inside) {
        return 0.0;
    }
    if half.forbids(&inside) {
        return FORBIDDEN;
    }
    let (mut mean, mut spread) = (0.0, 0.0);
    for &(d, factor) in half.terms.iter().filter(|(d, _)| inside(*d)) {
        mean += factor * beta(d);
        spread += factor * factor * variance(d);
    }
    log_normal_mass((mean - half.lower) / spread.sqrt())
}

/// `ln Φ(t)`, also far below 0.
pub(super) fn log_normal_mass(t: f64) -> f64 {
    if t > 9.0 {
        // 1 to the last digit.
        return 0.0;
    }
    if t > -30.0 {
        return (0.5 * erfc(-t * std::f64::consts::FRAC_1_SQRT_2)).ln();
    }
    // Mills' ratio by its asymptotic series: relative error below 1e-8.
    let s = 1.0 / (t * t);
    -0.5 * t * t - 0.5 * (2.0 * std::f64::consts::PI).ln() - (-t).ln()
        + (-s * (1.0 - 3.0 * s * (1.0 - 5.0 * s))).ln_1p()
}

/// Moments of the present model; `joint`: with the covariances.
pub(super) fn present(walker: &Walker<'_>, joint: bool) -> Moments {
    let (standard, tableau) = (walker.standard, &walker.tableau);
    let size = standard.size();
    let mut delta: Vec<f64> = standard.center.iter().map(|x| -x).collect();
    let mut variance = vec![0.0; size];
    for &k in &tableau.members {
        delta[k] += tableau.gradient[k];
        variance[k] = tableau.diagonal[k];
    }
    let (mut inside, mut covariance) = (Vec::new(), Vec::new());
    if joint {
        inside.clone_from(&tableau.members);
        covariance.reserve(inside.len() * inside.len());
        for &i in &inside {
            let row = tableau.row(i);
            covariance.extend(inside.iter().map(|&k| row[k]));
        }
    }
    Moments {
        delta,
        variance,
        excess: tableau.excess,
        holds: (0..standard.blocks.len())
            .map(|b| tableau.holds(b))
            .collect(),
        inside,
        covariance,
    }
}

/// Moments after moving one component; `excess` is c then.
///
/// ```text
/// out: β_i −= C_iB C_BB⁻¹ β_B,  C_ij −= C_iB C_BB⁻¹ C_Bj      in: β_i −= t_iB b,  C_ij += t_iB S⁻¹ t_jBᵀ,  b = S⁻¹ u_B
///                                                                C_iB = −t_iB S⁻¹,  C_BB = S⁻¹
/// ```
pub(super) fn after_flip(walker: &Walker<'_>, block: usize, excess: f64, joint: bool) -> Moments {
    let (standard, tableau) = (walker.standard, &walker.tableau);
    let mut moments = present(walker, false);
    moments.excess = excess;
    let own = standard.blocks[block];
    let inside = tableau.holds(block);
    moments.holds[block] = !inside;
    // S⁻¹ or C_BB⁻¹ as rows of L⁻¹: x ↦ |L⁻¹ x|², and its product with the gradient.
    let Ok(factor) = factor_of(walker, block) else {
        return present(walker, joint);
    };
    let mut step = tableau.gradient[own.range()].to_vec();
    factor.solve(&mut step);
    let sign = if inside { -1.0 } else { 1.0 };
    let stays: Vec<usize> = (tableau.members.iter().copied())
        .filter(|i| !own.range().contains(i))
        .collect();
    let entering = if inside { 0..0 } else { own.range() };
    // L⁻¹ of the block's part of every row that stays, then of the entering unit vectors.
    let mut halves = vec![0.0; (stays.len() + entering.len()) * own.len];
    let (rows, units) = halves.split_at_mut(stays.len() * own.len);
    for (&i, cross) in stays.iter().zip(rows.chunks_exact_mut(own.len)) {
        cross.copy_from_slice(&tableau.row(i)[own.range()]);
        let shift: f64 = cross.iter().zip(&step).map(|(t, b)| t * b).sum();
        moments.delta[i] -= shift;
        factor.solve_lower(cross);
        let spread: f64 = cross.iter().map(|x| x * x).sum();
        moments.variance[i] = (moments.variance[i] + sign * spread).max(1.0);
    }
    if inside {
        for k in own.range() {
            moments.delta[k] = -standard.center[k];
            moments.variance[k] = 0.0;
        }
    } else {
        for (a, unit) in units.chunks_exact_mut(own.len).enumerate() {
            let k = own.start + a;
            unit[a] = 1.0;
            factor.solve_lower(unit);
            moments.delta[k] = step[a] - standard.center[k];
            moments.variance[k] = unit.iter().map(|x| x * x).sum();
        }
    }
    if joint {
        let half = |a: usize| &halves[a * own.len..(a + 1) * own.len];
        let change = |a: usize, b: usize| {
            let pairs = half(a).iter().zip(half(b));
            pairs.map(|(x, y)| x * y).sum::<f64>()
        };
        moments.inside = stays.iter().copied().chain(entering).collect();
        let staying = stays.len();
        moments.fill(|a, b, i, j| match (a < staying, b < staying) {
            (true, true) => tableau.row(i)[j] + sign * change(a, b),
            (false, false) => change(a, b),
            _ => -change(a, b),
        });
    }
    moments
}

/// The factor of S or C_BB of a component.
fn factor_of(
    walker: &Walker<'_>,
    block: usize,
) -> std::result::Result<Cholesky, NotPositiveDefinite> {
    let (own, tableau) = (walker.standard.blocks[block], &walker.tableau);
    match own.len {
        1 => Cholesky::new(&tableau.diagonal[own.start..=own.start], 1),
        len => Cholesky::new(tableau.square(block), len),
    }
}

/// Moments after an exchange; `excess` is c then. See [`Pivot`] for the formulas.
pub(super) fn after_exchange(
    walker: &Walker<'_>,
    step: &Step,
    pivot: &Pivot,
    excess: f64,
    joint: bool,
) -> Moments {
    let (standard, tableau) = (walker.standard, &walker.tableau);
    let mut moments = present(walker, false);
    moments.excess = excess;
    let (leaving, entering) = pivot.positions.split_at(pivot.leaving);
    let all = pivot.positions.len();
    let stays: Vec<usize> = (tableau.members.iter().copied())
        .filter(|i| !leaving.contains(i))
        .collect();
    // L⁻¹ v of every row that stays, then of the entering unit vectors.
    let mut halves = vec![0.0; (stays.len() + entering.len()) * all];
    let (rows, units) = halves.split_at_mut(stays.len() * all);
    for (&i, v) in stays.iter().zip(rows.chunks_exact_mut(all)) {
        let row = tableau.row(i);
        v.iter_mut()
            .zip(&pivot.positions)
            .for_each(|(v, &k)| *v = row[k]);
        let (shift, spread) = pivot.forms(v);
        moments.delta[i] -= shift;
        moments.variance[i] = (moments.variance[i] - spread).max(1.0);
    }
    for &k in leaving {
        moments.delta[k] = -standard.center[k];
        moments.variance[k] = 0.0;
    }
    for ((a, &k), v) in entering.iter().enumerate().zip(units.chunks_exact_mut(all)) {
        v[pivot.leaving + a] = 1.0;
        let (mean, variance) = pivot.forms(v);
        moments.delta[k] = mean - standard.center[k];
        moments.variance[k] = (-variance).max(1.0);
    }
    for &block in step.leaving.iter().chain(&step.entering) {
        moments.holds[block] ^= true;
    }
    if joint {
        let staying = stays.len();
        let half = |a: usize| &halves[a * all..(a + 1) * all];
        moments.inside = stays.iter().chain(entering).copied().collect();
        moments.fill(|a, b, i, j| {
            let form = pivot.form(half(a), half(b));
            match (a < staying, b < staying) {
                (true, true) => tableau.row(i)[j] - form,
                (false, false) => -form,
                _ => form,
            }
        });
    }
    moments
}

/// ln of how much heavier than the reference a model may be.
const MOST_ABOVE: f64 = 100.0;

/// Weighted sums over models; weights relative to `e^reference`.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    pub(super) reference: f64,
    factor: f64,
    total: f64,
    /// Σ w z by place in `standard.blocks`.
    pub(super) inclusion: Vec<f64>,
    /// Σ w E[δ], Σ w E[δ²] by position.
    pub(super) shift: Vec<f64>,
    pub(super) moment: Vec<f64>,
    /// Σ w (1 + c).
    pub(super) misfit: f64,
    /// `None` unless columns were integrated out.
    joint: Option<Joint>,
}

/// Σ w E[γ γᵀ] of coefficients counted from those of the first model, γ = β − β₀: what is in neither model has γ = 0, so that a model costs the
/// square of its own columns and not of all.
#[derive(Debug, Clone)]
struct Joint {
    /// γ − δ = β̂ − β₀; empty before the first model.
    offset: Vec<f64>,
    /// Row-major.
    products: Vec<f64>,
}

impl Joint {
    /// One more model, by its share `weight` and that times φ.
    fn add(&mut self, center: &[f64], moments: &Moments, weight: f64, spread: f64) {
        let size = moments.delta.len();
        if self.offset.is_empty() {
            let outside = |(center, variance): (&f64, &f64)| match *variance > 0.0 {
                true => 0.0,
                false => *center,
            };
            let columns = center.iter().zip(&moments.variance);
            self.offset = columns.map(outside).collect();
        }
        let gamma: Vec<(usize, f64)> = (moments.delta.iter().zip(&self.offset).enumerate())
            .map(|(k, (delta, offset))| (k, delta + offset))
            .filter(|(_, gamma)| *gamma != 0.0)
            .collect();
        for &(i, own) in &gamma {
            let (row, scaled) = (&mut self.products[i * size..(i + 1) * size], weight * own);
            for &(j, other) in &gamma {
                row[j] += scaled * other;
            }
        }
        let rows = moments.covariance.chunks_exact(moments.inside.len().max(1));
        for (&i, covariances) in moments.inside.iter().zip(rows) {
            let row = &mut self.products[i * size..(i + 1) * size];
            for (&j, covariance) in moments.inside.iter().zip(covariances) {
                row[j] += spread * covariance;
            }
        }
    }
}

impl Sums {
    /// `joint`: with products.
    pub(super) fn new(standard: &Standard, joint: bool) -> Self {
        let factor = standard.noise_factor();
        let products = vec![0.0; if joint { standard.size().pow(2) } else { 0 }];
        Self {
            reference: 0.0,
            factor: if factor.is_finite() { factor } else { 0.0 },
            total: 0.0,
            inclusion: vec![0.0; standard.blocks.len()],
            shift: vec![0.0; standard.size()],
            moment: vec![0.0; standard.size()],
            misfit: 0.0,
            joint: joint.then(|| Joint {
                offset: Vec::new(),
                products,
            }),
        }
    }

    /// Σ w.
    pub(super) fn total(&self) -> f64 {
        self.total
    }

    /// w of a log weight.
    pub(super) fn weight(&self, log_weight: f64) -> f64 {
        (log_weight - self.reference).min(690.0).exp()
    }

    /// Moves the reference up where a model is too heavy for it.
    fn rebase(&mut self, log_weight: f64) {
        if log_weight <= self.reference + MOST_ABOVE {
            return;
        }
        let factor = (self.reference - log_weight).exp();
        self.reference = log_weight;
        self.total *= factor;
        self.misfit *= factor;
        let sums = [&mut self.inclusion, &mut self.shift, &mut self.moment];
        let joint = self.joint.iter_mut().map(|joint| &mut joint.products);
        let sums = sums.into_iter().chain(joint).flatten();
        sums.for_each(|sum| *sum *= factor);
    }

    /// E[δ δᵀ], row-major; empty unless columns were integrated out.
    ///
    /// ```text
    /// E[δδᵀ] = E[γγᵀ] − E[γ]oᵀ − oE[γ]ᵀ + ooᵀ,     γ = δ + o
    /// ```
    pub(super) fn products(&self) -> Vec<f64> {
        let Some(Joint { offset, products }) = &self.joint else {
            return Vec::new();
        };
        let total = self.total;
        let gamma: Vec<f64> = (self.shift.iter().zip(offset))
            .map(|(shift, offset)| shift / total + offset)
            .collect();
        let size = gamma.len().max(1);
        let mut out: Vec<f64> = products.iter().map(|sum| sum / total).collect();
        for (i, row) in out.chunks_exact_mut(size).enumerate() {
            if offset.is_empty() {
                break;
            }
            let (own, along) = (offset[i], gamma[i]);
            for ((value, offset), gamma) in row.iter_mut().zip(offset).zip(&gamma) {
                *value += own * offset - own * gamma - along * offset;
            }
        }
        out
    }

    /// One more model of `standard`.
    pub(super) fn add(&mut self, standard: &Standard, log_weight: f64, moments: &Moments) {
        self.rebase(log_weight);
        let weight = self.weight(log_weight);
        let misfit = 1.0 + moments.excess;
        let phi = misfit * self.factor;
        self.total += weight;
        self.misfit += weight * misfit;
        for (sum, &holds) in self.inclusion.iter_mut().zip(&moments.holds) {
            *sum += if holds { weight } else { 0.0 };
        }
        let rows = self.shift.iter_mut().zip(&mut self.moment);
        for ((shift, moment), (delta, variance)) in
            rows.zip(moments.delta.iter().zip(&moments.variance))
        {
            *shift += weight * delta;
            *moment += weight * (delta * delta + phi * variance);
        }
        if let Some(joint) = &mut self.joint {
            joint.add(&standard.center, moments, weight, weight * phi);
        }
    }
}
