//! First moments of mass of a link: what a wrong centre of mass in the model changes, the second level.

use super::Family;
use super::body::{Body, Ten};
use super::candidate::Proposal;
use super::directions::{Columns, split};
use super::parameter::Parameter;
use crate::robot::spatial::transpose;

/// `<link>.mass_moments`: differences of the first moments from the model with its density, about the model's centre of mass (mass × shift
/// of the centre); the tensor about that point is unchanged. Its parameters `mx`, `my`, `mz` have the axes of the link's frame; its columns
/// `.h1` … are directions of equal prior probability, without those that no motion shows.
///
/// `torque`: of the body's ten parameters at random states; `share`: prior sd in the metric of [`super::body`].
pub(super) fn proposal(body: &Body, torque: &[Vec<f64>], share: f64) -> Proposal {
    let trace: f64 = (0..3).map(|i| body.second[i][i]).sum();
    let columns = Columns {
        directions: split(&body.of_first_moments(), torque),
        size: (body.mass * trace / 6.0).sqrt(),
        share,
        letter: "h",
        family: Family::MassMoments,
        unit: "kg·m",
    };
    let to_link = transpose(&body.link.rotation);
    let rows: Vec<Ten> = (to_link.iter())
        .map(|row| {
            let mut own = [0.0; 10];
            own[1..4].copy_from_slice(row);
            own
        })
        .collect();
    let parameters = ["mx", "my", "mz"].map(|name| Parameter::new(name, "kg·m"));
    columns.proposal(
        body.index,
        (
            &format!("{}.mass_moments", body.name),
            &format!("centre of mass of {}", body.name),
        ),
        (parameters.to_vec(), rows),
    )
}
