//! From a [`Problem`] to a [`Posterior`]: every model (exact) or a Markov chain over models (Gibbs).

mod exact;
mod gibbs;
mod standard;
#[cfg(test)]
mod testing;

use crate::error::{Error, Result};
use crate::posterior::{Posterior, Problem};

/// `[inference] method`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// Exact up to [`EXACT_LIMIT`] columns, Gibbs beyond.
    Auto,
    /// All 2^K models.
    Exact,
    /// Collapsed Gibbs.
    Gibbs,
}

/// Largest K for which `auto` enumerates.
pub const EXACT_LIMIT: usize = 28;

/// `[inference]`.
#[derive(Debug, Clone, PartialEq)]
pub struct InferenceSettings {
    /// Method.
    pub method: Choice,
    /// Chains.
    pub chains: usize,
    /// Draws per chain after warm-up.
    pub draws: usize,
    /// Seed.
    pub seed: u64,
    /// Report disagreeing chains instead of refusing them (exit code 4).
    pub allow_disagreement: bool,
}

/// The posterior of `problem` by the chosen method.
///
/// # Errors
/// [`crate::Error::Setting`] for an impossible setting, [`crate::Error::NotFinite`] naming the column,
/// [`crate::Error::Refused`] when chains disagree.
pub fn infer(problem: &Problem, settings: &InferenceSettings) -> Result<Posterior> {
    let size = problem.xy.len();
    match settings.method {
        Choice::Auto if size <= EXACT_LIMIT => exact::enumerate(problem),
        Choice::Exact if size <= EXACT_LIMIT => exact::enumerate(problem),
        Choice::Exact => Err(Error::Setting {
            key: "inference.method".into(),
            problem: format!("`exact` with {size} columns would sum 2^{size} models"),
            remedy: format!("use `auto` or `gibbs`, or at most {EXACT_LIMIT} columns"),
        }),
        Choice::Auto | Choice::Gibbs => gibbs::sample(problem, settings),
    }
}

/// Runs one Gibbs chain for `scans` scans (half of them warm-up) and returns how many of the others' moves were
/// accepted: what a scan costs, and how much one does, without the summaries around it.
///
/// # Errors
/// As [`infer`].
pub fn scan(problem: &Problem, scans: usize, seed: u64) -> Result<u64> {
    gibbs::scan(problem, scans, seed)
}
