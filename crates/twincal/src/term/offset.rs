//! Constant torque offset: torque +1 per unit of β, e.g. a biased torque sensor or an unmodelled counterweight cable.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::Graph;

/// `<joint>.offset`: the actuator delivers β more, always, N·m (N for a slider). Lagrangian −q.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint) -> Candidate {
    let position = joint.position(graph);
    let phi = graph.scaled(-1.0, position);
    let kind = if joint.slides { "force" } else { "torque" };
    Candidate::lagrangian(
        graph,
        format!("{}.offset", joint.name),
        Family::Offset,
        joint.torque_unit(),
        format!("constant {kind} offset on {}", joint.name),
        phi,
    )
}
