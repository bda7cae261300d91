//! Zero position of a joint encoder.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::model_column::ModelColumn;

/// About one degree.
const PRIOR_SD: f64 = 0.02;
/// A few millimetres.
const PRIOR_SD_SLIDER: f64 = 0.005;

/// `<joint>.encoder_zero`: the joint really stands at q + β, rad (m for a slider). First order: torque ∂τ_nom/∂q_joint on
/// every joint.
pub(super) fn candidate(joint: &Joint) -> Candidate {
    Candidate::model(
        format!("{}.encoder_zero", joint.name),
        Family::EncoderZero,
        joint.position_unit(),
        format!("zero position of {}", joint.name),
        ModelColumn::PositionDerivative { joint: joint.index },
    )
    .within(if joint.slides {
        PRIOR_SD_SLIDER
    } else {
        PRIOR_SD
    })
}
