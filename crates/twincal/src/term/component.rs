//! A component: one physical story with all its columns, and its coefficients as the parameters that people know.

use super::Family;
use super::mixture::Mixture;
use super::parameter::{Before, Parameter};
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
    /// True for what is wrong with a link that a payload, which is the usual reason, would look like in every motion: its density and
    /// first moments. A wrong tensor alone is no payload, which has a mass.
    #[must_use]
    pub fn is_second_choice(&self) -> bool {
        let has_mass = matches!(self.family, Family::Density | Family::MassMoments);
        has_mass && self.alias_of.iter().any(|other| other == payload::NAME)
    }
}

/// How coefficients become parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Meaning<'a> {
    /// The coefficients themselves.
    Coefficients,
    /// Linear in the coefficients.
    Mixture(&'a Mixture),
    /// Mass, first moments and tensor, linear in the coefficients → mass, centre of mass, tensor, first moments.
    Payload(&'a Mixture),
    /// Stiffness and preload → stiffness, rest position and preload.
    Spring,
}

impl<'a> Meaning<'a> {
    pub(super) fn of(family: Family, mixture: Option<&'a Mixture>) -> Self {
        match (family, mixture) {
            (Family::Payload, Some(mixture)) => Self::Payload(mixture),
            (_, Some(mixture)) => Self::Mixture(mixture),
            (Family::Spring, None) => Self::Spring,
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
            Self::Mixture(mixture) => mixture.parameters.clone(),
            Self::Payload(_) => payload::parameters(),
            Self::Spring => spring::parameters(columns),
        }
    }

    /// Values of [`Meaning::parameters`] at coefficients `beta`, one per column.
    pub(super) fn values(self, beta: &[f64]) -> Vec<f64> {
        match self {
            Self::Coefficients => beta.to_vec(),
            Self::Mixture(mixture) => mixture.values(beta),
            Self::Payload(mixture) => payload::values(&mixture.values(beta)),
            Self::Spring => spring::values(beta),
        }
    }

    /// What is known of a parameter before the data where it is not its term's; `live`: which terms are columns.
    pub(super) fn before(self, parameter: usize, live: &[bool]) -> Option<Before> {
        match self {
            Self::Mixture(mixture) => Some(match mixture.prior_sd(parameter, live) {
                Some(sd) => Before::Width(sd),
                None => Before::Hidden,
            }),
            Self::Payload(mixture) => Some(payload::before(mixture, parameter, live)),
            Self::Coefficients | Self::Spring => None,
        }
    }
}
