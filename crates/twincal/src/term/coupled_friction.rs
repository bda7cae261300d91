//! Friction of a coupled motor: a motor that turns with the sum or the difference of two joints.

use super::Family;
use super::candidate::{Candidate, Joint, Proposal, direction};
use super::expression::Graph;
use super::viscous;

/// `<a>+<b>.coupled_friction` (or `-`): a motor whose speed is v = q̇_a ± q̇_b has friction of its own; by virtual work it
/// acts on both joints, on b with the sign. Columns `.viscous` (torque v) and `.coulomb` (torque tanh(v/v_s)).
/// Dissipated. In wrists with the motors in the forearm, motor 6 turns with q5 + q6.
///
/// `sign` is +1 or −1.
pub(super) fn proposal(
    graph: &mut Graph,
    a: &Joint,
    b: &Joint,
    sign: f64,
    velocity: f64,
) -> Proposal {
    let mark = if sign > 0.0 { '+' } else { '-' };
    let name = format!("{}{mark}{}.coupled_friction", a.name, b.name);
    let story = format!(
        "friction of a motor that turns with {} {mark} {}",
        a.name, b.name
    );
    let (rate_a, rate_b) = (a.velocity(graph), b.velocity(graph));
    let rate = graph.sum(0.0, &[(1.0, rate_a), (sign, rate_b)]);
    let columns = [
        ("viscous", viscous::unit(a), rate),
        ("coulomb", a.torque_unit(), direction(graph, rate, velocity)),
    ]
    .into_iter()
    .map(|(column, unit, torque)| {
        let other = graph.scaled(sign, torque);
        Candidate::torque(
            format!("{name}.{column}"),
            Family::CoupledFriction,
            unit,
            story.clone(),
            vec![(a.index, torque), (b.index, other)],
        )
    })
    .collect();
    Proposal { name, columns }
}

/// Pairs of joints that may share a motor: neighbours among the last three of a turning chain of at least six.
pub(super) fn pairs(joints: &[Joint]) -> Vec<(usize, usize)> {
    let n = joints.len();
    if n < 6 {
        return Vec::new();
    }
    [(n - 3, n - 2), (n - 2, n - 1)]
        .into_iter()
        .filter(|&(a, b)| !joints[a].slides && !joints[b].slides)
        .collect()
}
