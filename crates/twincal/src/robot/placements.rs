//! Where the rigid bodies of a robot are at joint positions: forward kinematics.
//!
//! ```text
//! ᵇᵃˢᵉT_i = ᵇᵃˢᵉT_parent · ᵖᵃʳᵉⁿᵗT_i(0) · Rot_z(x)   or   Trans_z(x),   x = multiplier · q + offset
//! ```
//!
//! # Source
//! Featherstone 2008, *Rigid Body Dynamics Algorithms*, section 4.1.

use super::{Placement, Robot};

/// A rigid body that a joint moves, with everything that is fixed to it.
#[derive(Debug, Clone, PartialEq)]
pub struct MovingBody {
    /// Link that its joint moves.
    pub link: String,
    /// Index of the body that carries the joint, always smaller than its own; `None`: the base.
    pub parent: Option<usize>,
    /// Moving joint that drives it, 0-based.
    pub joint: usize,
    /// Joint position = multiplier · q + offset; other than 1 where it follows another joint.
    pub multiplier: f64,
    /// See `multiplier`, rad or m.
    pub offset: f64,
    /// It slides along its axis instead of turning about it.
    pub prismatic: bool,
    /// Distance of its frame from that of the body that carries it while its joint is at 0, m.
    pub offset_from_parent: f64,
}

impl Robot {
    /// Rigid bodies that joints move, parents first.
    #[must_use]
    pub fn moving_bodies(&self) -> Vec<MovingBody> {
        let bodies = self.bodies.iter();
        bodies
            .map(|body| MovingBody {
                link: self.description.links[body.link].name.clone(),
                parent: body.parent,
                joint: body.coordinate,
                multiplier: body.multiplier,
                offset: body.offset,
                prismatic: body.prismatic,
                offset_from_parent: super::spatial::norm(body.translation),
            })
            .collect()
    }

    /// The body that a link belongs to (`None`: the base), and the link's frame in that body's frame; `None` for an unknown link.
    #[must_use]
    pub fn home_of_link(&self, link: &str) -> Option<(Option<usize>, Placement)> {
        let at = self
            .description
            .links
            .iter()
            .position(|own| own.name == link)?;
        self.homes.get(at).copied()
    }

    /// Frames of the moving bodies in the frame of the base; `q` in rad or m.
    ///
    /// # Panics
    /// If `q` is not of length [`Robot::dof`].
    ///
    /// # Examples
    /// ```
    /// # use twincal::robot::{JointDescription, JointKind, LinkDescription, Placement, Robot, RobotDescription};
    /// # let link = |name: &str| LinkDescription { name: name.into(), inertia: None };
    /// # let mut joint = JointDescription::new("turn", JointKind::Revolute, "base", "arm");
    /// # joint.placement.translation = [0.0, 0.0, 0.5];
    /// # let (robot, _) = Robot::new(RobotDescription {
    /// #     name: "arm".into(), gravity: [0.0, 0.0, -9.81], links: vec![link("base"), link("arm")],
    /// #     joints: vec![joint], allow_unphysical: false,
    /// # }, &Default::default())?;
    /// let arm = robot.body_placements(&[std::f64::consts::FRAC_PI_2])[0];
    /// let tip = arm.point([1.0, 0.0, 0.0]);
    /// assert!(tip[0].abs() < 1e-12 && (tip[1] - 1.0).abs() < 1e-12 && tip[2] == 0.5);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    #[must_use]
    pub fn body_placements(&self, q: &[f64]) -> Vec<Placement> {
        assert_eq!(q.len(), self.dof(), "one position for each joint");
        let mut placements: Vec<Placement> = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            let position = body.multiplier * q[body.coordinate] + body.offset;
            let at_zero = Placement {
                rotation: body.rotation,
                translation: body.translation,
            };
            let kind = match body.prismatic {
                true => super::JointKind::Prismatic,
                false => super::JointKind::Revolute,
            };
            let moved = at_zero.compose(&Placement::of_joint(kind, [0.0, 0.0, 1.0], position));
            placements.push(match body.parent {
                Some(parent) => placements[parent].compose(&moved),
                None => moved,
            });
        }
        placements
    }
}
