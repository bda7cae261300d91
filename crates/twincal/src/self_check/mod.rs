//! Do log and model speak of the same robot? Degrees for radians, torque of the motor's side, turned signs, exchanged joints.
//!
//! Every joint's torque is compared with what the nominal model, passive friction and motor inertia can explain; a mistake
//! is named only where another reading of the log explains by far more. Nothing is ever corrected in silence: degrees are
//! refused, all else counts as degraded data, with the remedy to try.

mod base;
mod columns;
mod degrees;
mod explain;
mod gravity_part;
mod correct;
mod parts;
mod sample;
mod scale;
mod shared;
mod velocity;

use crate::error::{Code, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::{Payload, Pipeline, Trajectory};
use degrees::refuse_degrees;
use explain::{Explained, Reading, explain};
use gravity_part::{Factors, factor_findings, missing_finding};
use parts::Parts;
use sample::{LEAST_INDEPENDENT, Sample};
use scale::{Scale, scales};
use serde::{Deserialize, Serialize};

pub use base::Base;

/// Compares logs with the model; silent unless the evidence is overwhelming.
///
/// | finding | what was seen |
/// |---|---|
/// | `base_orientation` | gravity acts in another direction than the model has it: a robot on a wall or ceiling |
/// | `torque_scale` | a joint's torque has the model's shape, but is more than 5 times larger or smaller |
/// | `sign_flip` | a joint's torque, or its motion, has the opposite sign |
/// | `joint_order` | joints are exchanged |
/// | `model_torque`, `gravity_compensated` | the torque holds no part of the model's, or none of its gravity |
/// | `clock_scale` | velocity, or all inertial torque, has a factor that a wrong clock would give it |
/// | `torque_copied`, `torque_constant` | a torque column is another joint's, or one number |
///
/// # Errors
/// [`crate::Error::Log`] for positions in degrees.
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
    /// What makes N·m of its torque where that is clearly logged in thousandths of it.
    pub torque_factor: Option<f64>,
    /// The joint of the log whose motion explains most as this joint's, and the sign of its position.
    pub motion: (String, f64),
    /// The sign of its velocity and acceleration.
    pub rates: f64,
    /// The same of torque.
    pub torque: (String, f64),
}

/// What [`self_check`] says, with the numbers behind it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Look {
    /// Every moving joint; empty without torque.
    pub joints: Vec<JointCheck>,
    /// How the base stands, where that explains more than the model's gravity.
    pub base: Option<Base>,
    /// Joints whose torque has the model's shape and another size: measured over the model's. Without a name it is that of all joints.
    pub sizes: Vec<(Option<String>, f64)>,
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
    let trajectories: Vec<&Trajectory> = trajectories.into_iter().collect();
    let loaded = with_known_payload(robot, &trajectories)?;
    let robot = loaded.as_ref().unwrap_or(robot);
    let mut samples = Vec::new();
    let mut logs = Vec::new();
    for &trajectory in &trajectories {
        let Some(sample) = Sample::take(pipeline, trajectory, trajectories.len()) else {
            continue;
        };
        refuse_degrees(robot, &trajectory.name, &sample)?;
        logs.push(&*trajectory.name);
        samples.push(sample);
    }
    let sample = Sample::pool(&samples);
    if sample.len == 0 {
        return Ok(Look::default());
    }
    let as_logged = explain(robot, &sample, &Reading::as_logged(robot.dof()));
    let read = Read::of(robot, &sample, &as_logged);
    let mut findings = read.findings(robot, &as_logged);
    let each = || logs.iter().copied().zip(&samples);
    let columns = (&logs[..], &samples[..]);
    findings.extend(columns::of_samples(&read.robot, columns, &read.standing));
    findings.extend(velocity::findings(each()));
    let mut scales = scales(robot, &sample, &read.explained);
    let of_all = scales.iter().any(|scale| scale.finding.subject.is_empty());
    if read.is_as_logged() && !of_all {
        let lacking: Vec<Finding> = each().filter_map(|log| lacking(&read.robot, log)).collect();
        // Torque without the model's part has no scale.
        if !lacking.is_empty() {
            scales.clear();
        }
        findings.extend(lacking);
    }
    let joints = joint_checks(robot, &as_logged, &read.reading, &scales);
    let sizes = scales.iter().filter_map(Scale::size).collect();
    findings.extend(scales.into_iter().map(|scale| scale.finding));
    if findings.is_empty() && sample.independent >= LEAST_INDEPENDENT {
        let factors = Factors::of(robot, &sample, &Parts::of(robot, &sample));
        findings.extend(factors.iter().flat_map(factor_findings));
    }
    Ok(Look {
        joints,
        base: read.base,
        sizes,
        findings,
    })
}

/// The robot with the payload that all logs state, at the last link; `None` where they state none, or not the same one.
fn with_known_payload(robot: &Robot, trajectories: &[&Trajectory]) -> Result<Option<Robot>> {
    let mut stated = trajectories.iter().map(|own| own.payload);
    match stated.next() {
        Some(first @ Payload::Known { mass, com }) if stated.all(|own| own == first) => {
            robot.carrying(robot.last_link(), mass, com).map(Some)
        }
        _ => Ok(None),
    }
}

/// The reading of the logs that explains most: how the base stands, then signs and order of joints.
struct Read {
    base: Option<Base>,
    /// The robot on that base.
    robot: Robot,
    /// What it explains with the joints as they are logged.
    standing: Vec<Option<Explained>>,
    reading: Reading,
    explained: Vec<Option<Explained>>,
}

/// By how much, in Σ ln(share left), a reading of signs and order must explain more than a turned base alone.
const RATHER_SIGNS: f64 = 1.0;

impl Read {
    /// The base comes first; signs and order on the base as the model has it where they explain more: a log whose joints are exchanged shows some
    /// gravity, too.
    fn of(robot: &Robot, sample: &Sample, as_logged: &[Option<Explained>]) -> Self {
        let upright = Self::on(None, robot.clone(), (sample, as_logged), as_logged.to_vec());
        let turned = match correct::is_doubtful(as_logged) {
            true => base::turned(robot, sample, as_logged),
            false => None,
        };
        let Some(turned) = turned else {
            return upright;
        };
        let turned = Self::on(
            Some(turned.base),
            turned.robot,
            (sample, as_logged),
            turned.explained,
        );
        let [signs, base] =
            [&upright, &turned].map(|read| correct::gain_of(as_logged, &read.explained));
        let more = match turned.is_as_logged() {
            true => RATHER_SIGNS,
            false => -RATHER_SIGNS,
        };
        match !upright.is_as_logged() && signs > base + more {
            true => upright,
            false => turned,
        }
    }

    /// The best reading of signs and order for a robot on a base.
    fn on(
        base: Option<Base>,
        robot: Robot,
        (sample, as_logged): (&Sample, &[Option<Explained>]),
        standing: Vec<Option<Explained>>,
    ) -> Self {
        let corrected = correct::correct(&robot, sample, &standing);
        let (reading, explained) = Some(corrected)
            .filter(|(_, explained)| correct::none_less(as_logged, explained))
            .unwrap_or_else(|| (Reading::as_logged(robot.dof()), standing.clone()));
        Self {
            base,
            robot,
            standing,
            reading,
            explained,
        }
    }

    /// No sign is turned and no joint exchanged.
    fn is_as_logged(&self) -> bool {
        self.reading == Reading::as_logged(self.robot.dof())
    }

    fn findings(&self, robot: &Robot, as_logged: &[Option<Explained>]) -> Vec<Finding> {
        let base = self.base.iter();
        let mut findings: Vec<Finding> = base
            .map(|base| base.finding(robot, as_logged, &self.standing))
            .collect();
        let signs = signs_and_order(robot, &self.reading, &self.standing, &self.explained);
        findings.extend(signs);
        findings
    }
}

/// The numbers behind the findings, joint by joint.
fn joint_checks(
    robot: &Robot,
    as_logged: &[Option<Explained>],
    reading: &Reading,
    scales: &[Scale],
) -> Vec<JointCheck> {
    let torque_factor = |name: &str| {
        let whose = |scale: &&Scale| ["", name].contains(&&*scale.finding.subject);
        scales.iter().find(whose)?.factor
    };
    let names = robot.joint_names();
    let joints = names.iter().enumerate().map(|(joint, name)| {
        let named = |(from, sign): (usize, f64)| (names[from].to_owned(), sign);
        let own = as_logged[joint];
        JointCheck {
            joint: (*name).to_owned(),
            explained: own.map(|e| 1.0 - e.left),
            without_model: own.map(|e| 1.0 - e.left_without_model),
            gain: own.map(|e| e.gain),
            torque_factor: torque_factor(name),
            motion: named(reading.motion[joint]),
            rates: reading.rates[joint],
            torque: named(reading.torque[joint]),
        }
    });
    joints.collect()
}

/// A finding where the torque of one log lacks the model's part.
fn lacking(robot: &Robot, (log, sample): (&str, &Sample)) -> Option<Finding> {
    if sample.independent < LEAST_INDEPENDENT {
        return None;
    }
    let factors = Factors::of(robot, sample, &Parts::of(robot, sample))?;
    let part = factors.missing()?;
    Some(missing_finding(log, part, &factors))
}

/// What [`correct::correct`] changed, in words.
fn signs_and_order(
    robot: &Robot,
    reading: &Reading,
    before: &[Option<Explained>],
    after: &[Option<Explained>],
) -> Vec<Finding> {
    let names = robot.joint_names();
    let mut findings = Vec::new();
    let mut moved = Vec::new();
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
        let signs = [motion_sign, reading.rates[joint], torque_sign];
        findings.extend(sign_flip(name, signs, [before[joint], after[joint]]));
    }
    if !moved.is_empty() {
        findings.push(joint_order(&moved, before, after));
    }
    findings
}

/// Opposite signs of a joint's position, velocity and torque; `explained` as logged and turned.
fn sign_flip(name: &str, signs: [f64; 3], explained: [Option<Explained>; 2]) -> Option<Finding> {
    let turned = match signs.map(|sign| sign < 0.0) {
        [false, false, false] => return None,
        [false, false, true] => "its torque has the opposite sign",
        [true, true, false] => "its position and velocity have the opposite sign",
        [true, false, false] => "its position has the opposite sign, its velocity has not",
        [false, true, false] => "its velocity has the opposite sign, its position has not",
        [true, false, true] => {
            "its position and its torque have the opposite sign, its velocity has not"
        }
        [false, true, true] => {
            "its velocity and its torque have the opposite sign, its position has not"
        }
        [true, true, true] => {
            "its axis points the other way (position, velocity and torque have the opposite sign)"
        }
    };
    let or_the_axis = match signs {
        [m, r, t] if m < 0.0 && r < 0.0 && t < 0.0 => ", or the axis in the model",
        _ => "",
    };
    let [before, after] = explained.map(|left| left.map_or(f64::NAN, |e| 1.0 - e.left));
    let share = |left: Option<Explained>| {
        left.map_or_else(String::new, |e| format!("{:.0} %", 100.0 * (1.0 - e.left)))
    };
    let [as_logged, when_turned] = explained.map(share);
    Some(Finding::new(
        Severity::Degraded,
        Code::SignFlip,
        name,
        format!(
            "joint `{name}`: {turned}: model and friction explain {as_logged} of its torque as logged, {when_turned} turned; nothing was \
             changed: turn the columns with [columns] factor{or_the_axis}",
        ),
        0,
    )
    .with([("explained", after), ("explained_before", before)]))
}

/// The columns that seem to be of other joints, and what is explained before and after they are exchanged.
fn joint_order(
    moved: &[String],
    before: &[Option<Explained>],
    after: &[Option<Explained>],
) -> Finding {
    let least = |explained: &[Option<Explained>]| {
        let worst = explained.iter().flatten().map(|e| e.left);
        1.0 - worst.fold(0.0, f64::max)
    };
    let all = |explained| format!("{:.0} %", 100.0 * least(explained));
    Finding::new(
        Severity::Degraded,
        Code::JointOrder,
        "",
        format!(
            "the log's joints seem exchanged: try {}; model and friction then explain at least {} of every joint's torque \
             instead of {}; nothing was changed: rename the columns, or map them in [columns]",
            moved.join(", "),
            all(after),
            all(before)
        ),
        moved.len() as u64,
    )
    .with([("explained", least(after)), ("explained_before", least(before))])
}

#[cfg(test)]
mod readings_tests;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
