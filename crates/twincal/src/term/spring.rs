//! Joint spring with a rest position: torque k (q − q₀), energy ½ k (q − q₀)².

use super::Family;
use super::candidate::{Candidate, Joint, Proposal};
use super::expression::Graph;
use super::parameter::Parameter;

/// `<joint>.spring`: columns `.stiffness` (torque +q) and `.preload` (torque +1), so that k (q − q₀) = k q + c with
/// q₀ = −c/k. Lagrangian −½ k q² − c q.
///
/// `held`: the torque that the joint holds against gravity, prior sd of the preload and, over 1 rad (1 m), of the stiffness; `None`:
/// learned from the data.
pub(super) fn proposal(graph: &mut Graph, joint: &Joint, held: Option<f64>) -> Proposal {
    let name = format!("{}.spring", joint.name);
    let story = format!("spring on {}", joint.name);
    let q = joint.position(graph);
    let square = graph.product(&[(q, 2)]);
    let energies = [graph.scaled(-0.5, square), graph.scaled(-1.0, q)];
    let unit = if joint.slides { "N/m" } else { "N·m/rad" };
    let columns = [("stiffness", unit), ("preload", joint.torque_unit())]
        .into_iter()
        .zip(energies)
        .map(|((column, unit), phi)| {
            let candidate = Candidate::lagrangian(
                graph,
                format!("{name}.{column}"),
                Family::Spring,
                unit,
                story.clone(),
                phi,
            );
            Candidate {
                prior_sd: held,
                ..candidate
            }
        })
        .collect();
    Proposal { name, columns }
}

/// Stiffness, rest position and preload, the torque at position 0: of a soft spring far from its rest position the motion shows the latter.
pub(super) fn parameters(columns: &[(String, String)]) -> Vec<Parameter> {
    let unit = columns.first().map_or("", |column| column.1.as_str());
    let (rest, torque) = if unit == "N/m" {
        ("m", "N")
    } else {
        ("rad", "N·m")
    };
    vec![
        Parameter::new("stiffness", unit),
        Parameter::new("rest_position", rest),
        Parameter::new("preload", torque),
    ]
}

/// `[k, −c/k, c]`.
pub(super) fn values(beta: &[f64]) -> Vec<f64> {
    vec![beta[0], -beta[1] / beta[0], beta[1]]
}
