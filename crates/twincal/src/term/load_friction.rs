//! Load-dependent friction: gears that rub more the more they carry.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::model_column::ModelColumn;

/// `<joint>.load_friction`: torque |τ_nom| tanh(q̇/v_s), dimensionless: 0.05 means friction of 5 % of the nominal torque.
/// Dissipated.
pub(super) fn candidate(joint: &Joint, velocity: f64) -> Candidate {
    Candidate::model(
        format!("{}.load_friction", joint.name),
        Family::LoadFriction,
        "1",
        format!("friction on {} that grows with the load", joint.name),
        ModelColumn::LoadFriction {
            joint: joint.index,
            velocity,
        },
    )
}
