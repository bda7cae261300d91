//! Drive constant: a torque that is measured as current is off by one factor.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::model_column::ModelColumn;

/// Drive constants are off by 5 to 10 %.
const PRIOR_SD: f64 = 0.1;

/// `<joint>.gain`: torque + the joint's nominal torque, dimensionless: 0.05 means that the drive delivers 5 % more than its
/// constant says. Beside it payload mass and gravity are hard to tell: see groups.
pub(super) fn candidate(joint: &Joint) -> Candidate {
    Candidate::model(
        format!("{}.gain", joint.name),
        Family::Gain,
        "1",
        format!("torque gain of {}", joint.name),
        ModelColumn::Nominal {
            joint: Some(joint.index),
        },
    )
    .within(PRIOR_SD)
}

/// `drives.gain`: torque + nominal torque on every joint, one factor for all: drives of one kind share the error of their constant.
pub(super) fn common() -> Candidate {
    Candidate::model(
        "drives.gain".to_owned(),
        Family::Gain,
        "1",
        "torque gain of all joints".to_owned(),
        ModelColumn::Nominal { joint: None },
    )
    .within(PRIOR_SD)
}
