//! Stribeck friction: what breaking away takes more than sliding.

use super::Family;
use super::candidate::{Candidate, Joint, direction};
use super::expression::{Function, Graph};

/// Velocity over which the excess falls to 1/e, rad/s or m/s.
pub(crate) const STRIBECK_VELOCITY: f64 = 0.1;

/// `<joint>.stribeck`: torque +tanh(q̇/v_s) exp(−(q̇/0.1)²), N·m (N for a slider): friction that falls from breakaway to
/// sliding within about 0.1 rad/s. Dissipated.
///
/// # Source
/// Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, the Gaussian form.
pub(super) fn candidate(graph: &mut Graph, joint: &Joint, velocity: f64) -> Candidate {
    let rate = joint.velocity(graph);
    let sign = direction(graph, rate, velocity);
    let square = graph.product(&[(rate, 2)]);
    let exponent = graph.scaled(-STRIBECK_VELOCITY.powi(-2), square);
    let fall = graph.function(Function::Exp, exponent);
    let torque = graph.product(&[(sign, 1), (fall, 1)]);
    Candidate::torque(
        format!("{}.stribeck", joint.name),
        Family::Stribeck,
        joint.torque_unit(),
        format!("Stribeck friction on {}", joint.name),
        vec![(joint.index, torque)],
    )
}
