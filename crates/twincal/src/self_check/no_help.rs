//! A model whose weight explains nothing of the torque that holds a weight: another robot's, or another order of the joints.

use super::explain::Explained;
use crate::error::{Finding, Severity};
use crate::robot::Robot;
use crate::words::significant;
use std::ops::RangeInclusive;

/// Share of a joint's torque that friction must leave to be explained by something else.
const NEEDED: f64 = 0.4;
/// Part of that share which the model leaves, whatever the factor at its torque, where it explains nothing.
const NOTHING: f64 = 0.8;
/// Share of the nominal torque's power that gravity has where inertia, and the noise of accelerations, hardly counts.
const WEIGHT: RangeInclusive<f64> = 0.8..=1.25;
/// Power of the nominal torque over that of the measured one from which it should explain something.
const LEAST: f64 = 0.01;

/// One finding on the first joint that is like that, with the others beside it.
pub(super) fn finding(robot: &Robot, explained: &[Option<Explained>]) -> Option<Finding> {
    let all = robot.joint_names().into_iter().zip(explained);
    let told = all.filter_map(|(name, joint)| Some((name, (*joint)?)));
    let of_no_help: Vec<(&str, Explained)> =
        told.filter(|(_, joint)| is_of_no_help(joint)).collect();
    let (name, joint) = of_no_help.first()?;
    let others: Vec<String> = of_no_help[1..]
        .iter()
        .map(|(name, _)| format!("`{name}`"))
        .collect();
    let others = match others.len() {
        0 => String::new(),
        _ => format!(", and alike on {}", others.join(", ")),
    };
    let percent = |left: f64| significant(100.0 * (1.0 - left).max(0.0), 2);
    let message = format!(
        "joint `{name}`: friction alone explains {} % of its torque, and with the model's weight it is still {} %{others}: this model is hardly the \
         robot's, or order or zero positions of the joints are others: look whether it is the right file",
        percent(joint.left_without_model),
        percent(joint.left)
    );
    let count = of_no_help.len() as u64;
    Some(Finding::new(
        Severity::Degraded,
        "model_of_no_help",
        *name,
        message,
        count,
    ))
}

fn is_of_no_help(joint: &Explained) -> bool {
    let [nominal, measured] = joint.sizes;
    joint.driven
        && joint.left_without_model > NEEDED
        && joint.left > NOTHING * joint.left_without_model
        && nominal > LEAST * measured
        && WEIGHT.contains(&(joint.gravity / nominal))
}
