//! The robot: a tree of joints, links and inertias that never changes once built.
//!
//! [`RobotDescription`] is what a model file says (readers fill it, see `twincal-io`); [`Robot::new`] checks it and
//! lays it out for the algorithms. If a [`Robot`] exists, it is valid.

use crate::error::{Finding, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Position of a frame in its parent: `x_parent = rotation · x + translation`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Rotation matrix, row-major.
    pub rotation: [[f64; 3]; 3],
    /// Origin of the frame in the parent, m.
    pub translation: [f64; 3],
}

/// What a joint lets its child do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// Turns about the axis, with limits.
    Revolute,
    /// Turns about the axis without limits.
    Continuous,
    /// Slides along the axis.
    Prismatic,
    /// Does not move.
    Fixed,
}

/// Mass, centre of mass and rotational inertia of a link, as in the model file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Inertia {
    /// kg.
    pub mass: f64,
    /// Centre of mass in the link frame, m.
    pub com: [f64; 3],
    /// Rotational inertia about the CENTRE OF MASS, axes parallel to the link frame, kg·m²; symmetric.
    pub tensor: [[f64; 3]; 3],
}

/// One link of a [`RobotDescription`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkDescription {
    /// Unique name.
    pub name: String,
    /// None: no inertia (a frame).
    pub inertia: Option<Inertia>,
}

/// One joint of a [`RobotDescription`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointDescription {
    /// Unique name.
    pub name: String,
    /// What it lets move.
    pub kind: JointKind,
    /// Name of the parent link.
    pub parent: String,
    /// Name of the child link.
    pub child: String,
    /// Joint frame (= child link frame at q = 0) in the parent link frame.
    pub placement: Placement,
    /// Axis in the joint frame; need not be normalised.
    pub axis: [f64; 3],
    /// Reflected motor inertia that the file states (MJCF `armature`), kg·m² or kg.
    pub armature: f64,
    /// Viscous damping that counts as nominal torque, N·m·s/rad or N·s/m.
    pub damping: f64,
    /// Spring stiffness that counts as nominal torque, N·m/rad or N/m.
    pub stiffness: f64,
    /// Rest position of that spring, rad or m.
    pub spring_reference: f64,
    /// `(joint, multiplier, offset)` when the joint mimics another.
    pub mimic: Option<(String, f64, f64)>,
    /// `(lower, upper, effort, velocity)` limits where the file states them; NaN where it does not.
    pub limits: Option<[f64; 4]>,
}

/// What a model file says, before it is checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotDescription {
    /// Name of the robot.
    pub name: String,
    /// Gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// Links in the file's order.
    pub links: Vec<LinkDescription>,
    /// Joints in the file's order; the moving ones in this order are q1…qn.
    pub joints: Vec<JointDescription>,
    /// Physically impossible inertias are a [`Finding`] instead of an error.
    pub allow_unphysical: bool,
}

/// A valid robot: immutable, cheap to share between threads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    description: RobotDescription,
    locked: BTreeMap<String, f64>,
    // the dynamics helper adds the laid-out bodies here
}

impl Robot {
    /// Checks a description and lays it out. `locked` fixes moving joints at a position (rad or m).
    ///
    /// # Errors
    /// [`crate::Error::Model`] for cycles, two roots, orphans, duplicate names, zero axes, impossible masses or inertias.
    pub fn new(_description: RobotDescription, _locked: &BTreeMap<String, f64>) -> Result<(Self, Vec<Finding>)> {
        todo!()
    }
    /// Number of moving joints n.
    pub fn dof(&self) -> usize {
        todo!()
    }
    /// Names of the moving joints, q1…qn.
    pub fn joint_names(&self) -> Vec<&str> {
        todo!()
    }
    /// Kind of moving joint `joint` (0-based).
    pub fn joint_kind(&self, _joint: usize) -> JointKind {
        todo!()
    }
    /// True if the axes of all moving joints are parallel at q = 0 (a planar arm).
    pub fn is_planar(&self) -> bool {
        todo!()
    }
}

/// Motion of `len` samples in structure-of-arrays form: `q[joint * len + sample]`. SI units.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// Number of samples.
    pub len: usize,
    /// Positions, dof × len, rad or m.
    pub q: &'a [f64],
    /// Velocities, dof × len.
    pub qd: &'a [f64],
    /// Accelerations, dof × len.
    pub qdd: &'a [f64],
}

/// Nominal torque of a batch: `M q̈ + bias + armature q̈ + damping q̇ + stiffness (q − q_ref)`; written to
/// `tau[joint * len + sample]`, N·m or N.
pub fn nominal_torque(_robot: &Robot, _motion: Motion<'_>, _tau: &mut [f64]) {
    todo!()
}
