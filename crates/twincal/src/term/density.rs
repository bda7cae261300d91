//! Density of a link: mass, first moments and tensor by one factor, the first level of what a link may be off.

use super::Family;
use super::body::Body;
use super::candidate::Candidate;
use super::model_column::ModelColumn;

/// `<link>.density`: torque of the link's own nominal inertia, dimensionless: 0.1 means 10 % more of everything.
///
/// `share` is the prior sd in the metric of [`super::body`], where a factor 1 + a is 2 |a| away.
pub(super) fn candidate(body: &Body, share: f64) -> Candidate {
    Candidate::model(
        format!("{}.density", body.name),
        Family::Density,
        "1",
        format!("density of {}", body.name),
        ModelColumn::Inertia {
            body: body.index,
            weights: body.shape,
        },
    )
    .within(0.5 * share)
}
