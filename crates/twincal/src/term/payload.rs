//! A body at the tool: mass, centre of mass and inertia in a named frame.

use super::Family;
use super::body::{Body, Ten};
use super::candidate::{Candidate, Proposal};
use super::directions::{Columns, split};
use super::mixture::Mixture;
use super::model_column::ModelColumn;
use super::parameter::{Before, Parameter};
use super::tensor;
use crate::robot::to_body_frame;
use crate::robot::{Placement, spatial};

/// Name of the component.
pub(super) const NAME: &str = "payload";

/// Name of the column of its mass.
pub(crate) const MASS: &str = "payload.m";

/// Mass, first moments and tensor about the frame's origin.
const PARAMETERS: usize = 10;

/// Where a payload is mounted: the frame that it is told in, and the body that carries it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mount {
    /// Name of the frame.
    pub(super) frame: String,
    /// In the body's frame.
    pub(super) placement: Placement,
    /// As large as what it may carry.
    pub(super) body: Body,
}

/// `payload`: a rigid body that the model does not have. Columns `.m`: a mass at the carrying body's centre of mass; `.h1` …: first moments
/// about that point; `.s1` …: second moments, which are in or out by themselves. Without these a payload is told from the body's own mass and centre of mass by nothing but
/// the prior. Neither the columns nor their prior know the frame, which only says where the parameters are told.
///
/// `torque`: of the body's ten parameters at random states.
pub(super) fn proposal(mount: &Mount, torque: &[Vec<f64>]) -> Proposal {
    let Mount {
        frame,
        placement,
        body,
    } = mount;
    let story = format!("payload at {frame}");
    let radius = body.second[0][0] / body.mass;
    let part = |directions: Vec<Ten>, size: f64, letter, family, unit| Columns {
        directions: split(&directions, torque),
        size,
        share: 1.0,
        letter,
        family,
        unit,
    };
    let first = part(
        body.of_first_moments(),
        body.mass * (0.5 * radius).sqrt(),
        "h",
        Family::Payload,
        "kg·m",
    );
    let second = part(
        body.of_second_moments(),
        body.mass * radius,
        "s",
        Family::PayloadTensor,
        "kg·m²",
    );
    let mass = Candidate::model(
        MASS.to_owned(),
        Family::Payload,
        "kg",
        story.clone(),
        ModelColumn::Inertia {
            body: body.index,
            weights: body.of_mass(),
        },
    )
    .within(body.mass);
    let mut columns = vec![mass];
    let mut weights = vec![(body.of_mass(), body.mass)];
    let mut hidden = Vec::new();
    for part in [&first, &second] {
        columns.extend(part.candidates(body.index, (NAME, &story)));
        weights.extend(part.weights());
        hidden.extend(part.hidden());
    }
    let rotation = spatial::transpose(&placement.rotation);
    let to_frame = to_body_frame(&Placement {
        rotation,
        translation: spatial::scale(-1.0, spatial::apply(&rotation, placement.translation)),
    });
    columns[0].mixture = Some(Mixture::new(parameters(), &to_frame, &weights, &hidden));
    Proposal {
        name: NAME.to_owned(),
        columns,
    }
}

/// Mass, centre of mass, tensor and first moments about the frame's origin.
pub(super) fn parameters() -> Vec<Parameter> {
    let mut all = vec![Parameter::new("mass", "kg")];
    all.extend(["com_x", "com_y", "com_z"].map(|name| Parameter::new(name, "m")));
    all.extend(tensor::NAMES.map(|name| Parameter::new(name, "kg·m²")));
    all.extend(["mx", "my", "mz"].map(|name| Parameter::new(name, "kg·m")));
    all
}

/// `[m, mx/m, my/m, mz/m, ixx … izz, mx, my, mz]` of `[m, mx, my, mz, ixx … izz]`.
pub(super) fn values(own: &[f64]) -> Vec<f64> {
    let (mass, first) = (own[0], &own[1..4]);
    let mut all = vec![mass];
    all.extend(first.iter().map(|moment| moment / mass));
    all.extend(&own[4..PARAMETERS]);
    all.extend(first);
    all
}

/// What is known of one of [`parameters`] before the data; a centre of mass is as hidden as its first moment.
pub(super) fn before(mixture: &Mixture, parameter: usize, live: &[bool]) -> Before {
    let source = match parameter {
        PARAMETERS.. => parameter - PARAMETERS + 1,
        _ => parameter,
    };
    match mixture.prior_sd(source, live) {
        None => Before::Hidden,
        Some(_) if (1..4).contains(&parameter) => Before::Ratio,
        Some(sd) => Before::Width(sd),
    }
}
