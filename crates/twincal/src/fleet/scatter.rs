//! Plug-ins of the hierarchy: how much units scatter in each component, and how often one deviates.
//!
//! ```text
//! ω_c² = Σ_u Σ_{k∈c} E[δ_uk]² / Σ_u Σ_{k∈c} (1 − P_kk/ω_c²)         (MacKay's fixed point)
//! ν_c² = Σ_ut Σ_{k∈c} E[ε_utk]² / Σ_ut Σ_{k∈c} (1 − Var(ε_utk)/ν_c²)
//! π    = (1 + Σ_uc P(w_uc = 1)) / ((10 + U) Σ_c o_c), 1/2 at most
//! ```
//! The first rounds know no deviations: there the sum of squares is that of a normal distribution with the median of |E[δ]|, which a few
//! units that deviate do not move.
//!
//! # Source
//! MacKay, Bayesian interpolation, Neural Computation 4 (1992), eq. 4.8 and 4.9, for one precision per component.

use super::deviations::{Prepared, Rules, State};
use super::hierarchy::{Hierarchy, Unit, UnitSums};
use super::sampler::{Chain, Iteration, UnitIteration, of_type};
use crate::error::Result;
use rayon::prelude::*;

/// ω² before anything is known, and its bounds, in squares of the slab's sd.
const FIRST: f64 = 1e-3;
const BOUNDS: (f64, f64) = (1e-10, 4.0);
/// ν² before anything is known: windows of one unit are alike.
const FIRST_WINDOWS: f64 = 1e-5;
/// Rounds without deviations, and rounds with them.
const ROBUST_ROUNDS: usize = 10;
const ROUNDS: usize = 8;
/// Iterations of a round, and those of them that settle first.
const ITERATIONS: usize = 10;
const SETTLING: usize = 4;
/// Deviations that one unit is expected to have before the data, and the number of units that this weighs like.
const EXPECTED: f64 = 0.1;
const WEIGHT: f64 = 10.0;
/// Median of |x| of a standard normal x.
const MEDIAN: f64 = 0.674_489_750_196_081_7;

/// Learns the plug-ins; returns the states of the units that the last round ended with.
///
/// # Errors
/// Those of inference.
pub(super) fn learn(
    hierarchy: &mut Hierarchy,
    seed: u64,
    watch: &dyn Fn(usize, usize) -> Result<()>,
) -> Result<Vec<State>> {
    let components = hierarchy.columns.len();
    hierarchy.plug_in.variance = vec![FIRST; components];
    hierarchy.plug_in.windows = vec![FIRST_WINDOWS; components];
    hierarchy.plug_in.share = share(hierarchy, 0.0);
    let none = vec![0.0; components];
    let odds = std::mem::replace(&mut hierarchy.odds, none);
    for round in 0..ROBUST_ROUNDS {
        watch(round, ROBUST_ROUNDS + ROUNDS)?;
        let units = prepared(hierarchy);
        let (variance, windows) = {
            let (gram, linear) = of_type_of(&units);
            let mut chain = Chain::new(hierarchy, &units, (&gram, &linear), (seed, 1));
            let found = [chain.iterate()?];
            (
                updated(hierarchy, &units, &found, robust_squares),
                updated_windows(hierarchy, &units, &found, robust_squares),
            )
        };
        (hierarchy.plug_in.variance, hierarchy.plug_in.windows) = (variance, windows);
    }
    hierarchy.odds = odds;
    let mut states = vec![State::default(); hierarchy.units.len()];
    for round in 0..ROUNDS {
        watch(ROBUST_ROUNDS + round, ROBUST_ROUNDS + ROUNDS)?;
        let units = prepared(hierarchy);
        let (variance, windows, deviations) = {
            let (gram, linear) = of_type_of(&units);
            let stream = 2 + round as u64;
            let mut chain =
                Chain::new(hierarchy, &units, (&gram, &linear), (seed, stream)).with_states(states);
            let mut found = Vec::new();
            for iteration in 0..ITERATIONS {
                let own = chain.iterate()?;
                if iteration >= SETTLING {
                    found.push(own);
                }
            }
            let variance = updated(hierarchy, &units, &found, squares);
            let windows = updated_windows(hierarchy, &units, &found, squares);
            states = chain.into_states();
            (variance, windows, deviations(&found))
        };
        (hierarchy.plug_in.variance, hierarchy.plug_in.windows) = (variance, windows);
        hierarchy.plug_in.share = share(hierarchy, deviations);
    }
    Ok(states)
}

/// The units under the present plug-ins.
pub(super) fn prepared(hierarchy: &Hierarchy) -> Vec<Prepared> {
    let (scatter, of_windows) = (hierarchy.scatter(), hierarchy.window_scatter());
    let rules = Rules {
        columns: &hierarchy.columns,
        odds: &hierarchy.odds,
        share: hierarchy.plug_in.share,
    };
    (hierarchy.units.par_iter())
        .map(|sums| Prepared::new(Unit::new(sums, &scatter, &of_windows), rules))
        .collect()
}

/// What all units say of the type where none deviates.
pub(super) fn of_type_of(units: &[Prepared]) -> (Vec<f64>, Vec<f64>) {
    of_type(units.iter().map(|prepared| &prepared.unit))
}

fn share(hierarchy: &Hierarchy, deviations: f64) -> f64 {
    let odds: f64 = hierarchy.odds.iter().sum();
    let units = hierarchy.units.len() as f64;
    let before = EXPECTED * WEIGHT;
    ((before + deviations) / ((WEIGHT + units) * odds.max(1.0))).min(0.5)
}

/// Σ P(w = 1), averaged over the iterations.
fn deviations(found: &[Iteration]) -> f64 {
    let all = found.iter().flat_map(|own| &own.units);
    let sum: f64 = all
        .flat_map(|unit| unit.conditional.iter().flatten())
        .map(|own| own.deviates)
        .sum();
    sum / found.len().max(1) as f64
}

/// Σ_u E[δ_uk]² of one column: its values in one iteration.
fn squares(offsets: &mut [f64]) -> f64 {
    offsets.iter().map(|x| x * x).sum()
}

/// The same from the median.
fn robust_squares(offsets: &mut [f64]) -> f64 {
    offsets.iter_mut().for_each(|x| *x = x.abs());
    offsets.sort_by(f64::total_cmp);
    let median = offsets[offsets.len() / 2];
    offsets.len() as f64 * (median / MEDIAN).powi(2)
}

fn updated(
    hierarchy: &Hierarchy,
    units: &[Prepared],
    found: &[Iteration],
    squares: fn(&mut [f64]) -> f64,
) -> Vec<f64> {
    let size = hierarchy.size();
    let now = &hierarchy.plug_in.variance;
    let of = |(component, columns): (usize, &Vec<usize>)| {
        let (mut sum, mut free) = (0.0, 0.0);
        for &k in columns {
            for iteration in found {
                let mut own: Vec<f64> = (iteration.units.iter())
                    .map(|unit| unit.offset[k])
                    .collect();
                sum += squares(&mut own) / found.len() as f64;
            }
            let left =
                |prepared: &Prepared| 1.0 - prepared.unit.posterior[k * size + k] / now[component];
            free += units.iter().map(left).sum::<f64>();
        }
        next(sum, free, now[component])
    };
    hierarchy.columns.iter().enumerate().map(of).collect()
}

/// The variance that squares ask for; where no data leave it open, the one before.
fn next(sum: f64, free: f64, now: f64) -> f64 {
    let asked = if free > 1e-9 { sum / free } else { now };
    asked.clamp(BOUNDS.0, BOUNDS.1)
}

/// ν² of every component from the last iteration: of units with two windows or more, for one window does not tell its scatter from that of units.
fn updated_windows(
    hierarchy: &Hierarchy,
    units: &[Prepared],
    found: &[Iteration],
    squares: fn(&mut [f64]) -> f64,
) -> Vec<f64> {
    let now = &hierarchy.plug_in.windows;
    let Some(found) = found.last() else {
        return now.clone();
    };
    let of_windows = hierarchy.window_scatter();
    let of_unit = |((sums, prepared), one): ((&UnitSums, &Prepared), &UnitIteration)| {
        let mut own = Vec::new();
        for (start, window) in sums
            .windows
            .iter()
            .enumerate()
            .filter(|_| sums.windows.len() > 1)
        {
            let mut beta = one.offset.clone();
            (beta.iter_mut().zip(&found.of_units)).for_each(|(beta, mu)| *beta += mu);
            for (deviation, b) in one.deviations.iter().filter(|(own, _)| own.start <= start) {
                let columns = &hierarchy.columns[deviation.component];
                columns.iter().for_each(|&k| beta[k] += b[k]);
            }
            own.push(window.scatter(&of_windows, &beta, &prepared.unit.posterior));
        }
        own
    };
    let pairs = hierarchy.units.par_iter().zip(units).zip(&found.units);
    let all: Vec<(Vec<f64>, Vec<f64>)> = pairs.flat_map_iter(of_unit).collect();
    let of = |(component, columns): (usize, &Vec<usize>)| {
        let (mut sum, mut free) = (0.0, 0.0);
        for &k in columns {
            let mut own: Vec<f64> = all.iter().map(|(mean, _)| mean[k]).collect();
            sum += if own.is_empty() {
                0.0
            } else {
                squares(&mut own)
            };
            free += all.iter().map(|(_, open)| 1.0 - open[k]).sum::<f64>();
        }
        next(sum, free, now[component])
    };
    hierarchy.columns.iter().enumerate().map(of).collect()
}
