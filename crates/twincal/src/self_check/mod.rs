//! Do log and model speak of the same robot? Degrees for radians, torque of the motor's side, turned signs, exchanged joints.
//!
//! Every joint's torque is compared with what the nominal model, passive friction and motor inertia can explain; a mistake
//! is named only where another reading of the log explains by far more. Nothing is ever mended in silence: degrees are
//! refused, all else is a warning with the mend to try.

mod explain;
mod mend;
mod sample;

use crate::error::{Error, Finding, Result, Severity};
use crate::robot::{JointKind, Robot};
use crate::signal::{Pipeline, Trajectory};
use explain::{Explained, Reading, explain};
use sample::Sample;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Torque that differs by this factor from the model's is not of the joint's side, or not in N·m.
const OTHER_UNIT: f64 = 5.0;
/// Share of torque that may be left where a factor is believed.
const CLEAR: f64 = 0.05;
/// Share that must be left without the model: else friction alone explains the torque, and the factor says nothing.
const NEEDED: f64 = 0.2;
/// The model must leave less than this part of what friction alone leaves.
const PART: f64 = 0.3;

/// Compares logs with the model; silent unless the evidence is overwhelming.
///
/// | finding | what was seen |
/// |---|---|
/// | `torque_scale` | a joint's torque has the model's shape, but is more than 5 times larger or smaller |
/// | `sign_flip` | a joint's torque, or its motion, has the opposite sign |
/// | `joint_order` | joints are exchanged |
///
/// # Errors
/// [`Error::Log`] for positions in degrees.
pub fn self_check<'a>(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectories: impl IntoIterator<Item = &'a Trajectory>,
) -> Result<Vec<Finding>> {
    Ok(look(robot, pipeline, trajectories)?.findings)
}

/// What the nominal model and passive friction explain of a joint's torque, and the reading of the log that explains most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointCheck {
    /// Name of the joint.
    pub joint: String,
    /// Share of the torque's variance that model, friction and motor inertia explain as logged; `None` for a joint that says
    /// nothing.
    pub explained: Option<f64>,
    /// The same without the model.
    pub without_model: Option<f64>,
    /// Factor at the nominal torque; 0 where friction alone explains more.
    pub gain: Option<f64>,
    /// The joint of the log whose motion explains most as this joint's, and its sign.
    pub motion: (String, f64),
    /// The same of torque.
    pub torque: (String, f64),
}

/// What [`self_check`] says, with the numbers behind it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Look {
    /// Every moving joint; empty without torque.
    pub joints: Vec<JointCheck>,
    /// Those of [`self_check`].
    pub findings: Vec<Finding>,
}

/// [`self_check`] with the numbers behind it.
///
/// # Errors
/// Like [`self_check`].
pub fn look<'a>(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectories: impl IntoIterator<Item = &'a Trajectory>,
) -> Result<Look> {
    let mut samples = Vec::new();
    for trajectory in trajectories {
        let Some(sample) = Sample::take(pipeline, trajectory) else {
            continue;
        };
        refuse_degrees(robot, &trajectory.name, &sample)?;
        samples.push(sample);
    }
    let sample = Sample::pool(&samples);
    if sample.len == 0 {
        return Ok(Look::default());
    }
    let as_logged = explain(robot, &sample, &Reading::as_logged(robot.dof()));
    let (reading, explained) = mend::mend(robot, &sample, &as_logged);
    let mut findings = signs_and_order(robot, &reading, &as_logged, &explained);
    findings.extend(scales(robot, &explained));
    let names = robot.joint_names();
    let joints = names.iter().enumerate().map(|(joint, name)| {
        let named = |(from, sign): (usize, f64)| (names[from].to_owned(), sign);
        let own = as_logged[joint];
        JointCheck {
            joint: (*name).to_owned(),
            explained: own.map(|e| 1.0 - e.left),
            without_model: own.map(|e| 1.0 - e.left_without_model),
            gain: own.map(|e| e.gain),
            motion: named(reading.motion[joint]),
            torque: named(reading.torque[joint]),
        }
    });
    Ok(Look {
        joints: joints.collect(),
        findings,
    })
}

/// Angles beyond a turn whose torque only makes sense when they are taken as degrees.
fn refuse_degrees(robot: &Robot, log: &str, sample: &Sample) -> Result<()> {
    let largest = sample.largest_angle(robot);
    if largest <= TAU {
        return Ok(());
    }
    let radians = Reading {
        motion: (0..robot.dof())
            .map(|joint| match robot.joint_kind(joint) {
                JointKind::Prismatic => (joint, 1.0),
                _ => (joint, PI / 180.0),
            })
            .collect(),
        ..Reading::as_logged(robot.dof())
    };
    let as_logged = explain(robot, sample, &Reading::as_logged(robot.dof()));
    if !mend::overwhelming(&as_logged, &explain(robot, sample, &radians)) {
        return Ok(());
    }
    Err(Error::Log {
        log: log.into(),
        problem: format!(
            "positions look like degrees: they reach {largest:.1}, and as degrees the model explains the torque"
        ),
        remedy: "export positions, velocities and accelerations in radians: × π/180, as with [columns] factor = \
                 { q = 0.017453292519943295, qd = 0.017453292519943295 }"
            .into(),
    })
}

/// Joints whose torque has the model's shape but another size.
fn scales(robot: &Robot, explained: &[Option<Explained>]) -> Vec<Finding> {
    let names = robot.joint_names();
    let mut findings = Vec::new();
    for (name, joint) in names.iter().zip(explained) {
        let Some(joint) = joint.filter(|joint| {
            joint.left < CLEAR
                && joint.left < PART * joint.left_without_model
                && joint.left_without_model > NEEDED
                && joint.gain > 0.0
        }) else {
            continue;
        };
        let problem = if joint.gain < 1.0 / OTHER_UNIT {
            format!(
                "torque is {:.3} of the model's: looks like gain {:.1} between this column and N·m at the joint (a current, \
                 or torque at the motor's side)",
                joint.gain,
                1.0 / joint.gain
            )
        } else if joint.gain > OTHER_UNIT {
            format!(
                "torque is {0:.1} times the model's: looks like gain {0:.1} (N·mm, mA or counts for N·m), unless a payload \
                 that heavy is missing in the model",
                joint.gain
            )
        } else {
            continue;
        };
        findings.push(Finding::new(
            Severity::Warning,
            "torque_scale",
            *name,
            format!(
                "joint `{name}`: {problem}; nothing was scaled: convert the column and fit again"
            ),
            0,
        ));
    }
    findings
}

/// What [`mend::mend`] changed, in words.
fn signs_and_order(
    robot: &Robot,
    reading: &Reading,
    before: &[Option<Explained>],
    after: &[Option<Explained>],
) -> Vec<Finding> {
    let names = robot.joint_names();
    let mut findings = Vec::new();
    let mut moved = Vec::new();
    let share = |left: &Option<Explained>| {
        left.map_or_else(String::new, |e| format!("{:.0} %", 100.0 * (1.0 - e.left)))
    };
    for (joint, name) in names.iter().enumerate() {
        let ((motion, motion_sign), (torque, torque_sign)) =
            (reading.motion[joint], reading.torque[joint]);
        if motion != joint && torque == motion {
            moved.push(format!("`{name}` = all columns of `{}`", names[motion]));
        } else {
            if motion != joint {
                moved.push(format!(
                    "`{name}` = position, velocity and acceleration of `{}`",
                    names[motion]
                ));
            }
            if torque != joint {
                moved.push(format!("`{name}` = torque of `{}`", names[torque]));
            }
        }
        let turned = match (motion_sign < 0.0, torque_sign < 0.0) {
            (false, false) => continue,
            (false, true) => "its torque has the opposite sign",
            (true, false) => "its position and velocity have the opposite sign",
            (true, true) => {
                "its axis points the other way (position, velocity and torque have the opposite sign)"
            }
        };
        findings.push(Finding::new(
            Severity::Warning,
            "sign_flip",
            *name,
            format!(
                "joint `{name}`: {turned}: model and friction explain {} of its torque as logged, {} turned; nothing was \
                 changed: turn the columns with [columns] factor, or the axis in the model",
                share(&before[joint]),
                share(&after[joint])
            ),
            0,
        ));
    }
    if !moved.is_empty() {
        let all = |explained: &[Option<Explained>]| {
            let worst = explained.iter().flatten().map(|e| e.left);
            format!("{:.0} %", 100.0 * (1.0 - worst.fold(0.0, f64::max)))
        };
        findings.push(Finding::new(
            Severity::Warning,
            "joint_order",
            "",
            format!(
                "the log's joints seem exchanged: try {}; model and friction then explain at least {} of every joint's torque \
                 instead of {}; nothing was changed: rename the columns, or map them in [columns]",
                moved.join(", "),
                all(after),
                all(before)
            ),
            moved.len() as u64,
        ));
    }
    findings
}

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
