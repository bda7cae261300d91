//! The motion that was found, at the controller's rate, checked once more between the samples of the search.

use super::clearance::path_of;
use super::found::Found;
use super::information::{Information, Objective as _, states_of};
use super::limits::JointLimits;
use super::recorded::{Following, Recorded};
use super::spline::{Spline, StateWeights};
use super::task::Task;
use super::torque::TORQUE_SHARE;
use super::{Design, DesignSettings};
use crate::error::{Error, Result};
use crate::excitation::{STATES, States, random_states};
use serde::Serialize;

/// Factor on the motion about its start where a sample between those of the search breaks a limit, and how often.
const SMALLER: f64 = 0.97;
const TRIES: usize = 40;
/// Samples of a span at which distances of the result are looked at: four each millisecond.
const PER_SPAN: usize = 1024;

/// Position, velocity and acceleration of every joint over time.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignedMotion {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Hz.
    pub rate: f64,
    /// Samples; the first at 0 s, the last at the end, both at rest.
    pub len: usize,
    /// rad or m, `[joint * len + sample]`.
    pub q: Vec<f64>,
    /// rad/s or m/s.
    pub qd: Vec<f64>,
    /// rad/s² or m/s².
    pub qdd: Vec<f64>,
}

/// Largest of each quantity of a joint in the motion, and as a share of its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointUse {
    /// Name of the joint.
    pub joint: String,
    /// Smallest and largest position.
    pub position: [f64; 2],
    /// Largest velocity, acceleration and jerk as a share of their limits; jerk as differences of acceleration.
    pub share: [f64; 3],
    /// Largest torque as a share of its limit; `None`: not limited.
    pub torque: Option<f64>,
}

/// The found motion at its rate; made smaller about its start until every sample is within torque and clearance.
///
/// # Errors
/// [`Error::Refused`] where it never is, naming what binds.
pub(super) fn finished(
    task: &Task<'_>,
    settings: &DesignSettings,
    information: &Information<'_>,
    found: Found,
    stopped: bool,
) -> Result<Design> {
    let mut splines = found.splines;
    let mut binding = String::new();
    for _ in 0..TRIES {
        let states = sampled(&splines, settings);
        let spans = splines[0].points.len() - 5;
        let broken = (task.too_much_torque(&states)).or_else(|| {
            let approach = task.too_close(&splines, (0..spans, None), PER_SPAN)?;
            Some(approach.in_words())
        });
        match broken {
            None => return described(task, settings, information, (&splines, states), stopped),
            Some(what) => binding = what,
        }
        for (spline, limits) in splines.iter_mut().zip(task.limits) {
            let start = limits.start;
            (spline.points.iter_mut()).for_each(|c| *c = start + SMALLER * (*c - start));
        }
    }
    Err(impossible(&binding))
}

/// What a motion shows, by itself and with what is recorded.
fn described(
    task: &Task<'_>,
    settings: &DesignSettings,
    information: &Information<'_>,
    (splines, states): (&[Spline], States),
    stopped: bool,
) -> Result<Design> {
    let spans = splines[0].points.len() - 5;
    let rows = states_of(splines, 0..spans);
    let random = random_states(task.robot, STATES);
    let promises = match task.questions {
        Some(own) => {
            let motions = [
                Some((&rows, settings.duration)),
                task.recorded.map(Recorded::motion),
            ];
            own.promises((motions, &random), settings.seed)?
        }
        None => Vec::new(),
    };
    let (mut sums, mut count) = (information.of(&rows), rows.len as f64);
    if let Some(own) = task.recorded {
        let following = Following::new(information, own);
        (sums, count, _) = following.both(&sums, count, settings.duration);
    }
    let path = || path_of(splines, 0..spans, PER_SPAN);
    Ok(Design {
        closest: task.clearance.and_then(|own| own.closest(&path())),
        promises,
        used: used(task, &states, settings.rate),
        motion: DesignedMotion {
            joints: task.limits.iter().map(|own| own.joint.clone()).collect(),
            rate: settings.rate,
            len: states.len,
            q: states.q,
            qd: states.qd,
            qdd: states.qdd,
        },
        columns: information.size(),
        log_determinant: information.log_determinant(&sums, count),
        condition: information.condition(&sums),
        stopped,
    })
}

/// No motion is within the limits; `binding` is the one that forbids it.
pub(super) fn impossible(binding: &str) -> Error {
    Error::Refused {
        problem: format!("no motion from the start is within the limits: {binding}"),
        remedy: "give another start, wider limits or a smaller margin".into(),
    }
}

/// Every sample at the rate.
fn sampled(splines: &[Spline], settings: &DesignSettings) -> States {
    let len = (settings.duration * settings.rate).round() as usize + 1;
    let mut states = States {
        len,
        still: vec![false; splines.len() * len],
        ..States::default()
    };
    let (spans, length) = (splines[0].points.len() - 5, splines[0].span);
    let places: Vec<(usize, StateWeights)> = (0..len)
        .map(|sample| {
            let place = (sample as f64 / settings.rate / length).min(spans as f64);
            let span = (place as usize).min(spans - 1);
            (span, StateWeights::at(place - span as f64))
        })
        .collect();
    for spline in splines {
        for (span, weights) in &places {
            let [q, qd, qdd] = spline.state(*span, weights);
            states.q.push(q);
            states.qd.push(qd);
            states.qdd.push(qdd);
        }
    }
    states
}

/// What the samples use of the limits.
fn used(task: &Task<'_>, states: &States, rate: f64) -> Vec<JointUse> {
    let torques = task.torque.map(|own| own.shares(states));
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0_f64, |a, b| a.max(b.abs()));
    let of_joint = |(joint, limits): (usize, &JointLimits)| {
        let own = joint * states.len..(joint + 1) * states.len;
        let q = || states.q[own.clone()].iter().copied();
        let (qd, qdd) = (&states.qd[own.clone()], &states.qdd[own.clone()]);
        let jerk = &mut qdd.windows(2).map(|pair| (pair[1] - pair[0]) * rate);
        let torque = torques.as_ref().map(|own_shares| &own_shares[own.clone()]);
        JointUse {
            joint: limits.joint.clone(),
            position: [
                q().fold(f64::INFINITY, f64::min),
                q().fold(f64::NEG_INFINITY, f64::max),
            ],
            share: [
                most(&mut qd.iter().copied()) / limits.velocity,
                most(&mut qdd.iter().copied()) / limits.acceleration,
                most(jerk) / limits.jerk,
            ],
            torque: torque
                .filter(|_| limits.torque.is_some())
                .map(|shares| TORQUE_SHARE * most(&mut shares.iter().copied())),
        }
    };
    task.limits.iter().enumerate().map(of_joint).collect()
}
