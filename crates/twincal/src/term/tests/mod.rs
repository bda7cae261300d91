//! Tests of the whole road from text to columns.

mod action;
mod arm;
mod columns;
mod frames;
mod judgement;
mod linearised;
mod parser;
mod parts;
mod sympy;

use super::candidate::Joint;
use super::propose::About;
use super::{Family, Library, LibrarySettings, Status};
use crate::error::{Finding, Result};

/// Joints `joint1`…; a slider where `slides` says so.
fn joints(slides: &[bool]) -> Vec<Joint> {
    let joint = |(index, &slides)| Joint {
        index,
        name: format!("joint{}", index + 1),
        slides,
    };
    slides.iter().enumerate().map(joint).collect()
}

/// Only these expressions.
fn only(terms: &[&str]) -> LibrarySettings {
    LibrarySettings {
        terms: terms.iter().map(|&term| term.to_owned()).collect(),
        generic: Some(false),
        ..LibrarySettings::default()
    }
}

/// Every built-in family, and these expressions.
fn all(terms: &[&str]) -> LibrarySettings {
    let mut settings = only(terms);
    settings.generic = Some(true);
    settings.families = Family::JOINT.to_vec();
    settings
}

/// A library for `n` hinges with parallel axes.
fn planar(n: usize, settings: &LibrarySettings) -> Result<(Library, Vec<Finding>)> {
    bare(&joints(&vec![false; n]), true, settings)
}

/// A library for joints alone.
fn bare(
    joints: &[Joint],
    parallel: bool,
    settings: &LibrarySettings,
) -> Result<(Library, Vec<Finding>)> {
    let about = About {
        joints,
        parallel,
        robot: None,
    };
    Library::build(&about, settings, None)
}

fn status_of<'a>(library: &'a Library, name: &str) -> &'a Status {
    &library
        .terms()
        .iter()
        .find(|term| term.name == name)
        .unwrap_or_else(|| panic!("no term {name}"))
        .status
}
