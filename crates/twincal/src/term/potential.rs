//! Potential of one joint: gravity compensators, counterbalances, cable bundles.

use super::Family;
use super::candidate::{Candidate, Joint, Proposal};
use super::expression::{Function, Graph};

/// `<joint>.potential`: any smooth energy of one angle up to its second harmonic, columns `.sin`, `.cos`, `.sin2`,
/// `.cos2`, J. The actuator delivers ∂U/∂q with U = Σ β·harmonic: Lagrangian −sin q, −cos q, −sin 2q, −cos 2q.
///
/// A turning joint only: a slider's potential has no natural period.
///
/// `held`: the torque that the joint holds against gravity, prior sd of each harmonic's torque; `None`: learned from the data.
pub(super) fn proposal(graph: &mut Graph, joint: &Joint, held: Option<f64>) -> Proposal {
    let name = format!("{}.potential", joint.name);
    let story = format!("conservative torque of {} alone", joint.name);
    let q = joint.position(graph);
    let columns = [
        ("sin", Function::Sin, 1.0),
        ("cos", Function::Cos, 1.0),
        ("sin2", Function::Sin, 2.0),
        ("cos2", Function::Cos, 2.0),
    ]
    .into_iter()
    .map(|(column, function, order)| {
        let angle = graph.scaled(order, q);
        let harmonic = graph.function(function, angle);
        let phi = graph.scaled(-1.0, harmonic);
        let candidate = Candidate::lagrangian(
            graph,
            format!("{name}.{column}"),
            Family::Potential,
            "N·m",
            story.clone(),
            phi,
        );
        Candidate {
            prior_sd: held.map(|held| held / order),
            ..candidate
        }
    })
    .collect();
    Proposal { name, columns }
}
