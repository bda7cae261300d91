//! A component: one physical story with all its columns, and its coefficients as the parameters that people know.

use super::Family;
use super::{payload, spring};
use serde::{Deserialize, Serialize};

/// One physical story: in or out of the model with all its columns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Component {
    /// Name as in result.json: `payload`, `<link>.tensor`, `<joint>.spring`, …; of a single term its own name.
    pub name: String,
    /// Family.
    pub family: Family,
    /// In words, with joint, link or frame: "viscous friction on elbow".
    pub story: String,
    /// Its terms, indices into [`super::Library::terms`], ascending and consecutive.
    pub terms: Vec<usize>,
    /// Components whose columns span the same torque for every motion: no data can tell them apart from this one.
    pub alias_of: Vec<String>,
}

impl Component {
    /// True for what is wrong with a link that a payload, which is the usual reason, would look like in every motion: its mass and
    /// first moments. A wrong tensor alone is no payload, which has a mass.
    #[must_use]
    pub fn is_second_choice(&self) -> bool {
        let has_mass = matches!(self.family, Family::MassMoments | Family::MassScale);
        has_mass && self.alias_of.iter().any(|other| other == payload::NAME)
    }
}

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

/// How coefficients become parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Meaning {
    /// The coefficients themselves.
    Coefficients,
    /// Mass, first moments, tensor about a centre → mass, centre of mass, tensor about the frame's origin.
    Payload {
        /// In the payload's frame, m.
        centre: [f64; 3],
    },
    /// Stiffness and preload → stiffness, rest position and preload.
    Spring,
}

impl Meaning {
    /// `centre` is what a payload's tensor is about.
    pub(super) fn of(family: Family, centre: [f64; 3]) -> Self {
        match family {
            Family::Payload => Self::Payload { centre },
            Family::Spring => Self::Spring,
            _ => Self::Coefficients,
        }
    }

    /// The parameters of a component with these columns (name after the component's, unit).
    pub(super) fn parameters(self, columns: &[(String, String)]) -> Vec<Parameter> {
        match self {
            Self::Coefficients => columns
                .iter()
                .map(|(name, unit)| Parameter::new(name, unit))
                .collect(),
            Self::Payload { .. } => payload::parameters(columns),
            Self::Spring => spring::parameters(columns),
        }
    }

    /// Values of [`Meaning::parameters`] at coefficients `beta`, one per column.
    pub(super) fn values(self, beta: &[f64]) -> Vec<f64> {
        match self {
            Self::Coefficients => beta.to_vec(),
            Self::Payload { centre } => payload::values(beta, centre),
            Self::Spring => spring::values(beta),
        }
    }
}
