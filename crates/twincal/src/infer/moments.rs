//! Moments of one model's coefficients, read off the tableau, for the present model and for its neighbours; and their
//! weighted sums.

use super::kin::Step;
use super::pivot::Pivot;
use super::standard::Standard;
use super::walker::Walker;
use crate::linear_algebra::{Cholesky, NotPositiveDefinite, add_weighted_squares, mirror};
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
    /// `(A_zz⁻¹)_kl`.
    pub(super) joint: Covariance,
}

/// C = A_zz⁻¹ of one model.
pub(super) enum Covariance {
    /// Not asked for.
    Unknown,
    /// Of the included positions, row by row.
    Whole {
        inside: Vec<usize>,
        entries: Vec<f64>,
    },
    /// `C + Σ f h hᵀ` of the present model's C: f of every h, and the entries of all, position by position of `at`.
    Beside {
        factors: Vec<f64>,
        at: Vec<usize>,
        halves: Vec<f64>,
    },
}

impl Moments {
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
    let joint = match joint {
        false => Covariance::Unknown,
        true => {
            let inside = tableau.members.clone();
            let mut entries = Vec::with_capacity(inside.len() * inside.len());
            for &i in &inside {
                let row = tableau.row(i);
                entries.extend(inside.iter().map(|&k| row[k]));
            }
            Covariance::Whole { inside, entries }
        }
    };
    Moments {
        delta,
        variance,
        excess: tableau.excess,
        holds: (0..standard.blocks.len())
            .map(|b| tableau.holds(b))
            .collect(),
        joint,
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
    // L⁻¹ of the block's part of every included row, then of the entering unit vectors, which count the other way round.
    let mut at = tableau.members.clone();
    let mut halves = vec![0.0; at.len() * own.len];
    for (&i, cross) in at.iter().zip(halves.chunks_exact_mut(own.len)) {
        cross.copy_from_slice(&tableau.row(i)[own.range()]);
        let shift: f64 = cross.iter().zip(&step).map(|(t, b)| t * b).sum();
        factor.solve_lower(cross);
        let spread: f64 = cross.iter().map(|x| x * x).sum();
        moments.delta[i] -= shift;
        moments.variance[i] = (moments.variance[i] + sign * spread).max(1.0);
    }
    if inside {
        for k in own.range() {
            moments.delta[k] = -standard.center[k];
            moments.variance[k] = 0.0;
        }
    } else {
        at.extend(own.range());
        let mut unit = vec![0.0; own.len];
        for (k, entering) in own.range().zip(&step) {
            unit.fill(0.0);
            unit[k - own.start] = -1.0;
            factor.solve_lower(&mut unit);
            moments.delta[k] = entering - standard.center[k];
            moments.variance[k] = unit.iter().map(|x| x * x).sum();
            halves.extend_from_slice(&unit);
        }
    }
    if joint {
        moments.joint = Covariance::Beside {
            factors: vec![sign; own.len],
            at,
            halves,
        };
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
    // L⁻¹ v of every included row, then of the entering unit vectors, which count the other way round.
    let mut at = tableau.members.clone();
    let mut halves = vec![0.0; at.len() * all];
    for (&i, v) in at.iter().zip(halves.chunks_exact_mut(all)) {
        let row = tableau.row(i);
        (v.iter_mut().zip(&pivot.positions)).for_each(|(v, &k)| *v = row[k]);
        let (shift, spread) = pivot.forms(v);
        moments.delta[i] -= shift;
        moments.variance[i] = (moments.variance[i] - spread).max(1.0);
    }
    for &k in leaving {
        moments.delta[k] = -standard.center[k];
        moments.variance[k] = 0.0;
    }
    let mut unit = vec![0.0; all];
    for (a, &k) in entering.iter().enumerate() {
        unit.fill(0.0);
        unit[pivot.leaving + a] = -1.0;
        let (mean, variance) = pivot.forms(&mut unit);
        moments.delta[k] = -mean - standard.center[k];
        moments.variance[k] = (-variance).max(1.0);
        halves.extend_from_slice(&unit);
    }
    at.extend(entering);
    for &block in step.leaving.iter().chain(&step.entering) {
        moments.holds[block] ^= true;
    }
    if joint {
        moments.joint = Covariance::Beside {
            factors: pivot.pivots.iter().map(|pivot| -1.0 / pivot).collect(),
            at,
            halves,
        };
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

/// Σ w E[γ γᵀ] of coefficients counted from those of the first model, γ = β − β₀.
///
/// Models beside one that is expanded wait until all are known: what they add is one product of matrices.
#[derive(Debug, Clone)]
struct Joint {
    /// γ − δ = β̂ − β₀; empty before the first model.
    offset: Vec<f64>,
    /// Row-major; the lower triangle alone.
    products: Vec<f64>,
    /// Rows of all positions whose weighted squares are still to be added, and the share of the expanded model's C.
    waiting: Vec<f64>,
    weights: Vec<f64>,
    beside: f64,
}

/// Rows that wait at most: memory.
const WAITING: usize = 256;

impl Joint {
    fn new(size: usize) -> Self {
        Self {
            offset: Vec::new(),
            products: vec![0.0; size * size],
            waiting: Vec::new(),
            weights: Vec::new(),
            beside: 0.0,
        }
    }

    /// One more model, by its share `weight` and that times φ.
    fn add(&mut self, center: &[f64], moments: &Moments, weight: f64, spread: f64) {
        if self.offset.is_empty() {
            let outside = |(center, variance): (&f64, &f64)| match *variance > 0.0 {
                true => 0.0,
                false => *center,
            };
            let columns = center.iter().zip(&moments.variance);
            self.offset = columns.map(outside).collect();
        }
        let gamma = moments.delta.iter().zip(&self.offset);
        self.waiting
            .extend(gamma.map(|(delta, offset)| delta + offset));
        self.weights.push(weight);
        match &moments.joint {
            Covariance::Unknown => {}
            Covariance::Whole { inside, entries } => self.add_whole(inside, entries, spread),
            Covariance::Beside {
                factors,
                at,
                halves,
            } => {
                self.beside += spread;
                let size = center.len();
                for (half, factor) in factors.iter().enumerate() {
                    let start = self.waiting.len();
                    self.waiting.resize(start + size, 0.0);
                    let row = &mut self.waiting[start..];
                    for (&k, values) in at.iter().zip(halves.chunks_exact(factors.len())) {
                        row[k] = values[half];
                    }
                    self.weights.push(factor * spread);
                }
            }
        }
        if self.weights.len() >= WAITING {
            self.settle();
        }
    }

    /// Adds C of some positions.
    fn add_whole(&mut self, inside: &[usize], entries: &[f64], spread: f64) {
        let size = self.offset.len();
        let rows = entries.chunks_exact(inside.len().max(1));
        for (&i, covariances) in inside.iter().zip(rows) {
            let row = &mut self.products[i * size..(i + 1) * size];
            for (&j, covariance) in inside.iter().zip(covariances) {
                // what stands above the diagonal is never read
                row[j] += spread * covariance;
            }
        }
    }

    /// Adds the rows that wait, without the positions that none of them has.
    fn settle(&mut self) {
        let size = self.offset.len();
        let mut has = vec![false; size];
        for row in self.waiting.chunks_exact(size.max(1)) {
            (has.iter_mut().zip(row)).for_each(|(has, x)| *has |= *x != 0.0);
        }
        let used: Vec<usize> = (0..size).filter(|&k| has[k]).collect();
        let mut rows = Vec::with_capacity(self.weights.len() * used.len());
        for row in self.waiting.chunks_exact(size.max(1)) {
            rows.extend(used.iter().map(|&k| row[k]));
        }
        let mut sums = vec![0.0; used.len() * used.len()];
        add_weighted_squares(&mut sums, &rows, &self.weights, used.len());
        let own = sums.chunks_exact(used.len().max(1)).enumerate();
        for (a, row) in own {
            let products = &mut self.products[used[a] * size..][..size];
            (used[..=a].iter().zip(row)).for_each(|(&j, sum)| products[j] += sum);
        }
        self.waiting.clear();
        self.weights.clear();
    }

    fn scale(&mut self, factor: f64) {
        let rows = self.products.iter_mut().chain(&mut self.weights);
        rows.for_each(|sum| *sum *= factor);
        self.beside *= factor;
    }
}

impl Sums {
    /// `joint`: with products.
    pub(super) fn new(standard: &Standard, joint: bool) -> Self {
        let factor = standard.noise_factor();
        Self {
            reference: 0.0,
            factor: if factor.is_finite() { factor } else { 0.0 },
            total: 0.0,
            inclusion: vec![0.0; standard.blocks.len()],
            shift: vec![0.0; standard.size()],
            moment: vec![0.0; standard.size()],
            misfit: 0.0,
            joint: joint.then(|| Joint::new(standard.size())),
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
        sums.into_iter().flatten().for_each(|sum| *sum *= factor);
        if let Some(joint) = &mut self.joint {
            joint.scale(factor);
        }
    }

    /// E[δ δᵀ], row-major; empty unless columns were integrated out.
    ///
    /// ```text
    /// E[δδᵀ] = E[γγᵀ] − E[γ]oᵀ − oE[γ]ᵀ + ooᵀ,     γ = δ + o
    /// ```
    pub(super) fn products(&mut self) -> Vec<f64> {
        let Some(joint) = &mut self.joint else {
            return Vec::new();
        };
        joint.settle();
        let Joint {
            offset, products, ..
        } = &*joint;
        let total = self.total;
        let gamma: Vec<f64> = (self.shift.iter().zip(offset))
            .map(|(shift, offset)| shift / total + offset)
            .collect();
        let size = gamma.len().max(1);
        let mut out: Vec<f64> = products.iter().map(|sum| sum / total).collect();
        mirror(&mut out, gamma.len());
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

    /// The model whose neighbours were added is left: adds what all of them have of its C.
    pub(super) fn leave(&mut self, walker: &Walker<'_>) {
        let Some(joint) = (self.joint.as_mut()).filter(|joint| joint.beside != 0.0) else {
            return;
        };
        let spread = std::mem::take(&mut joint.beside);
        let size = joint.offset.len();
        let inside = &walker.tableau.members;
        for &i in inside {
            let (row, sums) = (walker.tableau.row(i), &mut joint.products[i * size..]);
            inside.iter().for_each(|&j| sums[j] += spread * row[j]);
        }
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
