//! The layout for the algorithms: one rigid body per moving joint, its frame's z along the joint axis.

use super::coordinates::Source;
use super::inertia::{LARGEST, Moments, check};
use super::spatial::{IDENTITY, Matrix, is_about_x, multiply, norm, scale, transpose, z_to};
use super::tree::Tree;
use super::{JointDescription, JointKind, Placement, RobotDescription};
use crate::error::{Code, Error, Finding, Result, Severity};

/// A moving body with everything that is rigidly attached to it.
///
/// Its frame sits on the joint with z along the axis; at joint position x it has turned by x about z (or slid by x
/// along z) from `(rotation, translation)`, which is given in the parent body's frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Body {
    /// Index of the parent body, always smaller than the own; `None`: the base.
    pub(crate) parent: Option<usize>,
    /// Own frame at joint position 0 in the parent body's frame.
    pub(crate) rotation: Matrix,
    /// That rotation is one about x, as where frames follow Denavit and Hartenberg: it costs four products instead of nine.
    pub(crate) about_x: bool,
    /// Origin of that frame in the parent body's frame, m.
    pub(crate) translation: [f64; 3],
    /// Slides along z instead of turning about it.
    pub(crate) prismatic: bool,
    /// Index of the link that its joint moves.
    pub(crate) link: usize,
    /// Coordinate that moves it, 0-based.
    pub(crate) coordinate: usize,
    /// Joint position = multiplier · q + offset.
    pub(crate) multiplier: f64,
    /// See `multiplier`.
    pub(crate) offset: f64,
    /// Inertia about the own origin, in the own frame.
    pub(crate) moments: Moments,
    /// Motor inertia, kg·m² or kg.
    pub(crate) armature: f64,
    /// N·m·s/rad or N·s/m.
    pub(crate) damping: f64,
    /// N·m/rad or N/m.
    pub(crate) stiffness: f64,
    /// rad or m.
    pub(crate) spring_reference: f64,
}

/// The body that a link belongs to (`None`: the base) and the link's frame in that body's frame.
pub(crate) type Home = (Option<usize>, Placement);

fn refuse<T>(joint: &JointDescription, problem: String, remedy: &str) -> Result<T> {
    Err(Error::Model {
        culprit: format!("joint `{}`", joint.name),
        problem,
        remedy: remedy.into(),
    })
}

/// Merges what does not move and lays out what does.
///
/// # Errors
/// [`Error::Model`] for impossible inertias, a zero axis, numbers that are not finite.
pub(crate) fn lay_out(
    description: &RobotDescription,
    tree: &Tree,
    sources: &[Source],
    findings: &mut Vec<Finding>,
) -> Result<(Vec<Body>, Vec<Home>)> {
    for link in &description.links {
        if let Some(inertia) = &link.inertia {
            findings.extend(check(&link.name, inertia, description.allow_unphysical)?);
        }
    }
    let mut bodies: Vec<Body> = Vec::new();
    let mut home: Vec<Home> = vec![(None, Placement::IDENTITY); description.links.len()];
    for &j in &tree.order {
        let joint = &description.joints[j];
        let (parent, child) = tree.links[j];
        check_numbers(joint)?;
        let (parent_body, parent_frame) = home[parent];
        let frame = parent_frame.compose(&joint.placement);
        home[child] = match sources[j] {
            Source::Still(_) if joint.kind == JointKind::Fixed => (parent_body, frame),
            Source::Still(position) => {
                let axis = unit_axis(joint, findings)?;
                let moved = Placement::of_joint(joint.kind, axis, position);
                (parent_body, frame.compose(&moved))
            }
            Source::Follows {
                index,
                multiplier,
                offset,
            } => {
                let to_z = z_to(unit_axis(joint, findings)?);
                let rotation = multiply(&frame.rotation, &to_z);
                let frame = Placement { rotation, ..frame };
                let moved = Body {
                    parent: parent_body,
                    link: child,
                    coordinate: index,
                    multiplier,
                    offset,
                    ..Body::of_joint(joint, frame)
                };
                bodies.push(moved);
                (
                    Some(bodies.len() - 1),
                    Placement {
                        rotation: transpose(&to_z),
                        translation: [0.0; 3],
                    },
                )
            }
        };
        if let (Some(body), frame) = home[child]
            && let Some(inertia) = &description.links[child].inertia
        {
            bodies[body].moments = bodies[body].moments.plus(&Moments::placed(inertia, &frame));
        }
    }
    Ok((bodies, home))
}

impl Body {
    /// A body on the base that coordinate 0 moves as it is, without inertia of links.
    fn of_joint(joint: &JointDescription, frame: Placement) -> Self {
        Self {
            parent: None,
            rotation: frame.rotation,
            about_x: is_about_x(&frame.rotation),
            translation: frame.translation,
            prismatic: joint.kind == JointKind::Prismatic,
            link: 0,
            coordinate: 0,
            multiplier: 1.0,
            offset: 0.0,
            moments: Moments::default(),
            armature: joint.armature,
            damping: joint.damping,
            stiffness: joint.stiffness,
            spring_reference: joint.spring_reference,
        }
    }
}

/// The axis at length 1; a correction beyond printing precision is a finding.
fn unit_axis(joint: &JointDescription, findings: &mut Vec<Finding>) -> Result<[f64; 3]> {
    let length = norm(joint.axis);
    if !(length.is_finite() && length > 1e-12) {
        return refuse(
            joint,
            format!("axis {:?} has length {length}", joint.axis),
            "give a direction other than zero",
        );
    }
    if (length - 1.0).abs() > 1e-6 {
        let message = format!(
            "joint `{}`: axis {:?} has length {length:.6}; normalised to 1",
            joint.name, joint.axis
        );
        findings.push(
            Finding::new(
                Severity::Note,
                Code::AxisNormalised,
                &joint.name,
                message,
                1,
            )
            .with([
                ("length", length),
                ("axis_x", joint.axis[0]),
                ("axis_y", joint.axis[1]),
                ("axis_z", joint.axis[2]),
            ]),
        );
    }
    Ok(scale(1.0 / length, joint.axis))
}

fn check_numbers(joint: &JointDescription) -> Result<()> {
    let Placement {
        rotation,
        translation,
    } = &joint.placement;
    if !(translation
        .iter()
        .chain(rotation.as_flattened())
        .all(|v| v.is_finite()))
    {
        return refuse(
            joint,
            format!("its origin is not finite ({:?})", joint.placement),
            "give finite numbers",
        );
    }
    if let Some(length) = translation.iter().find(|v| v.abs() > LARGEST) {
        return refuse(
            joint,
            format!("its origin is {length:e} m away, the limit is {LARGEST:e}"),
            "correct the number or its unit",
        );
    }
    let square = multiply(rotation, &transpose(rotation));
    let error = (0..3)
        .flat_map(|i| (0..3).map(move |k| (i, k)))
        .fold(0f64, |worst, (i, k)| {
            worst.max((square[i][k] - IDENTITY[i][k]).abs())
        });
    let determinant =
        super::spatial::dot(rotation[0], super::spatial::cross(rotation[1], rotation[2]));
    if error > 1e-9 || determinant < 0.0 {
        return refuse(
            joint,
            format!("its rotation is not a rotation (error {error:.1e})"),
            "give a rotation matrix",
        );
    }
    for (what, value) in [
        ("armature", joint.armature),
        ("damping", joint.damping),
        ("stiffness", joint.stiffness),
        ("spring reference", joint.spring_reference),
    ] {
        if !value.is_finite() {
            return refuse(joint, format!("{what} is {value}"), "give a finite number");
        }
        if value.abs() > LARGEST {
            return refuse(
                joint,
                format!("{what} is {value:e}, the limit is {LARGEST:e}"),
                "correct the number or its unit",
            );
        }
        if value < 0.0 && what != "spring reference" {
            return refuse(joint, format!("{what} is {value}"), "it cannot be negative");
        }
    }
    Ok(())
}
