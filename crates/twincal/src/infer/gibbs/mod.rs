//! A collapsed Gibbs sampler of the structure, for any number of columns (method section 7).
//!
//! Chains start far apart and must agree: if R̂ or the inclusion probabilities of the chains differ, they are run again
//! with more scans per draw, and refused if that does not help.

mod acceptance;
mod chain;
mod jumps;
mod random;
mod state;
mod swaps;

use super::answer::{Averages, LISTED_MASS, LISTED_MODELS, Listed, posterior};
use super::exchanges::exchanges;
use super::reduced::Reduced;
use super::standard::Standard;
use super::{InferenceSettings, bounds, certain, certainty};
use crate::diagnostics::{NormalScores, convergence, mcse_mean};
use crate::error::{Error, Result};
use crate::posterior::{Method, Posterior, Problem};
use chain::{Length, Target, Trace};
use jumps::Jumps;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Largest R̂ of chains that agree.
pub const R_HAT_LIMIT: f64 = 1.01;
/// Largest difference of a PIP between chains that agree.
pub(super) const SPREAD_LIMIT: f64 = 0.1;
/// Scans per draw, tried in this order. Runs that know what the ones before them found are tried at the same length first.
const SCANS_PER_DRAW: [usize; 9] = [1, 1, 1, 1, 4, 4, 16, 64, 256];
/// The shortest runs count only if they are far better than chains that agree have to be: share of independent draws among
/// all of them, and standard error of the probabilities.
const MIXED: (f64, f64) = (0.05, 0.004);
/// Multiplications after which no longer run is tried (about 20 s).
pub(super) const WORK_LIMIT: f64 = 3e10;
/// The same where chains agree already.
const WORK_FOR_PRECISION: f64 = 5e9;
/// Fewest chains that can disagree, and fewest draws per chain that can be judged.
pub const LEAST_CHAINS: usize = 2;
/// See [`LEAST_CHAINS`].
pub const LEAST_DRAWS: usize = 100;

/// How far the chains agree.
struct Agreement {
    /// Of β, per position.
    r_hat: Vec<f64>,
    ess: Vec<f64>,
    /// Of the PIP, per component of [`Reduced::open`]; the others have none.
    mcse: Vec<f64>,
    /// Whether the PIP is that of [`Trace::jumped`], likewise.
    by_list: Vec<bool>,
    /// Largest difference of the PIP between two chains, likewise.
    spread: Vec<f64>,
}

impl Agreement {
    /// Draws that are nearly independent, see [`MIXED`].
    fn mixed(&self, draws: f64) -> bool {
        let independent = self.ess.iter().copied().fold(draws, f64::min);
        let error = self.mcse.iter().copied().fold(0.0, f64::max);
        independent >= MIXED.0 * draws && error <= MIXED.1
    }
}

/// Chains of one length.
struct Run {
    traces: Vec<Trace>,
    agreement: Agreement,
    /// The list that they jumped on.
    jumps: Jumps,
    /// Chains do not disagree.
    agree: bool,
    /// Probabilities are precise enough, or the run is longer than the shortest.
    mixed: bool,
}

impl Run {
    /// Multiplications that another run may cost: chains that agree are only made more precise by it.
    fn work_for_another(&self) -> f64 {
        if self.agree {
            WORK_FOR_PRECISION
        } else {
            WORK_LIMIT
        }
    }
}

/// Multiplications of a run over `columns` columns.
fn work(settings: &InferenceSettings, length: Length, columns: usize) -> f64 {
    let scans = settings.chains * settings.draws * length.scans_per_draw;
    1.5 * scans as f64 * (columns as f64).powi(2)
}

/// The posterior by Markov chains; `near`: one that is known to be near.
///
/// # Errors
/// Those of [`super::infer`].
pub(super) fn sample(
    problem: &Problem,
    near: Option<&Posterior>,
    settings: &InferenceSettings,
    most_bytes: Option<u64>,
) -> Result<Posterior> {
    require_draws(settings)?;
    let standard = Standard::new(problem)?;
    let certain = certain::components(&standard, problem, near);
    let reduced = Reduced::new(&standard, &certain);
    require_room(&reduced, settings, most_bytes)?;
    let jumps = Jumps::of(&reduced, problem, near);
    chains(problem, settings, &reduced, jumps, true)
}

/// Refuses chains that nobody could judge.
///
/// # Errors
/// [`Error::Setting`] naming `inference.chains` or `inference.draws`.
pub(super) fn require_draws(settings: &InferenceSettings) -> Result<()> {
    let key = match (settings.chains, settings.draws) {
        (chains, _) if chains < LEAST_CHAINS => "inference.chains",
        (_, draws) if draws < LEAST_DRAWS => "inference.draws",
        _ => return Ok(()),
    };
    Err(Error::Setting {
        key: key.into(),
        problem: format!(
            "{} chains of {} draws cannot be judged",
            settings.chains, settings.draws
        ),
        remedy: format!(
            "use at least {LEAST_CHAINS} chains (better 4) and {LEAST_DRAWS} draws (better 5000)"
        ),
    })
}

/// Refuses chains whose draws need more than `most` bytes; the longest run so far stands beside the next one.
///
/// # Errors
/// [`Error::Setting`] with both numbers.
fn require_room(
    reduced: &Reduced<'_>,
    settings: &InferenceSettings,
    most: Option<u64>,
) -> Result<()> {
    let of_chain = chain::bytes(reduced, settings.draws);
    let needed = of_chain.saturating_mul(2 * settings.chains as u64);
    match most {
        Some(most) if needed > most => Err(Error::Setting {
            key: "inference.draws".into(),
            problem: format!(
                "{} draws of {} chains need up to {:.1} MB of memory, and {:.1} MB are free",
                settings.draws,
                settings.chains,
                1e-6 * needed as f64,
                1e-6 * most as f64
            ),
            remedy: "use fewer draws or chains".into(),
        }),
        _ => Ok(()),
    }
}

/// [`sample`] with a given list of models to jump between; with `share`, chains that are run again know what all of them
/// visited.
fn chains(
    problem: &Problem,
    settings: &InferenceSettings,
    reduced: &Reduced<'_>,
    jumps: Jumps,
    share: bool,
) -> Result<Posterior> {
    let Some(run) = longest(problem, settings, reduced, jumps, share) else {
        return Err(Error::Setting {
            key: "inference.draws".into(),
            problem: "no run was tried".into(),
            remedy: "use fewer draws".into(),
        });
    };
    if let Some((d, why)) =
        disagreement(reduced, &run.agreement).filter(|_| !settings.allow_disagreement)
    {
        return Err(Error::Refused {
            problem: format!(
                "{} chains of {} draws disagree, most about `{}`: {why}",
                settings.chains, settings.draws, problem.names[reduced.full.order[d]]
            ),
            remedy: "raise inference.draws, or remove columns that the data cannot tell apart, or allow disagreement"
                .into(),
        });
    }
    summarise(reduced, &run, settings)
}

/// Runs of growing length, until one is enough or the next would cost too much: the last of them.
fn longest(
    problem: &Problem,
    settings: &InferenceSettings,
    reduced: &Reduced<'_>,
    mut jumps: Jumps,
    share: bool,
) -> Option<Run> {
    let standard = &reduced.open;
    let exchanges = exchanges(standard, &problem.prior, &reduced.active, false);
    let mut best: Option<Run> = None;
    for scans_per_draw in SCANS_PER_DRAW {
        let length = Length {
            warm_up: settings.draws / 4,
            draws: settings.draws,
            scans_per_draw,
        };
        if let Some(run) = &best {
            if work(settings, length, standard.size()) > run.work_for_another() {
                break;
            }
            if share {
                let visited = run.traces.iter().flat_map(|trace| trace.visits.keys());
                jumps = jumps.joined(visited.cloned().collect(), reduced, problem);
            }
        }
        let target = Target {
            reduced,
            prior: &problem.prior,
            exchanges: &exchanges,
            jumps: &jumps,
        };
        let traces: Vec<Trace> = (0..settings.chains)
            .into_par_iter()
            .map(|chain| chain::run(target, settings.seed, chain, length))
            .collect();
        let agreement = judge(reduced, &traces, settings.draws);
        let run = Run {
            agree: disagreement(reduced, &agreement).is_none(),
            mixed: scans_per_draw > SCANS_PER_DRAW[0]
                || agreement.mixed((settings.chains * settings.draws) as f64),
            traces,
            agreement,
            jumps: jumps.clone(),
        };
        let enough = run.agree && run.mixed;
        best = Some(run);
        if enough {
            break;
        }
    }
    best
}

/// See [`super::scan`].
pub(super) fn scan(problem: &Problem, scans: usize, seed: u64) -> Result<u64> {
    let standard = Standard::new(problem)?;
    let reduced = Reduced::whole(&standard, &certainty::none(&problem.prior));
    let target = Target {
        reduced: &reduced,
        prior: &problem.prior,
        exchanges: &exchanges(&standard, &problem.prior, &reduced.active, false),
        jumps: &Jumps::none(),
    };
    let length = Length {
        warm_up: 1,
        draws: 1,
        scans_per_draw: scans / 2,
    };
    Ok(chain::run(target, seed, 0, length).moves)
}

/// The chains' values of one row, `[row * draws + draw]`.
fn rows(traces: &[Trace], draws: usize, row: usize, values: fn(&Trace) -> &[f32]) -> Vec<Vec<f64>> {
    let of = |t: &Trace| {
        values(t)[row * draws..(row + 1) * draws]
            .iter()
            .map(|&x| f64::from(x))
            .collect()
    };
    traces.iter().map(of).collect()
}

fn judge(reduced: &Reduced<'_>, traces: &[Trace], draws: usize) -> Agreement {
    // One chain is compared with itself: its halves.
    let halved = traces.len() < 2;
    let (chains, each) = if halved {
        (2 * traces.len(), draws / 2)
    } else {
        (traces.len(), draws)
    };
    let scores = NormalScores::new(chains * (each / 2) * 2);
    let (r_hat, ess) = (0..reduced.full.size())
        .into_par_iter()
        .map(|d| {
            let beta = rows(traces, draws, d, |t| &t.beta);
            let halves: Vec<&[f64]> = beta
                .iter()
                .flat_map(|c| [&c[..draws / 2], &c[draws - draws / 2..]])
                .collect();
            let (r_hat, ess) = if halved {
                convergence(&halves, &scores)
            } else {
                convergence(&beta, &scores)
            };
            // Draws that are all equal (never included) agree.
            (if r_hat.is_nan() { 1.0 } else { r_hat }, ess)
        })
        .unzip();
    let unseen = 1.0 / (traces.len() * draws) as f64;
    let judged: Vec<(f64, bool, f64)> = (0..reduced.open.blocks.len())
        .into_par_iter()
        .map(|b| {
            let scanned = traces.iter().map(|t| t.inclusion[b] / draws as f64);
            let jumped = traces.iter().map(|t| t.jumped_inclusion[b] / draws as f64);
            // What the memory of the chains says, or the scatter of their means: rare visits hide from the first.
            let scans = mcse_mean(&rows(traces, draws, b, |t| &t.conditional))
                .max(standard_error(scanned.clone()));
            let list = mcse_mean(&rows(traces, draws, b, |t| &t.jumped))
                .max(standard_error(jumped.clone()));
            // The conditionals know no bounds.
            let by_list = reduced.full.bounded || list < scans;
            let (error, spread) = if by_list {
                (list, range(jumped))
            } else {
                (scans, range(scanned))
            };
            // A model that N draws never met may have about 1/N of the mass.
            let known = reduced.certain.contains(&b);
            let error = if known { 0.0 } else { error.hypot(unseen) };
            (error, by_list, spread)
        })
        .collect();
    Agreement {
        r_hat,
        ess,
        mcse: judged.iter().map(|j| j.0).collect(),
        by_list: judged.iter().map(|j| j.1).collect(),
        spread: judged.iter().map(|j| j.2).collect(),
    }
}

/// Largest less smallest.
fn range(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(0.0, f64::max);
    (largest - values.fold(1.0, f64::min)).max(0.0)
}

/// Standard error of the mean of independent values; 0 for one alone.
fn standard_error(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    if count < 2.0 {
        return 0.0;
    }
    let mean = values.clone().sum::<f64>() / count;
    let square: f64 = values.map(|x| (x - mean) * (x - mean)).sum();
    (square / (count * (count - 1.0))).sqrt()
}

/// The position that the chains disagree about most, and in which words.
fn disagreement(reduced: &Reduced<'_>, agreement: &Agreement) -> Option<(usize, String)> {
    let worst = |values: &[f64]| (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]));
    if let Some(d) = worst(&agreement.spread).filter(|&b| agreement.spread[b] > SPREAD_LIMIT) {
        return Some((
            reduced.first_position(d),
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

fn summarise(reduced: &Reduced<'_>, run: &Run, settings: &InferenceSettings) -> Result<Posterior> {
    let Run {
        traces,
        agreement,
        jumps,
        ..
    } = run;
    let standard = reduced.full;
    let draws = (settings.chains * settings.draws) as f64;
    let mean_of = |sums: fn(&Trace) -> &[f64], d: usize| {
        traces.iter().map(|t| sums(t)[d]).sum::<f64>() / draws
    };
    let block = standard.block_of();
    let positions = 0..standard.size();
    let inclusion: Vec<f64> = (0..reduced.open.blocks.len())
        .map(|b| {
            let pip = if agreement.by_list[b] {
                mean_of(|t| &t.jumped_inclusion, b)
            } else {
                mean_of(|t| &t.inclusion, b)
            };
            pip.clamp(0.0, 1.0)
        })
        .collect();
    let (inclusion, mcse) = (
        reduced.by_block(&inclusion, 1.0),
        reduced.by_block(&agreement.mcse, 0.0),
    );
    let mut averages = Averages {
        inclusion: block.iter().map(|&b| inclusion[b]).collect(),
        mcse: block.iter().map(|&b| mcse[b]).collect(),
        shift: positions
            .clone()
            .map(|d| mean_of(|t| &t.shift, d))
            .collect(),
        moment: positions.map(|d| mean_of(|t| &t.moment, d)).collect(),
        misfit: traces.iter().map(|t| t.misfit).sum::<f64>() / draws,
    };
    let listed = Listed::new(
        standard,
        visited(reduced, traces, jumps, draws),
        LISTED_MASS,
        LISTED_MODELS,
    )?;
    let log_weights = listed.models.iter().map(|m| m.weight.ln()).collect();
    let whole = bounds::Weights::Whole;
    let (listed, _) = bounds::apply(standard, &mut averages, listed, log_weights, whole)?;
    let method = Method::Gibbs {
        chains: settings.chains,
        draws: settings.draws,
        r_hat: agreement.r_hat.iter().copied().fold(1.0, f64::max),
        ess: agreement.ess.iter().copied().fold(draws, f64::min),
    };
    Ok(posterior(standard, &averages, listed, None, method))
}

/// Visited models, with columns and positions: those listed share the draws in the list by their weights, others have theirs.
fn visited(
    reduced: &Reduced<'_>,
    traces: &[Trace],
    jumps: &Jumps,
    draws: f64,
) -> Vec<(f64, Vec<u32>, Vec<usize>)> {
    let listed = traces.iter().map(|t| t.listed).sum::<u64>() as f64 / draws;
    let mut shares: BTreeMap<&[u64], f64> = BTreeMap::new();
    if listed > 0.0 {
        let weighted = jumps.weighted();
        shares.extend(weighted.map(|(set, share)| (set.as_slice(), listed * share)));
    }
    let visits = traces.iter().flat_map(|t| &t.visits);
    for (set, &count) in visits.filter(|(set, _)| !jumps.lists(set)) {
        *shares.entry(set).or_default() += count as f64 / draws;
    }
    shares
        .into_iter()
        .map(|(set, share)| {
            let (members, positions) = reduced.members(set);
            (share, members, positions)
        })
        .collect()
}

#[cfg(test)]
mod tests;
