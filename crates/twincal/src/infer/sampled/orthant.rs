//! A few coefficients, each above its bound: a proposal that knows its own density.
//!
//! `θ ~ N(μ, T⁻¹)` on `θ ≥ lower`, with T = L Lᵀ. From the last coefficient to the first each is drawn from its normal law given
//! the later ones, cut off at its bound. What that proposal is short of the law itself is the product of the masses above the
//! bounds (Geweke 1991; Hajivassiliou & McFadden 1998), whose mean over proposals is the mass of the orthant.

use super::planted::planted;
use crate::infer::moments::log_normal_mass;
use crate::linear_algebra::Cholesky;
use crate::random::Random;

/// See the module's text; the slab of θ is a standard normal, cut off and normalised likewise.
pub(super) struct Orthant {
    lower: Vec<f64>,
    mean: Vec<f64>,
    factor: Cholesky,
    /// ln of the evidence if there were no bounds, less ln of the slab's mass above them.
    log_free: f64,
}

impl Orthant {
    /// From precision T ≥ I, right-hand side and bounds; `None` if T has no factor.
    pub(super) fn new(precision: &[f64], rhs: Vec<f64>, lower: Vec<f64>) -> Option<Self> {
        let factor = Cholesky::new(precision, rhs.len()).ok()?;
        let mut mean = rhs;
        factor.solve_lower(&mut mean);
        let square: f64 = mean.iter().map(|x| x * x).sum();
        factor.solve_upper(&mut mean);
        let slab: f64 = lower.iter().map(|l| log_normal_mass(-l)).sum();
        Some(Self {
            log_free: 0.5 * (square - factor.log_determinant()) - planted!(0, slab, 0.0),
            lower,
            mean,
            factor,
        })
    }

    /// Mean and sd of coefficient i given the later ones.
    fn conditional(&self, i: usize, values: &[f64]) -> (f64, f64) {
        let (size, lower) = (self.mean.len(), self.factor.lower());
        let pull: f64 = (i + 1..size)
            .map(|k| lower[k * size + i] * (values[k] - self.mean[k]))
            .sum();
        let own = lower[i * size + i];
        (self.mean[i] - pull / own, 1.0 / own)
    }

    /// Coefficients, each drawn given the later ones.
    pub(super) fn propose(&self, random: &mut Random) -> Vec<f64> {
        let mut values = vec![0.0; self.mean.len()];
        for i in (0..values.len()).rev() {
            let (center, sd) = self.conditional(i, &values);
            values[i] = above(center, sd, self.lower[i], random);
        }
        values
    }

    /// ln of (likelihood × slab) over the proposal's density at `values`, against the component being out. With one
    /// coefficient it does not depend on its value.
    pub(super) fn log_weight(&self, values: &[f64]) -> f64 {
        let mass = |i: usize| {
            let (center, sd) = self.conditional(i, values);
            log_normal_mass((center - self.lower[i]) / sd)
        };
        self.log_free + (0..values.len()).map(mass).sum::<f64>()
    }

    /// Each coefficient once more, given all others.
    pub(super) fn stir(&self, mut values: Vec<f64>, random: &mut Random) -> Vec<f64> {
        let (size, factor) = (values.len(), self.factor.lower());
        let precision = |i: usize, k: usize| -> f64 {
            (0..=i.min(k))
                .map(|j| factor[i * size + j] * factor[k * size + j])
                .sum()
        };
        for i in 0..size {
            let own = precision(i, i);
            let pull: f64 = (0..size)
                .filter(|&k| k != i)
                .map(|k| precision(i, k) * (values[k] - self.mean[k]))
                .sum();
            values[i] = above(
                self.mean[i] - pull / own,
                1.0 / own.sqrt(),
                self.lower[i],
                random,
            );
        }
        values
    }
}

/// A draw from `N(center, sd²)` above `lower`.
fn above(center: f64, sd: f64, lower: f64, random: &mut Random) -> f64 {
    let lower = planted!(8, lower, f64::NEG_INFINITY);
    (center + sd * random.normal_above((lower - center) / sd)).max(lower)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean weight of proposals is the evidence: two coefficients by a fine grid. 40 000 proposals, 5 standard errors
    /// (false alarm 6e-7).
    #[test]
    fn proposals_weigh_what_the_orthant_holds() {
        let (precision, rhs) = ([3.0, 1.2, 1.2, 2.0], vec![-1.0, 0.6]);
        let lower = [-0.4, 0.0];
        let law = Orthant::new(&precision, rhs.clone(), lower.to_vec()).unwrap();
        let density = |x: f64, y: f64| {
            let square = precision[0] * x * x + 2.0 * precision[1] * x * y + precision[3] * y * y;
            (rhs[0] * x + rhs[1] * y - 0.5 * square).exp()
        };
        let (cells, width) = (2000, 8.0);
        let step = width / f64::from(cells);
        let sum: f64 = (0..cells)
            .flat_map(|i| (0..cells).map(move |k| (i, k)))
            .map(|(i, k)| {
                let at = |n: i32| (f64::from(n) + 0.5) * step;
                density(lower[0] + at(i), lower[1] + at(k))
            })
            .sum();
        // The slab above its bounds: Φ(0.4) · Φ(0), Φ(0.4) = 0.655421741610324.
        let slab = 2.0 * std::f64::consts::PI * 0.655_421_741_610_324 * 0.5;
        let truth = sum * step * step / slab;
        let mut random = Random::new(5, 0);
        let n = 40_000.0;
        let weights: Vec<f64> = (0..40_000)
            .map(|_| {
                let values = law.propose(&mut random);
                assert!(values[0] >= lower[0] && values[1] >= lower[1]);
                law.log_weight(&values).exp()
            })
            .collect();
        let mean = weights.iter().sum::<f64>() / n;
        let variance = weights.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / n;
        assert!(
            (mean - truth).abs() < 5.0 * (variance / n).sqrt() + 1e-5,
            "{mean} {truth}"
        );
    }
}
