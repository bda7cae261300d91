//! A whole URDF: links with inertias, joints with limits, damping and dry friction.

use super::super::edit::{digits, list};
use super::super::urdf::block;
use super::{Plan, attribute, nonzero};
use std::fmt::Write as _;
use twincal::robot::spatial::{IDENTITY, Matrix};
use twincal::robot::{JointDescription, JointKind};
use twincal::words::quoted;

/// What URDF readers assume, m/s².
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
/// Stands where a URDF asks for a limit and the model states none.
const UNLIMITED: f64 = 1e9;

/// The file's text.
pub(super) fn write(plan: &mut Plan) -> String {
    notes(plan);
    let description = &plan.description;
    let mut text = format!("<robot name=\"{}\">\n", attribute(&description.name));
    text += &plan
        .comment("URDF")
        .replace("<!--", "  <!--")
        .replace("\n     ", "\n       ");
    for link in &description.links {
        let name = attribute(&link.name);
        let Some(inertia) = &link.inertia else {
            let _ = writeln!(text, "  <link name=\"{name}\"/>");
            continue;
        };
        let _ = writeln!(text, "  <link name=\"{name}\">");
        text += &plan.warning(&link.name, "    ");
        for (depth, line) in block(inertia) {
            let _ = writeln!(text, "    {}{line}", "  ".repeat(depth));
        }
        text += "  </link>\n";
    }
    description
        .joints
        .iter()
        .for_each(|own| joint(&mut text, own));
    text += "</robot>\n";
    text
}

/// What a URDF cannot hold, and what it asks for.
fn notes(plan: &mut Plan) {
    let gravity = plan.description.gravity;
    if gravity != GRAVITY {
        plan.notes.push(format!(
            "A URDF cannot hold gravity: simulate it with ({}) m/s² in the frame of its base.",
            gravity.map(digits).join(", ")
        ));
    }
    let moves = |joint: &&JointDescription| joint.kind != JointKind::Fixed;
    let asks =
        |joint: &&JointDescription| moves(joint) && limit(joint).is_some_and(|own| own.invented);
    let invented = plan.description.joints.iter().filter(asks);
    let invented: Vec<&str> = invented.map(|joint| joint.name.as_str()).collect();
    if !invented.is_empty() {
        plan.notes.push(format!(
            "A URDF asks for limits that the model does not state: {UNLIMITED:e} stands there, at {}.",
            quoted(&invented)
        ));
    }
}

/// One `<joint>`.
fn joint(text: &mut String, joint: &JointDescription) {
    let limit = limit(joint);
    let kind = match joint.kind {
        JointKind::Fixed => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Revolute if range(joint).is_some() => "revolute",
        JointKind::Revolute | JointKind::Continuous => "continuous",
    };
    let name = attribute(&joint.name);
    let _ = writeln!(text, "  <joint name=\"{name}\" type=\"{kind}\">");
    let place = &joint.placement;
    let _ = writeln!(
        text,
        "    <origin xyz=\"{}\" rpy=\"{}\"/>",
        list(&place.translation),
        list(&angles(&place.rotation))
    );
    let _ = writeln!(text, "    <parent link=\"{}\"/>", attribute(&joint.parent));
    let _ = writeln!(text, "    <child link=\"{}\"/>", attribute(&joint.child));
    if joint.kind != JointKind::Fixed {
        let _ = writeln!(text, "    <axis xyz=\"{}\"/>", list(&joint.axis));
        if let Some(limit) = limit {
            let _ = writeln!(text, "    <limit{}/>", limit.attributes);
        }
        let dynamics =
            nonzero("damping", joint.damping) + &nonzero("friction", joint.unused_friction);
        if !dynamics.is_empty() {
            let _ = writeln!(text, "    <dynamics{dynamics}/>");
        }
        if let Some(mimic) = &joint.mimic {
            let _ = writeln!(
                text,
                "    <mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
                attribute(&mimic.joint),
                digits(mimic.multiplier),
                digits(mimic.offset)
            );
        }
    }
    text.push_str("  </joint>\n");
}

/// `<limit>` of a joint.
struct Limit {
    attributes: String,
    /// One of its numbers is [`UNLIMITED`].
    invented: bool,
}

/// `None` where the joint needs no `<limit>` and states none.
fn limit(joint: &JointDescription) -> Option<Limit> {
    let own = &joint.limits;
    let range = match (range(joint), joint.kind) {
        (None, JointKind::Prismatic) => Some([own.lower, own.upper]),
        (range, _) => range.map(|range| range.map(Some)),
    };
    if range.is_none() && own.effort.is_none() && own.velocity.is_none() {
        return None;
    }
    let [lower, upper] = range.unwrap_or_default();
    let mut limit = Limit {
        attributes: String::new(),
        invented: false,
    };
    let parts = [
        ("lower", lower, -UNLIMITED, range.is_some()),
        ("upper", upper, UNLIMITED, range.is_some()),
        ("effort", own.effort, UNLIMITED, true),
        ("velocity", own.velocity, UNLIMITED, true),
    ];
    for (name, stated, otherwise, is_asked) in parts {
        if is_asked {
            limit.invented |= stated.is_none();
            let value = digits(stated.unwrap_or(otherwise));
            let _ = write!(limit.attributes, " {name}=\"{value}\"");
        }
    }
    Some(limit)
}

/// Both position limits of a joint that has them.
fn range(joint: &JointDescription) -> Option<[f64; 2]> {
    let both = joint.limits.lower.zip(joint.limits.upper);
    let both = both.filter(|_| joint.kind != JointKind::Continuous);
    both.map(|(lower, upper)| [lower, upper])
}

/// Roll, pitch and yaw of a rotation R_z(yaw) R_y(pitch) R_x(roll).
///
/// Roll is taken from R_z(−yaw) R = R_y R_x, whatever yaw is where pitch is a quarter turn.
fn angles(r: &Matrix) -> [f64; 3] {
    if *r == IDENTITY {
        return [0.0; 3];
    }
    let yaw = r[1][0].atan2(r[0][0]);
    let (sine, cosine) = yaw.sin_cos();
    let pitch = (-r[2][0]).atan2(cosine * r[0][0] + sine * r[1][0]);
    let roll = (sine * r[0][2] - cosine * r[1][2]).atan2(cosine * r[1][1] - sine * r[0][1]);
    [roll, pitch, yaw]
}
