//! Constant torque offset: torque +1 per unit of β, e.g. a biased torque sensor or an unmodelled counterweight cable.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::{Graph, Variable};

/// `<joint>.offset`: the actuator delivers β more, always, N·m (N for a slider). Lagrangian −q.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint) -> Candidate {
    let position = graph.variable(Variable::Position(joint.index));
    Candidate {
        name: format!("{}.offset", joint.name),
        family: Family::Offset,
        unit: joint.torque_unit().to_owned(),
        story: format!(
            "constant {} offset on {}",
            if joint.slides { "force" } else { "torque" },
            joint.name
        ),
        lagrangian: Some(graph.scaled(-1.0, position)),
        image: vec![(joint.index, graph.constant(1.0))],
    }
}
