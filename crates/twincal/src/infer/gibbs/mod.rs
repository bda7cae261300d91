//! A collapsed Gibbs sampler of the structure, for any number of columns (method section 7).
//!
//! Chains start far apart and must agree: if R̂ or the inclusion probabilities of the chains differ, they are run again
//! with more scans per draw, and refused if that does not help.

mod chain;
mod random;
mod swaps;
mod tableau;

use super::InferenceSettings;
use super::exact::{LISTED_MASS, LISTED_MODELS};
use super::standard::Standard;
use crate::diagnostics::{ess_bulk, mcse_mean, r_hat};
use crate::error::{Error, Result};
use crate::posterior::{Method, Model, Posterior, Problem};
use chain::{Length, Trace};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Largest R̂ of chains that agree.
const R_HAT_LIMIT: f64 = 1.01;
/// Largest difference of a PIP between chains that agree.
const SPREAD_LIMIT: f64 = 0.1;
/// Scans per draw, tried in this order.
const SCANS_PER_DRAW: [usize; 4] = [4, 16, 64, 256];
/// Multiplications after which no longer run is tried (some minutes).
const WORK_LIMIT: f64 = 4e11;
/// Fewest draws per chain that can be judged.
const LEAST_DRAWS: usize = 100;

/// How far the chains agree, per position.
struct Agreement {
    r_hat: Vec<f64>,
    ess: Vec<f64>,
    mcse: Vec<f64>,
    /// Largest difference of the PIP between two chains.
    spread: Vec<f64>,
}

/// The posterior by Markov chains.
///
/// # Errors
/// Those of [`super::infer`].
pub(super) fn sample(problem: &Problem, settings: &InferenceSettings) -> Result<Posterior> {
    if settings.chains == 0 || settings.draws < LEAST_DRAWS {
        let key = if settings.chains == 0 {
            "inference.chains"
        } else {
            "inference.draws"
        };
        return Err(Error::Setting {
            key: key.into(),
            problem: format!(
                "{} chains of {} draws cannot be judged",
                settings.chains, settings.draws
            ),
            remedy: format!(
                "use at least 1 chain (better 4) and {LEAST_DRAWS} draws (better 5000)"
            ),
        });
    }
    let standard = Standard::new(problem)?;
    let mut best: Option<(Vec<Trace>, Agreement)> = None;
    for scans_per_draw in SCANS_PER_DRAW {
        let length = Length {
            warm_up: settings.draws / 2,
            draws: settings.draws,
            scans_per_draw,
        };
        let size = standard.size() as f64;
        let work = 1.5 * (settings.chains * settings.draws * scans_per_draw) as f64 * size * size;
        if best.is_some() && work > WORK_LIMIT {
            break;
        }
        let traces: Vec<Trace> = (0..settings.chains)
            .into_par_iter()
            .map(|chain| chain::run(&standard, &problem.prior, settings.seed, chain, length))
            .collect();
        let agreement = judge(&standard, &traces, settings.draws);
        let agree = disagreement(&agreement).is_none();
        best = Some((traces, agreement));
        if agree {
            break;
        }
    }
    let Some((traces, agreement)) = best else {
        return Err(Error::Setting {
            key: "inference.draws".into(),
            problem: "no run was tried".into(),
            remedy: "use fewer draws".into(),
        });
    };
    if let Some((d, why)) = disagreement(&agreement).filter(|_| !settings.allow_disagreement) {
        return Err(Error::Refused {
            problem: format!(
                "{} chains of {} draws disagree, most about `{}`: {why}",
                settings.chains, settings.draws, problem.names[standard.order[d]]
            ),
            remedy: "raise inference.draws, or remove columns that the data cannot tell apart, or allow disagreement"
                .into(),
        });
    }
    summarise(&standard, &traces, &agreement, settings)
}

/// See [`super::scan`].
pub(super) fn scan(problem: &Problem, scans: usize, seed: u64) -> Result<u64> {
    let standard = Standard::new(problem)?;
    let length = Length {
        warm_up: 1,
        draws: 1,
        scans_per_draw: scans / 2,
    };
    Ok(chain::run(&standard, &problem.prior, seed, 0, length).moves)
}

fn judge(standard: &Standard, traces: &[Trace], draws: usize) -> Agreement {
    let judged: Vec<[f64; 4]> = (0..standard.size())
        .into_par_iter()
        .map(|d| {
            let chains = |values: fn(&Trace) -> &[f32]| -> Vec<Vec<f64>> {
                let of = |t: &Trace| {
                    values(t)[d * draws..(d + 1) * draws]
                        .iter()
                        .map(|&x| f64::from(x))
                        .collect()
                };
                traces.iter().map(of).collect()
            };
            let beta = chains(|t| &t.beta);
            let conditional = chains(|t| &t.conditional);
            // One chain is compared with itself: its halves.
            let halves: Vec<&[f64]> = beta
                .iter()
                .flat_map(|c| [&c[..draws / 2], &c[draws - draws / 2..]])
                .collect();
            let r_hat = if traces.len() > 1 {
                r_hat(&beta)
            } else {
                r_hat(&halves)
            };
            // Draws that are all equal (never included) agree.
            let r_hat = if r_hat.is_nan() { 1.0 } else { r_hat };
            let pips = traces.iter().map(|t| t.inclusion[d] / draws as f64);
            let spread = pips.clone().fold(0.0, f64::max) - pips.fold(1.0, f64::min);
            [
                r_hat,
                ess_bulk(&beta),
                mcse_mean(&conditional),
                spread.max(0.0),
            ]
        })
        .collect();
    let column = |i: usize| judged.iter().map(|row| row[i]).collect();
    Agreement {
        r_hat: column(0),
        ess: column(1),
        mcse: column(2),
        spread: column(3),
    }
}

/// The position that the chains disagree about most, and in which words.
fn disagreement(agreement: &Agreement) -> Option<(usize, String)> {
    let worst = |values: &[f64]| (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]));
    if let Some(d) = worst(&agreement.spread).filter(|&d| agreement.spread[d] > SPREAD_LIMIT) {
        return Some((
            d,
            format!(
                "its inclusion probability differs by {:.2} between chains",
                agreement.spread[d]
            ),
        ));
    }
    worst(&agreement.r_hat)
        .filter(|&d| agreement.r_hat[d] > R_HAT_LIMIT)
        .map(|d| {
            (
                d,
                format!("R-hat is {:.3} (limit {R_HAT_LIMIT})", agreement.r_hat[d]),
            )
        })
}

fn summarise(
    standard: &Standard,
    traces: &[Trace],
    agreement: &Agreement,
    settings: &InferenceSettings,
) -> Result<Posterior> {
    let draws = (settings.chains * settings.draws) as f64;
    let mean_of = |sums: fn(&Trace) -> &[f64], d: usize| {
        traces.iter().map(|t| sums(t)[d]).sum::<f64>() / draws
    };
    let shift = |d: usize| mean_of(|t| &t.shift, d);
    let variance = |d: usize| (mean_of(|t| &t.moment, d) - shift(d) * shift(d)).max(0.0);
    let factor = standard.noise_factor();
    let misfit = traces.iter().map(|t| t.misfit).sum::<f64>() / draws;
    let inclusion = |d: usize| mean_of(|t| &t.inclusion, d).clamp(0.0, 1.0);
    let (models, models_mass) = list(standard, traces, draws)?;
    Ok(Posterior {
        component: standard.component.clone(),
        inclusion: standard.in_columns(inclusion),
        inclusion_mcse: standard.in_columns(|d| agreement.mcse[d]),
        mean: standard.coefficients(|d| standard.center[d] + shift(d)),
        sd: standard.coefficients(|d| match inclusion(d) > 0.0 {
            true if factor.is_finite() => variance(d).sqrt(),
            true => f64::INFINITY,
            false => 0.0,
        }),
        shape: standard.shape,
        noise: standard.noise(misfit * factor),
        models,
        models_mass,
        log_evidence: None,
        method: Method::Gibbs {
            chains: settings.chains,
            draws: settings.draws,
            r_hat: agreement.r_hat.iter().copied().fold(1.0, f64::max),
            ess: agreement.ess.iter().copied().fold(draws, f64::min),
        },
    })
}

/// Visited models by how often they were visited, most often first.
fn list(standard: &Standard, traces: &[Trace], draws: f64) -> Result<(Vec<Model>, f64)> {
    let mut visits: BTreeMap<&[u64], u64> = BTreeMap::new();
    for (set, count) in traces.iter().flat_map(|t| &t.visits) {
        *visits.entry(set).or_default() += count;
    }
    let mut found: Vec<(u64, Vec<u32>, Vec<usize>)> = visits
        .into_iter()
        .map(|(set, count)| {
            let positions: Vec<usize> = (0..standard.size())
                .filter(|d| set[d / 64] >> (d % 64) & 1 == 1)
                .collect();
            let mut members: Vec<u32> = positions
                .iter()
                .map(|&d| standard.order[d] as u32)
                .collect();
            members.sort_unstable();
            (count, members, positions)
        })
        .collect();
    found.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    let mut listed = 0;
    let mut models = Vec::new();
    for (count, _, positions) in found {
        if models.len() == LISTED_MODELS || listed as f64 >= LISTED_MASS * draws {
            break;
        }
        listed += count;
        models.push((positions, count));
    }
    let total = listed as f64;
    let models: Result<Vec<Model>> = models
        .iter()
        .map(|(positions, count)| standard.model(positions, *count as f64 / total))
        .collect();
    Ok((models?, total / draws))
}

#[cfg(test)]
mod tests;
