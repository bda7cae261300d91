//! Changes of a URDF: `<inertial>` of links, `<dynamics damping friction>` of joints.

use super::NO_BODY;
use super::edit::{Edits, digits, list};
use crate::error::Result;
use crate::model::Model;
use crate::model::xml::{Document, Element};
use twincal::robot::Inertia;
use twincal::robot::spatial::{IDENTITY, Matrix, roll_pitch_yaw, rotate_tensor, transpose};
use twincal::write_back::{JointChange, LinkChange, WriteBack};

/// Numbers of a file that differ by less than this share of their like stay as they are written.
const SAME: f64 = 1e-10;
/// Entries of a tensor, in the order in which URDFs list them.
const ENTRIES: [(&str, usize, usize); 6] = [
    ("ixx", 0, 0),
    ("ixy", 0, 1),
    ("ixz", 0, 2),
    ("iyy", 1, 1),
    ("iyz", 1, 2),
    ("izz", 2, 2),
];

/// The file's text with the change.
pub(super) fn write(model: &Model, change: &WriteBack) -> Result<Vec<u8>> {
    let document = model.document();
    let root = &document.elements[0];
    let mut edits = Edits::new(document);
    for change in &change.links {
        let named = |link: &&Element| link.text("name") == Some(change.link.as_str());
        if let Some(link) = document.children(root, "link").find(named) {
            inertial(document, &mut edits, link, change)?;
        }
    }
    for change in &change.joints {
        let named = |joint: &&Element| joint.text("name") == Some(change.joint.as_str());
        if let Some(joint) = document.children(root, "joint").find(named) {
            let mut joints = model.description.joints.iter();
            let nominal = joints.find(|joint| joint.name == change.joint);
            let nominal = nominal.map_or(0.0, |joint| joint.damping);
            dynamics(document, &mut edits, joint, change, nominal);
        }
    }
    Ok(edits.apply().into_bytes())
}

/// `<inertial>` of one link.
fn inertial(
    document: &Document,
    edits: &mut Edits<'_>,
    link: &Element,
    change: &LinkChange,
) -> Result<()> {
    let Inertia { mass, com, tensor } = change.after;
    let comment = edits.once(link, NO_BODY).filter(|_| change.no_body);
    let Some(inertial) = document.child(link, "inertial") else {
        let lines: Vec<_> = comment.into_iter().chain(block(&change.after)).collect();
        edits.first_child(link, &lines);
        return Ok(());
    };
    if let Some(comment) = comment {
        edits.first_child(link, &[comment]);
    }
    let mut rotation: Matrix = IDENTITY;
    let far = com.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    match document.child(inertial, "origin") {
        Some(origin) => {
            if let Some(angles) = document.numbers::<3>(origin, "rpy")? {
                rotation = roll_pitch_yaw(angles);
            }
            edits.numbers(origin, "xyz", &com, &[0.0; 3], SAME * far);
        }
        None if com.iter().any(|x| x.abs() > 1e-15) => {
            let line = format!("<origin xyz=\"{}\" rpy=\"0 0 0\"/>", list(&com));
            edits.first_child(inertial, &[(0, line)]);
        }
        None => {}
    }
    if let Some(element) = document.child(inertial, "mass") {
        edits.numbers(element, "value", &[mass], &[0.0], SAME * mass);
    }
    // In the axes that the file has chosen.
    let tensor = rotate_tensor(&transpose(&rotation), &tensor);
    let size = tensor
        .as_flattened()
        .iter()
        .fold(0.0_f64, |m, x| m.max(x.abs()));
    // Turned tensors and shifted centres round.
    let same = SAME * (size + mass * far * far);
    match document.child(inertial, "inertia") {
        Some(element) => {
            for (name, i, j) in ENTRIES {
                edits.numbers(element, name, &[tensor[i][j]], &[0.0], same);
            }
        }
        None => edits.last_child(inertial, &[(0, tensor_line(&tensor))]),
    }
    Ok(())
}

/// A whole `<inertial>`.
pub(super) fn block(inertia: &Inertia) -> Vec<(usize, String)> {
    vec![
        (0, "<inertial>".into()),
        (
            1,
            format!("<origin xyz=\"{}\" rpy=\"0 0 0\"/>", list(&inertia.com)),
        ),
        (1, format!("<mass value=\"{}\"/>", digits(inertia.mass))),
        (1, tensor_line(&inertia.tensor)),
        (0, "</inertial>".into()),
    ]
}

fn tensor_line(tensor: &Matrix) -> String {
    let entries = ENTRIES.map(|(name, i, j)| format!("{name}=\"{}\"", digits(tensor[i][j])));
    format!("<inertia {}/>", entries.join(" "))
}

/// `<dynamics>` of one joint; `nominal` is the damping that the nominal torque has.
fn dynamics(
    document: &Document,
    edits: &mut Edits<'_>,
    joint: &Element,
    change: &JointChange,
    nominal: f64,
) {
    let values = [
        ("damping", change.damping.map(|damping| nominal + damping)),
        ("friction", change.friction),
    ];
    match document.child(joint, "dynamics") {
        Some(dynamics) => {
            for (name, value) in values {
                if let Some(value) = value {
                    edits.numbers(dynamics, name, &[value], &[0.0], SAME * value);
                }
            }
        }
        None => {
            let told: Vec<String> = values
                .iter()
                .filter_map(|(name, value)| Some(format!("{name}=\"{}\"", digits((*value)?))))
                .collect();
            if !told.is_empty() {
                edits.last_child(joint, &[(0, format!("<dynamics {}/>", told.join(" ")))]);
            }
        }
    }
}
