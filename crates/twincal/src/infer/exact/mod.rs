//! All 2^C models, none stored: an elimination tree that shares Schur complements (method section 7).
//!
//! A node decides one column, the first of a component for the others. Excluding it costs one row operation, including
//! it one rank-1 Schur complement; a leaf is one logarithm and one exponential. Sums of weights, inclusions, means and
//! second moments come back up the tree, so the work is O(2^C) in all. The first three components are the lanes, the
//! next ones the tasks of the thread pool, in an order that depends on the problem only: any number of threads gives the
//! same bytes. Components that no model worth counting leaves out ([`super::certain`]) are not branched on, and subtrees whose
//! models together weigh next to nothing are not visited (`ahead.rs`): all that is left out weighs, by a
//! bound, less than 1e-10 of the sum, or 1e-8 where more than 20 components are to be decided.

mod ahead;
mod eliminate;
mod near_root;
mod node;
mod plan;
mod subtree;
mod sums;
mod tally;
mod tree;
mod walk;

use super::answer::{Averages, LISTED_MASS, LISTED_MODELS, Listed, posterior};
#[cfg(test)]
use super::certain;
use super::certainty::{self, Certain};
use super::joined::settle;
use super::reduced::Reduced;
use super::standard::Standard;
use crate::error::{Error, Result};
use crate::posterior::{Method, Posterior, Problem};
use sums::Layout;

/// Largest number of components that are branched on: sets of them are the bits of a u32.
const BRANCHES: usize = 30;
/// The posterior by summing over all models, whatever their number.
#[cfg(test)]
pub(super) fn enumerate(problem: &Problem) -> Result<Posterior> {
    let standard = Standard::new(problem)?;
    let certain = certain::components(&standard, problem, None);
    sum(problem, &certain)
}

/// The posterior by summing over all models; the certain components are not branched on.
///
/// # Errors
/// Those of [`super::infer`].
pub(super) fn sum(problem: &Problem, sure: &Certain) -> Result<Posterior> {
    let (order, certain) = certainty::order(&problem.prior, sure);
    if order.len() - certain > BRANCHES {
        return Err(Error::Setting {
            key: "inference.method".into(),
            problem: format!("2^{} models cannot be summed", order.len() - certain),
            remedy: "use `auto` or `gibbs`".into(),
        });
    }
    let standard = Standard::in_order(problem, &order)?;
    let size = standard.size();
    let (sums, tally) = walk::sum_all_models(&standard, &problem.prior, certain, sure.reference);
    let layout = Layout::new(size);
    let weight = sums[layout.weight()];
    let share = |index: usize| sums[index] / weight;
    let factor = standard.noise_factor();
    let mut averages = Averages {
        inclusion: (0..size).map(|d| share(layout.inclusion(d))).collect(),
        mcse: vec![0.0; size],
        shift: (0..size).map(|d| share(layout.shift(d))).collect(),
        moment: (0..size).map(|d| share(layout.moment(d, d))).collect(),
        misfit: if factor.is_finite() {
            share(layout.noise()) / factor
        } else {
            1.0
        },
    };
    let found = tally
        .into_models()
        .into_iter()
        .map(|(own, mask)| {
            let (members, positions) = standard.members(&set(&standard, certain, mask));
            (own / weight, members, positions)
        })
        .collect();
    let listed = Listed::new(&standard, found, LISTED_MASS, LISTED_MODELS)?;
    let (listed, log_growth) = settle(
        problem,
        &Reduced::new(&standard, sure),
        &mut averages,
        listed,
    )?;
    let log_evidence = standard.log_evidence(weight.ln() - tree::LOG_REFERENCE);
    let models = problem.prior.admissible_models();
    Ok(posterior(
        &standard,
        &averages,
        listed,
        Some(log_evidence + log_growth),
        Method::Exact { models },
    ))
}

/// The first `certain` components and those of a mask of the others, one bit each.
fn set(standard: &Standard, certain: usize, mask: u32) -> Vec<u64> {
    let count = standard.blocks.len();
    let mut set = vec![0; count.div_ceil(64)];
    (0..count)
        .filter(|b| b.checked_sub(certain).is_none_or(|b| mask >> b & 1 == 1))
        .for_each(|b| set[b / 64] |= 1 << (b % 64));
    set
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod unvisited;
