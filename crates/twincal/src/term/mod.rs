//! The candidates: one flat list of named columns (paper eq. 2–4, method sections 2 and 3).

use crate::error::{Finding, Result};
use crate::robot::{Motion, Robot};
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

/// Whether a term is a column, and if not, why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Status {
    /// It is a column of the regression.
    Candidate,
    /// Its torque image is a combination of the named terms.
    AliasOf(String),
    /// A total time derivative: torque image 0.
    NullLagrangian,
    /// Zero on all data.
    ZeroColumn,
}

/// One candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// Name as in result.json.
    pub name: String,
    /// Family.
    pub family: Family,
    /// Unit of its coefficient, e.g. `kg·m²`.
    pub unit: String,
    /// Column or not.
    pub status: Status,
}

/// `[library]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LibrarySettings {
    /// User expressions.
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

/// Ordered terms for one robot, ready to be evaluated. Column k of the regression is the k-th term whose status is
/// [`Status::Candidate`].
#[derive(Debug, Clone)]
pub struct Library {
    _private: (),
}

impl Library {
    /// Config terms, generic, viscous, coulomb, offset, motor inertia; nulls and aliases marked.
    pub fn propose(_robot: &Robot, _settings: &LibrarySettings) -> Result<(Self, Vec<Finding>)> {
        todo!()
    }
    /// All terms, dropped ones included, in order.
    pub fn terms(&self) -> &[Term] {
        todo!()
    }
    /// Index in `terms()` of each column.
    pub fn columns(&self) -> &[usize] {
        todo!()
    }
    /// Columns that are structurally non-zero on `joint`, ascending.
    pub fn columns_of_joint(&self, _joint: usize) -> &[usize] {
        todo!()
    }
    /// Marks columns as [`Status::ZeroColumn`] (data-dependent) and drops them.
    pub fn without_columns(&self, _columns: &[usize]) -> Self {
        todo!()
    }
    /// Evaluates every column on every joint where it is structurally non-zero: for joint j and the i-th entry of
    /// `columns_of_joint(j)`, `out[j][i * motion.len + sample]`. N·m per unit of β.
    pub fn evaluate(&self, _motion: Motion<'_>, _out: &mut [Vec<f64>]) {
        todo!()
    }
}
