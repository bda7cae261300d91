//! One line per candidate: inclusion probability, mean, sd and interval, all averaged over models (method section 7).

use super::mixture::{Level, Mixture};
use super::student::StudentT;
use super::{Method, Model, Posterior, Site};
use crate::linear_algebra::Cholesky;
use rayon::prelude::*;

/// Probability within one sd of the mean of a normal distribution.
const ONE_SD: f64 = 0.682_689_492_137_086;

/// What is known about the coefficient β_k of one column, in its own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColumnSummary {
    /// Posterior inclusion probability P(z_k = 1 | y).
    pub pip: f64,
    /// Monte Carlo standard error of `pip`; 0 when exact.
    pub pip_mcse: f64,
    /// E[β_k | y], unconditional.
    pub mean: f64,
    /// sd of β_k | y, unconditional.
    pub sd: f64,
    /// Central 95 % interval of β_k | y, unconditional: a spike of 1 − pip at 0 and a mixture of Student-t.
    pub interval95: [f64; 2],
    /// E[β_k | y, z_k = 1]; `None` if pip is 0.
    pub conditional_mean: Option<f64>,
    /// sd of β_k | y, z_k = 1; `None` if pip is 0.
    pub conditional_sd: Option<f64>,
    /// Median of β_k | y, z_k = 1; `None` if no stored model holds the column.
    pub conditional_median: Option<f64>,
    /// Central 68.3 % interval of β_k | y, z_k = 1: one sd to either side where it is normal, and not wider because a few
    /// light models lie far off.
    pub conditional_interval68: Option<[f64; 2]>,
    /// Central 95 % interval of β_k | y, z_k = 1.
    pub conditional_interval95: Option<[f64; 2]>,
    /// pip ≥ 0.5: a member of the median-probability model (Barbieri & Berger 2004).
    pub selected: bool,
}

impl ColumnSummary {
    fn of(
        posterior: &Posterior,
        student: &StudentT,
        column: usize,
        components: &Components,
    ) -> Self {
        let pip = posterior.inclusion[column].clamp(0.0, 1.0);
        let (mean, sd) = (posterior.mean[column], posterior.sd[column]);
        let summed = matches!(posterior.method, Method::Exact { .. })
            && posterior.models.iter().all(|model| model.sites.is_empty());
        let from_models = components.moments(student).filter(|_| !summed);
        let conditional = (pip > 0.0).then(|| {
            // Sums over all models are exact. Sampled or bounded ones round the three numbers each in its own way: their
            // difference is no variance, the models' own is.
            if let Some(moments) = from_models {
                return moments;
            }
            // E[β² | y] = pip · E[β² | y, z = 1], and the same for the mean.
            let conditional_mean = mean / pip;
            // sd² = pip·s² + pip(1 − pip)·m², solved for s² without the cancellation of raw second moments.
            let variance = sd * (sd / pip) - (1.0 - pip) * conditional_mean * conditional_mean;
            (conditional_mean, variance.max(0.0).sqrt())
        });
        let quantiles = components.quantiles(student);
        Self {
            pip,
            pip_mcse: posterior.inclusion_mcse[column],
            mean,
            sd,
            interval95: components.interval95(student, 1.0 - pip),
            conditional_mean: conditional.map(|pair| pair.0),
            conditional_sd: conditional.map(|pair| pair.1),
            conditional_median: quantiles.map(|[_, median, _]| median),
            conditional_interval68: quantiles.map(|[low, _, high]| [low, high]),
            conditional_interval95: quantiles.map(|_| components.interval95(student, 0.0)),
            selected: pip >= 0.5,
        }
    }
}

/// Summaries of all K columns, in their order.
///
/// Inclusion, mean and sd are the posterior's (all models); the shape of the intervals comes from the stored models that
/// hold the column. Scaling a column by c scales mean, sd and interval by 1/c and changes nothing else.
#[must_use]
pub fn summarise(posterior: &Posterior) -> Vec<ColumnSummary> {
    let student = StudentT::new(2.0 * posterior.shape);
    let diagonals: Vec<Vec<f64>> = (posterior.models.par_iter())
        .map(|model| {
            Cholesky::from_lower(model.factor.clone(), model.members.len()).inverse_diagonal()
        })
        .collect();
    let mut components = vec![Components::default(); posterior.inclusion.len()];
    for (model, diagonal) in posterior.models.iter().zip(&diagonals) {
        for (place, &column) in model.members.iter().enumerate() {
            let single = |site: &&Site| site.terms.is_empty() && site.place as usize == place;
            let bound = model.sites.iter().find(single);
            components[column as usize].push(
                bound.map_or(f64::NEG_INFINITY, |site| site.lower),
                model,
                model.mean[place],
                diagonal[place],
                posterior.shape,
            );
        }
    }
    (components.par_iter().enumerate())
        .map(|(k, components)| ColumnSummary::of(posterior, &student, k, components))
        .collect()
}

/// The t components of one coefficient given that it is included.
#[derive(Debug, Clone)]
struct Components {
    weights: Vec<f64>,
    locations: Vec<f64>,
    scales: Vec<f64>,
    /// Bound of the coefficient where it acts: intervals end there.
    lower: f64,
}

impl Default for Components {
    fn default() -> Self {
        Self {
            weights: Vec::new(),
            locations: Vec::new(),
            scales: Vec::new(),
            lower: f64::NEG_INFINITY,
        }
    }
}

impl Components {
    /// β_k | z, y ~ t_{2 a_n}(μ_k, (b_n/a_n) (A⁻¹)_kk).
    fn push(&mut self, lower: f64, model: &Model, location: f64, variance: f64, shape: f64) {
        if model.weight > 0.0 {
            self.lower = self.lower.max(lower);
            self.weights.push(model.weight);
            self.locations.push(location);
            self.scales.push((model.scale / shape * variance).sqrt());
        }
    }

    /// Mean and sd given that the column is in; `None` without models that hold it.
    fn moments(&self, student: &StudentT) -> Option<(f64, f64)> {
        let freedom = student.dof();
        let mass: f64 = self.weights.iter().sum();
        if mass <= 0.0 || freedom <= 2.0 {
            return None;
        }
        let average = |value: &dyn Fn(usize) -> f64| {
            let terms = self.weights.iter().enumerate();
            terms.map(|(i, w)| w * value(i)).sum::<f64>() / mass
        };
        let mean = average(&|i| self.locations[i]);
        let within = average(&|i| self.scales[i] * self.scales[i]) * freedom / (freedom - 2.0);
        let between = average(&|i| (self.locations[i] - mean) * (self.locations[i] - mean));
        Some((mean, (within + between).sqrt()))
    }

    fn interval95(&self, student: &StudentT, spike: f64) -> [f64; 2] {
        // Only models too light to be stored hold the column: the spike has more than 95 %.
        self.at(student, spike, Level::central(student, 0.95))
            .unwrap_or_default()
    }

    /// Lower end of the central 68.3 %, median and upper end, given that the column is in.
    fn quantiles(&self, student: &StudentT) -> Option<[f64; 3]> {
        let [low, high] = Level::central(student, ONE_SD);
        self.at(student, 0.0, [low, Level::new(student, 0.5), high])
    }

    /// The mixture's quantiles; `None` without models that hold the column.
    fn at<const N: usize>(
        &self,
        student: &StudentT,
        spike: f64,
        levels: [Level; N],
    ) -> Option<[f64; N]> {
        let mass: f64 = self.weights.iter().sum();
        if mass <= 0.0 {
            return None;
        }
        let weights: Vec<f64> = self.weights.iter().map(|w| w / mass).collect();
        let mixture = Mixture {
            weights: &weights,
            locations: &self.locations,
            scales: &self.scales,
            spike,
        };
        Some(levels.map(|level| mixture.quantile(student, level).max(self.lower)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posterior::Method;

    /// A matrix with these numbers on its diagonal and 0 elsewhere.
    fn diagonal(numbers: Vec<f64>) -> Vec<f64> {
        let size = numbers.len();
        let mut matrix = vec![0.0; size * size];
        for (i, number) in numbers.into_iter().enumerate() {
            matrix[i * size + i] = number;
        }
        matrix
    }

    /// Two columns, three models, numbers chosen so that everything has a closed form.
    fn posterior(unit: f64) -> Posterior {
        // A = diag(4, 25) in unit columns; β's unit is 1/unit of the column's.
        let (m1, m2) = (2.0 / unit, -0.5);
        let factor = |members: &[u32]| {
            let roots = members.iter();
            diagonal(
                roots
                    .map(|&k| if k == 0 { 2.0 * unit } else { 5.0 })
                    .collect(),
            )
        };
        let model = |members: &[u32], weight: f64| Model {
            members: members.to_vec(),
            weight,
            scale: 3.0,
            mean: members
                .iter()
                .map(|&k| if k == 0 { m1 } else { m2 })
                .collect(),
            factor: factor(members),
            sites: Vec::new(),
        };
        let shape: f64 = 11.0;
        let phi = 3.0 / (shape - 1.0);
        let pips = [0.8, 0.3];
        let moments = |pip: f64, mean: f64, variance: f64| {
            let first: f64 = pip * mean;
            (
                first,
                (pip * (variance + mean * mean) - first * first).sqrt(),
            )
        };
        let (mean0, sd0) = moments(pips[0], m1, phi / (4.0 * unit * unit));
        let (mean1, sd1) = moments(pips[1], m2, phi / 25.0);
        Posterior {
            component: vec![0, 1],
            inclusion: pips.to_vec(),
            inclusion_mcse: vec![0.0; 2],
            mean: vec![mean0, mean1],
            sd: vec![sd0, sd1],
            shape,
            noise: phi,
            models: vec![
                model(&[0], 0.6),
                model(&[0, 1], 0.2),
                model(&[1], 0.1),
                model(&[], 0.1),
            ],
            models_mass: 1.0,
            log_evidence: Some(0.0),
            method: Method::Exact { models: 4 },
        }
    }

    #[test]
    fn conditional_moments_are_those_of_the_models() {
        let rows = summarise(&posterior(1.0));
        let phi: f64 = 0.3;
        assert!((rows[0].conditional_mean.unwrap() - 2.0).abs() < 1e-14);
        assert!((rows[0].conditional_sd.unwrap() - (phi / 4.0).sqrt()).abs() < 1e-13);
        assert!((rows[1].conditional_mean.unwrap() + 0.5).abs() < 1e-14);
        assert!((rows[1].conditional_sd.unwrap() - (phi / 25.0).sqrt()).abs() < 1e-13);
        assert!(rows[0].selected && !rows[1].selected);
    }

    #[test]
    fn the_interval_is_the_closed_form_of_spike_plus_one_t() {
        let rows = summarise(&posterior(1.0));
        let student = StudentT::new(22.0);
        // Column 0: spike 0.2 at 0 and 0.8 of t(2, √(3/11/4)); 2.5 % falls left of the t's bulk, into the spike's left edge.
        let scale = (3.0_f64 / 11.0 / 4.0).sqrt();
        assert_eq!(rows[0].interval95[0], 0.0);
        let wanted = 2.0 + scale * student.quantile(1.0 - 0.025 / 0.8);
        assert!((rows[0].interval95[1] - wanted).abs() < 1e-11);
        // Column 1: spike 0.7, the t left of 0.
        let scale = (3.0_f64 / 11.0 / 25.0).sqrt();
        assert!(
            (rows[1].interval95[0] - (-0.5 + scale * student.quantile(0.025 / 0.3))).abs() < 1e-11
        );
        assert_eq!(rows[1].interval95[1], 0.0);
    }

    /// Three models agree and a light one lies far off: the sd is the light one's doing, what is told is not.
    #[test]
    fn a_light_model_far_off_moves_the_sd_and_neither_median_nor_interval() {
        let mut posterior = posterior(1.0);
        posterior.models[1].mean[0] = 40.0;
        posterior.models[1].weight = 0.006;
        posterior.models[0].weight = 0.794;
        let share = 0.006 / 0.8;
        let scale = (3.0_f64 / 11.0 / 4.0).sqrt();
        let variance = scale * scale * 22.0 / 20.0;
        let mean = 2.0 + share * 38.0;
        posterior.mean[0] = 0.8 * mean;
        let second = variance + (1.0 - share) * 4.0 + share * 1600.0;
        posterior.sd[0] = (0.8 * second - posterior.mean[0].powi(2)).sqrt();
        let row = summarise(&posterior)[0];
        assert!(row.conditional_sd.unwrap() > 3.0, "{row:?}");
        // The median of the heavy models' t and the light ones far above: its quantile at 0.5/(1 − share), and so the ends.
        let student = StudentT::new(22.0);
        let at = |level: f64| 2.0 + scale * student.quantile(level / (1.0 - share));
        assert!((row.conditional_median.unwrap() - at(0.5)).abs() < 1e-9);
        let [low, high] = row.conditional_interval68.unwrap();
        assert!((low - at(0.5 - 0.5 * ONE_SD)).abs() < 1e-9, "{row:?}");
        assert!((high - at(0.5 + 0.5 * ONE_SD)).abs() < 1e-9, "{row:?}");
        assert!(0.5 * (high - low) < 0.28);
    }

    #[test]
    fn scaling_a_column_scales_its_coefficient_and_nothing_else() {
        let (one, other) = (summarise(&posterior(1.0)), summarise(&posterior(1e6)));
        assert_eq!(one[1], other[1]);
        assert_eq!(one[0].pip, other[0].pip);
        let close = |a: f64, b: f64| (a * 1e-6 - b).abs() <= 1e-11 * b.abs();
        assert!(close(one[0].mean, other[0].mean) && close(one[0].sd, other[0].sd));
        assert!(close(one[0].interval95[1], other[0].interval95[1]));
        assert!(close(
            one[0].conditional_sd.unwrap(),
            other[0].conditional_sd.unwrap()
        ));
    }

    #[test]
    fn a_column_that_is_never_included_has_no_conditional_numbers() {
        let mut posterior = posterior(1.0);
        posterior.inclusion[1] = 0.0;
        posterior.mean[1] = 0.0;
        posterior.sd[1] = 0.0;
        posterior.models.truncate(1);
        let row = summarise(&posterior)[1];
        assert_eq!(
            (row.conditional_mean, row.conditional_sd, row.interval95),
            (None, None, [0.0; 2])
        );
        assert_eq!(
            (row.conditional_median, row.conditional_interval68),
            (None, None)
        );
        assert!(!row.selected);
    }
}
