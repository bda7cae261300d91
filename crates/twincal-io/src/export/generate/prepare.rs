//! From the calibrated robot to what a file states: locked joints fixed, friction of the file and of the twin in one number.

use super::Plan;
use std::collections::BTreeMap;
use twincal::robot::spatial::{norm, scale};
use twincal::robot::{JointDescription, JointKind, Placement, Robot, RobotDescription};
use twincal::words::quoted;
use twincal::write_back::WriteBack;

/// The robot with the change, ready to be written.
pub(super) fn plan(robot: &Robot, change: &WriteBack, from: &str) -> Plan {
    let mut description = stated(robot, change);
    let still = still(&description.joints, robot.locked());
    let mut fixed = Vec::new();
    for (joint, position) in description.joints.iter_mut().zip(still) {
        if let Some(position) = position {
            fixed.push(joint.name.clone());
            fix(joint, position);
        }
    }
    let mut notes = Vec::new();
    if !fixed.is_empty() {
        notes.push(format!(
            "Joints that do not move in the twin are fixed where they were locked: {}.",
            quoted(&fixed)
        ));
    }
    let no_bodies = change.links.iter().filter(|link| link.no_body);
    Plan {
        description,
        coordinates: robot.joint_names().into_iter().map(Into::into).collect(),
        no_bodies: no_bodies.map(|link| link.link.clone()).collect(),
        from: from.into(),
        notes,
    }
}

/// The description with the change and with damping and dry friction as a file states them: what was found, else what the model
/// states.
pub(super) fn stated(robot: &Robot, change: &WriteBack) -> RobotDescription {
    let mut description = change.description(robot.description());
    for joint in &mut description.joints {
        let found = change.joints.iter().find(|own| own.joint == joint.name);
        if found.and_then(|own| own.damping).is_none() {
            joint.damping += joint.unused_damping;
        }
        joint.unused_damping = 0.0;
        let friction = found.and_then(|own| own.friction);
        joint.unused_friction = friction.unwrap_or(joint.unused_friction);
    }
    description
}

/// Where each joint stays, rad or m: locked ones, and those that follow one that stays. `None` for joints that move.
fn still(joints: &[JointDescription], locked: &BTreeMap<String, f64>) -> Vec<Option<f64>> {
    let index: BTreeMap<&str, &JointDescription> = joints
        .iter()
        .map(|joint| (joint.name.as_str(), joint))
        .collect();
    let position = |joint: &JointDescription| {
        // q = m₁ (m₂ (…) + c₂) + c₁ down to the joint that follows none.
        let (mut here, mut factor, mut sum) = (joint, 1.0, 0.0);
        loop {
            if let Some(position) = locked.get(&here.name) {
                return Some(factor * position + sum);
            }
            let mimic = here.mimic.as_ref()?;
            sum += factor * mimic.offset;
            factor *= mimic.multiplier;
            if factor == 0.0 {
                return Some(sum);
            }
            here = index.get(mimic.joint.as_str())?;
        }
    };
    let moves = |joint: &JointDescription| joint.kind != JointKind::Fixed;
    (joints.iter())
        .map(|joint| position(joint).filter(|_| moves(joint)))
        .collect()
}

/// Makes a joint fixed at a position.
fn fix(joint: &mut JointDescription, position: f64) {
    let axis = scale(1.0 / norm(joint.axis), joint.axis);
    let moved = Placement::of_joint(joint.kind, axis, position);
    let placement = joint.placement.compose(&moved);
    *joint = JointDescription {
        placement,
        ..JointDescription::new(&joint.name, JointKind::Fixed, &joint.parent, &joint.child)
    };
}
