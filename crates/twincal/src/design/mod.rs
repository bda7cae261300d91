//! The motion that shows most: within all limits, from rest to rest.
//!
//! ```text
//! maximise ln det(M/n),  M = Σ Φᵀ W Φ over n rows of the motion, Φ the independent columns of the candidates
//! ```
//! or, with a posterior, what decides its open questions ([`Questions`]).
//!
//! Columns are of size 1 and joints of torque 1 at random states, as in [`crate::excitation`]. A motion is a B-spline of degree five for
//! each joint; the search changes some control points at a time, within what position, velocity, acceleration and jerk allow everywhere, and
//! keeps what torque and clearance allow.
//!
//! # Source
//! D-optimality: Swevers et al. 1997; simulated annealing: Kirkpatrick et al. 1983.

mod information;
mod limits;
mod motion;
mod questions;
mod search;
mod torque;
mod spline;
#[cfg(test)]
mod tests;

pub use limits::{JERK_TIME, JointLimits, SPEED_UP, StatedLimits, joint_limits};
pub use motion::{DesignedMotion, JointUse};
pub use questions::{Promise, Questions};
pub use torque::{FoundTorque, NominalTorque};

use crate::error::{Error, Result};
use crate::excitation::States;
use crate::robot::Robot;
use crate::term::Library;
use information::{Information, Objective};
use rayon::prelude::*;
use search::{Chain, Found};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Length of a span of the splines, s, where the motion is long enough.
const SPAN: f64 = 0.5;
/// Spans at least: five control points at either end stay, and some have to move.
const LEAST_SPANS: usize = 10;
/// Proposals between two looks at whether to go on.
const BATCH: usize = 50;

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
    /// Changes that each proposes.
    pub proposals: usize,
}

impl Default for DesignSettings {
    fn default() -> Self {
        Self {
            duration: 20.0,
            rate: 500.0,
            seed: 1,
            chains: 4,
            proposals: 6000,
        }
    }
}

/// Whether a robot can produce the torque that states ask for.
pub trait TorqueLimits: Sync {
    /// True where every joint's torque is within its limit in all states.
    fn allows(&self, states: &States) -> bool {
        self.exceeded(states).is_none()
    }

    /// Name of the joint that has too little torque in some state, with that torque and its limit.
    fn exceeded(&self, states: &States) -> Option<(String, f64, f64)>;
}

/// How far a robot is from itself, from the floor and from forbidden space.
pub trait Clearance: Sync {
    /// True where nothing is closer than the margin at these positions.
    fn allows(&self, q: &[f64]) -> bool {
        self.too_close(q).is_none()
    }

    /// The two things that are too close at these positions, with their distance, m.
    fn too_close(&self, q: &[f64]) -> Option<(String, String, f64)>;
}

/// What is asked for.
#[derive(Clone, Copy)]
#[allow(missing_debug_implementations, reason = "the limits are trait objects")]
pub struct Task<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Candidates: their columns are what the motion is to show where nothing is asked, and what its condition number is of.
    pub library: &'a Library,
    /// `None`: the motion is to show the candidates.
    pub questions: Option<&'a Questions<'a>>,
    /// What every joint stays within.
    pub limits: &'a [JointLimits],
    /// `None`: torque is not looked at.
    pub torque: Option<&'a dyn TorqueLimits>,
    /// `None`: collisions are not looked at.
    pub clearance: Option<&'a dyn Clearance>,
}

/// How far a search has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DesignStage {
    /// Proposals made by all chains.
    pub done: usize,
    /// Of so many.
    pub all: usize,
    /// What is maximised, of the best motion so far: ln det(M/n), or that of [`Questions`].
    pub gain: f64,
}

/// A motion, and what it shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The motion at its rate.
    pub motion: DesignedMotion,
    /// Independent columns that it was designed for.
    pub columns: usize,
    /// ln det(M/n).
    pub log_determinant: f64,
    /// Condition number of the rows: largest over smallest singular value.
    pub condition: f64,
    /// What the motion is expected to say of each question.
    pub promises: Vec<Promise>,
    /// How much of its limits each joint uses.
    pub used: Vec<JointUse>,
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
pub fn design(
    task: &Task<'_>,
    settings: &DesignSettings,
    watch: &(dyn Fn(DesignStage) -> Result<()> + Sync),
) -> Result<Design> {
    let (spans, span) = spans(settings)?;
    require_start(task)?;
    let information = Information::new(task.robot, task.library);
    let objective: &dyn Objective = match task.questions {
        Some(questions) => questions,
        None => &information,
    };
    let done = AtomicUsize::new(0);
    let all = settings.chains * settings.proposals;
    let best = Mutex::new(f64::NEG_INFINITY);
    let run = |number: usize| -> Result<(Found, bool)> {
        let random = (settings.seed, number as u64);
        let mut chain = Chain::new(task, objective, (spans, span), random);
        let mut stopped = false;
        for at in 0..settings.proposals {
            if at.is_multiple_of(BATCH) {
                let made = done.fetch_add(BATCH.min(settings.proposals - at), Ordering::Relaxed);
                let gain = largest(&best, chain.best());
                let stage = DesignStage {
                    done: made,
                    all,
                    gain,
                };
                match watch(stage) {
                    Err(Error::Cancelled) => {
                        stopped = true;
                        break;
                    }
                    other => other?,
                }
            }
            chain.step(at as f64 / settings.proposals as f64);
        }
        Ok((chain.into_best(), stopped))
    };
    let found: Vec<(Found, bool)> = (0..settings.chains)
        .into_par_iter()
        .map(run)
        .collect::<Result<_>>()?;
    let stopped = found.iter().any(|(_, stopped)| *stopped);
    let best = found.into_iter().map(|(found, _)| found);
    let best = best.reduce(|a, b| if b.value > a.value { b } else { a });
    let Some(best) = best else {
        return Err(setting("chains", "0 searches".into(), "use at least one"));
    };
    motion::finished(task, settings, &information, best, stopped)
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
    if duration * rate < (LEAST_SPANS * information::SAMPLES) as f64 || duration * rate > 1e7 {
        return Err(setting(
            "duration",
            format!("{duration} s at {rate} Hz are {} samples", duration * rate),
            "give a length and a rate with 80 samples to ten million",
        ));
    }
    let spans = ((duration / SPAN).round() as usize).max(LEAST_SPANS + 2);
    Ok((spans, duration / spans as f64))
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
    if let Some((one, other, distance)) = task.clearance.and_then(|own| own.too_close(&q)) {
        return Err(Error::Refused {
            problem: format!(
                "at the start `{one}` and `{other}` are {} m apart, closer than the margin",
                crate::words::significant(distance, 2)
            ),
            remedy: "give another start position in the limits file, or a smaller margin".into(),
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
