//! Angles in degrees that motion alone does not show: torque makes sense only where they are taken so.

use super::correct::{gain_of, overwhelming};
use super::explain::{Explained, Reading, explain};
use super::sample::Sample;
use crate::error::{Error, Result};
use crate::robot::{JointKind, Robot};
use std::f64::consts::{PI, TAU};

/// Refuses angles beyond a turn that the model explains as degrees: all of them, else those of the joints with which it explains most.
pub(super) fn refuse_degrees(robot: &Robot, log: &str, sample: &Sample) -> Result<()> {
    let is_turning = |joint: &usize| robot.joint_kind(*joint) != JointKind::Prismatic;
    let turning: Vec<usize> = (0..robot.dof()).filter(is_turning).collect();
    let is_beyond = |joint: &usize| largest(sample, *joint) > TAU;
    let beyond: Vec<usize> = turning.iter().copied().filter(is_beyond).collect();
    if beyond.is_empty() {
        return Ok(());
    }
    let as_logged = explain(robot, sample, &Reading::as_logged(robot.dof()));
    let all = explain(robot, sample, &in_degrees(robot, &turning));
    let (some, explained) = most_explained(robot, sample, &beyond, &as_logged);
    let is_clear = |after: &[Option<Explained>]| overwhelming(&as_logged, after);
    let rather_some = gain_of(&all, &explained) > 0.0;
    if is_clear(&explained) && (rather_some || !is_clear(&all)) {
        return Err(error(robot, log, sample, &some));
    }
    match is_clear(&all) {
        true => Err(error(robot, log, sample, &turning)),
        false => Ok(()),
    }
}

/// The joints that explain most as degrees, taken one after the other as long as another one explains more.
fn most_explained(
    robot: &Robot,
    sample: &Sample,
    beyond: &[usize],
    as_logged: &[Option<Explained>],
) -> (Vec<usize>, Vec<Option<Explained>>) {
    let mut joints: Vec<usize> = Vec::new();
    let mut current = as_logged.to_vec();
    loop {
        let others = beyond.iter().filter(|joint| !joints.contains(joint));
        let tried = others.map(|joint| {
            let mut with = joints.clone();
            with.push(*joint);
            with.sort_unstable();
            let explained = explain(robot, sample, &in_degrees(robot, &with));
            (gain_of(&current, &explained), with, explained)
        });
        let best = tried.max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, with, explained)) = best.filter(|(gain, ..)| *gain > 0.0) else {
            return (joints, current);
        };
        (joints, current) = (with, explained);
    }
}

/// The log with these joints in degrees.
fn in_degrees(robot: &Robot, joints: &[usize]) -> Reading {
    let factor = |joint: usize| match joints.contains(&joint) {
        true => PI / 180.0,
        false => 1.0,
    };
    Reading {
        motion: (0..robot.dof())
            .map(|joint| (joint, factor(joint)))
            .collect(),
        rates: (0..robot.dof()).map(factor).collect(),
        ..Reading::as_logged(robot.dof())
    }
}

fn error(robot: &Robot, log: &str, sample: &Sample, joints: &[usize]) -> Error {
    let names = robot.joint_names();
    let reached = joints.iter().map(|joint| largest(sample, *joint));
    let reached = reached.fold(0.0, f64::max);
    let own: Vec<&str> = joints.iter().map(|joint| names[*joint]).collect();
    let of_all = (0..robot.dof()).filter(|joint| robot.joint_kind(*joint) != JointKind::Prismatic);
    let (whose, factor) = match of_all.eq(joints.iter().copied()) {
        true => (String::new(), "0.017453292519943295".to_owned()),
        false => {
            let of = own
                .iter()
                .map(|name| format!("{name:?} = 0.017453292519943295"));
            (
                format!(" of joint `{}`", own.join("`, `")),
                format!("{{ {} }}", of.collect::<Vec<_>>().join(", ")),
            )
        }
    };
    Error::Log {
        log: log.into(),
        problem: format!(
            "positions{whose} look like degrees: they reach {reached:.1}, and as degrees the model explains the torque"
        ),
        remedy: format!(
            "export positions, velocities and accelerations in radians: × π/180, as with [columns] factor = {{ q = {factor}, qd = {factor} }}"
        ),
    }
}

/// Largest |q| of a joint, rad or m.
fn largest(sample: &Sample, joint: usize) -> f64 {
    let positions = sample.channels[0][joint].iter();
    positions.fold(0.0, |most, q| q.abs().max(most))
}
