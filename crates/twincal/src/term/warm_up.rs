//! Friction that changes as the joint warms up.

use super::Family;
use super::candidate::{Candidate, Joint, Proposal, direction};
use super::expression::{Graph, Variable};
use super::viscous;
use crate::signal::warmth_channel;

/// `<joint>.warm_up`: columns `.coulomb` (torque w tanh(q̇/v_s)) and `.viscous` (torque w q̇): what friction has more at w = 1 than at the
/// training logs' mean, where w is 0. w falls with the time since the log's start, or grows with the logged temperature ([`crate::signal::Warmth`]).
pub(super) fn proposal(graph: &mut Graph, joint: &Joint, velocity: f64) -> Proposal {
    let name = format!("{}.warm_up", joint.name);
    let story = format!("friction on {} that changes with warmth", joint.name);
    let warmth = graph.variable(Variable::History(warmth_channel(joint.index)));
    let rate = joint.velocity(graph);
    let sign = direction(graph, rate, velocity);
    let coulomb = graph.product(&[(sign, 1), (warmth, 1)]);
    let viscous = graph.product(&[(rate, 1), (warmth, 1)]);
    let columns = [
        ("coulomb", joint.torque_unit(), coulomb),
        ("viscous", viscous::unit(joint), viscous),
    ]
    .into_iter()
    .map(|(column, unit, torque)| {
        Candidate::torque(
            format!("{name}.{column}"),
            Family::WarmUp,
            unit,
            story.clone(),
            vec![(joint.index, torque)],
        )
    })
    .collect();
    Proposal { name, columns }
}
