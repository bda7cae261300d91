//! The motion that was found, at the controller's rate, checked once more between the samples of the search.

use super::information::{Information, Objective as _, states_of};
use super::search::{Found, position};
use super::spline::Spline;
use super::{Design, DesignSettings, Task};
use crate::error::{Error, Result};
use crate::excitation::{STATES, States, random_states};
use serde::Serialize;

/// Factor on the motion about its start where a sample between those of the search breaks a limit, and how often.
const SMALLER: f64 = 0.97;
const TRIES: usize = 40;

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
    /// Largest velocity, acceleration and jerk as a share of their limits.
    pub share: [f64; 3],
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
        match breaks(task, &states) {
            None => {
                let motion = DesignedMotion {
                    joints: task.limits.iter().map(|own| own.joint.clone()).collect(),
                    rate: settings.rate,
                    len: states.len,
                    q: states.q,
                    qd: states.qd,
                    qdd: states.qdd,
                };
                let spans = splines[0].points.len() - 5;
                let rows = states_of(&splines, 0..spans);
                let sums = information.of(&rows);
                let random = random_states(task.robot, STATES);
                let promises = match task.questions {
                    Some(own) => {
                        own.promises((&rows, &random), settings.duration, settings.seed)?
                    }
                    None => Vec::new(),
                };
                return Ok(Design {
                    promises,
                    motion,
                    columns: information.size(),
                    log_determinant: information.log_determinant(&sums, rows.len as f64),
                    condition: information.condition(&sums),
                    used: used(task, &splines),
                    stopped,
                });
            }
            Some(what) => binding = what,
        }
        for (spline, limits) in splines.iter_mut().zip(task.limits) {
            let start = limits.start;
            (spline.points.iter_mut()).for_each(|c| *c = start + SMALLER * (*c - start));
        }
    }
    Err(Error::Refused {
        problem: format!("no motion from the start is within the limits: {binding}"),
        remedy: "give another start, wider limits or a smaller margin".into(),
    })
}

/// Every sample at the rate.
fn sampled(splines: &[Spline], settings: &DesignSettings) -> States {
    let len = (settings.duration * settings.rate).round() as usize + 1;
    let mut states = States {
        len,
        still: vec![false; splines.len() * len],
        ..States::default()
    };
    for spline in splines {
        let spans = spline.points.len() - 5;
        for sample in 0..len {
            let place = (sample as f64 / settings.rate / spline.span).min(spans as f64);
            let span = (place as usize).min(spans - 1);
            let [q, qd, qdd] = spline.state(span, place - span as f64);
            states.q.push(q);
            states.qd.push(qd);
            states.qdd.push(qdd);
        }
    }
    states
}

/// The first constraint that a motion breaks, in words.
fn breaks(task: &Task<'_>, states: &States) -> Option<String> {
    if let Some((joint, torque, limit)) = task.torque.and_then(|own| own.exceeded(states)) {
        return Some(format!(
            "joint `{joint}` would need {} of torque, its limit is {}",
            crate::words::significant(torque, 3),
            crate::words::significant(limit, 3)
        ));
    }
    let clearance = task.clearance?;
    (0..states.len).find_map(|k| {
        let (one, other, distance) = clearance.too_close(&position(states, k))?;
        let distance = crate::words::significant(distance, 2);
        Some(format!("`{one}` and `{other}` would be {distance} m apart"))
    })
}

fn used(task: &Task<'_>, splines: &[Spline]) -> Vec<JointUse> {
    let own = task.limits.iter().zip(splines);
    own.map(|(limits, spline)| {
        let most = |order: usize, limit: f64| {
            let points = spline.derivative(order);
            points.iter().fold(0.0_f64, |most, x| most.max(x.abs())) / limit
        };
        let positions = spline.points.iter().copied();
        JointUse {
            joint: limits.joint.clone(),
            position: [
                positions.clone().fold(f64::INFINITY, f64::min),
                positions.fold(f64::NEG_INFINITY, f64::max),
            ],
            share: [
                most(1, limits.velocity),
                most(2, limits.acceleration),
                most(3, limits.jerk),
            ],
        }
    })
    .collect()
}
