//! Quadratic friction: what viscous friction is not in proportion to the speed.

use super::Family;
use super::candidate::{Candidate, Joint, direction};
use super::expression::Graph;

/// `<joint>.quadratic_friction`: torque +q̇ |q̇|, N·m·s²/rad² (N·s²/m² for a slider). Mostly negative beside viscous friction: gear
/// grease thins with speed and warmth, so that friction grows less and less. Dissipated together with viscous friction.
///
/// # Source
/// Olsson, Åström, Canudas de Wit, Gäfvert, Lischinsky 1998: viscous friction |v|^δ sgn(v) where it is not linear; here δ = 2 beside
/// δ = 1.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint) -> Candidate {
    let rate = joint.velocity(graph);
    let sign = direction(graph, rate, 0.0);
    let torque = graph.product(&[(rate, 2), (sign, 1)]);
    let unit = if joint.slides {
        "N·s²/m²"
    } else {
        "N·m·s²/rad²"
    };
    Candidate::torque(
        format!("{}.quadratic_friction", joint.name),
        Family::QuadraticFriction,
        unit,
        format!("quadratic friction on {}", joint.name),
        vec![(joint.index, torque)],
    )
}
