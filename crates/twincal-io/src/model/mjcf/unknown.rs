//! Elements and attributes that MJCF does not have: one finding lists them, so that a slip of the pen is seen.

use super::super::xml::{Document, Element, shorten};
use twincal::{Code, Finding, Severity};

/// Sections under `<mujoco>`.
const SECTIONS: [&str; 19] = [
    "compiler",
    "option",
    "size",
    "statistic",
    "visual",
    "default",
    "asset",
    "worldbody",
    "body",
    "deformable",
    "contact",
    "equality",
    "tendon",
    "actuator",
    "sensor",
    "keyframe",
    "custom",
    "extension",
    "include",
];
/// What a body, a frame or the world may hold.
const BODY: [&str; 14] = [
    "inertial",
    "joint",
    "freejoint",
    "geom",
    "attach",
    "site",
    "camera",
    "light",
    "plugin",
    "composite",
    "flexcomp",
    "frame",
    "body",
    "replicate",
];
/// Attributes of the elements whose numbers decide the dynamics.
const ATTRIBUTES: [(&str, &[&str]); 4] = [
    (
        "body",
        &[
            "name",
            "pos",
            "quat",
            "axisangle",
            "xyaxes",
            "zaxis",
            "euler",
            "childclass",
            "mocap",
            "gravcomp",
            "user",
            "sleep",
            "fuse",
            "simple",
        ],
    ),
    (
        "frame",
        &[
            "name",
            "pos",
            "quat",
            "axisangle",
            "xyaxes",
            "zaxis",
            "euler",
            "childclass",
        ],
    ),
    (
        "inertial",
        &[
            "pos",
            "quat",
            "axisangle",
            "xyaxes",
            "zaxis",
            "euler",
            "mass",
            "diaginertia",
            "fullinertia",
        ],
    ),
    (
        "joint",
        &[
            "name",
            "class",
            "type",
            "group",
            "pos",
            "axis",
            "springdamper",
            "springref",
            "springyield",
            "stiffness",
            "range",
            "limited",
            "actuatorfrcrange",
            "actuatorfrclimited",
            "actuatorgravcomp",
            "solreflimit",
            "solimplimit",
            "solreffriction",
            "solimpfriction",
            "margin",
            "ref",
            "armature",
            "damping",
            "frictionloss",
            "user",
        ],
    ),
];

/// Adds one finding that lists what is unknown (MuJoCo 4.0's schema), if anything is.
pub(super) fn report(document: &Document, root: &Element, findings: &mut Vec<Finding>) {
    let mut unknown: Vec<String> = Vec::new();
    let mut count = 0;
    let mut note = |element: &Element, text: String| {
        count += 1;
        if unknown.len() < 10 {
            unknown.push(format!("{text} at {}", document.place(element)));
        }
    };
    let mut stack: Vec<&Element> = Vec::new();
    for &child in &root.children {
        let element = &document.elements[child];
        if !SECTIONS.contains(&element.name.as_str()) {
            note(element, format!("<{}>", shorten(&element.name)));
        } else if element.name == "worldbody" {
            stack.push(element);
        }
    }
    while let Some(element) = stack.pop() {
        for &child in &element.children {
            let child = &document.elements[child];
            if !BODY.contains(&child.name.as_str()) {
                note(child, format!("<{}>", shorten(&child.name)));
            }
            if let Some((_, known)) = ATTRIBUTES.iter().find(|(name, _)| *name == child.name) {
                for attribute in &child.attributes {
                    if !known.contains(&attribute.name.as_str()) {
                        note(
                            child,
                            format!("<{}> {}=", child.name, shorten(&attribute.name)),
                        );
                    }
                }
            }
        }
        let inner = element
            .children
            .iter()
            .rev()
            .map(|&c| &document.elements[c]);
        stack.extend(inner.filter(|c| c.name == "body" || c.name == "frame"));
    }
    if count > 0 {
        let message = format!(
            "MJCF does not know, and twincal did not use: {}",
            unknown.join(", ")
        );
        findings.push(Finding::new(
            Severity::Warning,
            Code::UnknownElements,
            "",
            message,
            count,
        ));
    }
}
