//! The candidates: one flat list of named columns (paper eq. 2–4, method sections 2 and 3).
//!
//! ```text
//! text or family → φ(q, q̇) → D(φ) exactly → nulls and aliases out → one tape for all columns and joints
//! ```
//! One file per family: `viscous.rs` is the shortest that is an expression, `gain.rs` the shortest that is made from the
//! robot model; copy one to add a family. A family proposes components: a component is one physical story (a payload,
//! one joint's spring), in or out of the model with all its columns.

mod expression;
mod euler_lagrange;
mod motions;
mod table;
mod course;
mod family;
mod model_column;
mod recipes;
mod parts;
mod body;
mod parameter;
mod mixture;
mod candidate;
mod viscous;
mod coulomb;
mod offset;
mod motor_inertia;
mod directions;
mod payload;
mod density;
mod mass_moments;
mod tensor;
mod inertial;
mod base_tilt;
mod spring;
mod potential;
mod asymmetry;
mod stribeck;
mod hysteresis;
mod warm_up;
mod quadratic_friction;
mod load_friction;
mod coupled_friction;
mod coupled_inertia;
mod gain;
mod encoder_zero;
mod ripple;
mod user;
mod generic;
mod aliases;
mod words;
mod status;
mod component;
mod sentence;
mod propose;
mod overlaps;
mod verdicts;
mod library;
mod linearisation;
#[cfg(test)]
mod tests;

pub use component::Component;
pub use course::Course;
pub use expression::Function;
pub(crate) use expression::{Graph, Id as GraphId, Node, Variable};
pub use family::Family;
pub use library::Library;
pub(crate) use model_column::ModelColumn;
pub use model_column::Scratch;
pub(crate) use overlaps::levels;
pub(crate) use parameter::Before;
pub use parameter::Parameter;
pub(crate) use payload::MASS as PAYLOAD_MASS;
pub use recipes::Recipes;
pub use sentence::{Estimate, is_place, told};
pub use status::Status;
pub(crate) use stribeck::STRIBECK_VELOCITY;
pub use table::Table;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// Name as in result.json: the user's expression verbatim, a generic expression, or `<joint>.viscous`,
    /// `<joint>.coulomb`, `<joint>.offset`, `<joint>.motor_inertia`.
    pub name: String,
    /// Family.
    pub family: Family,
    /// Unit of its coefficient, e.g. `kg·m²`: J divided by the unit of the expression.
    pub unit: String,
    /// Column or not.
    pub status: Status,
    /// Index in [`Library::components`] of the component that it belongs to.
    pub component: usize,
}

/// `[library]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LibrarySettings {
    /// The user's expressions in ΔL: `+ - * / ^`, `sin cos tan exp log sqrt sinh cosh tanh atan`, `pi`, numbers,
    /// q1…qn and qd1…qdn.
    pub terms: Vec<String>,
    /// Built-in generic family; `None`: on up to 3 joints.
    pub generic: Option<bool>,
    /// Families that are proposed, beside `terms` and the generic one; order and repetition do not matter.
    pub families: Vec<Family>,
    /// v_s, rad/s or m/s; 0: sign(q̇).
    pub coulomb_velocity: f64,
    /// Link in whose frame the payload is described; `None`: the last link.
    pub payload_frame: Option<String>,
    /// Total viscous friction, Coulomb friction and motor inertia of a joint, the model's included, are at least 0.
    pub nonnegative: bool,
    /// Periods of gear ripple per turn (per metre for a slider) by joint; joints without an entry have none.
    pub ripple: BTreeMap<String, f64>,
    /// Coefficients by name of their term about which columns of the robot model are linearised; empty: the model as it is. Found by
    /// [`crate::calibrate::calibrate`], where effects that multiply each other are found together.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub linearised_at: BTreeMap<String, f64>,
}

impl LibrarySettings {
    /// True if the family is switched on.
    pub fn has(&self, family: Family) -> bool {
        self.families.contains(&family)
    }
}
