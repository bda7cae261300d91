//! The motion that shows most: within all limits, from rest to rest.
//!
//! ```text
//! maximise ln det(M/n),  M = Σ Φᵀ W Φ over n rows of the motion, Φ the independent columns of the candidates
//! ```
//! or another [`Criterion`] of M; with a posterior, what decides its open questions ([`Questions`]).
//!
//! Columns are of size 1 and joints of torque 1 at random states, as in [`crate::excitation`]. A motion is a B-spline of degree five for
//! each joint; the search changes some control points at a time, within what position, velocity, acceleration and jerk allow everywhere, and
//! keeps what torque and clearance allow.
//!
//! # Source
//! D-optimality: Swevers et al. 1997; simulated annealing: Kirkpatrick et al. 1983.

mod ascent;
mod clearance;
mod criterion;
mod found;
mod information;
mod limits;
mod load;
mod metric;
mod motion;
mod promises;
mod questions;
mod recorded;
mod search;
mod sizes;
mod spline;
mod structural;
mod task;
mod torque;
#[cfg(test)]
mod tests;

pub use clearance::{Approach, Clearance, NearSlope, Path};
pub use criterion::Criterion;
pub use limits::{JERK_TIME, JointLimits, SPEED_UP, StatedLimits, joint_limits, spread_positions};
pub use load::{Load, Loaded};
pub use motion::{DesignedMotion, JointUse};
pub use promises::Promise;
pub use questions::Questions;
pub use recorded::Recorded;
pub use structural::OtherRecording;
pub use task::Task;
pub use torque::{FoundTorque, NominalTorque, TorqueLimits};

use crate::error::{Error, Result};
use crate::excitation::States;
use found::Found;
use information::{Information, Objective};
use rayon::prelude::*;
use recorded::Following;
use search::Chain;
use spline::SPAN;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Spans at least: five control points at either end stay, and some have to move.
const LEAST_SPANS: usize = 10;
/// Samples at least.
const LEAST_SAMPLES: f64 = 80.0;
/// Proposals between two looks at whether to go on.
const BATCH: usize = 50;
/// Steps without a gain after which random changes are tried again.
const PATIENCE: usize = 4;
/// Random changes that count as one step uphill in what is done, and how many steps they take then.
const STEP: usize = 50;
const AGAIN: usize = 15;

/// Other starts that are tried, farther and farther away.
const STARTS: usize = 1000;

/// How a motion is designed.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignSettings {
    /// Length, s.
    pub duration: f64,
    /// Rate of its samples, Hz.
    pub rate: f64,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Searches of their own random numbers; the best one counts.
    pub chains: usize,
    /// Random changes that each proposes first.
    pub proposals: usize,
    /// Steps uphill that each makes then.
    pub steps: usize,
    /// What is maximised where nothing is asked.
    pub criterion: Criterion,
}

impl Default for DesignSettings {
    fn default() -> Self {
        Self {
            duration: 20.0,
            rate: 500.0,
            seed: 1,
            chains: 2,
            proposals: 1500,
            steps: 180,
            criterion: Criterion::Determinant,
        }
    }
}

/// How far a search has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DesignStage {
    /// Proposals made by all chains.
    pub done: usize,
    /// Of so many.
    pub all: usize,
    /// What is maximised, of the best motion so far: the [`Criterion`], or that of [`Questions`].
    pub gain: f64,
}

/// A motion, and what it shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The motion at its rate.
    pub motion: DesignedMotion,
    /// Independent columns that it was designed for.
    pub columns: usize,
    /// ln det(M/n), of what is recorded and this motion together.
    pub log_determinant: f64,
    /// Condition number of their rows: largest over smallest singular value.
    pub condition: f64,
    /// What the motion is expected to say of each question.
    pub promises: Vec<Promise>,
    /// How much of its limits each joint uses.
    pub used: Vec<JointUse>,
    /// The smallest distance of the motion; `None` where collisions are not looked at, or nothing can come close.
    pub closest: Option<Approach>,
    /// `watch` ended the search early: the motion is the best one until then.
    pub stopped: bool,
}

/// Looks for the motion.
///
/// `watch` is called now and then; [`Error::Cancelled`] from it ends the search with the best motion so far.
///
/// # Errors
/// [`Error::Setting`] for a duration or rate that is no positive number or too short, [`Error::Refused`] where torque or clearance forbid the
/// start, naming the constraint, and any other error of `watch`.
///
/// # Example
/// Eight seconds that show the friction of both joints, from rest to rest within all limits.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::design::{DesignSettings, StatedLimits, Task, design, joint_limits};
/// # use twincal::term::{Family, Library, LibrarySettings};
///
/// # let robot = two_link::arm(2.0)?;
/// # let settings = LibrarySettings { generic: Some(false), families: vec![Family::Viscous, Family::Coulomb], ..Default::default() };
/// # let (library, _) = Library::propose(&robot, &settings)?;
/// let own = StatedLimits { position: Some([-1.1, 1.3]), velocity: Some(1.7), ..Default::default() };
/// let stated = robot.joint_names().into_iter().map(|name| (name.to_owned(), own)).collect();
/// let limits = joint_limits(&robot, &stated)?;
/// let task = Task {
///     robot: &robot, library: &library, questions: None, recorded: None, limits: &limits, torque: None, clearance: None,
/// };
/// let settings = DesignSettings { duration: 8.0, rate: 250.0, proposals: 200, steps: 20, ..Default::default() };
/// let found = design(&task, &settings, &|_| Ok(()))?;
/// let (motion, last) = (&found.motion, found.motion.len - 1);
/// assert_eq!(last, 8 * 250);
/// assert!(motion.qd[0].abs() < 1e-9 && motion.qd[last].abs() < 1e-9);
/// assert!(motion.q.iter().all(|q| (-1.1..=1.3).contains(q)) && motion.qd.iter().all(|qd| qd.abs() <= 1.7));
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn design(
    task: &Task<'_>,
    settings: &DesignSettings,
    watch: &(dyn Fn(DesignStage) -> Result<()> + Sync),
) -> Result<Design> {
    let (spans, span) = spans(settings)?;
    require_start(task)?;
    let information = Information::new(task.robot, task.library).maximising(settings.criterion);
    let objective: &dyn Objective = match task.questions {
        Some(questions) => questions,
        None => &information,
    };
    let following = task.recorded.map(|own| Following::new(objective, own));
    let objective = following.as_ref().map_or(objective, |own| own);
    let done = AtomicUsize::new(0);
    let all = settings.chains * (settings.proposals + STEP * settings.steps);
    let best = Mutex::new(f64::NEG_INFINITY);
    let look = |made: usize, own: f64| -> Result<bool> {
        let done = done.fetch_add(made, Ordering::Relaxed);
        let gain = largest(&best, own);
        match watch(DesignStage { done, all, gain }) {
            Err(Error::Cancelled) => Ok(true),
            other => other.map(|()| false),
        }
    };
    let run = |number: usize| -> Result<(Searched, bool)> {
        let random = (settings.seed, number as u64);
        let chain = Chain::new(task, objective, (spans, span), random);
        searched(chain, settings, &look)
    };
    let found: Vec<(Searched, bool)> = (0..settings.chains)
        .into_par_iter()
        .map(run)
        .collect::<Result<_>>()?;
    let stopped = found.iter().any(|(_, stopped)| *stopped);
    let best = found.into_iter().map(|(found, _)| found);
    let best = best.reduce(|a, b| if b.0.value > a.0.value { b } else { a });
    let best = match best {
        None => return Err(setting("chains", "0 searches".into(), "use at least one")),
        Some((_, Some(binding))) => return Err(motion::impossible(&binding)),
        Some((best, None)) => best,
    };
    motion::finished(task, settings, &information, best, stopped)
}

/// What a chain found, and what forbade every change where there was none.
type Searched = (Found, Option<String>);

/// Random changes, then steps uphill; where these come to nothing, random changes again and uphill from there. True: it was asked to end.
fn searched(
    mut chain: Chain<'_>,
    settings: &DesignSettings,
    look: &dyn Fn(usize, f64) -> Result<bool>,
) -> Result<(Searched, bool)> {
    for at in 0..settings.proposals {
        let made = BATCH.min(settings.proposals - at);
        if at.is_multiple_of(BATCH) && look(made, chain.best())? {
            return Ok((chain.into_best(), true));
        }
        chain.step(at as f64 / settings.proposals as f64);
    }
    let mut at = 0;
    while at < settings.steps {
        let (mut climb, mut failed) = (chain.climb(), 0);
        while at < settings.steps && failed < PATIENCE {
            if look(STEP, climb.best().value)? {
                return Ok((climb.into_best(), true));
            }
            let gained = climb.step(at as f64 / settings.steps as f64);
            failed = if gained { 0 } else { failed + 1 };
            at += 1;
        }
        chain.resume(climb.into_best());
        for _ in 0..AGAIN.min(settings.steps - at) {
            if look(STEP, chain.best())? {
                return Ok((chain.into_best(), true));
            }
            (0..STEP).for_each(|_| chain.step(1.0));
            at += 1;
        }
    }
    Ok((chain.into_best(), false))
}

/// The larger of a number that is shared and one's own, which is shared then.
fn largest(shared: &Mutex<f64>, own: f64) -> f64 {
    shared.lock().map_or(own, |mut shared| {
        *shared = shared.max(own);
        *shared
    })
}

/// How many spans, and their length.
fn spans(settings: &DesignSettings) -> Result<(usize, f64)> {
    let (duration, rate) = (settings.duration, settings.rate);
    if !(duration > 0.0 && duration.is_finite()) {
        let problem = format!("{duration} s");
        return Err(setting("duration", problem, "give seconds, such as 20"));
    }
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(setting(
            "rate",
            format!("{rate} Hz"),
            "give the controller's rate",
        ));
    }
    if duration * rate < LEAST_SAMPLES || duration * rate > 1e7 {
        return Err(setting(
            "duration",
            format!("{duration} s at {rate} Hz are {} samples", duration * rate),
            "give a length and a rate with 80 samples to ten million",
        ));
    }
    let spans = ((duration / SPAN).round() as usize).max(LEAST_SPANS + 2);
    Ok((spans, duration / spans as f64))
}

/// Limits with a start where the robot can rest: where nobody stated one, and the usual one is not free, another as near to it as is found.
///
/// # Errors
/// [`Error::Refused`] for a stated start where the robot cannot rest, and where no other one is found.
pub fn with_free_start(task: &Task<'_>) -> Result<Vec<JointLimits>> {
    let first = require_start(task);
    let usual = task.limits.to_vec();
    let is_assumed = |own: &JointLimits| own.assumed.contains(&"start");
    if first.is_ok() || !usual.iter().any(is_assumed) {
        return first.map(|()| usual);
    }
    for k in 0..STARTS {
        let share = (k + 1) as f64 / STARTS as f64;
        let there = spread_positions(k, &usual);
        let mut moved = usual.clone();
        let free = moved.iter_mut().zip(&there);
        free.filter(|(own, _)| is_assumed(own))
            .for_each(|(own, q)| own.start += share * (q - own.start));
        let other = Task {
            limits: &moved,
            ..*task
        };
        if require_start(&other).is_ok() {
            return Ok(moved);
        }
    }
    first.map(|()| usual)
}

/// # Errors
/// [`Error::Refused`] where the robot cannot rest at the start.
fn require_start(task: &Task<'_>) -> Result<()> {
    let q: Vec<f64> = task.limits.iter().map(|own| own.start).collect();
    let states = States {
        len: 1,
        qd: vec![0.0; q.len()],
        qdd: vec![0.0; q.len()],
        still: vec![false; q.len()],
        q: q.clone(),
    };
    if let Some((joint, torque, limit)) = task.torque.and_then(|own| own.exceeded(&states)) {
        return Err(Error::Refused {
            problem: format!(
                "at the start joint `{joint}` needs {} of torque to rest, its limit is {}",
                crate::words::significant(torque, 3),
                crate::words::significant(limit, 3)
            ),
            remedy: "give another start position in the limits file, or the right torque limit"
                .into(),
        });
    }
    let at_rest = Path::at_rest(&q);
    if let Some(approach) = task.clearance.and_then(|own| own.breach(&at_rest, None)) {
        let [one, other] = approach.between;
        return Err(Error::Refused {
            problem: format!(
                "at the start `{one}` and `{other}` are {} m apart, closer than the margin",
                crate::words::significant(approach.distance, 2)
            ),
            remedy: "give another start in the limits file or a smaller margin, or name the two under `ignore`"
                .into(),
        });
    }
    Ok(())
}

fn setting(key: &str, problem: String, remedy: &str) -> Error {
    Error::Setting {
        key: format!("design.{key}"),
        problem,
        remedy: remedy.into(),
    }
}
