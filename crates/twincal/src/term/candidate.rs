//! What every family hands to the library: a named candidate with its torque image.

use super::Family;
use super::euler_lagrange::euler_lagrange;
use super::expression::{Function, Graph, Id, Variable};
use super::mixture::Mixture;
use super::model_column::ModelColumn;

/// A moving joint as the families see it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Joint {
    /// 0-based: q1 has index 0.
    pub(super) index: usize,
    /// Free text from the model file.
    pub(super) name: String,
    /// Slider (m) or hinge (rad).
    pub(super) slides: bool,
}

impl Joint {
    /// Unit of its torque: N·m, or N for a slider.
    pub(super) fn torque_unit(&self) -> &'static str {
        if self.slides { "N" } else { "N·m" }
    }

    /// Unit of its position: rad, or m for a slider.
    pub(super) fn position_unit(&self) -> &'static str {
        if self.slides { "m" } else { "rad" }
    }

    /// q of this joint.
    pub(super) fn position(&self, graph: &mut Graph) -> Id {
        graph.variable(Variable::Position(self.index))
    }

    /// q̇ of this joint.
    pub(super) fn velocity(&self, graph: &mut Graph) -> Id {
        graph.variable(Variable::Velocity(self.index))
    }
}

/// tanh(rate / v_s), or sign(rate) for v_s = 0: the direction of motion without a jump.
pub(super) fn direction(graph: &mut Graph, rate: Id, velocity: f64) -> Id {
    if velocity == 0.0 {
        graph.function(Function::Sign, rate)
    } else {
        let relative = graph.scaled(1.0 / velocity, rate);
        graph.function(Function::Tanh, relative)
    }
}

/// One column before it is judged.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    /// Name as in result.json.
    pub(super) name: String,
    /// Family.
    pub(super) family: Family,
    /// Unit of β.
    pub(super) unit: String,
    /// In physical words, with the joint: "viscous friction on elbow".
    pub(super) story: String,
    /// φ(q, q̇) where the term is a Lagrangian written as an expression.
    pub(super) lagrangian: Option<Id>,
    /// `(joint, torque per unit of β)`, joints ascending; structurally zero joints left out.
    pub(super) image: Vec<(usize, Id)>,
    /// Torque that is made from the robot model instead; then `image` is empty.
    pub(super) model: Option<ModelColumn>,
    /// Prior sd of β in its own unit where physics says one (a fifth of the link's mass); `None`: learned from the data.
    pub(super) prior_sd: Option<f64>,
    /// On the first column of a component: the parameters that its coefficients mix to; `None`: the coefficients themselves.
    pub(super) mixture: Option<Mixture>,
}

impl Candidate {
    /// A column whose torque is an expression that dissipates or is otherwise no Lagrangian.
    pub(super) fn torque(
        name: String,
        family: Family,
        unit: impl Into<String>,
        story: String,
        image: Vec<(usize, Id)>,
    ) -> Self {
        Self {
            name,
            family,
            unit: unit.into(),
            story,
            lagrangian: None,
            image,
            model: None,
            prior_sd: None,
            mixture: None,
        }
    }

    /// A column that is the Euler–Lagrange image of `phi`.
    pub(super) fn lagrangian(
        graph: &mut Graph,
        name: String,
        family: Family,
        unit: impl Into<String>,
        story: String,
        phi: Id,
    ) -> Self {
        Self {
            lagrangian: Some(phi),
            ..Self::torque(name, family, unit, story, euler_lagrange(graph, phi))
        }
    }

    /// A column that is made from the robot model.
    pub(super) fn model(
        name: String,
        family: Family,
        unit: impl Into<String>,
        story: String,
        column: ModelColumn,
    ) -> Self {
        Self {
            model: Some(column),
            ..Self::torque(name, family, unit, story, Vec::new())
        }
    }

    /// The same with a prior sd that physics says.
    pub(super) fn within(self, prior_sd: f64) -> Self {
        Self {
            prior_sd: Some(prior_sd),
            ..self
        }
    }
}

/// One component before it is judged: columns that are in or out together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Proposal {
    /// Name of the component.
    pub(super) name: String,
    /// Its columns, at least one.
    pub(super) columns: Vec<Candidate>,
}

impl From<Candidate> for Proposal {
    fn from(candidate: Candidate) -> Self {
        Self {
            name: candidate.name.clone(),
            columns: vec![candidate],
        }
    }
}
