//! URDF: `<robot>` with links and joints.

use super::ModelSettings;
use super::xml::{Document, Element, shorten};
use crate::error::Result;
use std::collections::BTreeSet;
use twincal::robot::spatial::{IDENTITY, roll_pitch_yaw, rotate_tensor};
use twincal::robot::{
    Inertia, JointDescription, JointKind, Limits, LinkDescription, Mimic, Placement,
    RobotDescription,
};
use twincal::{Code, Finding, Severity};

/// Gravity that URDF takes for granted, m/s².
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// Reads the document's root element.
///
/// # Errors
/// With the place of the element or attribute.
pub(super) fn read(
    document: &Document,
    settings: &ModelSettings,
) -> Result<(RobotDescription, Vec<Finding>)> {
    let root = &document.elements[0];
    refuse_xacro(document)?;
    let mut findings = Vec::new();
    let mut links = Vec::new();
    let mut joints = Vec::new();
    for &child in &root.children {
        let element = &document.elements[child];
        match element.name.as_str() {
            "link" => links.push(link(document, element)?),
            "joint" => joints.push(joint(document, element, settings, &mut findings)?),
            _ => {}
        }
    }
    take_frames(&mut links, &joints, &mut findings);
    report_shapes_without_inertia(document, root, &joints, &mut findings);
    define_world(&mut links, &joints, &mut findings);
    let name = root.text("name").unwrap_or("robot").to_string();
    Ok((
        RobotDescription {
            name,
            gravity: GRAVITY,
            links,
            joints,
            allow_unphysical: false,
        },
        findings,
    ))
}

/// A template that nobody expanded has `xacro:` elements or `${…}` in its values.
fn refuse_xacro(document: &Document) -> Result<()> {
    let template = |element: &&Element| {
        element.name.starts_with("xacro:")
            || element.attributes.iter().any(|a| a.value.contains("${"))
    };
    match document.elements.iter().find(template) {
        Some(element) => {
            let file = &document.files[element.file].name;
            Err(document.error(
                element,
                format!(
                    "<{}> belongs to a xacro template, not to a URDF",
                    shorten(&element.name)
                ),
                format!("expand it: xacro '{file}' > expanded.urdf"),
            ))
        }
        None => Ok(()),
    }
}

fn link(document: &Document, element: &Element) -> Result<LinkDescription> {
    let name = name(document, element)?;
    let mut inertials = document.children(element, "inertial");
    let Some(inertial) = inertials.next() else {
        return Ok(LinkDescription {
            name,
            inertia: None,
        });
    };
    if let Some(second) = inertials.next() {
        return Err(document.error(
            second,
            format!("link `{name}` has a second <inertial>"),
            "keep one of them: readers disagree which one counts",
        ));
    }
    let Some(mass) = document.child(inertial, "mass") else {
        return Err(document.error(
            inertial,
            format!("link `{name}`: <inertial> has no <mass>"),
            "add <mass value=\"…\"/> in kg",
        ));
    };
    let mass = required(document, mass, "value")?;
    let frame = origin(document, inertial)?;
    let tensor = match document.child(inertial, "inertia") {
        Some(inertia) => {
            let entry = |key: &str, needed: bool| match document.number(inertia, key)? {
                None if needed => required(document, inertia, key),
                value => Ok(value.unwrap_or(0.0)),
            };
            let (xx, yy, zz) = (
                entry("ixx", true)?,
                entry("iyy", true)?,
                entry("izz", true)?,
            );
            let (xy, xz, yz) = (
                entry("ixy", false)?,
                entry("ixz", false)?,
                entry("iyz", false)?,
            );
            [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        }
        None => [[0.0; 3]; 3],
    };
    // Not rotated when there is nothing to rotate: the file's own digits stay.
    let tensor = if frame.rotation == IDENTITY {
        tensor
    } else {
        rotate_tensor(&frame.rotation, &tensor)
    };
    Ok(LinkDescription {
        name,
        inertia: Some(Inertia {
            mass,
            com: frame.translation,
            tensor,
        }),
    })
}

fn joint(
    document: &Document,
    element: &Element,
    settings: &ModelSettings,
    findings: &mut Vec<Finding>,
) -> Result<JointDescription> {
    let name = name(document, element)?;
    let kind = kind(document, element, &name)?;
    let end = |role: &str| match document.child(element, role).and_then(|e| e.text("link")) {
        Some(link) => Ok(link.to_string()),
        None => Err(document.error(
            element,
            format!("joint `{name}` has no {role} link"),
            format!("add <{role} link=\"…\"/>"),
        )),
    };
    let mut joint = JointDescription::new(&name, kind, &end("parent")?, &end("child")?);
    joint.placement = origin(document, element)?;
    if kind == JointKind::Fixed {
        return Ok(joint);
    }
    joint.axis = match document.child(element, "axis") {
        Some(axis) => document.numbers(axis, "xyz")?.unwrap_or([1.0, 0.0, 0.0]),
        None => [1.0, 0.0, 0.0],
    };
    if let Some(limit) = document.child(element, "limit") {
        joint.limits = Limits {
            lower: document.number(limit, "lower")?,
            upper: document.number(limit, "upper")?,
            effort: document.number(limit, "effort")?,
            velocity: document.number(limit, "velocity")?,
        };
    }
    if let Some(mimic) = document.child(element, "mimic") {
        joint.mimic = Some(coupling(document, mimic, &name)?);
    }
    if let Some(dynamics) = document.child(element, "dynamics") {
        let damping = document.number(dynamics, "damping")?.unwrap_or(0.0);
        let friction = document.number(dynamics, "friction")?.unwrap_or(0.0);
        match settings.use_urdf_friction {
            true => joint.damping = damping,
            false => joint.unused_damping = damping,
        }
        joint.unused_friction = friction;
        if damping != 0.0 || friction != 0.0 {
            findings.push(stated_friction(&name, damping, friction, settings));
        }
    }
    Ok(joint)
}

/// The `type` of `<joint>`.
fn kind(document: &Document, element: &Element, joint: &str) -> Result<JointKind> {
    match element.text("type") {
        Some("revolute") => Ok(JointKind::Revolute),
        Some("continuous") => Ok(JointKind::Continuous),
        Some("prismatic") => Ok(JointKind::Prismatic),
        Some("fixed") => Ok(JointKind::Fixed),
        other => Err(document.error(
            element,
            format!(
                "joint `{joint}` has type `{}`",
                shorten(other.unwrap_or(""))
            ),
            "twincal supports revolute, continuous, prismatic and fixed joints",
        )),
    }
}

/// `<mimic>` of a joint.
fn coupling(document: &Document, mimic: &Element, joint: &str) -> Result<Mimic> {
    let Some(other) = mimic.text("joint") else {
        return Err(document.error(
            mimic,
            format!("joint `{joint}` mimics nothing"),
            "name the other joint: <mimic joint=\"…\"/>",
        ));
    };
    Ok(Mimic {
        joint: other.into(),
        multiplier: document.number(mimic, "multiplier")?.unwrap_or(1.0),
        offset: document.number(mimic, "offset")?.unwrap_or(0.0),
    })
}

/// Whether damping and friction that `<dynamics>` states count as nominal torque.
fn stated_friction(name: &str, damping: f64, friction: f64, settings: &ModelSettings) -> Finding {
    let used = if settings.use_urdf_friction {
        "its damping counts as nominal torque, its dry friction does not"
    } else {
        "not part of the nominal torque (vendors put solver values there; use_urdf_friction = true counts \
         the damping)"
    };
    let message = format!(
        "joint `{name}`: <dynamics> states damping {damping} and friction {friction}: {used}"
    );
    Finding::new(Severity::Note, Code::UrdfDynamics, name, message, 1)
        .with([("damping", damping), ("friction", friction)])
}

/// A link that no joint moves by itself and whose `<inertial>` says mass 0 is a frame (of a tool, of a sensor): it weighs nothing.
fn take_frames(
    links: &mut [LinkDescription],
    joints: &[JointDescription],
    findings: &mut Vec<Finding>,
) {
    for link in links {
        let finite =
            |inertia: &Inertia| inertia.tensor.as_flattened().iter().all(|v| v.is_finite());
        let massless = |inertia: &Inertia| inertia.mass == 0.0 && finite(inertia);
        let Some(inertia) = link.inertia.filter(massless) else {
            continue;
        };
        let moves =
            |joint: &JointDescription| joint.kind != JointKind::Fixed && joint.child == link.name;
        if joints.iter().any(moves) {
            continue;
        }
        let largest = inertia.tensor.as_flattened().iter();
        let largest = largest.fold(0.0_f64, |largest, v| largest.max(v.abs()));
        let (severity, rest) = match largest {
            0.0 => (Severity::Note, String::new()),
            _ => (
                Severity::Warning,
                format!(
                    "; its inertia tensor (up to {largest:.3e} kg·m²) is left out, give the link its mass if it has one"
                ),
            ),
        };
        let name = &link.name;
        let message =
            format!("link `{name}`: mass 0 and no moving joint of its own, taken as a frame{rest}");
        findings.push(
            Finding::new(severity, Code::MasslessFrame, name, message, 1)
                .with((largest > 0.0).then_some(("largest_moment", largest))),
        );
        link.inertia = None;
    }
}

/// A moving link that has a shape but no `<inertial>` weighs nothing here; meshes are never opened.
fn report_shapes_without_inertia(
    document: &Document,
    root: &Element,
    joints: &[JointDescription],
    findings: &mut Vec<Finding>,
) {
    let moved: BTreeSet<&str> = (joints.iter())
        .filter(|joint| joint.kind != JointKind::Fixed)
        .map(|joint| joint.child.as_str())
        .collect();
    for link in document.children(root, "link") {
        let has = |child: &str| document.child(link, child).is_some();
        let name = link.text("name").unwrap_or("");
        if moved.contains(name) && (has("visual") || has("collision")) && !has("inertial") {
            let message = format!(
                "link `{name}` has a shape but no <inertial>: it weighs nothing in the nominal torque; compute mass, centre of mass \
                 and inertia from its mesh (MeshLab, or the CAD program) and add them"
            );
            findings.push(Finding::new(
                Severity::Warning,
                Code::LinkWithoutInertia,
                name,
                message,
                1,
            ));
        }
    }
}

/// Drake's convention: a link `world` that is used and not defined is the fixed base.
fn define_world(
    links: &mut Vec<LinkDescription>,
    joints: &[JointDescription],
    findings: &mut Vec<Finding>,
) {
    let used = joints.iter().any(|j| j.parent == "world");
    if used && !links.iter().any(|l| l.name == "world") {
        links.insert(
            0,
            LinkDescription {
                name: "world".into(),
                inertia: None,
            },
        );
        findings.push(Finding::new(
            Severity::Note,
            Code::UndefinedWorldLink,
            "world",
            "link `world` is used but not defined: taken as the fixed base (Drake's convention; Pinocchio refuses it)",
            1,
        ));
    }
}

/// `<origin xyz rpy>` of an element; the identity without one.
pub(super) fn origin(document: &Document, element: &Element) -> Result<Placement> {
    let Some(origin) = document.child(element, "origin") else {
        return Ok(Placement::IDENTITY);
    };
    let translation = document.numbers(origin, "xyz")?.unwrap_or([0.0; 3]);
    let rotation = match document.numbers::<3>(origin, "rpy")? {
        Some(angles) if angles == [0.0; 3] => IDENTITY,
        Some(angles) => roll_pitch_yaw(angles),
        None => IDENTITY,
    };
    Ok(Placement {
        rotation,
        translation,
    })
}

fn name(document: &Document, element: &Element) -> Result<String> {
    match element.text("name") {
        Some(name) if !name.is_empty() => Ok(name.into()),
        _ => Err(document.error(
            element,
            format!("<{}> has no name", element.name),
            "give it a unique name",
        )),
    }
}

/// A number that must be there.
pub(super) fn required(document: &Document, element: &Element, key: &str) -> Result<f64> {
    match document.number(element, key)? {
        Some(value) => Ok(value),
        None => Err(document.error(
            element,
            format!("<{}> has no attribute `{key}`", element.name),
            format!("add {key}=\"…\""),
        )),
    }
}
