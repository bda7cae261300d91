//! MJCF: `<mujoco>` with compiler settings, default classes, bodies, joints and inertias.

mod body;
mod compiler;
mod couplings;
mod defaults;
mod geom;
mod inertial;
mod shapes;
mod sites;
mod unknown;

use super::xml::{Document, Element};
use crate::error::Result;
pub(super) use shapes::of_document as geometry;
pub(crate) use shapes::seen_from;
pub(crate) use sites::{BodySite, JointSite, Sites};

use body::Tree;
use compiler::Compiler;
use defaults::{Defaults, View};
use twincal::robot::RobotDescription;
use twincal::{Code, Finding, Severity};

/// Reads the document, whose includes are expanded.
///
/// # Errors
/// With the place of the element or attribute.
pub(super) fn read(document: &Document) -> Result<(RobotDescription, Vec<Finding>, Sites)> {
    let root = &document.elements[0];
    let compiler = Compiler::read(document, root)?;
    let defaults = Defaults::read(document, root)?;
    let total_mass = compiler.total_mass;
    let overrides = compiler.overrides();
    let mut tree = Tree::new(document, compiler, defaults);
    tree.sites.overrides = overrides;
    let gravity = option(document, root, &mut tree.findings)?;
    if document.child(root, "worldbody").is_none() {
        return Err(document.error(
            root,
            "the model has no <worldbody>",
            "is it a part that another file includes?",
        ));
    }
    for world in document.children(root, "worldbody") {
        tree.read_world(world)?;
    }
    couplings::read(&mut tree, root)?;
    unknown::report(document, root, &mut tree.findings);
    let mut links = tree.links;
    if total_mass > 0.0 {
        let mass: f64 = links
            .iter()
            .filter_map(|l| l.inertia.as_ref())
            .map(|i| i.mass)
            .sum();
        let factor = total_mass / mass;
        for inertia in links.iter_mut().filter_map(|l| l.inertia.as_mut()) {
            inertia.mass *= factor;
            inertia.tensor = inertia.tensor.map(|row| row.map(|v| v * factor));
        }
    }
    let name = root.text("model").unwrap_or("robot").to_string();
    Ok((
        RobotDescription {
            name,
            gravity,
            links,
            joints: tree.joints,
            allow_unphysical: false,
        },
        tree.findings,
        tree.sites,
    ))
}

/// Gravity, and what else of `<option>` would change torque.
fn option(document: &Document, root: &Element, findings: &mut Vec<Finding>) -> Result<[f64; 3]> {
    let mut gravity = [0.0, 0.0, -9.81];
    let mut disabled = Vec::new();
    for option in document.children(root, "option") {
        let view = View::plain(document, option);
        gravity = view.numbers("gravity")?.unwrap_or(gravity);
        let fluid = view.number("density")?.unwrap_or(0.0) != 0.0
            || view.number("viscosity")?.unwrap_or(0.0) != 0.0;
        if fluid {
            findings.push(Finding::new(
                Severity::Warning,
                Code::FluidNotUsed,
                "",
                "<option> states a medium (density, viscosity): its drag is not part of the nominal torque",
                1,
            ));
        }
        for flag in document.children(option, "flag") {
            for name in ["gravity", "spring", "damper"] {
                if flag.text(name) == Some("disable") {
                    disabled.push(name);
                }
            }
        }
    }
    if disabled.contains(&"gravity") {
        gravity = [0.0; 3];
    }
    for name in disabled.into_iter().filter(|n| *n != "gravity") {
        let message = format!(
            "<flag {name}=\"disable\"/> is a simulator's switch: joint {name}s stay in the nominal torque"
        );
        findings.push(Finding::new(
            Severity::Warning,
            Code::FlagNotUsed,
            name,
            message,
            1,
        ));
    }
    Ok(gravity)
}
