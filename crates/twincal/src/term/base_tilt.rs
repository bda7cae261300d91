//! Direction and size of gravity: a base that is not level, or gravity that the model file states wrongly.

use super::Family;
use super::candidate::{Candidate, Proposal};
use super::model_column::ModelColumn;

/// `base.tilt`: gravity in the base frame is g + β; columns `.x`, `.y`, `.z`, m/s². A tilt of the base by a small angle α
/// changes gravity by 9.81 α sideways.
pub(super) fn proposal() -> Proposal {
    let name = "base.tilt".to_owned();
    let columns = ["x", "y", "z"]
        .into_iter()
        .enumerate()
        .map(|(axis, column)| {
            Candidate::model(
                format!("{name}.{column}"),
                Family::Tilt,
                "m/s²",
                "error of gravity in the base frame".to_owned(),
                ModelColumn::Gravity { axis },
            )
        })
        .collect();
    Proposal { name, columns }
}
