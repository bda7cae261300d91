//! Reads a generated file back: its torque is the robot's, its joints and links say what was meant.

use super::super::{DIGITS, close};
use super::{Plan, prepare};
use crate::error::{Error, Result};
use crate::model::{Model, ModelFormat, ModelSettings, parse_model};
use std::collections::BTreeMap;
use twincal::robot::{JointDescription, JointKind, Motion, Robot, nominal_torque};
use twincal::write_back::WriteBack;

/// States at which torque is compared.
const STATES: usize = 32;
/// Torque of a joint counts as none below this share of the largest torque of all joints.
const SMALL: f64 = 1e-3;

/// Compares the text with what it is made from.
///
/// # Errors
/// [`Error::Internal`] with the joint or link that differs.
pub(super) fn verify(
    format: ModelFormat,
    robot: &Robot,
    change: &WriteBack,
    plan: &Plan,
    text: &str,
) -> Result<()> {
    let settings = ModelSettings {
        gravity: (format == ModelFormat::Urdf).then_some(plan.description.gravity),
        use_urdf_friction: true,
        allow_unphysical: plan.description.allow_unphysical,
        ..ModelSettings::default()
    };
    let name = match format {
        ModelFormat::Urdf => "generated.urdf",
        ModelFormat::Mjcf => "generated.xml",
    };
    let again = parse_model(name, text.as_bytes(), &settings)?;
    compare_joints(plan, &again)?;
    compare_links(plan, &again)?;
    let (again, _) = again.robot(&BTreeMap::new())?;
    let mut meant = prepare::stated(robot, change);
    // With the masses that the format asks for.
    meant.links.clone_from(&plan.description.links);
    let (meant, _) = Robot::new(meant, robot.locked())?;
    compare_torque(&meant, &again)
}

fn differs(what: String, problem: String) -> Error {
    Error::Internal {
        what: format!("generated file, {what}"),
        problem,
    }
}

/// Damping, friction, motor inertia, springs and limits of joints.
fn compare_joints(plan: &Plan, again: &Model) -> Result<()> {
    let found: BTreeMap<&str, &JointDescription> = (again.description.joints.iter())
        .map(|joint| (joint.name.as_str(), joint))
        .collect();
    for joint in plan
        .description
        .joints
        .iter()
        .filter(|own| own.kind != JointKind::Fixed)
    {
        let Some(other) = found.get(joint.name.as_str()) else {
            return Err(differs(
                format!("joint `{}`", joint.name),
                "is not there".into(),
            ));
        };
        let numbers = |own: &JointDescription| {
            [
                own.damping,
                own.unused_friction,
                own.armature,
                own.stiffness,
                own.stiffness * own.spring_reference,
            ]
        };
        let (meant, read) = (numbers(joint), numbers(other));
        let near = |(a, b): (&f64, &f64)| (a - b).abs() <= DIGITS * a.abs();
        let limited = |own: &JointDescription| own.limits.lower.zip(own.limits.upper);
        let is_range = limited(joint).is_some_and(|(lower, upper)| lower < upper);
        let same_limits = !is_range
            || joint.kind == JointKind::Continuous
            || limited(other).is_some_and(|(lower, upper)| {
                let (low, high) = limited(joint).unwrap_or_default();
                near((&low, &lower)) && near((&high, &upper))
            });
        if !(meant.iter().zip(&read).all(near) && same_limits) {
            return Err(differs(
                format!("joint `{}`", joint.name),
                format!(
                    "meant {meant:?} {:?}, reads back as {read:?} {:?}",
                    joint.limits, other.limits
                ),
            ));
        }
    }
    Ok(())
}

/// Inertias of links.
fn compare_links(plan: &Plan, again: &Model) -> Result<()> {
    let links: BTreeMap<&str, _> = (again.description.links.iter())
        .map(|link| (link.name.as_str(), link.inertia))
        .collect();
    for link in &plan.description.links {
        let read = links.get(link.name.as_str()).copied().flatten();
        let same = match (&link.inertia, &read) {
            (Some(meant), Some(read)) => close(read, meant),
            (None, None) => links.contains_key(link.name.as_str()),
            _ => false,
        };
        if !same {
            return Err(differs(
                format!("link `{}`", link.name),
                format!("meant {:?}, reads back as {read:?}", link.inertia),
            ));
        }
    }
    Ok(())
}

/// Torque of both at states that fill a box, joint by joint by name.
fn compare_torque(meant: &Robot, again: &Robot) -> Result<()> {
    let names = meant.joint_names();
    let theirs = again.joint_names();
    let place = |name: &&str| theirs.iter().position(|other| other == name);
    let places: Option<Vec<usize>> = names.iter().map(place).collect();
    let Some(places) = places.filter(|_| theirs.len() == names.len()) else {
        return Err(differs(
            "joints".into(),
            format!("meant {names:?}, reads back as {theirs:?}"),
        ));
    };
    let wanted = torque(meant, &(0..names.len()).collect::<Vec<_>>());
    let read = torque(again, &places);
    let largest = |own: &[f64]| own.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let all = largest(&wanted);
    for (joint, name) in names.iter().enumerate() {
        let own = &wanted[joint * STATES..(joint + 1) * STATES];
        let there = &read[places[joint] * STATES..(places[joint] + 1) * STATES];
        let error: Vec<f64> = own.iter().zip(there).map(|(a, b)| a - b).collect();
        let (error, scale) = (largest(&error), largest(own).max(SMALL * all));
        if error > DIGITS * scale || !there.iter().all(|torque| torque.is_finite()) {
            return Err(differs(
                format!("joint `{name}`"),
                format!("its torque is {error:e} away from the robot's, of {scale:e}"),
            ));
        }
    }
    Ok(())
}

/// Nominal torque, `joint * STATES + state`; the state of `places[k]` is the k-th of the sequence.
fn torque(robot: &Robot, places: &[usize]) -> Vec<f64> {
    let joints = places.len();
    let mut parts = [3.0, 2.0, 5.0].map(|range| (range, vec![0.0; joints * STATES]));
    for (which, (range, values)) in parts.iter_mut().enumerate() {
        for (k, place) in places.iter().enumerate() {
            // Kronecker sequence: multiples of square roots, modulo 1.
            let step = ((3 * k + which) as f64 + 2.5).sqrt();
            for state in 0..STATES {
                let fraction = ((state as f64 + 0.5) * step).fract();
                values[place * STATES + state] = *range * (2.0 * fraction - 1.0);
            }
        }
    }
    let [(_, q), (_, qd), (_, qdd)] = parts;
    let mut tau = vec![0.0; joints * STATES];
    let motion = Motion {
        len: STATES,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    nominal_torque(robot, motion, &mut tau);
    tau
}
