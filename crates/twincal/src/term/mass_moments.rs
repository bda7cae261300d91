//! Mass and first moments of a link: what a wrong mass or centre of mass in the model changes.

use super::Family;
use super::candidate::{Candidate, Proposal};
use super::model_column::LinkFrame;

/// Names and units of the four, in the order of the regressor's parameters.
pub(super) const COLUMNS: [(&str, &str); 4] =
    [("m", "kg"), ("mx", "kg·m"), ("my", "kg·m"), ("mz", "kg·m")];

/// `<link>.mass_moments`: columns `.m`, `.mx`, `.my`, `.mz`: differences of mass and first moments from the model, the
/// moments about the model's centre of mass (mass × shift of the centre), axes of the link's frame; the tensor about that
/// point is unchanged.
///
/// `mass` is the prior sd of the mass, kg, and `moment` that of a first moment, kg·m.
pub(super) fn proposal(link: &LinkFrame, mass: f64, moment: f64) -> Proposal {
    let name = format!("{}.mass_moments", link.name);
    let columns = COLUMNS
        .into_iter()
        .enumerate()
        .map(|(parameter, (column, unit))| {
            Candidate::model(
                format!("{name}.{column}"),
                Family::MassMoments,
                unit,
                format!("mass and centre of mass of {}", link.name),
                link.column(parameter),
            )
            .within(if parameter == 0 { mass } else { moment })
        })
        .collect();
    Proposal { name, columns }
}
