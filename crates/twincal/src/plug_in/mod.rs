//! Noise weights, autocorrelation, misfit and slab scale: everything that is plugged into the posterior.
//!
//! `fit` iterates likelihood → infer → residual at the model average until nothing moves (method section 5);
//! `fit_tempered` lets what no candidate describes count as noise. Given the plug-ins, exact enumeration and Gibbs
//! sampling share one target.

mod autoregression;
mod left_out;
mod memory;
mod misfit;
mod passband;
pub(crate) mod size;
mod tempering;
mod usual;

pub(crate) use tempering::{count_misfit, fit_tempered};

use crate::diagnostics::integrated_autocorrelation_time;
use crate::error::Result;
use crate::gram::{Gram, JointGram};
use crate::infer::approximate;
use crate::likelihood::{Columns, NoiseModel, NoiseSettings, PlugIn, assemble};
use crate::observations::Part;
use crate::posterior::{Posterior, Problem};
use crate::prior::PriorSettings;
use crate::signal::Auto;
use crate::statistics::{JointUnit, Sums, Unit, of_joint, residual_form};
use autoregression::Residual;
use passband::Passband;

/// Rounds of the fixed-point iteration at most.
const ROUNDS: usize = 20;
/// Rounds of a rough one.
const ROUGH_ROUNDS: usize = 4;
/// Relative change of every plug-in below which the iteration has converged.
const TOLERANCE: f64 = 1e-6;
/// Components beyond which a posterior in the loop is itself known to about 1e-3, and its fixed point no better.
const MANY: usize = 28;
/// The same three numbers with many components.
const MANY_ROUNDS: usize = 8;
const MANY_ROUGH_ROUNDS: usize = 2;
const MANY_TOLERANCE: f64 = 3e-3;
/// A residual below this share of the torque's squares is rounding, from rows and from sums.
const ROUNDING: f64 = 1e-22;
const ROUNDING_OF_SUMS: f64 = 1e-14;
/// Share of E[φ] that is noise at least.
const LEAST_SHARE: f64 = 1e-3;
/// Bounds of a learned slab scale v.
const SLAB_BOUNDS: (f64, f64) = (1e-2, 1e9);
/// v before anything is known.
const FIRST_SLAB: f64 = 100.0;

/// What a fit is told.
#[derive(Debug, Clone, Copy)]
pub struct FitSettings<'a> {
    /// `[noise]`.
    pub noise: NoiseSettings,
    /// `[prior]`.
    pub prior: &'a PriorSettings,
}

/// A posterior with the plug-ins that it was computed from.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Statistics of the training parts.
    pub gram: Gram,
    /// The plug-ins in force.
    pub plug_in: PlugIn,
    /// The regression and prior that they make.
    pub problem: Problem,
    /// Its posterior, by [`approximate`]: what is reported is inferred once more from `problem`.
    pub posterior: Posterior,
    /// Rounds until nothing moved.
    pub rounds: usize,
    /// False if the iteration was still moving after the last round.
    pub converged: bool,
}

/// What coefficients with a physical prior add to E[φ] by their size, Σ E[z_k β_k²]/v_k / n: their slab v_k = sd²/φ is a matter of β and sd, not of
/// noise. Left in, a coefficient of more than √n prior sd would raise φ, narrow its own slab by that, and be lost.
fn held_by_physics(
    columns: &Columns,
    prior: &PriorSettings,
    problem: &Problem,
    posterior: &Posterior,
) -> f64 {
    if prior.scaled_variance != Auto::Auto {
        return 0.0;
    }
    let second =
        |k: usize| posterior.sd[k] * posterior.sd[k] + posterior.mean[k] * posterior.mean[k];
    let physical = (0..columns.names.len()).filter(|&k| columns.prior_sd[k].is_some());
    let sum: f64 = physical.map(|k| second(k) / problem.prior.slab[k]).sum();
    sum / problem.n
}

/// Which plug-ins an iteration may move, and how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moving {
    /// Weights, autoregression and slab scale, until they rest.
    All,
    /// The slab scale alone, until it rests: what is known of the noise stays.
    SlabScale,
    /// The slab scale alone, a few rounds: enough to compare settings, not to report.
    SlabScaleRoughly,
}

impl Moving {
    fn rounds(self, components: usize) -> usize {
        match (self, components > MANY) {
            (Self::All | Self::SlabScale, false) => ROUNDS,
            (Self::All | Self::SlabScale, true) => MANY_ROUNDS,
            (Self::SlabScaleRoughly, false) => ROUGH_ROUNDS,
            (Self::SlabScaleRoughly, true) => MANY_ROUGH_ROUNDS,
        }
    }
}

/// Iterates the plug-ins to their fixed point on the training data.
///
/// τ and λ of `start` are kept as they are. `known` is the posterior of a similar problem, to start the search from.
///
/// # Errors
/// Those of [`assemble`] and [`approximate`].
pub(crate) fn fit(
    sums: &Sums,
    columns: &Columns,
    settings: FitSettings<'_>,
    start: &PlugIn,
    moving: Moving,
    known: Option<&Posterior>,
) -> Result<Fit> {
    let total = sums.total();
    let data = (&total, sums.cutoff);
    fit_sums(data, columns, settings, start, moving, known)
}

/// [`fit`] to sums over all rows, behind a filter with a cut-off in cycles per row.
fn fit_sums(
    (total, cutoff): (&Unit, f64),
    columns: &Columns,
    settings: FitSettings<'_>,
    start: &PlugIn,
    moving: Moving,
    known: Option<&Posterior>,
) -> Result<Fit> {
    let gram = &total.gram;
    let mut plug_in = start.clone();
    let mut known = known.cloned();
    let components = columns.family.len();
    let tolerance = if components > MANY {
        MANY_TOLERANCE
    } else {
        TOLERANCE
    };
    let passband = passband(cutoff, settings.noise);
    if let Some(passband) = &passband {
        plug_in.passed = passband.share();
    }
    let mut rounds = 0;
    loop {
        rounds += 1;
        let problem = assemble(gram, columns, &plug_in, settings.prior)?;
        let posterior = approximate(&problem, known.as_ref())?;
        let mut next = plug_in.clone();
        if moving == Moving::All {
            let told = (settings.noise, passband.as_ref());
            move_noise(&mut next, total, told, &posterior.mean);
        }
        if settings.prior.scaled_variance == Auto::Auto {
            next.scaled_variance = slab_scales(gram, columns, &plug_in, &problem, &posterior);
            next.payload = size::payload_size(columns, plug_in.payload, &problem, &posterior);
        }
        if posterior.noise.is_finite() {
            let held = held_by_physics(columns, settings.prior, &problem, &posterior);
            next.noise = (posterior.noise - held).max(LEAST_SHARE * posterior.noise);
        }
        let converged = largest_change(&plug_in, &next) < tolerance;
        if converged || rounds == moving.rounds(components) {
            return Ok(Fit {
                gram: gram.clone(),
                plug_in,
                problem,
                posterior,
                rounds,
                converged,
            });
        }
        plug_in = next;
        known = Some(posterior);
    }
}

/// [`fit`] to one Gram alone, of rows behind no filter.
pub(crate) fn fit_gram(
    gram: &Gram,
    columns: &Columns,
    settings: FitSettings<'_>,
    start: &PlugIn,
    moving: Moving,
) -> Result<Fit> {
    let squares = |joint: &JointGram| {
        let last = joint.s0.size - 1;
        JointUnit {
            torque: joint.s0.at(last, last),
            ..JointUnit::default()
        }
    };
    let total = Unit {
        joints: gram.joints.iter().map(squares).collect(),
        gram: gram.clone(),
    };
    fit_sums((&total, 0.0), columns, settings, start, moving, None)
}

/// Where an iteration starts: white noise of equal size on every joint.
pub(crate) fn start(sums: &Sums, columns: &Columns, prior: &PriorSettings) -> PlugIn {
    first(sums.joints(), columns, prior)
}

/// [`start`] for so many joints.
pub(crate) fn first(joints: usize, columns: &Columns, prior: &PriorSettings) -> PlugIn {
    let v = match prior.scaled_variance {
        Auto::Value(v) => v,
        Auto::Auto => FIRST_SLAB,
    };
    PlugIn::start(joints, columns.families.len(), v)
}

/// The filter that an autoregression of rows has to be told of.
fn passband(cutoff: f64, noise: NoiseSettings) -> Option<Passband> {
    match noise.model {
        NoiseModel::Ar1 => Passband::new(cutoff),
        NoiseModel::Iid | NoiseModel::Tempered => None,
    }
}

/// Weights and autoregression that the residual at the model average asks for; one ρ for all joints where they share one
/// variance, so that they share σ too.
fn move_noise(
    plug_in: &mut PlugIn,
    total: &Unit,
    (noise, passband): (NoiseSettings, Option<&Passband>),
    mean: &[f64],
) {
    let joints = total.gram.joints.iter().zip(&total.joints);
    let sums: Vec<Residual> = joints
        .map(|(gram, own)| Residual::new(gram, mean, ROUNDING_OF_SUMS * own.torque))
        .collect();
    if noise.model == NoiseModel::Ar1 {
        plug_in.rho = if noise.per_joint {
            sums.iter().map(Residual::coefficient).collect()
        } else {
            let all: Residual = sums.iter().sum();
            vec![all.coefficient(); sums.len()]
        };
        if let Some(passband) = passband {
            let found = plug_in.rho.iter().map(|rho| passband.autoregression(*rho));
            (plug_in.rho, plug_in.variance) =
                found.map(|found| (found.rho, found.variance)).unzip();
        }
    }
    if noise.per_joint {
        let variance: Vec<f64> = sums
            .iter()
            .zip(&plug_in.rho)
            .map(|(sums, rho)| sums.innovation_variance(*rho))
            .collect();
        plug_in.weight = weights(&total.gram, &variance);
    }
}

/// Residuals `y − Xβ` of a joint over all parts, as the fit weighs them, as runs of consecutive moving rows.
pub fn residual_runs(training: &[Part<'_>], joint: usize, beta: &[f64]) -> Vec<Vec<f64>> {
    training
        .iter()
        .flat_map(|part| part.weighted_runs(joint, beta))
        .collect()
}

/// Integrated autocorrelation time of a joint's residual, rows, at least 1.
pub fn residual_correlation_time(training: &[Part<'_>], joint: usize, beta: &[f64]) -> f64 {
    let runs = residual_runs(training, joint, beta);
    if is_rounding(training, joint, runs.iter().flatten().map(|r| r * r).sum()) {
        return 1.0; // rounding has no memory that means anything
    }
    let runs: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
    let cutoffs = training.iter().map(|part| part.observations.cutoff);
    let cutoff = cutoffs.fold(0.0, f64::max);
    memory::behind_filter(integrated_autocorrelation_time(&runs), cutoff)
}

/// The same from the power of the rows behind these sums by bands of frequency; `gram` is that of all of them.
pub(crate) fn correlation_time((sums, gram): (&Sums, &Gram), joint: usize, beta: &[f64]) -> f64 {
    let own = &gram.joints[joint];
    let left = residual_form(&own.s0, &of_joint(own, beta));
    if left <= ROUNDING_OF_SUMS * sums.torque_squares()[joint] {
        return 1.0; // rounding has no memory that means anything
    }
    memory::behind_filter(sums.spectra[joint].autocorrelation_time(beta), sums.cutoff)
}

/// Whether residual squares of a joint are what rounding leaves of its torque.
fn is_rounding(training: &[Part<'_>], joint: usize, squares: f64) -> bool {
    let measured = training.iter().map(|part| {
        let torque = part.observations.joints[joint]
            .measured
            .some(part.rows.clone());
        torque.iter().map(|tau| tau * tau).sum::<f64>()
    });
    squares <= ROUNDING * measured.sum::<f64>()
}

/// `w_j ∝ 1/s_j²` with n_j-weighted geometric mean 1. A joint without rows or without residual weighs like the mean.
fn weights(gram: &Gram, variance: &[f64]) -> Vec<f64> {
    let largest = variance.iter().copied().fold(0.0, f64::max);
    let usable = |j: usize| gram.joints[j].n > 0.0 && variance[j] > 1e-24 * largest;
    let (mut sum, mut rows) = (0.0, 0.0);
    for j in (0..variance.len()).filter(|&j| usable(j)) {
        sum += gram.joints[j].n * variance[j].ln();
        rows += gram.joints[j].n;
    }
    let mean = if rows > 0.0 { sum / rows } else { 0.0 };
    (0..variance.len())
        .map(|j| {
            if usable(j) {
                (mean - variance[j].ln()).exp()
            } else {
                1.0
            }
        })
        .collect()
}

/// Slab scale of each family by one EM step of its evidence, with one pseudo-term at the scale of the residual.
///
/// ```text
/// v_f = (v_0 + Σ_{k∈f} E[z_k β_k² / φ] r_k) / (1 + Σ_{k∈f} PIP_k),   v_0 = mean(y²) / E[φ]
/// ```
/// with r_k of [`Columns::references`].
fn slab_scales(
    gram: &Gram,
    columns: &Columns,
    now: &PlugIn,
    problem: &Problem,
    posterior: &Posterior,
) -> Vec<f64> {
    let reference_of = columns.references(gram, &now.weight);
    if !posterior.noise.is_finite() {
        return now.scaled_variance.clone(); // less than two effective rows know no scale
    }
    let noise = posterior.noise.max(f64::MIN_POSITIVE);
    let reference = (problem.yy / problem.n / noise).clamp(SLAB_BOUNDS.0, SLAB_BOUNDS.1);
    let mut sum = vec![reference; columns.families.len()];
    let mut count = vec![1.0; columns.families.len()];
    for k in (0..columns.names.len()).filter(|&k| columns.prior_sd[k].is_none()) {
        let second = posterior.sd[k] * posterior.sd[k] + posterior.mean[k] * posterior.mean[k];
        let family = columns.family_of(k);
        sum[family] += second * reference_of[k] / noise;
        count[family] += posterior.inclusion[k];
    }
    sum.iter()
        .zip(&count)
        .map(|(s, c)| (s / c).clamp(SLAB_BOUNDS.0, SLAB_BOUNDS.1))
        .collect()
}

fn largest_change(a: &PlugIn, b: &PlugIn) -> f64 {
    let relative = |x: &[f64], y: &[f64]| {
        x.iter()
            .zip(y)
            .map(|(x, y)| (x - y).abs() / x.abs().max(y.abs()).max(1e-3))
            .fold(0.0, f64::max)
    };
    relative(&a.weight, &b.weight)
        .max(relative(&a.rho, &b.rho))
        .max(relative(&a.autocorrelation_time, &b.autocorrelation_time))
        .max(relative(&a.scaled_variance, &b.scaled_variance))
        .max(relative(&[a.payload.scale], &[b.payload.scale]))
        .max(relative(&[a.payload.odds], &[b.payload.odds]))
        .max((a.noise - b.noise).abs() / a.noise.max(b.noise).max(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests;
