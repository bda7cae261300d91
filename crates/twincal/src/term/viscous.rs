//! Viscous friction: torque +q̇ per unit of β. The shortest complete family: copy it to add one.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::Graph;

/// `<joint>.viscous`: the actuator delivers β q̇ more, N·m·s/rad (N·s/m for a slider). No energy: it is dissipated.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint) -> Candidate {
    let image = vec![(joint.index, joint.velocity(graph))];
    Candidate::torque(
        format!("{}.viscous", joint.name),
        Family::Viscous,
        unit(joint),
        format!("viscous friction on {}", joint.name),
        image,
    )
}

/// Unit of a viscous coefficient.
pub(super) fn unit(joint: &Joint) -> &'static str {
    if joint.slides {
        "N·s/m"
    } else {
        "N·m·s/rad"
    }
}
