//! What two chains say of a fleet: probabilities, draws and means.

use super::deviations::{Deviation, Prepared, State};
use super::hierarchy::{Hierarchy, UnitSums};
use super::sampler::{Chain, Iteration, UnitIteration};
use super::scatter::{of_type_of, prepared};
use crate::error::Result;
use crate::linear_algebra::Cholesky;
use crate::random::Random;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Share of a chain's iterations that settle first.
const SETTLING: usize = 4;
/// Random stream of the draws of scatter.
const STREAM: u64 = 7 << 60;

/// Posterior of the hierarchy given its plug-ins.
#[derive(Debug, Clone)]
pub(super) struct FleetPosterior {
    /// P(z = 1) of each column.
    pub(super) inclusion: Vec<f64>,
    /// Draws of μ, K each.
    pub(super) mu: Vec<Vec<f64>>,
    pub(super) units: Vec<UnitPosterior>,
    /// Largest difference of P(a unit deviates) between the chains.
    pub(super) spread: f64,
}

/// Of one unit.
#[derive(Debug, Clone, Default)]
pub(super) struct UnitPosterior {
    /// P(any component deviates).
    pub(super) deviates: f64,
    /// P(w = 1) of each component.
    pub(super) inclusion: Vec<f64>,
    /// P(w = 1, s = start) of each component, start by start.
    pub(super) starts: Vec<Vec<f64>>,
    /// Draws of what deviates, over the columns of its component: b where it changes, δ + b where it deviates from the start.
    pub(super) draws: Vec<(Deviation, Vec<f64>)>,
    /// E[β] in each of the unit's windows, K each.
    pub(super) means: Vec<Vec<f64>>,
    /// E[β βᵀ] in the last window, K × K row-major.
    pub(super) second: Vec<f64>,
}

/// How long chains are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Length {
    pub(super) chains: usize,
    pub(super) iterations: usize,
    pub(super) seed: u64,
}

/// Runs the chains: the first from where the plug-ins were learned, the others from no deviation.
///
/// # Errors
/// Those of inference.
pub(super) fn sample(
    hierarchy: &Hierarchy,
    states: Vec<State>,
    length: Length,
    watch: &(dyn Fn(usize, usize) -> Result<()> + Sync),
) -> Result<FleetPosterior> {
    let units = prepared(hierarchy);
    let (gram, linear) = of_type_of(&units);
    let done = AtomicUsize::new(0);
    let run = |chain: usize| -> Result<Sums> {
        let stream = 100 + chain as u64;
        let mut own = Chain::new(hierarchy, &units, (&gram, &linear), (length.seed, stream));
        if chain == 0 {
            own = own.with_states(states.clone());
        }
        let settling = length.iterations / SETTLING;
        let mut sums = Sums::new(hierarchy);
        for iteration in 0..settling + length.iterations {
            let all = length.chains * (settling + length.iterations);
            watch(done.fetch_add(1, Ordering::Relaxed), all)?;
            let mut one = own.iterate()?;
            if iteration >= settling {
                sums.add(hierarchy, &units, &one);
                let seed = (length.seed, STREAM + stream * 1_000_000 + iteration as u64);
                add_scatter(&mut one, hierarchy, &units, seed);
                sums.add_draws(hierarchy, one);
            }
        }
        Ok(sums)
    };
    let chains: Vec<Sums> = (0..length.chains)
        .into_par_iter()
        .map(run)
        .collect::<Result<_>>()?;
    Ok(Sums::joined(chains))
}

/// What deviates from the start is δ + b: of b alone, scatter says what it likes.
fn add_scatter(
    one: &mut Iteration,
    hierarchy: &Hierarchy,
    units: &[Prepared],
    (seed, stream): (u64, u64),
) {
    let size = hierarchy.size();
    let mut random = Random::new(seed, stream);
    for (unit, prepared) in one.units.iter_mut().zip(units) {
        let mean = &unit.offset;
        for (own, b) in unit.deviations.iter_mut().filter(|(own, _)| own.start == 0) {
            let columns = &hierarchy.columns[own.component];
            let covariance: Vec<f64> = (columns.iter())
                .flat_map(|&i| columns.iter().map(move |&k| i * size + k))
                .map(|at| prepared.unit.posterior[at])
                .collect();
            let mut noise: Vec<f64> = columns.iter().map(|_| random.normal()).collect();
            let sds = columns
                .iter()
                .map(|&k| prepared.unit.posterior[k * size + k].sqrt());
            noise = match Cholesky::new(&covariance, columns.len()) {
                Ok(factor) => lower_times(factor.lower(), &noise),
                Err(_) => noise
                    .iter()
                    .zip(sds)
                    .map(|(noise, sd)| noise * sd)
                    .collect(),
            };
            for (&k, noise) in columns.iter().zip(noise) {
                b[k] += mean[k] + noise;
            }
        }
    }
}

/// L x.
fn lower_times(lower: &[f64], x: &[f64]) -> Vec<f64> {
    let rows = lower.chunks_exact(x.len().max(1));
    rows.map(|row| row.iter().zip(x).map(|(l, x)| l * x).sum())
        .collect()
}

/// Sums over the iterations of one chain.
#[derive(Debug, Clone, Default)]
struct Sums {
    iterations: f64,
    inclusion: Vec<f64>,
    mu: Vec<Vec<f64>>,
    units: Vec<UnitPosterior>,
}

impl Sums {
    fn new(hierarchy: &Hierarchy) -> Self {
        let (components, size) = (hierarchy.columns.len(), hierarchy.size());
        let unit = |sums: &UnitSums| UnitPosterior {
            inclusion: vec![0.0; components],
            starts: vec![vec![0.0; sums.windows.len()]; components],
            means: vec![vec![0.0; size]; sums.windows.len()],
            second: vec![0.0; size * size],
            ..UnitPosterior::default()
        };
        Self {
            inclusion: vec![0.0; size],
            units: hierarchy.units.iter().map(unit).collect(),
            ..Self::default()
        }
    }

    fn add(&mut self, hierarchy: &Hierarchy, units: &[Prepared], one: &Iteration) {
        self.iterations += 1.0;
        add(&mut self.inclusion, &one.inclusion);
        for ((sums, unit), prepared) in self.units.iter_mut().zip(&one.units).zip(units) {
            let covariance = &prepared.unit.posterior;
            sums.add(hierarchy, unit, (one.mu.last(), covariance));
        }
    }

    /// Draws of the type and of what deviates, with scatter.
    fn add_draws(&mut self, hierarchy: &Hierarchy, one: Iteration) {
        for (sums, unit) in self.units.iter_mut().zip(one.units) {
            for (deviation, b) in unit.deviations {
                let columns = hierarchy.columns[deviation.component].iter();
                sums.draws
                    .push((deviation, columns.map(|&k| b[k]).collect()));
            }
        }
        self.mu.extend(one.mu);
    }

    /// Of all chains, as averages.
    fn joined(chains: Vec<Self>) -> FleetPosterior {
        let share = |chain: &Self, unit: usize| chain.units[unit].deviates / chain.iterations;
        let units = chains.first().map_or(0, |chain| chain.units.len());
        let spread = |unit: usize| {
            let shares = chains.iter().map(|chain| share(chain, unit));
            let largest = shares.clone().fold(0.0, f64::max);
            largest - shares.fold(1.0, f64::min)
        };
        let spread = (0..units).map(spread).fold(0.0, f64::max);
        let mut sum = Self::default();
        for chain in chains {
            if sum.units.is_empty() {
                sum = chain;
                continue;
            }
            sum.iterations += chain.iterations;
            add(&mut sum.inclusion, &chain.inclusion);
            sum.mu.extend(chain.mu);
            for (own, other) in sum.units.iter_mut().zip(chain.units) {
                own.join(other);
            }
        }
        let weight = 1.0 / sum.iterations.max(1.0);
        scale(&mut sum.inclusion, weight);
        sum.units.iter_mut().for_each(|unit| unit.scale(weight));
        FleetPosterior {
            inclusion: sum.inclusion,
            mu: sum.mu,
            units: sum.units,
            spread,
        }
    }
}

impl UnitPosterior {
    /// `covariance` is that of scatter given everything else.
    fn add(
        &mut self,
        hierarchy: &Hierarchy,
        one: &UnitIteration,
        (mu, covariance): (Option<&Vec<f64>>, &[f64]),
    ) {
        self.deviates += f64::from(u8::from(!one.deviations.is_empty()));
        for (component, conditional) in one.conditional.iter().enumerate() {
            if let Some(conditional) = conditional {
                self.inclusion[component] += conditional.deviates;
                add(&mut self.starts[component], &conditional.starts);
            }
        }
        let mut base = one.offset.clone();
        if let Some(mu) = mu {
            add(&mut base, mu);
        }
        let mut own = vec![base; self.means.len()];
        for (deviation, b) in &one.deviations {
            let columns = &hierarchy.columns[deviation.component];
            for &k in columns {
                let after = own.iter_mut().skip(deviation.start);
                after.for_each(|mean| mean[k] += b[k]);
            }
        }
        for (sum, own) in self.means.iter_mut().zip(&own) {
            add(sum, own);
        }
        let last = own.last().map_or(&[][..], Vec::as_slice);
        for (i, x) in last.iter().enumerate() {
            let at = i * last.len();
            let row = self.second[at..].iter_mut().zip(&covariance[at..]);
            row.zip(last)
                .for_each(|((sum, covariance), other)| *sum += x * other + covariance);
        }
    }

    fn join(&mut self, other: Self) {
        self.deviates += other.deviates;
        add(&mut self.inclusion, &other.inclusion);
        add(&mut self.second, &other.second);
        for (own, other) in self.means.iter_mut().zip(&other.means) {
            add(own, other);
        }
        for (own, other) in self.starts.iter_mut().zip(&other.starts) {
            add(own, other);
        }
        self.draws.extend(other.draws);
    }

    fn scale(&mut self, weight: f64) {
        self.deviates *= weight;
        scale(&mut self.inclusion, weight);
        scale(&mut self.second, weight);
        self.means.iter_mut().for_each(|own| scale(own, weight));
        self.starts.iter_mut().for_each(|own| scale(own, weight));
    }
}

fn add(sum: &mut [f64], more: &[f64]) {
    sum.iter_mut()
        .zip(more)
        .for_each(|(sum, more)| *sum += more);
}

fn scale(values: &mut [f64], factor: f64) {
    values.iter_mut().for_each(|value| *value *= factor);
}
