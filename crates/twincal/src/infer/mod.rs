//! From a [`Problem`] to a [`Posterior`]: every model (exact), a Markov chain over models (Gibbs), or, for comparing
//! settings, the models that a search finds.

mod answer;
mod approximate;
mod bounds;
mod certain;
mod certainty;
mod check;
mod exact;
mod exchanges;
mod gibbs;
mod joined;
mod kin;
mod moments;
mod pivot;
mod reduced;
mod search;
mod standard;
mod tableau;
mod walker;
#[cfg(test)]
mod testing;

pub use gibbs::{LEAST_CHAINS, LEAST_DRAWS, R_HAT_LIMIT};

use crate::error::{Error, Result};
use crate::posterior::{Posterior, Problem};
use standard::Standard;

/// `[inference] method`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// Exact up to [`EXACT_LIMIT`] uncertain components, Gibbs beyond.
    Auto,
    /// All 2^C models.
    Exact,
    /// Collapsed Gibbs.
    Gibbs,
}

/// Largest number of uncertain components for which `auto` enumerates. Components that no model worth counting leaves
/// out (below e⁻⁴⁰ of a single model's weight) do not count.
pub const EXACT_LIMIT: usize = 28;

/// Columns from which on a walk from the model with everything in it, which loses digits at every step, is avoided where it can be.
const MANY_COLUMNS: usize = 256;

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
///
/// # Example
/// One column that may be in or out: the posterior odds in closed form, with A = G + 1/v and the gain r²/A of the fit.
/// ```
/// use twincal::infer::{Choice, InferenceSettings, infer};
/// use twincal::posterior::Problem;
/// use twincal::prior::{Inclusion, Prior};
///
/// let (g, r, yy, n, v, a0, b0) = (40.0_f64, 12.0_f64, 10.0, 40.0, 1.0, 2.0, 0.5);
/// let problem = Problem {
///     gram: vec![g], xy: vec![r], yy, n, log_constant: 0.0, names: vec!["x".into()],
///     prior: Prior::single(vec![v], vec![0], Inclusion::Probability(0.5), (a0, b0)),
/// };
/// let settings = InferenceSettings { method: Choice::Exact, chains: 2, draws: 100, seed: 1, allow_disagreement: false };
/// let posterior = infer(&problem, &settings)?;
/// let a = g + 1.0 / v;
/// let odds = (v * a).powf(-0.5) * ((b0 + yy / 2.0) / (b0 + (yy - r * r / a) / 2.0)).powf(a0 + n / 2.0);
/// assert!((posterior.inclusion[0] - odds / (1.0 + odds)).abs() < 1e-9);
/// assert!((posterior.mean[0] - posterior.inclusion[0] * r / a).abs() < 1e-9); // over both models
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn infer(problem: &Problem, settings: &InferenceSettings) -> Result<Posterior> {
    checked(problem, by_method(problem, None, settings, None)?)
}

/// [`infer`] where an approximate posterior of the same problem is known: with very many columns a good model to start from is half of the work.
/// Chains whose draws need more than `most_bytes` are refused before they are allocated: where that fails the process ends.
///
/// # Errors
/// Those of [`infer`], and [`crate::Error::Setting`] for too many draws.
pub fn infer_near(
    problem: &Problem,
    near: &Posterior,
    settings: &InferenceSettings,
    most_bytes: Option<u64>,
) -> Result<Posterior> {
    let near = Some(near).filter(|_| problem.names.len() > MANY_COLUMNS);
    checked(problem, by_method(problem, near, settings, most_bytes)?)
}

fn checked(problem: &Problem, posterior: Posterior) -> Result<Posterior> {
    let wrong = posterior.mean.iter().position(|mean| !mean.is_finite());
    match wrong {
        None => Ok(posterior),
        Some(k) => Err(Error::NotFinite {
            what: "the posterior mean".into(),
            column: problem.names[k].clone(),
            remedy: "columns depend on each other and the slab is too wide to tell them apart: give prior.slab a smaller \
                     scaled_variance, or leave a candidate out"
                .into(),
        }),
    }
}

/// The posterior by the chosen method, whatever its numbers are.
fn by_method(
    problem: &Problem,
    near: Option<&Posterior>,
    settings: &InferenceSettings,
    most_bytes: Option<u64>,
) -> Result<Posterior> {
    if settings.method == Choice::Gibbs {
        return gibbs::sample(problem, near, settings, most_bytes);
    }
    let certain = certain::components(&Standard::new(problem)?, problem, near);
    let open = certain.sure.iter().filter(|c| !**c).count();
    match settings.method {
        _ if open <= EXACT_LIMIT => exact::sum(problem, &certain),
        Choice::Exact => Err(Error::Setting {
            key: "inference.method".into(),
            problem: format!("`exact` with {open} uncertain components would sum 2^{open} models"),
            remedy: format!(
                "use `auto` or `gibbs`, or at most {EXACT_LIMIT} components that the data leave open"
            ),
        }),
        Choice::Auto | Choice::Gibbs => gibbs::sample(problem, near, settings, most_bytes),
    }
}

/// A posterior in milliseconds, for comparing settings (fixed points, folds, sensitivities), not for reporting.
///
/// The heaviest known model is expanded again and again: all models one component or one exchange away are weighed, and
/// every model that was weighed counts. It ends when at most 1e-6 of the mass is missing by its own estimate, or after a
/// fixed number of models; [`crate::posterior::Method::Search`] says how much is missing. With few components all models
/// are weighed. `warm`, a posterior of nearly the same problem, gives the starts. No random numbers: the same bytes on
/// any number of threads.
///
/// # Errors
/// As [`infer`], but for disagreeing chains.
pub fn approximate(problem: &Problem, warm: Option<&Posterior>) -> Result<Posterior> {
    approximate::approximate(problem, warm)
}

/// Runs one Gibbs chain for `scans` scans (half of them warm-up) and returns how many of the others' moves were
/// accepted: what a scan costs, and how much one does, without the summaries around it.
///
/// # Errors
/// As [`infer`].
pub fn scan(problem: &Problem, scans: usize, seed: u64) -> Result<u64> {
    gibbs::scan(problem, scans, seed)
}
