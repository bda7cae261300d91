//! What a robot's bodies may have more than its model says: a payload, and body by body density, first moments and tensor.

use super::body::{Body, bodies};
use super::candidate::Proposal;
use super::model_column::{ModelColumn, ModelColumns, Scratch};
use super::motions::{channels, random_motions};
use super::payload::{self, Mount};
use super::{Family, LibrarySettings, density, mass_moments, tensor};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::robot::{Motion, Robot, did_you_mean};
use std::sync::Arc;

/// Prior sd of what a body's inertia is off, in the metric of [`super::body`]: half of a mass, of a second moment along an axis.
const LINK_SHARE: f64 = 0.5;
/// Prior sd of a payload as a share of all moving mass: about what arms are rated for.
const PAYLOAD_SHARE: f64 = 0.3;
/// Size of tools and workpieces, m.
const PAYLOAD_SIZE: f64 = 0.1;
/// Prior sd of a payload of an arm without mass, kg.
const SOME_MASS: f64 = 1.0;

/// Payload and the levels of every body, named after the link that its joint carries: links that are fixed to each other are one body.
///
/// A level is a deviation from what those before it make of the model: a factor on everything, first moments beside that, second moments
/// beside both. Their prior is the body's own; a payload's is that of a body of three tenths of all moving mass on the last body, whose first
/// moments and tensor have the payload's prior: what both can say is told by prior odds alone, not by whose prior happens to fit.
///
/// # Errors
/// [`Error::Setting`] for a payload frame that does not move.
pub(super) fn inertial(
    robot: &Robot,
    settings: &LibrarySettings,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Proposal>> {
    let wanted = [
        Family::Payload,
        Family::Density,
        Family::MassMoments,
        Family::Tensor,
    ];
    if !wanted.into_iter().any(|family| settings.has(family)) {
        return Ok(Vec::new());
    }
    let bodies = bodies(robot);
    let torque = torques(robot);
    let mut all = Vec::new();
    let mount = match settings.has(Family::Payload) {
        true => Some(payload_mount(robot, settings, &bodies)?),
        false => None,
    };
    if let Some(mount) = &mount {
        all.push(payload::proposal(mount, &torque[mount.body.index]));
    }
    if settings.has(Family::Density) {
        all.extend((bodies.iter()).map(|body| density::candidate(body, LINK_SHARE).into()));
    }
    let each = bodies.iter().zip(&torque);
    let each = each.map(|(body, torque)| match &mount {
        Some(mount) if mount.body.index == body.index => (&mount.body, torque, 1.0),
        _ => (body, torque, LINK_SHARE),
    });
    if settings.has(Family::MassMoments) {
        let own = each.clone();
        all.extend(own.map(|(body, torque, share)| mass_moments::proposal(body, torque, share)));
    }
    if settings.has(Family::Tensor) {
        all.extend(each.map(|(body, torque, share)| tensor::proposal(body, torque, share)));
    }
    findings.extend(floored(&bodies));
    Ok(all)
}

/// The frame of `payload_frame`, or of the last link, and a payload on the body that carries it.
fn payload_mount(robot: &Robot, settings: &LibrarySettings, bodies: &[Body]) -> Result<Mount> {
    let name = match &settings.payload_frame {
        Some(name) => name.as_str(),
        None => robot.last_link(),
    };
    let Some((body, placement)) = robot.body_of_link(name) else {
        let links = robot.description().links.iter();
        return Err(Error::Setting {
            key: "library.payload_frame".to_owned(),
            problem: format!("the model has no moving link `{name}`"),
            remedy: did_you_mean(name, links.map(|link| link.name.as_str())),
        });
    };
    let total: f64 = (0..bodies.len())
        .map(|body| robot.parameters_of_body(body)[0])
        .sum();
    let mass = if total > 0.0 {
        PAYLOAD_SHARE * total
    } else {
        SOME_MASS
    };
    Ok(Mount {
        frame: name.to_owned(),
        placement,
        body: bodies[body].carried(mass, PAYLOAD_SIZE),
    })
}

/// Torque of each body's ten parameters at random states, `[body][parameter][joint * states + state]`.
fn torques(robot: &Robot) -> Vec<Vec<Vec<f64>>> {
    let (joints, count) = (robot.dof(), robot.bodies().len());
    let mut columns = ModelColumns::new(Arc::new(robot.clone()));
    for row in 0..10 * count {
        let mut weights = [0.0; 10];
        weights[row % 10] = 1.0;
        let column = ModelColumn::Inertia {
            body: row / 10,
            weights,
        };
        columns.push(column, (0..joints).map(|joint| (joint, row)).collect());
    }
    let states = random_motions(joints);
    let [q, qd, qdd] = channels(&states, joints);
    let len = states.len();
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut out = vec![vec![0.0; 10 * count * len]; joints];
    columns.evaluate(motion, len, &mut out, &mut Scratch::default());
    let of = |row: usize| -> Vec<f64> {
        let own = out
            .iter()
            .flat_map(|table| &table[row * len..(row + 1) * len]);
        own.copied().collect()
    };
    (0..count)
        .map(|body| (0..10).map(|k| of(10 * body + k)).collect())
        .collect()
}

/// Says of which bodies the model's inertia is no measure for what it may be off.
fn floored(bodies: &[Body]) -> Option<Finding> {
    let told: Vec<String> = (bodies.iter())
        .filter_map(|body| Some(format!("`{}` ({})", body.name, body.floored?)))
        .collect();
    (!told.is_empty()).then(|| {
        Finding::new(
            Severity::Note,
            Code::InertiaFloor,
            "",
            format!(
                "the model's inertia is a placeholder for {}: prior widths take at least 1 % of the mass that the joint moves and radii of a \
                 tenth of the link's length; give these links their own inertia where you know it",
                told.join(", ")
            ),
            0,
        )
    })
}
