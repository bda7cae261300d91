//! The posterior of a fleet against brute force: all models of the type times all states of all units, each by the density of the data
//! under its own covariance.

use super::deviations::State;
use super::hierarchy::{Hierarchy, SCALES, Scatter, UnitSums, Window, dot};
use super::posterior::{FleetPosterior, Length, sample};
use crate::linear_algebra::Cholesky;
use crate::prior::{Inclusion, Prior};
use crate::random::Random;
use rayon::prelude::*;

/// Candidates.
const COLUMNS: usize = 6;
const WINDOWS: usize = 2;

/// Units whose last but one candidates may deviate, from random rows.
fn small(units: usize, deviating: usize, seed: u64) -> Hierarchy {
    let mut random = Random::new(seed, 0);
    let mu = [0.9, 0.0, -0.5, 0.0, 0.0, 0.25];
    let window = |index: usize, beta: &[f64], random: &mut Random| {
        let (mut precision, mut score) = (vec![0.0; COLUMNS * COLUMNS], vec![0.0; COLUMNS]);
        for _ in 0..14 {
            let shared = random.normal();
            let x: Vec<f64> = (0..COLUMNS)
                .map(|_| 0.5 * shared + random.normal())
                .collect();
            let y = dot(&x, beta) + random.normal();
            for i in 0..COLUMNS {
                score[i] += x[i] * y;
                (0..COLUMNS).for_each(|k| precision[i * COLUMNS + k] += x[i] * x[k]);
            }
        }
        Window {
            index,
            precision,
            score,
        }
    };
    let units = (0..units)
        .map(|unit| {
            let beta: Vec<f64> = mu.iter().map(|mu| mu + 0.2 * random.normal()).collect();
            let windows = (0..WINDOWS).map(|index| {
                let mut own = beta.clone();
                if unit == 1 && index == 1 {
                    own[0] += 0.9;
                }
                window(index, &own, &mut random)
            });
            UnitSums {
                windows: windows.collect(),
            }
        })
        .collect();
    let prior = Prior::single(
        vec![1.0; COLUMNS],
        vec![0; COLUMNS],
        Inclusion::Probability(0.3),
        (1.0, 1.0),
    );
    Hierarchy {
        units,
        prior,
        columns: (0..COLUMNS).map(|k| vec![k]).collect(),
        names: (0..COLUMNS).map(|k| format!("c{k}")).collect(),
        odds: (0..COLUMNS)
            .map(|k| f64::from(u8::from(k < deviating)))
            .collect(),
        plug_in: Scatter {
            variance: vec![0.04, 0.01, 0.04, 0.09, 0.02, 0.04],
            windows: vec![0.02, 0.04, 0.01, 0.01, 0.03, 0.02],
            share: 0.15,
        },
    }
}

/// What enumeration says.
struct Truth {
    /// P(z_k = 1).
    inclusion: Vec<f64>,
    /// P(w = 1) by unit and component.
    deviates: Vec<Vec<f64>>,
    /// P(w = 1, s = 1) likewise.
    late: Vec<Vec<f64>>,
    /// P(a unit deviates).
    any: Vec<f64>,
    /// E[μ].
    mu: Vec<f64>,
}

/// State of one component of one unit: none, or (start, scale).
fn states() -> Vec<(Option<(usize, usize)>, f64)> {
    let share = 0.15;
    let mut all = vec![(None, 1.0 - share)];
    for start in 0..WINDOWS {
        let of_start = 0.5;
        for scale in 0..SCALES.len() {
            all.push((Some((start, scale)), share * of_start / SCALES.len() as f64));
        }
    }
    all
}

/// Everything that is added up: each model of the type with each combination of states of some components over some units.
struct Enumeration<'a> {
    hierarchy: &'a Hierarchy,
    /// Components that may deviate.
    deviating: usize,
    states: Vec<(Option<(usize, usize)>, f64)>,
    /// L of every unit and window, with Λ = L Lᵀ: z_ut = L⁻¹ η is Lᵀβ with unit noise.
    roots: Vec<Vec<f64>>,
    /// All z_ut, one after the other.
    z: Vec<f64>,
}

/// One model with one combination of states: ln of its density times its prior, and E[μ].
struct Weighed {
    model: usize,
    combination: usize,
    log: f64,
    mu: Vec<f64>,
}

impl<'a> Enumeration<'a> {
    fn new(hierarchy: &'a Hierarchy, deviating: usize) -> Self {
        let windows = hierarchy.units.iter().flat_map(|unit| &unit.windows);
        let whitened = |window: &Window| {
            let factor = Cholesky::new(&window.precision, COLUMNS).unwrap();
            let mut z = window.score.clone();
            factor.solve_lower(&mut z);
            (factor.lower().to_vec(), z)
        };
        let (roots, z): (Vec<Vec<f64>>, Vec<Vec<f64>>) = windows.map(whitened).unzip();
        Self {
            hierarchy,
            deviating,
            states: states(),
            roots,
            z: z.concat(),
        }
    }

    /// States of a combination, by digits: unit, component, state and its prior.
    fn digits(
        &self,
        combination: usize,
    ) -> impl Iterator<Item = (usize, usize, Option<(usize, usize)>, f64)> {
        let mut left = combination;
        (0..self.hierarchy.units.len() * self.deviating).map(move |digit| {
            let (state, prior) = self.states[left % self.states.len()];
            left /= self.states.len();
            (digit / self.deviating, digit % self.deviating, state, prior)
        })
    }

    /// Row k of L of a cell, a unit in a window.
    fn row(&self, cell: usize, k: usize) -> &[f64] {
        &self.roots[cell][k * COLUMNS..(k + 1) * COLUMNS]
    }

    /// Adds to the covariance of z a variance of β_k that two cells share.
    fn spread(&self, matrix: &mut [f64], [a, b]: [usize; 2], k: usize, variance: f64) {
        let size = self.z.len();
        for i in 0..=k {
            for j in 0..=k {
                matrix[(a * COLUMNS + i) * size + b * COLUMNS + j] +=
                    variance * self.row(a, k)[i] * self.row(b, k)[j];
            }
        }
    }

    /// Covariance of z with the coefficients of one model of the type, and ln of its prior.
    fn of_type(&self, model: usize) -> (Vec<f64>, f64) {
        let (size, cells) = (self.z.len(), self.roots.len());
        let plug_in = &self.hierarchy.plug_in;
        let mut matrix = vec![0.0; size * size];
        (0..size).for_each(|i| matrix[i * size + i] = 1.0);
        let mut log = 0.0;
        for k in 0..COLUMNS {
            let inside = model >> k & 1 == 1;
            log += f64::ln(if inside { 0.3 } else { 0.7 });
            for a in 0..cells {
                for b in 0..cells {
                    let mut variance = f64::from(u8::from(inside));
                    if a / WINDOWS == b / WINDOWS {
                        variance += plug_in.variance[k];
                    }
                    if a == b {
                        variance += plug_in.windows[k];
                    }
                    self.spread(&mut matrix, [a, b], k, variance);
                }
            }
        }
        (matrix, log)
    }

    fn weigh(&self, model: usize, combination: usize) -> Weighed {
        let (mut matrix, mut log) = self.of_type(model);
        for (unit, k, state, prior) in self.digits(combination) {
            log += prior.ln();
            let Some((start, scale)) = state else {
                continue;
            };
            let cell = |window: usize| unit * WINDOWS + window;
            for a in start..WINDOWS {
                for b in start..WINDOWS {
                    self.spread(&mut matrix, [cell(a), cell(b)], k, SCALES[scale]);
                }
            }
        }
        let factor = Cholesky::new(&matrix, self.z.len()).unwrap();
        let mut half = self.z.clone();
        factor.solve_lower(&mut half);
        log -= 0.5 * (factor.log_determinant() + dot(&half, &half));
        factor.solve_upper(&mut half);
        // E[μ_k] = Σ over cells of the row of L times the solved data.
        let mu = (0..COLUMNS).map(|k| {
            let inside = f64::from(u8::from(model >> k & 1 == 1));
            let solved = half.chunks_exact(COLUMNS).enumerate();
            inside
                * solved
                    .map(|(cell, half)| dot(self.row(cell, k), half))
                    .sum::<f64>()
        });
        Weighed {
            model,
            combination,
            log,
            mu: mu.collect(),
        }
    }

    /// All models with all combinations.
    fn weighed(&self) -> Vec<Weighed> {
        let models = 1 << COLUMNS;
        let digits = self.hierarchy.units.len() * self.deviating;
        let combinations = self.states.len().pow(digits as u32);
        (0..models * combinations)
            .into_par_iter()
            .map(|at| self.weigh(at % models, at / models))
            .collect()
    }
}

/// Probabilities over all that is enumerated.
fn enumerate(hierarchy: &Hierarchy, deviating: usize) -> Truth {
    let enumeration = Enumeration::new(hierarchy, deviating);
    let all = enumeration.weighed();
    let units = hierarchy.units.len();
    let largest = all
        .iter()
        .map(|weighed| weighed.log)
        .fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = all
        .iter()
        .map(|weighed| (weighed.log - largest).exp())
        .sum();
    let mut truth = Truth {
        inclusion: vec![0.0; COLUMNS],
        deviates: vec![vec![0.0; deviating]; units],
        late: vec![vec![0.0; deviating]; units],
        any: vec![0.0; units],
        mu: vec![0.0; COLUMNS],
    };
    for weighed in &all {
        let weight = (weighed.log - largest).exp() / total;
        for k in 0..COLUMNS {
            truth.inclusion[k] += weight * f64::from(u8::from(weighed.model >> k & 1 == 1));
            truth.mu[k] += weight * weighed.mu[k];
        }
        let mut any = vec![false; units];
        for (unit, k, state, _) in enumeration.digits(weighed.combination) {
            if let Some((start, _)) = state {
                any[unit] = true;
                truth.deviates[unit][k] += weight;
                truth.late[unit][k] += weight * start as f64;
            }
        }
        for (sum, any) in truth.any.iter_mut().zip(any) {
            *sum += weight * f64::from(u8::from(any));
        }
    }
    truth
}

fn sampled(hierarchy: &Hierarchy, iterations: usize) -> FleetPosterior {
    let length = Length {
        chains: 2,
        iterations,
        seed: 7,
    };
    let states = vec![State::default(); hierarchy.units.len()];
    sample(hierarchy, states, length, &|_, _| Ok(())).unwrap()
}

/// Largest differences over 2 × 4000 iterations; probabilities of this size have a Monte Carlo standard error of at most 0.006 with the
/// autocorrelation seen, so that 0.025 is passed by chance with a probability below 1e-4.
fn compare(units: usize, deviating: usize, seed: u64) {
    let hierarchy = small(units, deviating, seed);
    let truth = enumerate(&hierarchy, deviating);
    let found = sampled(&hierarchy, 4000);
    let near = |what: &str, a: f64, b: f64| {
        assert!(
            (a - b).abs() < 0.025,
            "{what}: sampled {a:.4}, enumerated {b:.4}"
        );
    };
    for k in 0..COLUMNS {
        near(&format!("z{k}"), found.inclusion[k], truth.inclusion[k]);
        let draws = found.mu.len() as f64;
        let mean = found.mu.iter().map(|mu| mu[k]).sum::<f64>() / draws;
        near(&format!("mu{k}"), mean, truth.mu[k]);
    }
    for (unit, own) in found.units.iter().enumerate() {
        near(&format!("unit {unit}"), own.deviates, truth.any[unit]);
        for k in 0..deviating {
            near(
                &format!("unit {unit} c{k}"),
                own.inclusion[k],
                truth.deviates[unit][k],
            );
            near(
                &format!("unit {unit} c{k} late"),
                own.starts[k][1],
                truth.late[unit][k],
            );
        }
    }
    // The test is of something: probabilities that are neither 0 nor 1.
    let open = |p: &f64| *p > 0.05 && *p < 0.95;
    assert!(truth.inclusion.iter().any(open) && truth.any.iter().any(open));
}

#[test]
fn four_units_with_six_candidates_equal_brute_force() {
    compare(4, 1, 3);
}

#[test]
fn two_deviating_candidates_of_a_unit_equal_brute_force() {
    compare(2, 2, 5);
}

/// A unit without the second window, and scores of a change against their definition.
#[test]
fn a_missing_window_is_no_window() {
    let mut hierarchy = small(3, 2, 11);
    hierarchy.units[2].windows.remove(0);
    let found = sampled(&hierarchy, 50);
    assert_eq!(found.units[2].starts[0].len(), 1);
    let mut means = found
        .units
        .iter()
        .flat_map(|unit| unit.means.iter().flatten());
    assert!(means.all(|x| x.is_finite()));
}

/// The same bytes on any number of threads.
#[test]
fn chains_are_the_same_on_one_thread() {
    let hierarchy = small(3, 2, 13);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let (many, one) = (
        sampled(&hierarchy, 40),
        pool.install(|| sampled(&hierarchy, 40)),
    );
    assert_eq!(many.inclusion, one.inclusion);
    assert_eq!(many.mu, one.mu);
    let units = |found: &FleetPosterior| -> Vec<(f64, Vec<Vec<f64>>)> {
        found
            .units
            .iter()
            .map(|unit| (unit.deviates, unit.means.clone()))
            .collect()
    };
    assert_eq!(units(&many), units(&one));
}
