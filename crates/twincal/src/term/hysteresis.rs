//! Friction that remembers: what builds up over some milliradians after a velocity reversal instead of at once.

use super::Family;
use super::candidate::{Candidate, Joint, Proposal};
use super::expression::{Graph, Variable};
use crate::signal::{STOPS, stop_channel};

/// `<joint>.hysteresis`: columns `.stop1` to `.stop3`, torque e_k/r_k − tanh(q̇/v_s), N·m (N for a slider): so much of the Coulomb friction
/// is the slip of an element that first bends by up to 2 r_k. While the joint slides on, columns are 0 and friction is what `.coulomb` says.
/// Dissipated as long as the numbers are not negative and together at most the Coulomb friction.
///
/// # Source
/// Al-Bender, Lampaert, Swevers 2005: Maxwell-slip elements, the linear form of a Prandtl–Ishlinskii operator.
pub(super) fn proposal(graph: &mut Graph, joint: &Joint) -> Proposal {
    let name = format!("{}.hysteresis", joint.name);
    let column = |stop: usize| {
        let channel = graph.variable(Variable::History(stop_channel(joint.index, stop)));
        Candidate::torque(
            format!("{name}.stop{}", stop + 1),
            Family::Hysteresis,
            joint.torque_unit(),
            format!("friction with hysteresis on {}", joint.name),
            vec![(joint.index, channel)],
        )
    };
    let columns = (0..STOPS).map(column).collect();
    Proposal { name, columns }
}
