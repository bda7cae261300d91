//! What a model file says about a robot, before anything is checked.

use serde::{Deserialize, Serialize};

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

impl JointKind {
    /// Unit of the joint's generalised force.
    #[must_use]
    pub fn torque_unit(self) -> &'static str {
        match self {
            Self::Prismatic => "N",
            Self::Revolute | Self::Continuous | Self::Fixed => "N·m",
        }
    }
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

/// A joint that follows another: `q = multiplier · q_joint + offset`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mimic {
    /// Name of the joint that it follows.
    pub joint: String,
    /// Ratio of the two velocities.
    pub multiplier: f64,
    /// Position while the other is at 0, rad or m.
    pub offset: f64,
}

/// Limits of a joint where the file states them. They never change a torque.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Limits {
    /// Smallest position, rad or m.
    pub lower: Option<f64>,
    /// Largest position, rad or m.
    pub upper: Option<f64>,
    /// Largest torque or force, N·m or N.
    pub effort: Option<f64>,
    /// Largest speed, rad/s or m/s.
    pub velocity: Option<f64>,
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
    /// Axis in the joint frame; need not be normalised; of no meaning for a fixed joint.
    pub axis: [f64; 3],
    /// Reflected motor inertia that the file states (MJCF `armature`), kg·m² or kg.
    pub armature: f64,
    /// Viscous damping that counts as nominal torque, N·m·s/rad or N·s/m.
    pub damping: f64,
    /// Spring stiffness that counts as nominal torque, N·m/rad or N/m.
    pub stiffness: f64,
    /// Rest position of that spring, rad or m.
    pub spring_reference: f64,
    /// Viscous damping that the file states and that does not count as nominal torque, N·m·s/rad or N·s/m.
    #[serde(default)]
    pub unused_damping: f64,
    /// Dry friction that the file states, N·m or N; it never counts as nominal torque.
    #[serde(default)]
    pub unused_friction: f64,
    /// Set when the joint mimics another.
    pub mimic: Option<Mimic>,
    /// As far as stated.
    pub limits: Limits,
}

impl JointDescription {
    /// A joint at the parent's origin that turns about z: no motor inertia, friction, spring or limits.
    pub fn new(name: &str, kind: JointKind, parent: &str, child: &str) -> Self {
        Self {
            name: name.into(),
            kind,
            parent: parent.into(),
            child: child.into(),
            placement: Placement::IDENTITY,
            axis: [0.0, 0.0, 1.0],
            armature: 0.0,
            damping: 0.0,
            stiffness: 0.0,
            spring_reference: 0.0,
            unused_damping: 0.0,
            unused_friction: 0.0,
            mimic: None,
            limits: Limits::default(),
        }
    }
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
    /// Physically impossible inertias are a [`Finding`](crate::Finding) instead of an error.
    pub allow_unphysical: bool,
}
