//! What MJCF states outside the bodies and still acts on joints: equalities, tendons, motor inertia of actuators.

use super::super::xml::{Element, shorten};
use super::body::Tree;
use crate::error::Result;
use std::collections::BTreeMap;
use twincal::robot::{Mimic, did_you_mean};
use twincal::{Code, Finding, Severity};

/// Reads `<equality>`, `<tendon>` and `<actuator>` into the joints, or reports them.
///
/// # Errors
/// At an element that names a joint which does not exist.
pub(super) fn read<'a>(tree: &mut Tree<'a>, root: &'a Element) -> Result<()> {
    let document = tree.document;
    let joints: Joints = tree
        .joints
        .iter()
        .enumerate()
        .map(|(index, j)| (j.name.clone(), index))
        .collect();
    for section in document.children(root, "equality") {
        for &child in &section.children {
            equality(tree, &joints, &document.elements[child])?;
        }
    }
    for section in document.children(root, "tendon") {
        for &child in &section.children {
            let element = &document.elements[child];
            let view = tree.defaults.view(document, element, None)?;
            let mut acts = false;
            for name in ["stiffness", "damping", "armature", "frictionloss"] {
                acts |= match view.get(name) {
                    Some((element, attribute)) => document
                        .number_list(element, attribute)?
                        .iter()
                        .any(|&v| v != 0.0),
                    None => false,
                };
            }
            if acts {
                let name = element.text("name").unwrap_or("").to_string();
                let message = format!(
                    "tendon `{name}`: its spring, damper and inertia are not part of the nominal torque"
                );
                tree.findings.push(Finding::new(
                    Severity::Warning,
                    Code::TendonNotUsed,
                    name,
                    message,
                    1,
                ));
            }
        }
    }
    for section in document.children(root, "actuator") {
        for &child in &section.children {
            actuator(tree, &joints, &document.elements[child])?;
        }
    }
    Ok(())
}

/// Joint index by name.
type Joints = BTreeMap<String, usize>;

/// Index of a joint that an element names.
fn find(tree: &Tree<'_>, joints: &Joints, element: &Element, name: &str) -> Result<usize> {
    match joints.get(name) {
        Some(&index) => Ok(index),
        None => Err(tree.document.error(
            element,
            format!(
                "<{}> names joint `{}`, which does not exist",
                element.name,
                shorten(name)
            ),
            did_you_mean(name, joints.keys().map(String::as_str)),
        )),
    }
}

/// A linear equality of two joints is a mimic; others close loops that a tree does not have.
fn equality<'a>(tree: &mut Tree<'a>, joints: &Joints, element: &'a Element) -> Result<()> {
    let view = tree.defaults.view(tree.document, element, None)?;
    if view.flag("active") == Some(false) {
        return Ok(());
    }
    let poly = polynomial(tree, element)?;
    if let ("joint", Some(first), Some(second)) = (
        element.name.as_str(),
        element.text("joint1"),
        element.text("joint2"),
    ) {
        let (follower, leader) = (
            find(tree, joints, element, first)?,
            find(tree, joints, element, second)?,
        );
        if poly[2..] == [0.0; 3] && poly[1] != 0.0 && tree.joints[follower].mimic.is_none() {
            // q1 − ref1 = a0 + a1 (q2 − ref2)
            let offset = tree.references[follower] + poly[0] - poly[1] * tree.references[leader];
            tree.joints[follower].mimic = Some(Mimic {
                joint: second.into(),
                multiplier: poly[1],
                offset,
            });
            let message = format!(
                "joint `{first}` follows `{second}` (equality): {} · q + {offset}",
                poly[1]
            );
            tree.findings.push(
                Finding::new(Severity::Note, Code::MimicFromEquality, first, message, 1)
                    .with([("multiplier", poly[1]), ("offset", offset)]),
            );
            return Ok(());
        }
    }
    let name = element
        .text("name")
        .or(element.text("joint1"))
        .or(element.text("body1"))
        .unwrap_or("")
        .to_string();
    let message = format!(
        "equality <{}> `{name}`: its forces are not part of the nominal torque (twincal works on trees); lock the joints \
         that it holds",
        shorten(&element.name)
    );
    tree.findings.push(Finding::new(
        Severity::Warning,
        Code::EqualityNotUsed,
        name,
        message,
        1,
    ));
    Ok(())
}

/// Coefficients of an equality, from the constant one on.
fn polynomial(tree: &Tree<'_>, element: &Element) -> Result<[f64; 5]> {
    let mut poly = [0.0, 1.0, 0.0, 0.0, 0.0];
    if let Some(attribute) = element.get("polycoef") {
        for (slot, value) in poly
            .iter_mut()
            .zip(tree.document.number_list(element, attribute)?)
        {
            *slot = value;
        }
    }
    Ok(poly)
}

/// Rotor inertia and damping that an actuator adds to its joint: gear² times its own. A gear other than 1 is said: columns
/// of torque are meant at the joint, which is gear × control of a motor.
fn actuator<'a>(tree: &mut Tree<'a>, joints: &Joints, element: &'a Element) -> Result<()> {
    let view = tree.defaults.view(tree.document, element, None)?;
    let (armature, damping) = (view.linear("armature")?, view.linear("damping")?);
    let gear = match view.get("gear") {
        Some((element, attribute)) => tree
            .document
            .number_list(element, attribute)?
            .first()
            .copied()
            .unwrap_or(1.0),
        None => 1.0,
    };
    let name = element.text("name").unwrap_or("").to_string();
    let Some(joint) = element.text("joint") else {
        if armature != 0.0 || damping != 0.0 {
            let message = format!(
                "actuator `{name}` drives no single joint: its inertia and damping are not used"
            );
            tree.findings.push(Finding::new(
                Severity::Warning,
                Code::ActuatorNotUsed,
                name,
                message,
                1,
            ));
        }
        return Ok(());
    };
    let index = find(tree, joints, element, joint)?;
    tree.joints[index].armature += gear * gear * armature;
    tree.joints[index].damping += gear * gear * damping;
    if gear != 1.0 {
        let message = format!(
            "actuator `{name}` has gear {gear}: torque columns are those of joint `{joint}`, which is {gear} × the actuator's force; \
             the gear itself changes no nominal torque"
        );
        tree.findings.push(
            Finding::new(Severity::Note, Code::ActuatorGear, joint, message, 1)
                .with([("gear", gear)]),
        );
    }
    Ok(())
}
