//! Friction that differs between the two directions of motion.

use super::Family;
use super::candidate::{Candidate, Joint, Proposal, direction};
use super::expression::Graph;
use super::viscous;

/// `<joint>.asymmetry`: half the difference between the friction of both directions, columns `.coulomb` (torque
/// +tanh²(q̇/v_s)) and `.viscous` (torque +q̇ tanh(q̇/v_s), that is |q̇|). While the joint moves the first is the same as an
/// offset; the data rarely tell the two apart.
pub(super) fn proposal(graph: &mut Graph, joint: &Joint, velocity: f64) -> Proposal {
    let name = format!("{}.asymmetry", joint.name);
    let story = format!("friction on {} that depends on direction", joint.name);
    let rate = joint.velocity(graph);
    let sign = direction(graph, rate, velocity);
    let coulomb = graph.product(&[(sign, 2)]);
    let viscous = graph.product(&[(rate, 1), (sign, 1)]);
    let columns = [
        ("coulomb", joint.torque_unit(), coulomb),
        ("viscous", viscous::unit(joint), viscous),
    ]
    .into_iter()
    .map(|(column, unit, torque)| {
        Candidate::torque(
            format!("{name}.{column}"),
            Family::Asymmetry,
            unit,
            story.clone(),
            vec![(joint.index, torque)],
        )
    })
    .collect();
    Proposal { name, columns }
}
