//! What every family hands to the library: a named candidate with its torque image.

use super::Family;
use super::expression::{Graph, Id, Variable};

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

    /// q̇ of this joint.
    pub(super) fn velocity(&self, graph: &mut Graph) -> Id {
        graph.variable(Variable::Velocity(self.index))
    }
}

/// One candidate before it is judged.
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
    /// φ(q, q̇) where the term is a Lagrangian.
    pub(super) lagrangian: Option<Id>,
    /// `(joint, torque per unit of β)`, joints ascending; structurally zero joints left out.
    pub(super) image: Vec<(usize, Id)>,
}
