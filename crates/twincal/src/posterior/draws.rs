//! Joint posterior draws of structure, noise and coefficients (paper fig. 3; method section 7).

use super::bounded::Law;
use super::{Model, Posterior};
use crate::random::Random;
use std::sync::OnceLock;

/// Independent draws from p(z, φ, β | y).
#[derive(Debug, Clone, PartialEq)]
pub struct CoefficientDraws {
    /// Index in `posterior.models` of each draw's structure z.
    pub models: Vec<u32>,
    /// φ of each draw, (N·m)².
    pub noise: Vec<f64>,
    /// β of each draw, `beta[draw * columns + k]`; exactly 0 where k is not in z.
    pub beta: Vec<f64>,
    /// K.
    pub columns: usize,
}

/// Draws from one posterior. What drawing from a model needs is worked out when the model first comes up, once for all draws.
#[derive(Debug)]
pub struct Drawer<'a> {
    posterior: &'a Posterior,
    laws: Vec<OnceLock<Law>>,
}

impl<'a> Drawer<'a> {
    /// Ready to draw; nothing is worked out yet.
    #[must_use]
    pub fn new(posterior: &'a Posterior) -> Self {
        Self {
            posterior,
            laws: posterior.models.iter().map(|_| OnceLock::new()).collect(),
        }
    }

    /// `count` independent draws: z by model weight, φ | z ~ InvGamma(a_n, b_n), then β_z = μ_z + √φ L⁻ᵀ ε with A_z = L Lᵀ.
    ///
    /// Coefficients with bounds ([`super::Site`]) come from the normal distribution of the model cut off there.
    ///
    /// Draw `i` depends only on `seed`, `stream` and the draws before it, never on threads. A posterior without models (it
    /// cannot come from inference) gives no draws.
    ///
    /// # Example
    /// Mean and spread of the draws are those of the posterior; the same seed gives the same draws.
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// use twincal::posterior::draws::draw;
    ///
    /// # let fit = two_link::study()?;
    /// let posterior = &fit.twin().posterior;
    /// let draws = draw(posterior, 4000, 1, 0);
    /// let hidden: Vec<f64> = draws.beta.iter().step_by(draws.columns).copied().collect(); // column 0
    /// let mean = hidden.iter().sum::<f64>() / 4000.0;
    /// let sd = posterior.sd[0] / 4000_f64.sqrt(); // of that mean
    /// assert!((mean - posterior.mean[0]).abs() < 5.0 * sd);
    /// assert_eq!(draw(posterior, 4000, 1, 0), draws);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    #[must_use]
    pub fn draw(&self, count: usize, seed: u64, stream: u64) -> CoefficientDraws {
        self.draw_given(|_| true, count, seed, stream)
    }

    /// [`Self::draw`] given that z is one of the models that `holds` says yes to; no draws if there is none.
    #[must_use]
    pub fn draw_given(
        &self,
        holds: impl Fn(&Model) -> bool,
        count: usize,
        seed: u64,
        stream: u64,
    ) -> CoefficientDraws {
        let posterior = self.posterior;
        let columns = posterior.inclusion.len();
        let mut random = Random::new(seed, stream);
        let mut draws = CoefficientDraws {
            models: Vec::new(),
            noise: Vec::new(),
            beta: Vec::new(),
            columns,
        };
        let models = posterior.models.iter().enumerate();
        let (among, cumulative): (Vec<usize>, Vec<f64>) = models
            .filter(|(_, model)| holds(model))
            .scan(0.0, |sum, (index, model)| {
                *sum += model.weight;
                Some((index, *sum))
            })
            .unzip();
        let Some(last) = among.len().checked_sub(1) else {
            return draws;
        };
        draws.beta = vec![0.0; count * columns];
        let mut direction = Vec::new();
        for row in 0..count {
            let level = random.uniform() * cumulative[last];
            let index = among[cumulative.partition_point(|&sum| sum < level).min(last)];
            let model = &posterior.models[index];
            let phi = random.inverse_gamma(posterior.shape, model.scale);
            let size = model.members.len();
            direction.clear();
            direction.extend((0..size).map(|_| random.normal()));
            let law = self.laws[index].get_or_init(|| Law::new(model));
            law.factor.solve_upper(&mut direction);
            for (x, mean) in direction.iter_mut().zip(&law.mean) {
                *x = mean + phi.sqrt() * *x;
            }
            law.cut_off(&mut direction, phi, &mut random);
            for (&column, x) in model.members.iter().zip(&direction) {
                draws.beta[row * columns + column as usize] = *x;
            }
            draws.models.push(index as u32);
            draws.noise.push(phi);
        }
        draws
    }
}

/// [`Drawer::draw`] for those who draw once.
#[must_use]
pub fn draw(posterior: &Posterior, count: usize, seed: u64, stream: u64) -> CoefficientDraws {
    Drawer::new(posterior).draw(count, seed, stream)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posterior::Method;
    use crate::posterior::student::StudentT;

    fn posterior() -> Posterior {
        // A = [[4, 2], [2, 10]] with L = [[2, 0], [1, 3]].
        let full = Model {
            members: vec![0, 2],
            weight: 0.7,
            scale: 6.0,
            mean: vec![1.0, -2.0],
            factor: vec![2.0, 0.0, 1.0, 3.0],
            sites: Vec::new(),
        };
        let small = Model {
            members: vec![1],
            weight: 0.3,
            scale: 8.0,
            mean: vec![0.5],
            factor: vec![2.0],
            sites: Vec::new(),
        };
        Posterior {
            component: vec![0, 1, 2],
            inclusion: vec![0.7, 0.3, 0.7],
            inclusion_mcse: vec![0.0; 3],
            mean: vec![0.7, 0.15, -1.4],
            sd: vec![1.0; 3],
            shape: 6.0,
            noise: 1.32,
            models: vec![full, small],
            models_mass: 1.0,
            log_evidence: None,
            method: Method::Exact { models: 8 },
        }
    }

    const COUNT: usize = 20_000;

    /// False alarm about 1e-4 per |z| > 4 or KS > 2.225; six checks, fixed seed.
    #[test]
    fn draws_have_the_weights_covariance_and_t_margins_of_the_posterior() {
        let draws = draw(&posterior(), COUNT, 5, 1);
        let chosen = draws.models.iter().filter(|&&m| m == 0).count() as f64;
        let n = COUNT as f64;
        assert!(((chosen / n - 0.7) / (0.21 / n).sqrt()).abs() < 4.0);
        // Given model 0, β_0 is t with 12 degrees of freedom, scale² (6/6)(A⁻¹)_00 = 10/36.
        let student = StudentT::new(12.0);
        for (column, location, variance) in [(0, 1.0, 10.0_f64 / 36.0), (2, -2.0, 4.0 / 36.0)] {
            let mut values: Vec<f64> = (0..COUNT)
                .filter(|&i| draws.models[i] == 0)
                .map(|i| student.cdf((draws.beta[i * 3 + column] - location) / variance.sqrt()))
                .collect();
            values.sort_by(f64::total_cmp);
            let m = values.len() as f64;
            let worst = values
                .iter()
                .enumerate()
                .fold(0.0_f64, |w, (i, p)| w.max((p - (i as f64 + 0.5) / m).abs()));
            assert!(
                worst * m.sqrt() < 2.225,
                "column {column}: {}",
                worst * m.sqrt()
            );
        }
        // Covariance given φ: φ · (−2/36); standardised by φ it is a sum of products of normals with correlation
        // −2/√40, whose variance is 1 + ρ² each.
        let rho = -2.0 / 40.0_f64.sqrt();
        let products: Vec<f64> = (0..COUNT)
            .filter(|&i| draws.models[i] == 0)
            .map(|i| {
                let (a, b) = (draws.beta[i * 3] - 1.0, draws.beta[i * 3 + 2] + 2.0);
                a * b / draws.noise[i] / (40.0_f64.sqrt() / 36.0)
            })
            .collect();
        let m = products.len() as f64;
        let z = (products.iter().sum::<f64>() / m - rho) / ((1.0 + rho * rho) / m).sqrt();
        assert!(z.abs() < 4.0, "{z}");
    }

    #[test]
    fn excluded_coefficients_are_exactly_zero_and_streams_differ() {
        let draws = draw(&posterior(), 200, 5, 1);
        for i in 0..200 {
            let row = &draws.beta[i * 3..i * 3 + 3];
            if draws.models[i] == 0 {
                assert!(row[1] == 0.0 && row[0] != 0.0 && row[2] != 0.0);
            } else {
                assert!(row[0] == 0.0 && row[2] == 0.0 && row[1] != 0.0);
            }
        }
        assert_eq!(draws, draw(&posterior(), 200, 5, 1));
        assert_ne!(draws, draw(&posterior(), 200, 5, 2));
        assert_eq!(draw(&posterior(), 100, 5, 1).beta[..], draws.beta[..300]);
    }

    /// What is drawn given a condition has the law of a posterior in which only such models are.
    #[test]
    fn draws_given_a_condition_are_those_of_the_models_that_meet_it() {
        let posterior = posterior();
        let drawer = Drawer::new(&posterior);
        let given = drawer.draw_given(|model| model.members.contains(&1), 300, 5, 1);
        assert!(given.models.iter().all(|&model| model == 1));
        let alone = Posterior {
            models: posterior.models[1..].to_vec(),
            ..posterior.clone()
        };
        assert_eq!(draw(&alone, 300, 5, 1).beta, given.beta);
        assert_eq!(drawer.draw(300, 5, 1), draw(&posterior, 300, 5, 1));
        assert!(drawer.draw_given(|_| false, 300, 5, 1).models.is_empty());
    }
}
