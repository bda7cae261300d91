//! Mass scale of a link: mass, first moments and tensor by one factor, as with a wrong density.

use super::Family;
use super::candidate::Candidate;
use super::model_column::{LinkFrame, ModelColumn};

/// A model is off by about a fifth where it is off.
const PRIOR_SD: f64 = 0.2;

/// `<link>.mass_scale`: torque of the link's own nominal inertia, dimensionless: 0.1 means 10 % more of everything.
///
/// `nominal` are the ten nominal parameters of the body that the link belongs to, in the body's frame.
pub(super) fn candidate(link: &LinkFrame, nominal: [f64; 10]) -> Candidate {
    Candidate::model(
        format!("{}.mass_scale", link.name),
        Family::MassScale,
        "1",
        format!("mass scale of {}", link.name),
        ModelColumn::Inertia {
            body: link.body,
            weights: nominal,
        },
    )
    .within(PRIOR_SD)
}
