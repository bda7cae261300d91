//! Effects that multiply each other: where the torque of the robot model is linearised.
//!
//! Gravity acts on masses, a drive constant on all torque of its joint, a joint zero on the torque of gravity: torque is linear in each of them, not in
//! all together. With β* the coefficients that a fit found, θ their inertias, gravity and zeros, and g_j the drive gains of joint j,
//!
//! ```text
//! τ_j(β) = (1 + g_j) τ_j(θ) + …  ≈  τ_j(θ*) + (1 + g_j*) Σ_k ∂τ_j/∂θ_k(θ*) (θ_k − θ_k*) + g_j τ_j(θ*) + …
//! ```
//! This is linear in β again, with columns of the changed robot and a torque that no coefficient moves, the products. The error is
//! one of second order in β − β*: after one or two fits there is none that counts. Coefficients keep their meaning, deviations from the model.

use super::model_column::ModelColumn;
use crate::robot::{Change, Robot};

/// Coefficients about which a library is linearised.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Linearisation {
    /// Of every term; 0 where it moves nothing.
    values: Vec<f64>,
    /// What they make of the robot, and without what it carries.
    change: [Change; 2],
    /// 1 + g_j.
    gain: Vec<f64>,
}

/// One term as this sees it.
pub(super) struct Moved<'a> {
    pub(super) column: &'a ModelColumn,
    pub(super) value: f64,
    pub(super) is_payload: bool,
}

impl Linearisation {
    /// `terms`: those of the robot model, in the place of the others `None`.
    pub(super) fn new<'a>(joints: usize, terms: impl Iterator<Item = Option<Moved<'a>>>) -> Self {
        let mut all = Self {
            values: Vec::new(),
            change: Default::default(),
            gain: vec![1.0; joints],
        };
        for term in terms {
            let moved = term.filter(|term| term.value != 0.0);
            all.values
                .push(moved.as_ref().map_or(0.0, |term| term.value));
            let Some(Moved {
                column,
                value,
                is_payload,
            }) = moved
            else {
                continue;
            };
            match column {
                ModelColumn::Inertia { body, weights } => {
                    let added = (*body, weights.map(|weight| value * weight));
                    all.change[0].inertia.push(added);
                    if !is_payload {
                        all.change[1].inertia.push(added);
                    }
                }
                ModelColumn::Gravity { axis } => {
                    all.change
                        .iter_mut()
                        .for_each(|change| change.gravity[*axis] += value);
                }
                ModelColumn::PositionDerivative { joint } => {
                    all.change
                        .iter_mut()
                        .for_each(|change| change.zero.push((*joint, value)));
                }
                ModelColumn::Nominal { joint: Some(joint) } => all.gain[*joint] += value,
                ModelColumn::Nominal { joint: None } => {
                    all.gain.iter_mut().for_each(|gain| *gain += value);
                }
                // Its coefficient is none of the robot's numbers.
                ModelColumn::LoadFriction { .. } => {
                    if let Some(last) = all.values.last_mut() {
                        *last = 0.0;
                    }
                }
            }
        }
        all
    }

    /// The robot with the effects, in a log where the payload acts or does not.
    pub(super) fn robot(&self, robot: &Robot, payload_acts: bool) -> Robot {
        robot.changed(&self.change[usize::from(!payload_acts)])
    }

    /// Whether the payload is one of the effects.
    pub(super) fn carries(&self) -> bool {
        self.change[0] != self.change[1]
    }

    /// What a column of the robot model is multiplied with on a joint.
    pub(super) fn factor(&self, column: &ModelColumn, joint: usize) -> f64 {
        match column {
            ModelColumn::Nominal { .. } | ModelColumn::LoadFriction { .. } => 1.0,
            _ => self.gain[joint],
        }
    }

    /// θ_k* of a term that is one of the robot's numbers; 0 of all others.
    pub(super) fn taken_off(&self, term: usize, column: Option<&ModelColumn>) -> f64 {
        match column {
            Some(ModelColumn::Nominal { .. } | ModelColumn::LoadFriction { .. }) | None => 0.0,
            Some(_) => self.values[term],
        }
    }

    /// Drive gain of a joint, 1 + g.
    pub(super) fn gain(&self, joint: usize) -> f64 {
        self.gain[joint]
    }
}
