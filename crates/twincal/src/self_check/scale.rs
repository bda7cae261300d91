//! Torque of another size than the model's: another unit, another side of the gear.

use super::explain::Explained;
use super::sample::{LEAST_INDEPENDENT, Sample};
use crate::error::{Code, Finding, Severity};
use crate::robot::Robot;
use crate::words::significant;
use std::ops::RangeInclusive;

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
/// Share of torque that may be left where a factor is believed.
const CLEAR: f64 = 0.05;
/// Share that must be left without the model: else friction alone explains the torque, and the factor says nothing.
const NEEDED: f64 = 0.2;
/// The model must leave less than this part of what friction alone leaves.
const PART: f64 = 0.3;

/// Joints whose torque has the model's shape but another size, and those whose torque is far beyond what the model says that the
/// drive can do; one finding where all torque is in thousandths of N·m.
pub(super) fn scales(
    robot: &Robot,
    sample: &Sample,
    explained: &[Option<Explained>],
) -> Vec<Scale> {
    let names = robot.joint_names();
    let gains: Vec<Option<f64>> = explained.iter().map(|joint| shaped(*joint)).collect();
    let efforts = efforts(robot, sample);
    if let Some(of_all) = thousandths(&names, &gains, &efforts) {
        return vec![of_all];
    }
    let mut scales = Vec::new();
    for (joint, (name, gain)) in names.iter().zip(gains).enumerate() {
        let off = match gain {
            Some(gain) if !is_thousand(gain) && sample.independent < LEAST_INDEPENDENT => None,
            Some(gain) => of_gain(gain),
            None => beyond_effort(&efforts, joint).map(of_effort),
        };
        let Some((problem, factor)) = off else {
            continue;
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

/// All torque in thousandths of N·m, by the factors at the model's torque or, where no joint has one, by the effort limits.
fn thousandths(
    names: &[&str],
    gains: &[Option<f64>],
    efforts: &[Option<[f64; 2]>],
) -> Option<Scale> {
    let shaped: Vec<(&str, f64)> = (names.iter().zip(gains))
        .filter_map(|(name, gain)| Some((*name, (*gain)?)))
        .collect();
    if shaped.len() > 1 && shaped.iter().all(|(_, gain)| is_thousand(*gain)) {
        let joints: Vec<&str> = shaped.iter().map(|(joint, _)| *joint).collect();
        let problem = format!(
            "torque is about 1000 times the model's on every joint on which the model tells ({}): looks like N·mm for N·m",
            joints.join(", ")
        );
        return Some(Scale::new(None, problem, Some(THOUSANDTH)).times(Some(1.0 / THOUSANDTH)));
    }
    if shaped.is_empty() && all_beyond_effort(efforts) {
        let problem =
            "torque is far beyond the model's effort limit on every joint: looks like N·mm for N·m"
                .to_owned();
        return Some(Scale::new(None, problem, Some(THOUSANDTH)));
    }
    None
}

/// What is wrong with torque of the model's shape and so many times its size, and what makes N·m of it.
fn of_gain(gain: f64) -> Option<(String, Option<f64>)> {
    if gain < 1.0 / OTHER_UNIT {
        let problem = format!(
            "torque is {gain:.3} of the model's: looks like gain {:.1} between this column and N·m at the joint (a current, \
             or torque at the motor's side)",
            1.0 / gain
        );
        return Some((problem, None));
    }
    if gain > OTHER_UNIT {
        let problem = format!(
            "torque is {gain:.1} times the model's: looks like gain {gain:.1} (N·mm, mA or counts for N·m), unless a payload \
             that heavy is missing in the model"
        );
        return Some((problem, is_thousand(gain).then_some(THOUSANDTH)));
    }
    None
}

/// What is wrong with torque beyond the effort limit, and what makes N·m of it.
fn of_effort([largest, limit]: [f64; 2]) -> (String, Option<f64>) {
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

/// Torque of another size than the model's.
pub(super) struct Scale {
    /// Of which joint; of all where its subject is empty.
    pub(super) finding: Finding,
    /// What makes N·m of it where it is a thousandth.
    pub(super) factor: Option<f64>,
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

    /// See [`super::Look::sizes`].
    pub(super) fn size(&self) -> Option<(Option<String>, f64)> {
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
