//! `design.json`: what a designed motion shows, for programs.

use super::WARNING;
use crate::error::{Error, Result};
use serde::Serialize;
use twincal::design::{Design, DesignSettings, JointLimits, JointUse, Promise};
use twincal::robot::JointKind;

/// Version of the format.
const SCHEMA: u64 = 1;

/// What else stands in `design.json`.
#[derive(Debug, Clone)]
pub struct About<'a> {
    /// Name of the model.
    pub model: String,
    /// As asked for.
    pub settings: &'a DesignSettings,
    /// In force.
    pub limits: &'a [JointLimits],
    /// Kind of each joint: sliders move in m.
    pub kinds: Vec<JointKind>,
}

#[derive(Debug, Serialize)]
struct DesignJson<'a> {
    schema: u64,
    twincal: &'static str,
    warning: &'static str,
    model: &'a str,
    duration: f64,
    rate: f64,
    seed: u64,
    samples: usize,
    stopped: bool,
    base_parameters: usize,
    log_determinant: f64,
    condition: f64,
    limits: &'a [JointLimits],
    promises: &'a [Promise],
    used: &'a [JointUse],
}

/// The file.
///
/// # Errors
/// [`Error::Internal`] if it cannot be written as JSON.
pub fn design_json(design: &Design, about: &About<'_>) -> Result<Vec<u8>> {
    let file = DesignJson {
        schema: SCHEMA,
        twincal: env!("CARGO_PKG_VERSION"),
        warning: WARNING,
        model: &about.model,
        duration: about.settings.duration,
        rate: about.settings.rate,
        seed: about.settings.seed,
        samples: design.motion.len,
        stopped: design.stopped,
        base_parameters: design.columns,
        log_determinant: design.log_determinant,
        condition: design.condition,
        limits: about.limits,
        promises: &design.promises,
        used: &design.used,
    };
    let mut bytes = serde_json::to_vec_pretty(&file).map_err(|e| Error::Internal {
        what: "a design as JSON".into(),
        problem: e.to_string(),
    })?;
    bytes.push(b'\n');
    Ok(bytes)
}
