//! The robot: a tree of joints, links and inertias that never changes once built.
//!
//! [`RobotDescription`] is what a model file says (readers fill it, see `twincal-io`); [`Robot::new`] checks it and
//! lays it out for the algorithms: what does not move is merged, one body per moving joint remains. If a [`Robot`]
//! exists, it is valid.

mod description;
mod names;
pub mod spatial;
mod inertia;
mod tree;
mod coordinates;
mod bodies;
mod dense;
mod parameters;
mod carry;
mod changed;
mod regrouped;
mod lane_vectors;
mod recursion;
mod motion;
mod block;
mod dynamics;
mod random_states;
pub mod regressor;
mod base_parameters;
mod gravity;
mod derivative;
mod mass_matrix;
mod placements;
mod energy_regressor;
mod energy;

#[cfg(test)]
pub(crate) mod testing;

pub use base_parameters::{BaseParameters, DependentParameter, base_parameters};
pub use block::{BLOCK, BlockWorkspace, Instructions, STRIDE};
pub use derivative::position_derivative;
pub use description::{
    Inertia, JointDescription, JointKind, Limits, LinkDescription, Mimic, Placement,
    RobotDescription,
};
pub use dynamics::{Workspace, inverse_dynamics, mass_matrix, nominal_torque, nominal_torque_with};
pub use energy::{kinetic_energy, potential_energy};
pub use energy_regressor::energy_regressor;
pub use gravity::gravity_regressor;
pub use inertia::principal_axes;
pub use mass_matrix::mass_matrices;
pub use motion::Motion;
pub use names::{did_you_mean, nearest_names};
pub use parameters::{PARAMETERS, PINOCCHIO_ORDER, body_parameters, inertia_of, to_body_frame};
pub use placements::MovingBody;
#[cfg(test)]
pub(crate) use random_states::random_states;
pub use regressor::{Pair, Regressor, RegressorBlock};

use crate::error::{Code, Error, Finding, Result, Severity};
pub(crate) use bodies::Body;
use bodies::Home;
pub(crate) use changed::Change;
pub(crate) use regrouped::regrouped;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A valid robot: immutable, cheap to share between threads.
///
/// It is written to files as its description and its locked joints, and read back through [`Robot::new`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub struct Robot {
    description: RobotDescription,
    locked: BTreeMap<String, f64>,
    /// Index in `description.joints` of q1…qn.
    coordinates: Vec<usize>,
    /// Moving bodies, parents first.
    bodies: Vec<Body>,
    /// Per link of `description`.
    homes: Vec<Home>,
    planar: bool,
}

/// What is written of a [`Robot`].
#[derive(Clone, Serialize, Deserialize)]
struct Parts {
    description: RobotDescription,
    locked: BTreeMap<String, f64>,
}

impl From<Robot> for Parts {
    fn from(robot: Robot) -> Self {
        Self {
            description: robot.description,
            locked: robot.locked,
        }
    }
}

impl TryFrom<Parts> for Robot {
    type Error = Error;

    fn try_from(parts: Parts) -> Result<Self> {
        Self::new(parts.description, &parts.locked).map(|(robot, _)| robot)
    }
}

impl Robot {
    /// [`Robot::new`] of a robot whose joints are all free, without what was found on the way.
    ///
    /// # Errors
    /// Those of [`Robot::new`].
    ///
    /// # Example
    /// ```
    /// use twincal::robot::*;
    ///
    /// let inertia = Inertia { mass: 2.0, com: [0.0; 3], tensor: [[0.0; 3]; 3] };
    /// let link = |name: &str, inertia| LinkDescription { name: name.into(), inertia };
    /// let mut joint = JointDescription::new("axis", JointKind::Prismatic, "base", "cart");
    /// joint.axis = [1.0, 0.0, 0.0];
    /// let robot = Robot::from_description(RobotDescription {
    ///     name: "slider".into(),
    ///     gravity: [0.0, 0.0, -9.81],
    ///     links: vec![link("base", None), link("cart", Some(inertia))],
    ///     joints: vec![joint],
    ///     allow_unphysical: false,
    /// })?;
    /// assert_eq!(robot.joint_names(), ["axis"]);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    pub fn from_description(description: RobotDescription) -> Result<Self> {
        Self::new(description, &BTreeMap::new()).map(|(robot, _)| robot)
    }

    /// Checks a description and lays it out. `locked` fixes moving joints at a position (rad or m).
    ///
    /// Findings: `axis_normalised`, `point_mass`, `unphysical_inertia`, `locked_fixed_joint`, `locked_beyond_limits`,
    /// `moves_no_mass`.
    ///
    /// # Errors
    /// [`Error::Model`] for cycles, two roots, orphans, duplicate names, zero axes, impossible masses or inertias,
    /// locked or mimicked joints that do not exist, a robot without a moving joint.
    ///
    /// # Example
    /// An arm with its elbow locked at a right angle is a robot of one joint: 3 kg at the elbow and 2 kg above it, both 0.5 m from the shoulder's axis.
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// use std::collections::BTreeMap;
    /// use twincal::robot::{Robot, Workspace, inverse_dynamics};
    ///
    /// # let description = two_link::arm(2.0)?.description().clone();
    /// let locked = BTreeMap::from([("elbow".to_owned(), std::f64::consts::FRAC_PI_2)]);
    /// let (robot, findings) = Robot::new(description, &locked)?;
    /// for finding in &findings {
    ///     println!("{}", finding.message);
    /// }
    /// assert_eq!(robot.joint_names(), ["shoulder"]);
    /// let mut tau = [0.0];
    /// inverse_dynamics(&robot, &mut Workspace::new(&robot), &[0.0], &[0.0], &[0.0], &mut tau);
    /// assert!((tau[0] - 9.81 * (3.0 + 2.0) * 0.5).abs() < 1e-9);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    pub fn new(
        description: RobotDescription,
        locked: &BTreeMap<String, f64>,
    ) -> Result<(Self, Vec<Finding>)> {
        let mut findings = Vec::new();
        if !description.gravity.iter().all(|v| v.is_finite()) {
            return Err(Error::Model {
                culprit: format!("robot `{}`", description.name),
                problem: format!("gravity is {:?}", description.gravity),
                remedy: "give three finite numbers in m/s²".into(),
            });
        }
        let tree = tree::plant(&description)?;
        let (sources, coordinates) = coordinates::assign(&description, locked, &mut findings)?;
        let (bodies, homes) = bodies::lay_out(&description, &tree, &sources, &mut findings)?;
        report_massless(&description, &coordinates, &bodies, &mut findings);
        dense::report(&description, &coordinates, &bodies, &mut findings);
        let planar = axes_parallel(&bodies);
        Ok((
            Self {
                description,
                locked: locked.clone(),
                coordinates,
                bodies,
                homes,
                planar,
            },
            findings,
        ))
    }

    /// Number of moving joints n.
    pub fn dof(&self) -> usize {
        self.coordinates.len()
    }

    /// Names of the moving joints, q1…qn: in the model's order, without fixed, locked and mimicking ones.
    pub fn joint_names(&self) -> Vec<&str> {
        self.coordinates
            .iter()
            .map(|&j| self.description.joints[j].name.as_str())
            .collect()
    }

    /// Moving joint `joint` (0-based) as the model states it.
    ///
    /// # Panics
    /// If `joint` ≥ [`Robot::dof`].
    pub fn joint(&self, joint: usize) -> &JointDescription {
        &self.description.joints[self.coordinates[joint]]
    }

    /// Kind of moving joint `joint` (0-based).
    ///
    /// # Panics
    /// If `joint` ≥ [`Robot::dof`].
    pub fn joint_kind(&self, joint: usize) -> JointKind {
        self.joint(joint).kind
    }

    /// True if the axes of all moving joints are parallel at q = 0 (a planar arm).
    pub fn is_planar(&self) -> bool {
        self.planar
    }

    /// Moving bodies as the algorithms see them, parents first.
    pub(crate) fn layout(&self) -> &[Body] {
        &self.bodies
    }

    /// What the model file says.
    pub fn description(&self) -> &RobotDescription {
        &self.description
    }

    /// The same robot where gravity in the base frame is another, m/s².
    pub(crate) fn with_gravity(&self, gravity: [f64; 3]) -> Self {
        let mut robot = self.clone();
        robot.description.gravity = gravity;
        robot
    }

    /// Positions of the joints that were locked, rad or m.
    pub fn locked(&self) -> &BTreeMap<String, f64> {
        &self.locked
    }
}

/// Says which coordinates move neither mass nor motor inertia: their nominal torque is 0 by construction.
fn report_massless(
    description: &RobotDescription,
    coordinates: &[usize],
    bodies: &[Body],
    findings: &mut Vec<Finding>,
) {
    let mut carries: Vec<bool> = bodies
        .iter()
        .map(|b| b.moments.mass > 0.0 || b.armature > 0.0)
        .collect();
    let mut moves_mass = vec![false; coordinates.len()];
    for i in (0..bodies.len()).rev() {
        if carries[i] {
            moves_mass[bodies[i].coordinate] = true;
            if let Some(parent) = bodies[i].parent {
                carries[parent] = true;
            }
        }
    }
    for (&j, _) in coordinates
        .iter()
        .zip(&moves_mass)
        .filter(|&(_, &moves)| !moves)
    {
        let name = &description.joints[j].name;
        let message =
            format!("joint `{name}`: nothing beyond it has mass; its nominal torque is 0");
        findings.push(Finding::new(
            Severity::Warning,
            Code::MovesNoMass,
            name,
            message,
            1,
        ));
    }
}

/// Are all joint axes parallel at q = 0? (Then they are at any q.)
fn axes_parallel(bodies: &[Body]) -> bool {
    let mut frames: Vec<spatial::Matrix> = Vec::with_capacity(bodies.len());
    for body in bodies {
        frames.push(match body.parent {
            Some(parent) => spatial::multiply(&frames[parent], &body.rotation),
            None => body.rotation,
        });
    }
    let axis = |r: &spatial::Matrix| [r[0][2], r[1][2], r[2][2]];
    frames
        .iter()
        .all(|r| spatial::norm(spatial::cross(axis(r), axis(&frames[0]))) < 1e-4)
}
