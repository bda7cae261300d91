//! Inertias of links: from coefficients of bodies to mass, centre of mass and tensor of the link that a file names.

use super::metric::torque_metric;
use super::{Place, Projection, Writer};
use crate::error::Result;
use crate::rigid_body::{Link, project};
use crate::robot::spatial::{apply, scale, transpose};
use crate::robot::{Inertia, Placement, Robot, body_parameters, inertia_of, to_body_frame};
use crate::term::Family;
use serde::Serialize;

/// A link with a new inertia.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinkChange {
    /// Name of the link.
    pub link: String,
    /// As the nominal model has it.
    pub before: Option<Inertia>,
    /// As it is now: its pseudo-inertia is positive definite.
    pub after: Inertia,
    /// True where no rigid body can have what was found: `after` is the one with the nearest torque, and no measure of the link.
    pub no_body: bool,
}

/// The link that takes up what changes on a body: the payload's own frame, else the link that the body is named
/// after; where that has no inertia the heaviest link of the body.
pub(super) fn home<'w>(writer: &'w Writer<'_>, body: usize, family: Family) -> &'w str {
    let robot = &writer.calibration.twin.robot;
    let named = if family.is_payload() {
        writer.library.payload_frame(robot)
    } else {
        robot.bodies()[body]
    };
    let mass = |link: &str| {
        let mut links = robot.description().links.iter();
        let found = links.find(|other| other.name == link);
        found.and_then(|link| link.inertia).map_or(0.0, |i| i.mass)
    };
    if mass(named) > 0.0 {
        return named;
    }
    let heaviest = robot
        .links_of_body(body)
        .into_iter()
        .max_by(|a, b| mass(a).total_cmp(&mass(b)));
    heaviest.filter(|link| mass(link) > 0.0).unwrap_or(named)
}

/// New inertias of all links that `held` columns change, physical ones; `gravity`: where it changes too.
pub(super) fn changes(
    writer: &Writer<'_>,
    held: &[Option<Place>],
    beta: &[f64],
    gravity: Option<[f64; 3]>,
) -> Result<(Vec<LinkChange>, Option<Projection>)> {
    let robot = &writer.calibration.twin.robot;
    let links = found(writer, held, beta);
    let twin = &writer.calibration.twin;
    // In the file changed inertias meet changed gravity.
    let torque = || {
        let mut description = robot.description().clone();
        description.gravity = gravity.unwrap_or(description.gravity);
        let (robot, _) = Robot::new(description, robot.locked())?;
        let states = writer.states.motion();
        Ok(torque_metric(&robot, &twin.noise, states, &links))
    };
    let (parameters, projection) = project(&links, torque)?;
    let mut changes: Vec<LinkChange> = Vec::new();
    for link in &robot.description().links {
        let Some(index) = links.iter().position(|own| own.name == link.name) else {
            continue;
        };
        if let Some(after) = inertia_of(&parameters[index]) {
            changes.push(LinkChange {
                link: link.name.clone(),
                before: link.inertia,
                after,
                no_body: (projection.iter()).any(|p| p.links.contains(&link.name)),
            });
        }
    }
    Ok((changes, projection))
}

/// Links that `held` columns change, with the parameters that they change them to, physical or not.
fn found<'w>(writer: &'w Writer<'_>, held: &[Option<Place>], beta: &[f64]) -> Vec<Link<'w>> {
    let robot = &writer.calibration.twin.robot;
    let mut links: Vec<Link<'w>> = Vec::new();
    for (column, place) in held.iter().enumerate() {
        let Some(Place::Inertia { body, weights }) = place else {
            continue;
        };
        let term = &writer.library.terms()[writer.library.columns()[column]];
        let name = home(writer, *body, term.family);
        let known = links.iter().position(|link| link.name == name);
        let index = known.unwrap_or_else(|| {
            let nominal = robot.description().links.iter().find(|l| l.name == name);
            let nominal = nominal.and_then(|link| link.inertia);
            let nominal = nominal.map_or([0.0; 10], |i| body_parameters(&i, &Placement::IDENTITY));
            links.push(Link {
                name,
                nominal,
                found: nominal,
            });
            links.len() - 1
        });
        let placement = robot
            .body_of_link(name)
            .map_or(Placement::IDENTITY, |(_, placement)| placement);
        let map = to_body_frame(&inverse(&placement));
        for (found, row) in links[index].found.iter_mut().zip(&map) {
            let change = row.iter().zip(weights).map(|(a, w)| a * w);
            *found += beta[column] * change.sum::<f64>();
        }
    }
    links
}

/// The outer frame seen from the inner one.
fn inverse(placement: &Placement) -> Placement {
    let rotation = transpose(&placement.rotation);
    Placement {
        rotation,
        translation: scale(-1.0, apply(&rotation, placement.translation)),
    }
}
