//! Inertia of a coupled motor: a rotor that turns with the sum or the difference of two joints.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::Graph;

/// `<a>+<b>.coupled_inertia` (or `-`): the rotor of a motor whose speed is v = q̇_a ± q̇_b, seen through the gear, kg·m².
/// Lagrangian ½ v², so that the torque is v̇ on joint a and ±v̇ on joint b. What is new beside the motor inertia of both joints is that
/// each is accelerated by the other.
///
/// `sign` is +1 or −1.
///
/// # Source
/// Lagrange's equation for the rotor's own kinetic energy; the shaft's speed is that of the wrist's gear train (see `coupled_friction`).
pub(super) fn candidate(graph: &mut Graph, a: &Joint, b: &Joint, sign: f64) -> Candidate {
    let mark = if sign > 0.0 { '+' } else { '-' };
    let (rate_a, rate_b) = (a.velocity(graph), b.velocity(graph));
    let rate = graph.sum(0.0, &[(1.0, rate_a), (sign, rate_b)]);
    let square = graph.product(&[(rate, 2)]);
    let energy = graph.scaled(0.5, square);
    Candidate::lagrangian(
        graph,
        format!("{}{mark}{}.coupled_inertia", a.name, b.name),
        Family::CoupledInertia,
        "kg·m²",
        format!(
            "inertia of a motor that turns with {} {mark} {}",
            a.name, b.name
        ),
        energy,
    )
}
