//! Coulomb friction: torque +tanh(q̇/v_s) per unit of β, sign(q̇) for v_s = 0.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::{Function, Graph};

/// `<joint>.coulomb`: the actuator delivers β more in the direction of motion, N·m (N for a slider). Dissipated.
///
/// `velocity` is v_s, rad/s or m/s; 0 gives sign(q̇) with sign(0) = 0.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint, velocity: f64) -> Candidate {
    let rate = joint.velocity(graph);
    let torque = if velocity == 0.0 {
        graph.function(Function::Sign, rate)
    } else {
        let relative = graph.scaled(1.0 / velocity, rate);
        graph.function(Function::Tanh, relative)
    };
    Candidate {
        name: format!("{}.coulomb", joint.name),
        family: Family::Coulomb,
        unit: joint.torque_unit().to_owned(),
        story: format!("Coulomb friction on {}", joint.name),
        lagrangian: None,
        image: vec![(joint.index, torque)],
    }
}
