//! The candidates: one flat list of named columns (paper eq. 2–4, method sections 2 and 3).
//!
//! ```text
//! text or family → φ(q, q̇) → D(φ) exactly → nulls and aliases out → one tape for all columns and joints
//! ```
//! One file per family: `viscous.rs` is the shortest, copy it to add one.

mod expression;
mod euler_lagrange;
mod candidate;
mod viscous;
mod coulomb;
mod offset;
mod motor_inertia;
mod user;
mod generic;
mod aliases;
mod words;
mod status;
mod library;
#[cfg(test)]
mod tests;

pub use expression::Scratch;
pub use library::Library;
pub use status::Status;

use serde::{Deserialize, Serialize};

/// Which family a term belongs to; each family has its own Beta–Binomial inclusion prior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// The user's own expressions.
    User,
    /// The built-in trigonometric and polynomial family.
    Generic,
    /// Viscous friction.
    Viscous,
    /// Coulomb friction.
    Coulomb,
    /// Constant torque offset.
    Offset,
    /// Reflected inertia of the motor.
    MotorInertia,
}

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
}

/// `[library]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LibrarySettings {
    /// The user's expressions in ΔL: `+ - * / ^`, `sin cos tan exp log sqrt sinh cosh tanh atan`, `pi`, numbers,
    /// q1…qn and qd1…qdn.
    pub terms: Vec<String>,
    /// Built-in generic family; `None`: on up to 3 joints.
    pub generic: Option<bool>,
    /// Viscous friction per joint.
    pub viscous: bool,
    /// Coulomb friction per joint.
    pub coulomb: bool,
    /// v_s, rad/s or m/s; 0: sign(q̇).
    pub coulomb_velocity: f64,
    /// Torque offset per joint.
    pub offset: bool,
    /// Motor inertia per joint.
    pub motor_inertia: bool,
}
