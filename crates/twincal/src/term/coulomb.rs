//! Coulomb friction: torque +tanh(q̇/v_s) per unit of β, sign(q̇) for v_s = 0.

use super::Family;
use super::candidate::{Candidate, Joint, direction};
use super::expression::Graph;

/// `<joint>.coulomb`: the actuator delivers β more in the direction of motion, N·m (N for a slider). Dissipated.
///
/// `velocity` is v_s, rad/s or m/s; 0 gives sign(q̇) with sign(0) = 0.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint, velocity: f64) -> Candidate {
    let rate = joint.velocity(graph);
    let image = vec![(joint.index, direction(graph, rate, velocity))];
    Candidate::torque(
        format!("{}.coulomb", joint.name),
        Family::Coulomb,
        joint.torque_unit(),
        format!("Coulomb friction on {}", joint.name),
        image,
    )
}
