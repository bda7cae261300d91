//! Viscous friction: torque +q̇ per unit of β. The shortest complete term: copy it to add a family.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::Graph;

/// `<joint>.viscous`: the actuator delivers β q̇ more, N·m·s/rad (N·s/m for a slider). No energy: it is dissipated.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint) -> Candidate {
    Candidate {
        name: format!("{}.viscous", joint.name),
        family: Family::Viscous,
        unit: if joint.slides {
            "N·s/m"
        } else {
            "N·m·s/rad"
        }
        .to_owned(),
        story: format!("viscous friction on {}", joint.name),
        lagrangian: None,
        image: vec![(joint.index, joint.velocity(graph))],
    }
}
