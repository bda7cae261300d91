//! Inertia tensor of a link: what a wrong tensor in the model changes, the third level.

use super::Family;
use super::body::{Body, Ten};
use super::candidate::Proposal;
use super::directions::{Columns, split};
use super::parameter::Parameter;
use crate::robot::spatial::transpose;
use crate::robot::{Placement, to_body_frame};

/// Names of the six, in the order of the regressor's parameters 4…9.
pub(super) const NAMES: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

/// `<link>.tensor`: differences of the inertia tensor about the centre of mass from the model with its density, kg·m². Its parameters `ixx`
/// … `izz` have the axes of the link's frame; its columns `.s1` … are directions of equal prior probability, without those that no motion
/// shows.
///
/// `torque`: of the body's ten parameters at random states; `share`: prior sd in the metric of [`super::body`].
pub(super) fn proposal(body: &Body, torque: &[Vec<f64>], share: f64) -> Proposal {
    let trace: f64 = (0..3).map(|i| body.second[i][i]).sum();
    let columns = Columns {
        directions: split(&body.of_second_moments(), torque),
        size: trace / 3.0,
        share,
        letter: "s",
        family: Family::Tensor,
        unit: "kg·m²",
    };
    // Neither mass nor first moments change: the tensor is the same about every point.
    let to_link = to_body_frame(&Placement {
        rotation: transpose(&body.link.rotation),
        translation: [0.0; 3],
    });
    let rows: Vec<Ten> = to_link[4..].to_vec();
    let parameters = NAMES.map(|name| Parameter::new(name, "kg·m²"));
    columns.proposal(
        body.index,
        (
            &format!("{}.tensor", body.name),
            &format!("inertia tensor of {}", body.name),
        ),
        (parameters.to_vec(), rows),
    )
}
