//! Units of a joint, and of numbers over all joints.

use serde::Serialize;
use twincal::calibrate::Calibration;
use twincal::robot::JointKind;

/// Units of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct Units {
    pub(crate) position: &'static str,
    pub(crate) velocity: &'static str,
    pub(crate) acceleration: &'static str,
    pub(crate) torque: &'static str,
}

impl Units {
    pub(crate) fn of(kind: JointKind) -> Self {
        match kind {
            JointKind::Prismatic => Self {
                position: "m",
                velocity: "m/s",
                acceleration: "m/s²",
                torque: "N",
            },
            _ => Self {
                position: "rad",
                velocity: "rad/s",
                acceleration: "rad/s²",
                torque: "N·m",
            },
        }
    }
}

/// The unit of torque, if all joints share one; the pooled numbers mix N·m and N otherwise.
#[must_use]
pub fn pooled_unit(calibration: &Calibration) -> &'static str {
    let robot = &calibration.twin.robot;
    let mut joints = (0..calibration.noise.len()).map(|joint| Units::of(robot.joint_kind(joint)));
    match joints.next() {
        Some(first) if joints.all(|own| own == first) => first.torque,
        _ => "N·m and N",
    }
}

/// Unit of a joint's torque; empty of a name that is none.
pub(crate) fn unit_of(calibration: &Calibration, name: &str) -> &'static str {
    let mut joints = calibration.noise.iter();
    let joint = joints.position(|joint| joint.joint == name);
    joint.map_or("", |joint| {
        Units::of(calibration.twin.robot.joint_kind(joint)).torque
    })
}
