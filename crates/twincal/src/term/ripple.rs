//! Gear ripple: torque with a known number of periods per turn.

use super::Family;
use super::candidate::{Candidate, Joint, Proposal};
use super::expression::{Function, Graph};

/// `<joint>.ripple`: columns `.sin` and `.cos`, torque +sin(N q) and +cos(N q), N·m, where N = `periods` per turn (the gear
/// ratio, or twice that for a harmonic drive). For a slider N counts periods per metre. Lagrangian cos(N q)/N, −sin(N q)/N.
pub(super) fn proposal(graph: &mut Graph, joint: &Joint, periods: f64) -> Proposal {
    let name = format!("{}.ripple", joint.name);
    let story = format!("gear ripple on {}", joint.name);
    let order = if joint.slides {
        std::f64::consts::TAU * periods
    } else {
        periods
    };
    let q = joint.position(graph);
    let angle = graph.scaled(order, q);
    let columns = [("sin", Function::Cos, 1.0), ("cos", Function::Sin, -1.0)]
        .into_iter()
        .map(|(column, function, sign)| {
            let wave = graph.function(function, angle);
            let phi = graph.scaled(sign / order, wave);
            Candidate::lagrangian(
                graph,
                format!("{name}.{column}"),
                Family::Ripple,
                joint.torque_unit(),
                story.clone(),
                phi,
            )
        })
        .collect();
    Proposal { name, columns }
}
