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
mod shared;
mod velocity;

use crate::error::{Code, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::{Payload, Pipeline, Trajectory};
use crate::words::significant;
use degrees::refuse_degrees;
use explain::{Explained, Reading, explain};
use gravity_part::{Factors, factor_findings, missing_finding};
use parts::Parts;
use sample::Sample;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

pub use base::Base;

/// Torque that differs by this factor from the model's is not of the joint's side, or not in N·m.
const OTHER_UNIT: f64 = 5.0;
/// Torque of all joints that differs by this factor from the model's is of another unit, side or robot.
const FAR_OFF: f64 = 30.0;
/// Share of it that friction must leave where it is too large.
const NEEDED_OF_ALL: f64 = 0.2;
/// N·m per unit of a torque in N·mm.
const THOUSANDTH: f64 = 1e-3;
/// |ln| within which a factor may differ from 1000 and still be thousandths: a model's masses are not that wrong.
const LIKE_A_THOUSAND: f64 = 0.4;
/// Largest torque over the effort limit where torque is in thousandths of N·m: a drive uses between a fiftieth of its limit and all.
const THOUSANDTHS: RangeInclusive<f64> = 20.0..=1500.0;
/// The same where it is another unit or side, whichever: a drive's peak is two or three times what it may do for long.
const BEYOND: f64 = 5.0;
/// Independent samples below which a factor is not told: a second of motion looks like one of its five columns by chance.
const LEAST_INDEPENDENT: f64 = 90.0;
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
    findings.extend(each().flat_map(|log| columns::of_sample(&read.robot, log, &read.standing)));
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

/// Joints whose torque has the model's shape but another size, and those whose torque is far beyond what the model says that the
/// drive can do; one finding where all torque is in thousandths of N·m.
fn scales(robot: &Robot, sample: &Sample, explained: &[Option<Explained>]) -> Vec<Scale> {
    let names = robot.joint_names();
    let gains: Vec<Option<f64>> = explained.iter().map(|joint| shaped(*joint)).collect();
    let told: Vec<(&str, f64)> = (names.iter().zip(&gains))
        .filter_map(|(name, gain)| Some((*name, (*gain)?)))
        .collect();
    if told.len() > 1 && told.iter().all(|(_, gain)| is_thousand(*gain)) {
        let joints: Vec<&str> = told.iter().map(|(joint, _)| *joint).collect();
        let problem = format!(
            "torque is about 1000 times the model's on every joint on which the model tells ({}): looks like N·mm for N·m",
            joints.join(", ")
        );
        return vec![Scale::new(None, problem, Some(THOUSANDTH)).times(Some(1.0 / THOUSANDTH))];
    }
    let efforts = efforts(robot, sample);
    if told.is_empty() && all_beyond_effort(&efforts) {
        let problem =
            "torque is far beyond the model's effort limit on every joint: looks like N·mm for N·m"
                .to_owned();
        return vec![Scale::new(None, problem, Some(THOUSANDTH))];
    }
    let mut scales = Vec::new();
    for (joint, (name, gain)) in names.iter().zip(gains).enumerate() {
        let (problem, factor) = match gain {
            Some(gain) if !is_thousand(gain) && sample.independent < LEAST_INDEPENDENT => continue,
            Some(gain) if gain < 1.0 / OTHER_UNIT => (
                format!(
                    "torque is {gain:.3} of the model's: looks like gain {:.1} between this column and N·m at the joint (a current, \
                     or torque at the motor's side)",
                    1.0 / gain
                ),
                None,
            ),
            Some(gain) if gain > OTHER_UNIT => (
                format!(
                    "torque is {gain:.1} times the model's: looks like gain {gain:.1} (N·mm, mA or counts for N·m), unless a payload \
                     that heavy is missing in the model"
                ),
                is_thousand(gain).then_some(THOUSANDTH),
            ),
            Some(_) => continue,
            None => match beyond_effort(&efforts, joint) {
                Some([largest, limit]) => {
                    let times = used([largest, limit]);
                    let thousandths = THOUSANDTHS.contains(&times);
                    let problem = format!(
                        "torque reaches {largest:.0}, {times:.0} times the effort limit of the model ({limit}), where other joints stay within \
                         theirs: looks like {}",
                        match thousandths {
                            true => "N·mm for N·m",
                            false => "another unit or side (a current, counts, the motor's side)",
                        }
                    );
                    (problem, thousandths.then_some(THOUSANDTH))
                }
                None => continue,
            },
        };
        let effort = efforts[joint].filter(|_| gain.is_none());
        let scale = Scale::new(Some(name), problem, factor).times(gain);
        scales.push(scale.beyond(effort));
    }
    if let Some(times) = far_off(explained).filter(|_| scales.is_empty()) {
        let size = match times > 1.0 {
            true => format!("{} times", significant(times, 2)),
            false => format!("1/{} of", significant(1.0 / times, 2)),
        };
        let problem = format!(
            "torque of all joints together is {size} the model's: looks like another unit or side (N·mm, currents, the motor's side), or \
             another robot"
        );
        scales.push(Scale::new(None, problem, None).times(Some(times)));
    }
    scales
}

/// Size of the measured torque of all joints over that of the model's, where that is further off than [`FAR_OFF`] and no friction explains it: a
/// slow arm without gravity may well have friction of many times its nominal torque, but no drive that holds a weight has 30 times it, and no
/// joint needs less than that.
fn far_off(explained: &[Option<Explained>]) -> Option<f64> {
    let told = || explained.iter().flatten();
    let nominal: f64 = told().map(|joint| joint.sizes[0]).sum();
    let measured: f64 = told().map(|joint| joint.sizes[1]).sum();
    let left = told().map(|joint| joint.left_without_model * joint.sizes[1]);
    let times = (measured / nominal).sqrt();
    let unexplained = left.sum::<f64>() > NEEDED_OF_ALL * measured;
    let mut holds_a_weight = told().filter(|joint| joint.gravity > 0.5 * joint.sizes[0]);
    let too_heavy = holds_a_weight.clone().next().is_some()
        && holds_a_weight.all(|joint| joint.sizes[1] > FAR_OFF.powi(2) * joint.sizes[0]);
    let large = times > FAR_OFF && (too_heavy || unexplained);
    (times.is_finite() && (large || times < 1.0 / FAR_OFF)).then_some(times)
}

/// Torque of another size than the model's.
struct Scale {
    /// Of which joint; of all where its subject is empty.
    finding: Finding,
    /// What makes N·m of it where it is a thousandth.
    factor: Option<f64>,
    /// Measured over the model's, where the torque has its shape.
    times: Option<f64>,
}

impl Scale {
    fn times(self, times: Option<f64>) -> Self {
        let finding = self.finding.with(times.map(|times| ("factor", times)));
        Self {
            finding,
            times,
            ..self
        }
    }

    /// Largest torque, and the limit that it is beyond.
    fn beyond(self, effort: Option<[f64; 2]>) -> Self {
        let of =
            |[largest, limit]: [f64; 2]| [("largest_torque", largest), ("effort_limit", limit)];
        let finding = self.finding.with(effort.into_iter().flat_map(of));
        Self { finding, ..self }
    }

    /// See [`Look::sizes`].
    fn size(&self) -> Option<(Option<String>, f64)> {
        let joint = &self.finding.subject;
        let joint = (!joint.is_empty()).then(|| joint.clone());
        self.times.map(|times| (joint, times))
    }

    fn new(joint: Option<&str>, problem: String, factor: Option<f64>) -> Self {
        let whose = joint.map_or_else(String::new, |name| format!("joint `{name}`: "));
        let (subject, columns) = match joint {
            Some(name) => (name, "column"),
            None => ("", "columns"),
        };
        Self {
            finding: Finding::new(
                Severity::Degraded,
                Code::TorqueScale,
                subject,
                format!(
                    "{whose}{problem}; nothing was scaled: convert the {columns} and fit again"
                ),
                0,
            ),
            factor,
            times: None,
        }
    }
}

/// Factor at the nominal torque of a joint whose torque has the model's shape.
fn shaped(joint: Option<Explained>) -> Option<f64> {
    let clear = joint.filter(|joint| {
        joint.left < CLEAR
            && joint.left < PART * joint.left_without_model
            && joint.left_without_model > NEEDED
            && joint.gain > 0.0
    });
    clear.map(|joint| joint.gain)
}

fn is_thousand(gain: f64) -> bool {
    (gain * THOUSANDTH).ln().abs() <= LIKE_A_THOUSAND
}

/// Largest torque of each joint and the model's effort limit, where it states one.
fn efforts(robot: &Robot, sample: &Sample) -> Vec<Option<[f64; 2]>> {
    let of_joint = |joint: usize| {
        let limit = robot.joint(joint).limits.effort?;
        let torque = sample.channels[3][joint].iter();
        let largest = torque.fold(0.0_f64, |most, tau| most.max(tau.abs()));
        (limit > 0.0 && largest > 0.0).then_some([largest, limit])
    };
    (0..robot.dof()).map(of_joint).collect()
}

/// Largest torque and limit of a joint that is clearly beyond what its drive can do. A model's limits may be made up: most of the
/// others have to keep theirs.
fn beyond_effort(efforts: &[Option<[f64; 2]>], joint: usize) -> Option<[f64; 2]> {
    let others = efforts.iter().enumerate();
    let others = others.filter_map(|(other, effort)| effort.filter(|_| other != joint));
    let kept = others.filter(|other| used(*other) <= 1.0).count();
    let own = efforts[joint]?;
    (2 * kept > efforts.len() && used(own) > BEYOND).then_some(own)
}

/// True where all joints are, by limits that are of each joint.
fn all_beyond_effort(efforts: &[Option<[f64; 2]>]) -> bool {
    let beyond =
        |effort: &Option<[f64; 2]>| effort.is_some_and(|own| THOUSANDTHS.contains(&used(own)));
    let limits: Vec<f64> = efforts.iter().flatten().map(|[_, limit]| *limit).collect();
    let differ = limits.iter().any(|limit| *limit != limits[0]);
    differ && efforts.iter().all(beyond)
}

/// Largest torque over the limit.
fn used([largest, limit]: [f64; 2]) -> f64 {
    largest / limit
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
    let known = |left: &Option<Explained>| left.map_or(f64::NAN, |e| 1.0 - e.left);
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
        let signs = [motion_sign, reading.rates[joint], torque_sign];
        let turned = match signs.map(|sign| sign < 0.0) {
            [false, false, false] => continue,
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
        findings.push(Finding::new(
            Severity::Degraded,
            Code::SignFlip,
            *name,
            format!(
                "joint `{name}`: {turned}: model and friction explain {} of its torque as logged, {} turned; nothing was \
                 changed: turn the columns with [columns] factor{or_the_axis}",
                share(&before[joint]),
                share(&after[joint])
            ),
            0,
        )
        .with([("explained", known(&after[joint])), ("explained_before", known(&before[joint]))]));
    }
    if !moved.is_empty() {
        let least = |explained: &[Option<Explained>]| {
            let worst = explained.iter().flatten().map(|e| e.left);
            1.0 - worst.fold(0.0, f64::max)
        };
        let all = |explained| format!("{:.0} %", 100.0 * least(explained));
        findings.push(Finding::new(
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
        .with([("explained", least(after)), ("explained_before", least(before))]));
    }
    findings
}

#[cfg(test)]
mod readings_tests;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
