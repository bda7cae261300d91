//! Changes of an MJCF: `<inertial>`, joint damping, frictionloss, armature and spring, gravity.

use super::NO_BODY;
use super::edit::{Edits, list};
use crate::error::{Error, Place, Result};
use crate::model::Model;
use crate::model::mjcf::{BodySite, JointSite};
use crate::model::xml::{Document, Element};
use twincal::robot::spatial::{Matrix, add, apply, cross, dot, rotate_tensor, scale, transpose};
use twincal::robot::{Inertia, principal_axes};
use twincal::write_back::{JointChange, LinkChange, WriteBack};

/// Numbers of a file that differ by less than this share of their like stay as they are written.
const SAME: f64 = 1e-10;
/// Attributes that turn an `<inertial>`.
const WAYS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// The file's text with the change.
pub(super) fn write(model: &Model, change: &WriteBack) -> Result<Vec<u8>> {
    let (document, sites) = (model.document(), model.sites());
    if document.files.len() > 1 {
        let problem = format!("the model is spread over {} files", document.files.len());
        return Err(Error::content(
            Place::file(model.name()),
            problem,
            "fit a model of one file: in Python mujoco.mj_saveLastXML('flat.xml', model)",
        ));
    }
    if let (Some(setting), false) = (sites.overrides, change.links.is_empty()) {
        return Err(Error::content(
            Place::file(model.name()),
            format!("<compiler {setting}>: the simulator does not use what <inertial> says"),
            "save the model as MuJoCo compiled it: in Python mujoco.mj_saveLastXML('flat.xml', model), and fit that",
        ));
    }
    let mut edits = Edits::new(document);
    let at = |offset: usize| document.elements.iter().find(|e| e.offset == offset);
    for change in &change.links {
        let mut bodies = sites.bodies.iter();
        if let Some(site) = bodies.find(|site| site.link == change.link)
            && let Some(body) = at(site.offset)
        {
            inertial(&mut edits, body, site, change, &at);
        }
    }
    for change in &change.joints {
        let mut joints = sites.joints.iter();
        if let Some(site) = joints.find(|site| site.joint == change.joint)
            && let Some(joint) = at(site.offset)
        {
            passive(&mut edits, joint, site, change);
        }
    }
    if let Some(new) = change.gravity {
        gravity(document, &mut edits, new)?;
    }
    Ok(edits.apply().into_bytes())
}

/// `<inertial>` of one body.
fn inertial<'e>(
    edits: &mut Edits<'_>,
    body: &Element,
    site: &BodySite,
    change: &LinkChange,
    at: &dyn Fn(usize) -> Option<&'e Element>,
) {
    let Inertia { mass, com, tensor } = change.after;
    let com = add(com, site.origin);
    let found = site.inertial.as_ref();
    let comment = edits.once(body, NO_BODY).filter(|_| change.no_body);
    let Some((element, frame, own)) =
        found.and_then(|(offset, frame, own)| Some((at(*offset)?, frame, own)))
    else {
        let line = format!(
            "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            list(&com),
            list(&[mass]),
            list(&six(&tensor))
        );
        let lines: Vec<_> = comment.into_iter().chain([(0, line)]).collect();
        edits.first_child(body, &lines);
        return;
    };
    if let Some(comment) = comment {
        edits.first_child(body, &[comment]);
    }
    // In the frames around the element.
    let back = transpose(&frame.rotation);
    let com = apply(&back, add(com, scale(-1.0, frame.translation)));
    let tensor = rotate_tensor(&back, &tensor);
    let far = com.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    edits.numbers(element, "mass", &[mass], &[0.0], SAME * mass);
    edits.numbers(element, "pos", &com, &[0.0; 3], SAME * far);
    let turned = rotate_tensor(&transpose(own), &tensor);
    let size = tensor
        .as_flattened()
        .iter()
        .fold(0.0_f64, |m, x| m.max(x.abs()));
    let same = SAME * (size + mass * far * far);
    let diagonal = [(0, 1), (0, 2), (1, 2)]
        .iter()
        .all(|&(i, j)| turned[i][j].abs() <= same);
    if element.get("fullinertia").is_some() {
        edits.numbers(element, "fullinertia", &six(&turned), &[0.0; 6], same);
    } else if diagonal {
        let moments = [turned[0][0], turned[1][1], turned[2][2]];
        edits.numbers(element, "diaginertia", &moments, &[0.0; 3], same);
    } else {
        let (moments, axes) = principal_axes(&tensor);
        edits.numbers(element, "diaginertia", &moments, &[0.0; 3], 0.0);
        let quaternion = list(&quaternion(&axes));
        match WAYS.into_iter().find(|way| element.get(way).is_some()) {
            Some(way) => edits.replace_attribute(element, way, "quat", &quaternion),
            None => edits.add_attribute(element, "quat", &quaternion),
        }
    }
}

/// Joint attributes; classes stay as they are, so that no other joint changes.
fn passive(edits: &mut Edits<'_>, joint: &Element, site: &JointSite, change: &JointChange) {
    let mut set = |name: &str, value: Option<f64>, stated: f64| {
        if let Some(value) = value {
            edits.numbers(joint, name, &[value], &[stated], SAME * value.abs());
        }
    };
    let sum = |stated: f64, change: Option<f64>| change.map(|change| (stated + change).max(0.0));
    set("damping", sum(site.damping, change.damping), site.damping);
    set("frictionloss", change.friction, site.frictionloss);
    set(
        "armature",
        sum(site.armature, change.armature),
        site.armature,
    );
    if let Some([stiffness, rest]) = change.spring {
        set("stiffness", Some(stiffness), site.stiffness);
        let stated = site.spring_reference / site.angle;
        set("springref", Some(rest / site.angle), stated);
    }
}

/// `<option gravity>`: the last one that states it, else the last option, else a new one.
fn gravity(document: &Document, edits: &mut Edits<'_>, new: [f64; 3]) -> Result<()> {
    let root = &document.elements[0];
    let options: Vec<&Element> = document.children(root, "option").collect();
    let off = |option: &&&Element| {
        let mut flags = document.children(option, "flag");
        flags.any(|flag| flag.text("gravity") == Some("disable"))
    };
    if let Some(option) = options.iter().find(off) {
        return Err(document.error(
            option,
            "gravity is switched off, but the data see a change of it",
            "switch it on, and fit again",
        ));
    }
    let stated = options.iter().rev().find(|o| o.get("gravity").is_some());
    match stated.or(options.last()) {
        Some(option) => edits.numbers(option, "gravity", &new, &[0.0, 0.0, -9.81], SAME * 10.0),
        None => {
            let line = format!("<option gravity=\"{}\"/>", list(&new));
            edits.first_child(root, &[(0, line)]);
        }
    }
    Ok(())
}

/// xx, yy, zz, xy, xz, yz.
pub(super) fn six(tensor: &Matrix) -> [f64; 6] {
    [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|(i, j)| tensor[i][j])
}

/// w, x, y, z of a rotation whose columns are known up to their sign.
pub(super) fn quaternion(axes: &Matrix) -> [f64; 4] {
    let mut r = *axes;
    if dot(r[0], cross(r[1], r[2])) < 0.0 {
        r.iter_mut().for_each(|row| row[2] = -row[2]);
    }
    // The largest of the four is found without cancellation (Shepperd 1978).
    let trace = r[0][0] + r[1][1] + r[2][2];
    let squares = [
        1.0 + trace,
        1.0 + 2.0 * r[0][0] - trace,
        1.0 + 2.0 * r[1][1] - trace,
        1.0 + 2.0 * r[2][2] - trace,
    ];
    let mut largest = 0;
    for k in 1..4 {
        if squares[k] > squares[largest] {
            largest = k;
        }
    }
    let double = squares[largest].sqrt();
    let part = |x: f64| 0.5 * x / double;
    let [wx, wy, wz] = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
    let [xy, xz, yz] = [r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]];
    let own = 0.5 * double;
    match largest {
        0 => [own, part(wx), part(wy), part(wz)],
        1 => [part(wx), own, part(xy), part(xz)],
        2 => [part(wy), part(xy), own, part(yz)],
        _ => [part(wz), part(xz), part(yz), own],
    }
}
