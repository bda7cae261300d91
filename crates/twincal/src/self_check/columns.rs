//! Torque columns that hold no measurement of their joint: another joint's, or one constant number.

use super::explain::Explained;
use super::parts::{DRIVEN, Parts, driven, needed};
use super::sample::Sample;
use crate::error::{Code, Finding, Severity};
use crate::robot::Robot;
use crate::words::significant;

/// Share of samples in which two columns must be the same number.
const SAME: f64 = 0.99;
/// Share of the variances of gravity and inertia that the model's torque has where nothing cancels, and which a passive joint does not reach
/// although its model is off.
const CLEARLY_DRIVEN: f64 = 0.5;
/// Range of a column, as a share of its size, up to which it is constant: resampling rounds.
const CONSTANT: f64 = 1e-9;

/// Findings on the columns of each log's sample.
pub(super) fn of_samples(
    robot: &Robot,
    (logs, samples): (&[&str], &[Sample]),
    explained: &[Option<Explained>],
) -> Vec<Finding> {
    let joints = 0..robot.dof();
    let changes = |joint: usize| {
        let mut moving = samples
            .iter()
            .filter(|own| own.moves[joint].contains(&true));
        moving.any(|own| !is_constant(own, joint))
    };
    let has_drive: Vec<bool> = joints.clone().map(changes).collect();
    let mut findings = Vec::new();
    for (&log, sample) in logs.iter().zip(samples) {
        findings.extend(copied(robot, log, sample, explained));
        if joints.clone().any(|joint| is_constant(sample, joint)) {
            let parts = Parts::of(robot, sample);
            findings.extend(constant(robot, (log, sample, &parts), &has_drive));
        }
    }
    findings
}

/// Pairs of joints that have one torque column.
fn copied(
    robot: &Robot,
    log: &str,
    sample: &Sample,
    explained: &[Option<Explained>],
) -> Vec<Finding> {
    let names = robot.joint_names();
    let share = |k: usize, a: usize, b: usize| {
        let [a, b] = [a, b].map(|joint| &sample.channels[k][joint]);
        let same = a.iter().zip(b).filter(|(a, b)| a == b).count();
        same as f64 / sample.len as f64
    };
    let left = |joint: usize| explained[joint].map_or(1.0, |e| e.left);
    let mut findings = Vec::new();
    for a in 0..names.len() {
        for b in a + 1..names.len() {
            let is_one = share(3, a, b) > SAME && !is_constant(sample, a);
            // Two fingers of a gripper move alike and have one drive.
            if !is_one || share(0, a, b) > SAME {
                continue;
            }
            let (wrong, right) = if left(a) > left(b) { (a, b) } else { (b, a) };
            let message = format!(
                "log `{log}`: the torque of joint `{}` is that of joint `{}` in {:.0} % of the samples: one column was written twice; map the \
                 measured torque of `{}` in [columns] tau, or log it again",
                names[wrong],
                names[right],
                100.0 * share(3, a, b),
                names[wrong]
            );
            let count = sample.len as u64;
            let finding = Finding::new(
                Severity::Degraded,
                Code::TorqueCopied,
                names[wrong],
                message,
                count,
            );
            findings.push(finding.with([("share", share(3, a, b))]));
        }
    }
    findings
}

/// Joints that move while their torque never changes. A torque of 0 is that of a joint without a drive where gravity and inertia nearly cancel; where
/// its torque changes in another log, of one that swings freely in this one: they cancel.
fn constant(
    robot: &Robot,
    (log, sample, parts): (&str, &Sample, &Parts),
    has_drive: &[bool],
) -> Vec<Finding> {
    let gravity = parts.gravity(robot.description().gravity);
    let names = robot.joint_names();
    let moved = needed(sample, parts, &gravity, DRIVEN);
    let [driven, clearly] =
        [DRIVEN, CLEARLY_DRIVEN].map(|share| driven(sample, parts, &gravity, share));
    let wrong = (0..names.len()).filter(|joint| is_constant(sample, *joint));
    let wrong = wrong.filter_map(|joint| {
        let value = sample.channels[3][joint][0];
        let size = match (has_drive[joint], value == 0.0) {
            (true, true) => moved[joint],
            (false, true) => clearly[joint],
            (_, false) => driven[joint],
        };
        Some((joint, value, size?))
    });
    wrong
        .map(|(joint, value, size)| {
            let elsewhere = match has_drive[joint] {
                true => " while it changes in other logs and",
                false => " while",
            };
            let message = format!(
                "log `{log}`: the torque of joint `{}` is {} throughout{elsewhere} the model needs {} {} (sd) for its motion: no measurement; map its \
                 torque in [columns] tau, or leave this log out",
                names[joint],
                significant(value, 3),
                significant(size, 2),
                robot.joint_kind(joint).torque_unit()
            );
            let count = sample.len as u64;
            Finding::new(Severity::Degraded, Code::TorqueConstant, names[joint], message, count)
                .with([("torque", value), ("torque_needed_sd", size)])
        })
        .collect()
}

/// True if a joint's torque never changes.
pub(super) fn is_constant(sample: &Sample, joint: usize) -> bool {
    let values = sample.channels[3][joint].iter();
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(*x), high.max(*x)]
    });
    high - low <= CONSTANT * high.abs().max(low.abs())
}
