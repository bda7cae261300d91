//! A physical parameter that people know a component by, and what is known of it before the data.

use serde::{Deserialize, Serialize};

/// A physical parameter of a component.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parameter {
    /// `mass`, `com_x`, `stiffness`, …
    pub name: String,
    /// SI unit.
    pub unit: String,
}

impl Parameter {
    pub(super) fn new(name: &str, unit: &str) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
        }
    }
}

/// What is known of a parameter before the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Before {
    /// No motion shows it.
    Hidden,
    /// Its prior sd.
    Width(f64),
    /// It is a ratio and has none.
    Ratio,
}
