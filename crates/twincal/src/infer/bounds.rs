//! Coefficients with bounds: the slab and the posterior of every model truncated to `β_k ≥ lower_k` and, for sums that are bounded,
//! `aᵀβ ≥ lower`.
//!
//! Truncating both multiplies the weight of a model by
//!
//! ```text
//! P(β ≥ lower | z, y) / P(β ≥ lower | z)
//! ```
//!
//! and makes its moments those of a truncated distribution. Both come from expectation propagation (Minka 2001; Cunningham,
//! Hennig & Lacoste-Julien 2011): each bound becomes a normal site that matches mean and variance. φ is set to b_z/a_n.
//!
//! Listed models are treated one by one; the others, light by construction, are scaled as the listed ones are on
//! average. Where that moves weight to models that a sum without bounds does not list, a search that knows the bounds
//! lists them (`joined.rs`). Chains know the bounds themselves (`gibbs/chain/admission.rs`): of their models only the moments change.

mod acting;
mod propagation;

use super::answer::{Averages, Listed};
use super::moments::{FORBIDDEN, log_normal_mass};
use super::reduced::Reduced;
use super::standard::{Standard, nudged};
use super::tableau::Tableau;
use crate::error::Result;
use crate::linear_algebra::{Cholesky, NotPositiveDefinite};
use crate::posterior::{Model, Problem};
use acting::{Acting, Bound, FAR};
pub(super) use acting::{SlabMasses, most_of_sums};
use propagation::propagate;
use rayon::prelude::*;

/// Probability of what is not listed below which its moments are not told from the sampler's error.
const FEW: f64 = 0.01;

/// A model lighter than this share without bounds was not listed for its weight.
const JOINED_SHARE: f64 = 1e-12;

/// What the weights of listed models already contain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Weights {
    /// The mass of the slab within the bounds, nothing of the posterior's.
    Free,
    /// All of it: the models are those of chains that know the bounds.
    Whole,
    /// Also the posterior's mass as if coefficients were independent.
    Guided,
}

/// Truncates the listed models and corrects the averages; also ln of what the bounds multiply the sum over all models with.
///
/// The logs of the weights count: a model that bounds favour may be too light without them for a number.
pub(super) fn apply(
    standard: &Standard,
    averages: &mut Averages,
    listed: Listed,
    mut log_weights: Vec<f64>,
    weights: Weights,
) -> Result<(Listed, f64)> {
    if !standard.bounded || listed.models.is_empty() {
        return Ok((listed, 0.0));
    }
    let before: Vec<Model> = listed.models.clone();
    let mut listed = listed;
    if !truncate_all(standard, &mut listed, &mut log_weights, weights)? {
        let models = before;
        return Ok((Listed { models, ..listed }, 0.0));
    }
    // Weights in units of the heaviest with bounds.
    let unit = log_weights
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    for (model, log_weight) in listed.models.iter_mut().zip(&log_weights) {
        model.weight = (log_weight - unit).exp();
    }
    let scale = unlisted_factor(&before, &listed.models);
    let all: f64 = before.iter().map(|m| m.weight).sum();
    let masses = Masses {
        scale,
        before: all,
        total: listed.mass() + scale * (1.0 - all).max(0.0),
    };
    correct(standard, averages, &before, &listed, &masses);
    let total = masses.total;
    Ok((heaviest_first(&listed, total), unit + total.ln()))
}

/// Truncates every listed model and multiplies its weight accordingly; whether a bound acts.
fn truncate_all(
    standard: &Standard,
    listed: &mut Listed,
    log_weights: &mut [f64],
    weights: Weights,
) -> Result<bool> {
    let rows = listed.models.par_iter_mut().zip(&listed.positions);
    let log_ratios: Vec<Result<f64>> = rows
        .map(|(model, positions)| truncate(standard, model, positions, weights))
        .collect();
    let mut acts = false;
    let models = listed.models.iter().zip(log_ratios);
    for ((model, log_ratio), log_weight) in models.zip(log_weights) {
        // Of several errors the first model's, on any number of threads.
        let log_ratio = log_ratio?;
        acts |= log_ratio.abs() > 1e-12 || !model.sites.is_empty();
        *log_weight += log_ratio;
    }
    Ok(acts)
}

/// What bounds multiply the weight of models that are not listed with: the factor of those that a method without bounds listed.
fn unlisted_factor(before: &[Model], listed: &[Model]) -> f64 {
    let was_listed = |model: &&Model| model.weight > JOINED_SHARE;
    let old: f64 = before.iter().filter(was_listed).map(|m| m.weight).sum();
    let new: f64 = (before.iter().zip(listed))
        .filter(|(before, _)| was_listed(before))
        .map(|(_, model)| model.weight)
        .sum();
    new / old
}

/// Sums of weights without bounds and with them.
struct Masses {
    /// Factor on the weights of models that are not listed.
    scale: f64,
    /// Listed models without bounds, as a share of all.
    before: f64,
    /// All models with bounds, in units of the heaviest.
    total: f64,
}

/// Makes averages without bounds those with bounds; `before`: the listed models without bounds.
fn correct(
    standard: &Standard,
    averages: &mut Averages,
    before: &[Model],
    listed: &Listed,
    masses: &Masses,
) {
    let size = standard.size();
    // About the mean without bounds: what a sampler's average and its list differ by must not be measured by how far that is from 0.
    let about = averages.shift.clone();
    let mut sums = about_the_mean(averages, masses.scale);
    let mut own = Averages {
        inclusion: vec![0.0; size],
        mcse: Vec::new(),
        shift: vec![0.0; size],
        moment: vec![0.0; size],
        misfit: 0.0,
    };
    for ((model, old), positions) in listed.models.iter().zip(before).zip(&listed.positions) {
        count(standard, &about, &mut sums, (old, -masses.scale), positions);
        count(standard, &about, &mut own, (model, 1.0), positions);
    }
    // What is left is that of models that are not listed. Where they are few it is but what a sampler's averages and its list differ by: rare
    // models of wide moments, which bounds rule out, would stand in it.
    let few = 1.0 - masses.before < FEW;
    for d in 0..size {
        sums.inclusion[d] += own.inclusion[d];
        let left = if few { 0.0 } else { 1.0 };
        sums.shift[d] = own.shift[d] + left * sums.shift[d];
        sums.moment[d] = own.moment[d] + left * sums.moment[d];
    }
    sums.misfit += own.misfit;
    let total = masses.total;
    let mass = if few { listed.mass() } else { total };
    for d in 0..size {
        let (moved, spread) = (sums.shift[d] / mass, sums.moment[d] / mass);
        // No less than the spread of the listed models about this mean.
        let least = own.moment[d] - 2.0 * moved * own.shift[d] + moved * moved * listed.mass();
        let spread = spread.max(least / mass + moved * moved);
        averages.inclusion[d] = (sums.inclusion[d] / total).clamp(0.0, 1.0);
        averages.shift[d] = about[d] + moved;
        averages.moment[d] = spread + about[d] * (2.0 * moved + about[d]);
    }
    averages.misfit = sums.misfit / total;
}

/// Averages times `scale`, with moments about their own mean.
fn about_the_mean(averages: &Averages, scale: f64) -> Averages {
    let about = &averages.shift;
    let size = about.len();
    let mut sums = Averages {
        inclusion: averages.inclusion.clone(),
        mcse: averages.mcse.clone(),
        shift: vec![0.0; size],
        moment: averages.moment.clone(),
        misfit: averages.misfit,
    };
    for d in 0..size {
        sums.inclusion[d] *= scale;
        sums.moment[d] = scale * (sums.moment[d] - about[d] * about[d]);
    }
    sums.misfit *= scale;
    sums
}

/// Listed models with the heaviest first, weights as shares of `total`.
fn heaviest_first(listed: &Listed, total: f64) -> Listed {
    let mut order: Vec<usize> = (0..listed.models.len()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (&listed.models[a], &listed.models[b]);
        b.weight
            .total_cmp(&a.weight)
            .then_with(|| a.members.cmp(&b.members))
    });
    Listed {
        models: order
            .iter()
            .map(|&i| Model {
                weight: listed.models[i].weight / total,
                ..listed.models[i].clone()
            })
            .collect(),
        positions: order.iter().map(|&i| listed.positions[i].clone()).collect(),
    }
}

/// ln of a model's weight but for what all models share, from its own factor.
pub(super) fn log_weight(problem: &Problem, standard: &Standard, model: &Model) -> f64 {
    let prior = &problem.prior;
    let mut holds = vec![false; prior.components()];
    model
        .members
        .iter()
        .for_each(|&k| holds[prior.component[k as usize]] = true);
    let mut counts = vec![0; prior.families()];
    let mut log = 0.0;
    for block in standard.blocks.iter().filter(|b| holds[b.component]) {
        counts[block.family] += 1;
        log += block.factor.ln();
    }
    let count = model.members.len();
    for (i, &k) in model.members.iter().enumerate() {
        log -= 0.5 * prior.slab[k as usize].ln() + model.factor[i * count + i].ln();
    }
    log + prior.log_model(&counts) - standard.shape * standard.misfit(model.scale).ln()
}

/// Adds `factor · weight` times the moments of a model; those of coefficients less their center and `about`.
fn count(
    standard: &Standard,
    about: &[f64],
    sums: &mut Averages,
    (model, factor): (&Model, f64),
    positions: &[usize],
) {
    let weight = factor * model.weight;
    let noise = standard.noise_factor();
    let noise = if noise.is_finite() { noise } else { 0.0 };
    let misfit = standard.misfit(model.scale);
    sums.misfit += weight * misfit;
    let origin = standard.center.iter().zip(about);
    let mut delta: Vec<f64> = origin.map(|(center, about)| -center - about).collect();
    let inverse = Cholesky::from_lower(model.factor.clone(), positions.len()).inverse_diagonal();
    let mut variance = vec![0.0; delta.len()];
    for (i, &d) in positions.iter().enumerate() {
        let unit = standard.natural(d);
        delta[d] += model.mean[i] * unit;
        // Coefficients in natural units, φ in (1 + c): φ/(N·m)² · unit² = misfit · factor.
        variance[d] = inverse[i] * standard.precision_unit(d) * misfit * noise;
        sums.inclusion[d] += weight;
    }
    for d in 0..delta.len() {
        sums.shift[d] += weight * delta[d];
        sums.moment[d] += weight * (delta[d] * delta[d] + variance[d]);
    }
}

/// Truncates one model: its mean and factor become those of the matched normal. Returns ln of what its weight, as it
/// stands, must be multiplied with.
pub(super) fn truncate(
    standard: &Standard,
    model: &mut Model,
    positions: &[usize],
    weights: Weights,
) -> Result<f64> {
    let Some(acting) = Acting::new(standard, positions) else {
        return Ok(FORBIDDEN);
    };
    let phi = model.scale / standard.shape;
    let count = positions.len();
    let factor = Cholesky::from_lower(model.factor.clone(), count);
    let mut log_ratio = match weights {
        Weights::Whole => 0.0,
        Weights::Free | Weights::Guided => {
            let masses = &mut SlabMasses::default();
            acting.slab_ratio(standard, positions, model.scale, masses)
        }
    };
    // A⁻¹ a of every bound, for the covariance in units of φ.
    let solved = |terms: &[(usize, f64)]| {
        let mut x = vec![0.0; count];
        terms.iter().for_each(|&(i, f)| x[i] = f);
        factor.solve(&mut x);
        x
    };
    let columns: Vec<Vec<f64>> = acting.bounds.iter().map(|b| solved(&b.terms)).collect();
    let place = |a: usize| {
        let bound = &acting.bounds[a];
        let sd = (phi * bound.sum(&columns[a])).sqrt();
        (sd, (bound.sum(&model.mean) - bound.lower) / sd)
    };
    if weights == Weights::Guided {
        let alone = |a: &usize| acting.bounds[*a].group.is_none();
        let own = (0..columns.len()).filter(alone).map(place);
        log_ratio -= own.map(|(_, t)| log_normal_mass(t)).sum::<f64>();
        log_ratio -= acting.guided(standard, positions, model, &factor);
    }
    let places: Vec<(f64, f64)> = (0..columns.len()).map(place).collect();
    let shared = |a: usize, b: usize| phi * acting.bounds[b].sum(&columns[a]);
    let Some((near, log_mass, sites)) = mass(&places, shared) else {
        return Ok(log_ratio);
    };
    if weights != Weights::Whole {
        log_ratio += log_mass;
    }
    let at_bounds = near.iter().zip(sites).map(|(&a, (precision, shift))| {
        // Sites are in x = (aᵀβ − lower)/sd: −½ τ x² + ν x.
        let (bound, sd) = (&acting.bounds[a], places[a].0);
        let precision = phi * precision / (sd * sd);
        let shift = phi * shift / sd + precision * bound.lower;
        (bound, precision, shift)
    });
    match_sites(model, count, at_bounds)
        .map_err(|error| standard.singular(positions[error.pivot]))?;
    Ok(log_ratio)
}

/// Multiplies a model of `count` columns by sites −½ precision (aᵀβ)² + shift aᵀβ, in units of φ.
fn match_sites<'a>(
    model: &mut Model,
    count: usize,
    sites: impl Iterator<Item = (&'a Bound, f64, f64)>,
) -> std::result::Result<(), NotPositiveDefinite> {
    let mut matrix = multiply_transposed(&model.factor, count);
    let mut right = vec![0.0; count];
    for i in 0..count {
        right[i] = (0..count)
            .map(|k| matrix[i * count + k] * model.mean[k])
            .sum();
    }
    for (bound, precision, shift) in sites {
        for &(i, f) in &bound.terms {
            let others = bound.terms.iter();
            others.for_each(|&(k, g)| matrix[i * count + k] += precision * f * g);
            right[i] += shift * f;
        }
        model.sites.push(bound.site(precision, shift));
    }
    let factor = nudged(&matrix, count)?;
    factor.solve(&mut right);
    model.mean = right;
    model.factor = factor.into_lower();
    Ok(())
}

/// The bounds that act, ln of the mass within them and their sites, from (standard deviation, distance in it) of the mean from every bound
/// and the covariance of two of them; `None` where none acts.
#[expect(clippy::type_complexity, reason = "named where it is used, twice")]
fn mass(
    places: &[(f64, f64)],
    shared: impl Fn(usize, usize) -> f64,
) -> Option<(Vec<usize>, f64, Vec<(f64, f64)>)> {
    let near: Vec<usize> = (0..places.len()).filter(|&a| places[a].1 < FAR).collect();
    if near.is_empty() {
        return None;
    }
    let score: Vec<f64> = near.iter().map(|&a| places[a].1).collect();
    let correlation: Vec<f64> = near
        .iter()
        .flat_map(|&a| near.iter().map(move |&b| (a, b)))
        .map(|(a, b)| shared(a, b) / (places[a].0 * places[b].0))
        .collect();
    let (log_mass, sites) = propagate(&score, &correlation);
    Some((near, log_mass, sites))
}

/// The slab's part of [`log_ratio`] in a model of these positions that fits as the full one does; 0 where a bound forbids it.
pub(super) fn slab_ratio(standard: &Standard, positions: &[usize], masses: &mut SlabMasses) -> f64 {
    let scale = standard.scale_of(1.0);
    Acting::new(standard, positions).map_or(0.0, |acting| {
        acting.slab_ratio(standard, positions, scale, masses)
    })
}

/// What [`truncate`] multiplies the weight of the model in a tableau with, ln, without a factor of its own; `set` by place in `open.blocks`.
///
/// Columns that were integrated out have no bound that acts ([`Reduced`]).
pub(super) fn log_ratio(
    reduced: &Reduced<'_>,
    tableau: &Tableau<'_>,
    set: &[u64],
    masses: &mut SlabMasses,
) -> f64 {
    let standard = reduced.full;
    let (_, positions) = reduced.members(set);
    let Some(acting) = Acting::new(standard, &positions) else {
        return FORBIDDEN;
    };
    let misfit = 1.0 + tableau.excess;
    let slab = acting.slab_ratio(standard, &positions, standard.scale_of(misfit), masses);
    // By place in `positions`, as the bounds: the position of `open` and its units per unit of the coefficient.
    let mut unit = vec![None; standard.size()];
    for (k, (d, stretch)) in reduced.left().enumerate() {
        unit[d] = Some((k, stretch * standard.natural(d)));
    }
    let open: Vec<Option<(usize, f64)>> = positions.iter().map(|&d| unit[d]).collect();
    let phi = 0.5 * misfit / standard.shape;
    let shared = |a: &Bound, b: &Bound| -> Option<f64> {
        let mut sum = 0.0;
        for &(i, f) in &a.terms {
            let (k, own) = open[i]?;
            let row = tableau.row(k);
            for &(j, g) in &b.terms {
                let (l, other) = open[j]?;
                sum += f * g * row[l] / (own * other);
            }
        }
        Some(phi * sum)
    };
    let mean = |bound: &Bound| -> Option<f64> {
        let term = |&(i, f): &(usize, f64)| open[i].map(|(k, own)| f * tableau.gradient[k] / own);
        bound.terms.iter().map(term).sum()
    };
    let place = |bound: &Bound| {
        let of =
            |variance: f64, mean: f64| (variance.sqrt(), (mean - bound.lower) / variance.sqrt());
        let known = shared(bound, bound).zip(mean(bound));
        known.map_or((1.0, f64::INFINITY), |(variance, mean)| of(variance, mean))
    };
    let places: Vec<(f64, f64)> = acting.bounds.iter().map(place).collect();
    let both = |a: usize, b: usize| shared(&acting.bounds[a], &acting.bounds[b]).unwrap_or(0.0);
    slab + mass(&places, both).map_or(0.0, |(_, log_mass, _)| log_mass)
}

/// `L Lᵀ`.
fn multiply_transposed(lower: &[f64], count: usize) -> Vec<f64> {
    let mut matrix = vec![0.0; count * count];
    for i in 0..count {
        for k in 0..=i {
            let value = (0..=k)
                .map(|j| lower[i * count + j] * lower[k * count + j])
                .sum();
            matrix[i * count + k] = value;
            matrix[k * count + i] = value;
        }
    }
    matrix
}

#[cfg(test)]
mod tests;
