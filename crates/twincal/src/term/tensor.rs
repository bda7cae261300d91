//! Inertia tensor of a link: what a wrong tensor in the model changes.

use super::Family;
use super::candidate::{Candidate, Proposal};
use super::model_column::LinkFrame;

/// Names of the six, in the order of the regressor's parameters 4…9.
pub(super) const COLUMNS: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

/// `<link>.tensor`: columns `.ixx` … `.izz`: differences of the inertia tensor about the centre of mass from the model,
/// kg·m², axes of the link's frame.
///
/// `inertia` is the prior sd of every entry, kg·m².
pub(super) fn proposal(link: &LinkFrame, inertia: f64) -> Proposal {
    let name = format!("{}.tensor", link.name);
    let columns = COLUMNS
        .into_iter()
        .enumerate()
        .map(|(k, column)| {
            Candidate::model(
                format!("{name}.{column}"),
                Family::Tensor,
                "kg·m²",
                format!("inertia tensor of {}", link.name),
                link.column(4 + k),
            )
            .within(inertia)
        })
        .collect();
    Proposal { name, columns }
}
