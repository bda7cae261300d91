//! Simulation-based calibration (Talts et al. 2018): parameters from the prior, data from the parameters, posterior from
//! the data. If the posterior is right, its statements about the parameters come true as often as it says.
//!
//! This catches what a comparison with the same formula cannot: a wrong prior, a missing constant per model, a
//! factor in the wrong units.

use super::Source;
use twincal::infer::{Choice, InferenceSettings, infer};
use twincal::posterior::{Model, Posterior, Problem};
use twincal::prior::{Inclusion, Prior};

const SIZE: usize = 8;
const ROWS: usize = 25;

/// What the data are drawn from.
struct Truth {
    included: [bool; SIZE],
    beta: [f64; SIZE],
    phi: f64,
}

impl Truth {
    /// A draw from the prior: φ = b0/Gamma(a0); the urn of each family.
    fn of(prior: &Prior, source: &mut Source) -> Self {
        let phi = prior.scale / source.gamma(6);
        let (mut seen, mut inside) = ([0, 0], [0, 0]);
        let mut truth = Self {
            included: [false; SIZE],
            beta: [0.0; SIZE],
            phi,
        };
        for k in 0..SIZE {
            let family = prior.family[k];
            let p = match prior.inclusion {
                Inclusion::Probability(p) => p,
                Inclusion::ExpectedTerms(terms) => {
                    let b = SIZE as f64 / terms - 1.0;
                    (1.0 + f64::from(inside[family])) / (1.0 + b + f64::from(seen[family]))
                }
            };
            truth.included[k] = source.uniform() < p;
            seen[family] += 1;
            inside[family] += i32::from(truth.included[k]);
            if truth.included[k] {
                truth.beta[k] = (phi * prior.slab[k]).sqrt() * source.normal();
            }
        }
        truth
    }
}

/// One draw from the joint distribution of parameters and data; two families, correlated columns.
fn simulate(source: &mut Source, inclusion: Inclusion) -> (Truth, Problem) {
    let prior = Prior::single(
        (0..SIZE)
            .map(|k| 0.4 * f64::powi(2.0, k as i32 - 4))
            .collect(),
        (0..SIZE).map(|k| k % 2).collect(),
        inclusion,
        (3.0, 2.0),
    );
    let truth = Truth::of(&prior, source);
    let (mut gram, mut xy, mut yy) = (vec![0.0; SIZE * SIZE], vec![0.0; SIZE], 0.0);
    for _ in 0..ROWS {
        let common = source.normal();
        let x: [f64; SIZE] = std::array::from_fn(|_| 0.6 * common + 0.8 * source.normal());
        let signal: f64 = x.iter().zip(&truth.beta).map(|(x, beta)| x * beta).sum();
        let y = signal + truth.phi.sqrt() * source.normal();
        for i in 0..SIZE {
            xy[i] += x[i] * y;
            (0..SIZE).for_each(|j| gram[i * SIZE + j] += x[i] * x[j]);
        }
        yy += y * y;
    }
    let names = (0..SIZE).map(|k| format!("x{k}")).collect();
    (
        truth,
        Problem {
            gram,
            xy,
            yy,
            n: ROWS as f64,
            log_constant: 0.0,
            prior,
            names,
        },
    )
}

/// What is included in truth, and the data that came of it.
pub(super) fn draw_problem(source: &mut Source, inclusion: Inclusion) -> ([bool; SIZE], Problem) {
    let (truth, problem) = simulate(source, inclusion);
    (truth.included, problem)
}

/// Predicted probabilities and what happened, in ten bins.
#[derive(Default)]
struct Reliability {
    predicted: [f64; 10],
    variance: [f64; 10],
    happened: [f64; 10],
    count: [f64; 10],
}

impl Reliability {
    fn add(&mut self, p: f64, happened: bool) {
        let bin = ((p * 10.0) as usize).min(9);
        self.predicted[bin] += p;
        self.variance[bin] += p * (1.0 - p);
        self.happened[bin] += f64::from(happened);
        self.count[bin] += 1.0;
    }

    /// No bin off by more than `limit` standard errors.
    fn check(&self, limit: f64) {
        for bin in 0..10 {
            let off = self.happened[bin] - self.predicted[bin];
            let error = (self.variance[bin] + 1e-6).sqrt();
            assert!(
                off.abs() <= limit * error,
                "bin {bin}: {} predicted, {} happened of {}",
                self.predicted[bin],
                self.happened[bin],
                self.count[bin]
            );
        }
    }
}

/// One draw of β_k from the mixture of models.
fn draw(source: &mut Source, posterior: &Posterior, k: usize) -> f64 {
    let mut target = source.uniform();
    let model: &Model = posterior
        .models
        .iter()
        .find(|m| {
            target -= m.weight;
            target < 0.0
        })
        .unwrap_or(&posterior.models[0]);
    let Some(place) = model.members.iter().position(|&j| j as usize == k) else {
        return 0.0;
    };
    // a_n = 3 + 25/2: β = μ + √φ L⁻ᵀ ε
    assert!((posterior.shape - 15.5).abs() < 1e-12);
    let phi = model.scale / source.gamma(31);
    let m = model.members.len();
    let mut x: Vec<f64> = (0..m).map(|_| source.normal()).collect();
    for i in (0..m).rev() {
        x[i] /= model.factor[i * m + i];
        for j in 0..i {
            x[j] -= model.factor[i * m + j] * x[i];
        }
    }
    model.mean[place] + phi.sqrt() * x[place]
}

/// 20 000 PIPs against what was included, ranks of true coefficients among posterior draws, and the noise.
///
/// False alarm: 4.5 standard errors in 20 bins 1.4e-4, χ² with 19 degrees of freedom beyond 55 2e-5, two more
/// statistics at 4.5 standard errors 2e-5; the seed is fixed.
#[test]
fn exact_posteriors_are_calibrated() {
    let settings = InferenceSettings {
        method: Choice::Exact,
        chains: 1,
        draws: 100,
        seed: 1,
        allow_disagreement: false,
    };
    for (seed, inclusion) in [
        (1, Inclusion::Probability(0.3)),
        (2, Inclusion::ExpectedTerms(2.5)),
    ] {
        let mut source = Source::new(seed);
        let mut reliability = Reliability::default();
        let mut ranks = [0.0f64; 20];
        let (mut noise, mut spread) = (Vec::new(), Vec::new());
        let runs = 1250;
        for run in 0..runs {
            let (truth, problem) = simulate(&mut source, inclusion);
            let posterior = infer(&problem, &settings).unwrap();
            let mut excess = 0.0;
            for k in 0..SIZE {
                reliability.add(posterior.inclusion[k], truth.included[k]);
                excess += (truth.beta[k] - posterior.mean[k]).powi(2) - posterior.sd[k].powi(2);
            }
            spread.push(excess / posterior.noise);
            noise.push(truth.phi / posterior.noise - 1.0);
            // Rank of the truth among 19 draws, ties (exact zeros) broken at random.
            let k = run % SIZE;
            let others: Vec<f64> = (0..19).map(|_| draw(&mut source, &posterior, k)).collect();
            let below = others.iter().filter(|&&x| x < truth.beta[k]).count();
            let ties = others.iter().filter(|&&x| x == truth.beta[k]).count();
            ranks[below + (source.uniform() * (ties + 1) as f64) as usize] += 1.0;
        }
        reliability.check(4.5);
        let each = f64::from(runs as u32) / 20.0;
        let chi2: f64 = ranks.iter().map(|r| (r - each).powi(2) / each).sum();
        assert!(chi2 < 55.0, "ranks {ranks:?}: chi-squared {chi2}");
        // Given the data, both have mean 0.
        for (what, values) in [("noise", noise), ("squared errors", spread)] {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let error = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>()).sqrt() / n;
            assert!(mean.abs() < 4.5 * error, "{what}: {mean} ± {error}");
        }
    }
}

/// The sampler's PIPs come true, too: 200 data sets, 1600 PIPs, 4.5 standard errors (false alarm 1e-4, fixed seed).
#[test]
fn sampled_posteriors_are_calibrated() {
    let settings = InferenceSettings {
        method: Choice::Gibbs,
        chains: 2,
        draws: 300,
        seed: 5,
        allow_disagreement: true,
    };
    let mut source = Source::new(3);
    let mut reliability = Reliability::default();
    for _ in 0..200 {
        let (truth, problem) = simulate(&mut source, Inclusion::ExpectedTerms(2.5));
        let posterior = infer(&problem, &settings).unwrap();
        (0..SIZE).for_each(|k| reliability.add(posterior.inclusion[k], truth.included[k]));
    }
    reliability.check(4.5);
}
