//! Where bodies and joints stand in an MJCF, and what an element itself (with its class) says: for export.

use twincal::robot::Placement;
use twincal::robot::spatial::Matrix;

/// Everything that export needs beside the description.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Sites {
    /// Bodies as links.
    pub(crate) bodies: Vec<BodySite>,
    /// Joints as they are stated, before actuators and tendons.
    pub(crate) joints: Vec<JointSite>,
    /// A setting of the compiler that makes inertias something else than what `<inertial>` says.
    pub(crate) overrides: Option<&'static str>,
}

/// One `<body>`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BodySite {
    /// Link of the description.
    pub(crate) link: String,
    /// Byte of its `<`.
    pub(crate) offset: usize,
    /// Byte of its `<inertial>`, the frames around that, and its own orientation in them.
    pub(crate) inertial: Option<(usize, Placement, Matrix)>,
    /// Origin of the link's frame in the body's frame, m.
    pub(crate) origin: [f64; 3],
}

/// One `<joint>`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointSite {
    /// Joint of the description.
    pub(crate) joint: String,
    /// Byte of its `<`.
    pub(crate) offset: usize,
    /// Radians (or metres) per unit of angle in the file.
    pub(crate) angle: f64,
    /// As stated.
    pub(crate) damping: f64,
    /// As stated.
    pub(crate) armature: f64,
    /// As stated.
    pub(crate) frictionloss: f64,
    /// As stated.
    pub(crate) stiffness: f64,
    /// As stated, rad or m.
    pub(crate) spring_reference: f64,
}
