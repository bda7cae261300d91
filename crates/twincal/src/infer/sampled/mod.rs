//! Structure, coefficients, noise and autocorrelation sampled together: `noise.uncertainty = "sampled"` (method section 5).
//!
//! Elsewhere noise weights and autocorrelation are plug-ins: one number each, as if it were known. Here they are drawn like the
//! rest, and what they add to the uncertainty of every effect is in its PIP, its sd and its draws.

mod chain;
mod orthant;
mod planted;
mod sweep;
mod target;

use super::gibbs::{R_HAT_LIMIT, SPREAD_LIMIT, WORK_LIMIT, require_draws};
use super::standard::Standard;
use super::{InferenceSettings, bounds};
use crate::diagnostics::{ess_bulk, mcse_mean, r_hat};
use crate::error::{Error, Result};
use crate::gram::Gram;
use crate::infer::answer::{LISTED_MASS, LISTED_MODELS, Listed};
use crate::likelihood::{
    AUTO_SHAPE, Columns, NoiseInterval, NoiseModel, NoiseSettings, PlugIn, assemble, auto_scale,
};
use crate::linear_algebra::Cholesky;
use crate::posterior::{Method, Model, Posterior, Problem};
use crate::prior::PriorSettings;
use crate::random::Random;
use chain::Chain;
use rayon::prelude::*;
use std::collections::BTreeMap;
use target::{Noise, Target};

/// Transitions per draw, tried in this order until the chains agree.
const STEPS_PER_DRAW: [usize; 3] = [1, 4, 16];
/// Factors on the noise variance at which chains start.
const STARTS: [f64; 4] = [1.0, 4.0, 0.25, 2.0];
/// Draws from which a column's spread is taken.
const ENOUGH: usize = 100;
/// What the spread of draws may do to the sd of the listed models.
const WIDEN: (f64, f64) = (1.0, 3.0);

/// What a fit with plug-ins left behind, and the settings.
#[derive(Debug, Clone, Copy)]
pub struct Given<'a> {
    /// Statistics of all training rows.
    pub grams: &'a Gram,
    /// Columns, components, bounds.
    pub columns: &'a Columns,
    /// Where the chains start; its slab scales stay.
    pub plug_in: &'a PlugIn,
    /// The regression at those plug-ins.
    pub problem: &'a Problem,
    /// Its posterior: E[φ | y] turns slab scales into variances, the heaviest model is a start.
    pub posterior: &'a Posterior,
    /// `[prior]`.
    pub prior: &'a PriorSettings,
    /// `[noise]`.
    pub noise: NoiseSettings,
}

/// The sampled posterior, in the form of one with plug-ins.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// Weights and ρ at the draws' mean.
    pub plug_in: PlugIn,
    /// The regression there.
    pub problem: Problem,
    /// Inclusion, mean and sd from the draws. The listed models are those visited, conditional on the mean noise, widened to the
    /// draws' spread.
    pub posterior: Posterior,
    /// What the draws say of each joint's noise.
    pub noise: Vec<NoiseInterval>,
}

/// What one chain drew: arrays `[row * draws + draw]`.
struct Trace {
    conditional: Vec<f32>,
    beta: Vec<f32>,
    /// ln of the stationary noise variance σ²/(1−ρ²) of each joint.
    log_variance: Vec<f32>,
    rho: Vec<f32>,
    visits: BTreeMap<Vec<bool>, u64>,
}

/// Samples structure, coefficients, noise variances and autocorrelation.
///
/// # Errors
/// [`Error::Setting`] with a tempered likelihood, too few draws, or a component of which only some columns have bounds;
/// [`Error::Refused`] when chains disagree.
///
/// # Source
/// method section 5; AR(1) likelihood of section 4.
pub fn sample(given: Given<'_>, settings: &InferenceSettings) -> Result<Sampled> {
    check(&given, settings)?;
    let phi = given.posterior.noise;
    let slab: Vec<f64> = given
        .problem
        .prior
        .slab
        .iter()
        .map(|v| (v * phi).sqrt())
        .collect();
    let (group, noise) = groups(&given);
    let start = Noise {
        variance: (0..noise.len())
            .map(|g| {
                let joint = group.iter().position(|own| *own == g).unwrap_or(0);
                phi / given.plug_in.weight[joint]
            })
            .collect(),
        rho: given.plug_in.rho.clone(),
    };
    let target = Target::new(
        &given.grams.joints,
        group,
        noise,
        given.noise.model == NoiseModel::Ar1,
        slab,
        &given.problem.prior,
        &start,
    );
    let (traces, agreement) = chains(&target, &given, &start, settings)?;
    summarise(&given, &target, &traces, &agreement, settings)
}

/// Whether a likelihood has variances to draw.
///
/// # Errors
/// [`Error::Setting`] for the tempered one.
pub fn sampled_likelihood(model: NoiseModel) -> Result<()> {
    match model {
        NoiseModel::Iid | NoiseModel::Ar1 => Ok(()),
        NoiseModel::Tempered => Err(Error::Setting {
            key: "noise.uncertainty".into(),
            problem: "\"sampled\" draws the variance of a likelihood, and a tempered one is none"
                .into(),
            remedy:
                "set noise.model = \"ar1\" (or \"iid\") as well, or leave noise.uncertainty out"
                    .into(),
        }),
    }
}

fn check(given: &Given<'_>, settings: &InferenceSettings) -> Result<()> {
    sampled_likelihood(given.noise.model)?;
    require_draws(settings)?;
    let prior = &given.problem.prior;
    let bounded = |k: &usize| prior.lower[*k] > f64::NEG_INFINITY;
    let mixed = |columns: &Vec<usize>| columns.iter().any(bounded) && !columns.iter().all(bounded);
    if let Some(columns) = prior.columns().iter().find(|columns| mixed(columns)) {
        return Err(Error::Setting {
            key: "noise.uncertainty".into(),
            problem: format!(
                "`{}` belongs to a component of which only some columns have bounds",
                given.problem.names[columns[0]]
            ),
            remedy: "set library.nonnegative = false".into(),
        });
    }
    Ok(())
}

/// Noise group of each joint, and each group's prior.
fn groups(given: &Given<'_>) -> (Vec<usize>, Vec<(f64, f64)>) {
    let joints = &given.grams.joints;
    let group: Vec<usize> = if given.noise.per_joint {
        (0..joints.len()).collect()
    } else {
        vec![0; joints.len()]
    };
    let count = group.iter().max().map_or(0, |g| g + 1);
    let prior = (0..count)
        .map(|g| {
            given.prior.noise.unwrap_or_else(|| {
                let own = joints.iter().zip(&group).filter(|(_, own)| **own == g);
                let (rows, squares) = own.fold((0.0, 0.0), |(rows, squares), (joint, _)| {
                    let last = joint.columns.len();
                    (rows + joint.n, squares + joint.s0.at(last, last))
                });
                let mean = if rows > 0.0 { squares / rows } else { 1.0 };
                let found = match given.plug_in.noise {
                    phi if phi > 0.0 && given.noise.per_joint => phi / given.plug_in.weight[g],
                    phi if phi > 0.0 => phi,
                    _ => mean,
                };
                (AUTO_SHAPE, auto_scale(found, mean))
            })
        })
        .collect();
    (group, prior)
}

/// How far chains agree.
struct Agreement {
    r_hat: f64,
    ess: f64,
    /// Per component.
    mcse: Vec<f64>,
    /// The quantity that they agree least about, and in which words.
    worst: Option<String>,
}

/// Runs the chains, longer where they disagree.
fn chains(
    target: &Target<'_>,
    given: &Given<'_>,
    start: &Noise,
    settings: &InferenceSettings,
) -> Result<(Vec<Trace>, Agreement)> {
    let mut last = None;
    for steps in STEPS_PER_DRAW {
        let size = target.size() as f64;
        let work = 0.4 * (settings.chains * settings.draws * steps) as f64 * size * size * size;
        if last.is_some() && work > WORK_LIMIT {
            break;
        }
        let traces = (0..settings.chains)
            .into_par_iter()
            .map(|chain| run(target, given, start, settings, chain, steps))
            .collect::<Result<Vec<_>>>()?;
        let agreement = judge(target, given, &traces, settings.draws);
        let agree = agreement.worst.is_none();
        last = Some((traces, agreement));
        if agree {
            break;
        }
    }
    match last {
        Some((traces, agreement)) if agreement.worst.is_none() || settings.allow_disagreement => {
            Ok((traces, agreement))
        }
        other => Err(Error::Refused {
            problem: format!(
                "{} chains of {} draws disagree: {}",
                settings.chains,
                settings.draws,
                other.and_then(|o| o.1.worst).unwrap_or_default()
            ),
            remedy: "raise inference.draws, or leave noise.uncertainty out, or allow disagreement"
                .into(),
        }),
    }
}

fn run(
    target: &Target<'_>,
    given: &Given<'_>,
    start: &Noise,
    settings: &InferenceSettings,
    number: usize,
    steps: usize,
) -> Result<Trace> {
    let mut random = Random::new(settings.seed, number as u64);
    let mut holds = vec![false; target.columns.len()];
    if let Some(heaviest) = given.posterior.models.first() {
        let members = heaviest.members.iter();
        members.for_each(|&k| holds[given.posterior.component[k as usize]] = true);
    }
    // Over-dispersed: the heaviest model, none, a few components turned round, many.
    let turned = [0.0, 0.0, 0.2, 0.5][number % 4];
    for (component, inside) in holds.iter_mut().enumerate() {
        let bounded = target.prior.lower[target.columns[component][0]] > f64::NEG_INFINITY;
        // A bounded component starts outside: inside it would need coefficients. A child in without its parent does not stay so for
        // a step: whichever of them is visited first moves.
        *inside = !bounded && number % 4 != 1 && (*inside != (random.uniform() < turned));
    }
    let factor = STARTS[number % STARTS.len()];
    let mut noise = start.clone();
    noise.variance.iter_mut().for_each(|v| *v *= factor);
    let mut chain = Chain::new(target, noise, holds, random);
    let (draws, joints) = (settings.draws, target.grams.len());
    let mut trace = Trace {
        conditional: vec![0.0; target.columns.len() * draws],
        beta: vec![0.0; target.size() * draws],
        log_variance: vec![0.0; joints * draws],
        rho: vec![0.0; joints * draws],
        visits: BTreeMap::new(),
    };
    for _ in 0..settings.draws / 2 * steps {
        chain.step()?;
    }
    for draw in 0..draws {
        for _ in 0..steps {
            chain.step()?;
        }
        let put = |values: &mut Vec<f32>, row: usize, value: f64| {
            values[row * draws + draw] = value as f32;
        };
        for (c, &p) in chain.conditional.iter().enumerate() {
            put(&mut trace.conditional, c, p);
        }
        for (k, &beta) in chain.beta.iter().enumerate() {
            put(&mut trace.beta, k, beta);
        }
        for (j, &rho) in chain.noise.rho.iter().enumerate() {
            let variance = chain.noise.variance[target.group[j]] / (1.0 - rho * rho);
            put(&mut trace.log_variance, j, variance.ln());
            put(&mut trace.rho, j, rho);
        }
        *trace.visits.entry(chain.holds.clone()).or_default() += 1;
    }
    Ok(trace)
}

/// Which array of a [`Trace`].
type Rows = fn(&Trace) -> &[f32];

/// The chains' values of one row.
fn rows(traces: &[Trace], draws: usize, row: usize, of: Rows) -> Vec<Vec<f64>> {
    traces
        .iter()
        .map(|trace| {
            let values = &of(trace)[row * draws..(row + 1) * draws];
            values.iter().map(|&x| f64::from(x)).collect()
        })
        .collect()
}

fn judge(target: &Target<'_>, given: &Given<'_>, traces: &[Trace], draws: usize) -> Agreement {
    let names = &given.problem.names;
    let mut quantities: Vec<(String, Vec<Vec<f64>>)> = (0..target.size())
        .map(|k| (names[k].clone(), rows(traces, draws, k, |t| &t.beta)))
        .collect();
    for joint in (0..target.grams.len()).filter(|&j| target.grams[j].n > 0.0) {
        let word = |what: &str| format!("{what} of joint {}", joint + 1);
        quantities.push((
            word("noise"),
            rows(traces, draws, joint, |t| &t.log_variance),
        ));
        quantities.push((
            word("autocorrelation"),
            rows(traces, draws, joint, |t| &t.rho),
        ));
    }
    let judged: Vec<(f64, f64)> = quantities
        .par_iter()
        .map(|(_, chains)| {
            let halves: Vec<&[f64]> = chains
                .iter()
                .flat_map(|c| [&c[..draws / 2], &c[draws - draws / 2..]])
                .collect();
            let r_hat = if chains.len() > 1 {
                r_hat(chains)
            } else {
                r_hat(&halves)
            };
            // Draws that are all equal (never in, or ρ = 0) agree.
            (if r_hat.is_nan() { 1.0 } else { r_hat }, ess_bulk(chains))
        })
        .collect();
    let mut agreement = Agreement {
        r_hat: 1.0,
        ess: (traces.len() * draws) as f64,
        mcse: Vec::with_capacity(target.columns.len()),
        worst: None,
    };
    for ((name, _), (r_hat, ess)) in quantities.iter().zip(judged) {
        if ess.is_finite() {
            agreement.ess = agreement.ess.min(ess);
        }
        if r_hat > agreement.r_hat {
            agreement.r_hat = r_hat;
            agreement.worst = (r_hat > R_HAT_LIMIT)
                .then(|| format!("R-hat of `{name}` is {r_hat:.3} (limit {R_HAT_LIMIT})"));
        }
    }
    for (c, columns) in target.columns.iter().enumerate() {
        let chains = rows(traces, draws, c, |t| &t.conditional);
        let pips = chains
            .iter()
            .map(|chain| chain.iter().sum::<f64>() / draws as f64);
        let spread = pips.clone().fold(0.0, f64::max) - pips.fold(1.0, f64::min);
        if spread > SPREAD_LIMIT {
            agreement.worst = Some(format!(
                "the inclusion probability of `{}` differs by {spread:.2} between chains",
                names[columns[0]]
            ));
        }
        let mcse = mcse_mean(&chains);
        agreement.mcse.push(if mcse.is_nan() { 0.0 } else { mcse });
    }
    agreement
}

fn summarise(
    given: &Given<'_>,
    target: &Target<'_>,
    traces: &[Trace],
    agreement: &Agreement,
    settings: &InferenceSettings,
) -> Result<Sampled> {
    let draws = settings.draws;
    let all = (traces.len() * draws) as f64;
    let pooled = |row: usize, of: Rows| -> Vec<f64> { rows(traces, draws, row, of).concat() };
    let (plug_in, phi) = mean_noise(given, target, &pooled);
    let mut problem = assemble(given.grams, given.columns, &plug_in, given.prior)?;
    problem.prior.slab = target.slab.iter().map(|s| s * s / phi).collect();
    problem.prior.halves.clear();
    let standard = Standard::new(&problem)?;
    let mut visits: BTreeMap<&[bool], u64> = BTreeMap::new();
    for (holds, count) in traces.iter().flat_map(|trace| &trace.visits) {
        *visits.entry(holds).or_default() += count;
    }
    let found = visits
        .into_iter()
        .map(|(holds, count)| {
            let mut set = vec![0u64; standard.blocks.len().div_ceil(64)];
            for (b, block) in standard.blocks.iter().enumerate() {
                set[b / 64] |= u64::from(holds[block.component]) << (b % 64);
            }
            let (members, positions) = standard.members(&set);
            (count as f64 / all, members, positions)
        })
        .collect();
    let listed = Listed::new(&standard, found, LISTED_MASS, LISTED_MODELS)?;
    let mass = listed.mass();
    let mut models = listed.models;
    for (model, positions) in models.iter_mut().zip(&listed.positions) {
        model.weight /= mass;
        // The chains know the bounds: only the model's moments are missing.
        bounds::truncate(&standard, model, positions, bounds::Weights::Free)?;
    }
    let beta: Vec<Vec<f64>> = (0..target.size()).map(|k| pooled(k, |t| &t.beta)).collect();
    widen(&mut models, &beta, standard.shape, &problem.prior.lower);
    let moments = beta.iter().map(|draws| mean_and_sd(draws));
    let (mean, sd): (Vec<f64>, Vec<f64>) = moments.unzip();
    let pip: Vec<f64> = (0..target.columns.len())
        .map(|c| pooled(c, |t| &t.conditional).iter().sum::<f64>() / all)
        .collect();
    let of_column = |values: &[f64]| -> Vec<f64> {
        let component = problem.prior.component.iter();
        component.map(|&c| values[c]).collect()
    };
    let posterior = Posterior {
        component: problem.prior.component.clone(),
        inclusion: of_column(&pip),
        inclusion_mcse: of_column(&agreement.mcse),
        mean,
        sd,
        shape: standard.shape,
        noise: phi,
        models,
        models_mass: mass.min(1.0),
        log_evidence: None,
        method: Method::Gibbs {
            chains: settings.chains,
            draws,
            r_hat: agreement.r_hat,
            ess: agreement.ess,
        },
    };
    let noise = (0..target.grams.len())
        .map(|joint| {
            let sigma = interval95(pooled(joint, |t| &t.log_variance));
            NoiseInterval {
                sigma95: sigma.map(|log| (0.5 * log).exp()),
                rho95: target
                    .autoregressive
                    .then(|| interval95(pooled(joint, |t| &t.rho))),
            }
        })
        .collect();
    Ok(Sampled {
        plug_in,
        problem,
        posterior,
        noise,
    })
}

/// Weights and ρ that stand for the draws, and φ: mean ρ, and the innovation variance with which the stationary one has its
/// mean.
fn mean_noise(
    given: &Given<'_>,
    target: &Target<'_>,
    pooled: &dyn Fn(usize, Rows) -> Vec<f64>,
) -> (PlugIn, f64) {
    let mut plug_in = given.plug_in.clone();
    let (mut sum, mut rows) = (0.0, 0.0);
    let mut variance = Vec::with_capacity(target.grams.len());
    for (joint, gram) in target.grams.iter().enumerate() {
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
        let rho = mean(pooled(joint, |t| &t.rho));
        let stationary = mean(
            pooled(joint, |t| &t.log_variance)
                .iter()
                .map(|log| log.exp())
                .collect(),
        );
        if gram.n > 0.0 {
            plug_in.rho[joint] = rho;
        }
        let own = stationary * (1.0 - plug_in.rho[joint] * plug_in.rho[joint]);
        sum += gram.n * own.ln();
        rows += gram.n;
        variance.push(own);
    }
    let phi = (sum / rows).exp();
    for (joint, own) in variance.into_iter().enumerate() {
        let informed = target.grams[joint].n > 0.0;
        plug_in.weight[joint] = if informed { phi / own } else { 1.0 };
    }
    plug_in.noise = phi;
    (plug_in, phi)
}

/// Widens the listed models' laws to the spread of the draws: given that a column is in, the mixture has the draws' variance.
fn widen(models: &mut [Model], beta: &[Vec<f64>], shape: f64, lower: &[f64]) {
    let mut factor = vec![1.0; beta.len()];
    let (mut weight, mut within) = (vec![0.0; beta.len()], vec![0.0; beta.len()]);
    let (mut first, mut second) = (vec![0.0; beta.len()], vec![0.0; beta.len()]);
    for model in models.iter() {
        let count = model.members.len();
        let diagonal = Cholesky::from_lower(model.factor.clone(), count).inverse_diagonal();
        let phi = model.scale / (shape - 1.0).max(f64::MIN_POSITIVE);
        for (i, &k) in model.members.iter().enumerate() {
            let k = k as usize;
            weight[k] += model.weight;
            within[k] += model.weight * phi * diagonal[i];
            first[k] += model.weight * model.mean[i];
            second[k] += model.weight * model.mean[i] * model.mean[i];
        }
    }
    for (k, draws) in beta.iter().enumerate() {
        let inside: Vec<f64> = draws.iter().copied().filter(|x| *x != 0.0).collect();
        if inside.len() < ENOUGH || lower[k] > f64::NEG_INFINITY || within[k] <= 0.0 {
            continue;
        }
        let sd = mean_and_sd(&inside).1;
        let between = second[k] / weight[k] - (first[k] / weight[k]).powi(2);
        let ratio = (sd * sd - between.max(0.0)) * weight[k] / within[k];
        factor[k] = ratio.max(0.0).sqrt().clamp(WIDEN.0, WIDEN.1);
    }
    for model in models {
        let count = model.members.len();
        for (i, &k) in model.members.iter().enumerate() {
            // A = L Lᵀ, cov = φ A⁻¹: D cov D is D⁻¹ L.
            let row = &mut model.factor[i * count..(i + 1) * count];
            row.iter_mut().for_each(|x| *x /= factor[k as usize]);
        }
    }
}

fn mean_and_sd(draws: &[f64]) -> (f64, f64) {
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<f64>() / n;
    let variance = draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
    (mean, variance.sqrt())
}

/// 2.5 and 97.5 % of the draws.
fn interval95(mut draws: Vec<f64>) -> [f64; 2] {
    draws.sort_by(f64::total_cmp);
    let last = draws.len() - 1;
    [0.025, 0.975].map(|p| draws[(p * last as f64).round() as usize])
}

#[cfg(test)]
mod tests;
