//! Torque error of a model file, as it was and as it is written: its RMSE on the held-out rows, with the friction that it states.

use super::dropped::DroppedTorque;
use super::{Place, WriteBack, Writer};
use crate::evaluator::STATES;
use crate::linear_algebra::Cholesky;
use crate::term::ModelColumn;
use crate::validate::WORSE;
use serde::Serialize;

/// Share of the normal equations' diagonal that is added to it: columns depend on each other.
const RIDGE: f64 = 1e-10;

/// Torque error of one joint on the moving held-out rows, N·m (N).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointTorqueError {
    /// Name of the joint.
    pub joint: String,
    /// RMSE of the user's file: nominal torque with the damping and the friction that the file states. `None` without rows, or where it states
    /// friction of a kind that was no candidate.
    pub rms_before: Option<f64>,
    /// RMSE of the written file, likewise; `None` also where no candidate has the torque that the format cannot hold.
    pub rms: Option<f64>,
}

impl JointTorqueError {
    /// Both errors, `[rms_before, rms]`, where the written file is worse than the user's by more than 2 %.
    #[must_use]
    pub fn worse(&self) -> Option<[f64; 2]> {
        let (before, after) = self.rms_before.zip(self.rms)?;
        (after > WORSE * before).then_some([before, after])
    }
}

/// What the file holds, in coefficients.
pub(super) struct InFile<'a> {
    /// Places of the columns that it holds.
    pub(super) held: &'a [Option<Place>],
    /// Coefficients of these columns.
    pub(super) coefficients: &'a [f64],
    /// Torque by which the file differs from the sum of these columns, as [`super::lost::beyond`] has it.
    pub(super) lost: &'a [f64],
    /// What the file is without of the nominal model.
    pub(super) dropped: &'a DroppedTorque,
}

impl Writer<'_> {
    /// Errors of all joints.
    pub(super) fn torque_error(
        &self,
        change: &WriteBack,
        file: &InFile<'_>,
    ) -> Vec<JointTorqueError> {
        let robot = &self.calibration.twin.robot;
        let moments = &self.calibration.validation.moments;
        let mut after = self.projected(file.lost);
        let held = file.held.iter().zip(&file.dropped.coefficients);
        for ((after, written), (place, dropped)) in
            after.iter_mut().zip(file.coefficients).zip(held)
        {
            let written = if place.is_some() { *written } else { 0.0 };
            *after = written - *after - dropped;
        }
        let mut before = vec![0.0; after.len()];
        let named = robot.joint_names().into_iter().enumerate();
        let errors = named.map(|(joint, name)| {
            let changed = change.joints.iter().find(|own| own.joint == name);
            let stated = robot.joint(joint);
            let frictions = [
                (
                    self.column_at(&Place::Viscous(joint)),
                    stated.unused_damping,
                    changed.and_then(|own| own.damping),
                ),
                (
                    self.column_at(&Place::Coulomb(joint)),
                    stated.unused_friction,
                    changed.and_then(|own| own.friction),
                ),
            ];
            let mut known = [true, true];
            for (column, stated, new) in frictions {
                match column {
                    Some(column) => {
                        before[column] = stated;
                        after[column] = new.unwrap_or(stated);
                    }
                    None => known = known.map(|known| known && stated == 0.0),
                }
            }
            let error = |known: bool, beta: &[f64]| {
                let own = moments.get(joint).filter(|_| known)?;
                own.rms(beta)
            };
            JointTorqueError {
                joint: name.to_owned(),
                rms_before: error(known[0], &before),
                rms: error(known[1] && file.dropped.is_known[joint], &after),
            }
        });
        errors.collect()
    }

    /// The column whose coefficient goes there.
    fn column_at(&self, place: &Place) -> Option<usize> {
        (0..self.library.columns().len()).find(|column| self.place(*column).as_ref() == Some(place))
    }

    /// Coefficients of the columns of inertias and gravity whose torque is nearest to `torque`, `joint * STATES + state`, over states within the training
    /// range; 0 of all others.
    pub(super) fn projected(&self, torque: &[f64]) -> Vec<f64> {
        let columns = self.library.columns().len();
        let is_inertial = |column| {
            matches!(
                self.library.model_column(column),
                Some(ModelColumn::Inertia { .. } | ModelColumn::Gravity { .. })
            )
        };
        let inertial: Vec<usize> = (0..columns).filter(|column| is_inertial(*column)).collect();
        let mut nearest = vec![0.0; columns];
        let (mut normal, mut right) = (vec![0.0; inertial.len().pow(2)], vec![0.0; inertial.len()]);
        for (joint, torque) in torque.chunks_exact(STATES).enumerate() {
            let own: Vec<(usize, &[f64])> = (inertial.iter().enumerate())
                .filter_map(|(i, column)| Some((i, self.states.column(joint, *column)?)))
                .collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for (i, x) in &own {
                right[*i] += dot(x, torque);
                for (k, other) in &own {
                    normal[i * inertial.len() + k] += dot(x, other);
                }
            }
        }
        for i in 0..inertial.len() {
            let own = &mut normal[i * inertial.len() + i];
            *own = if *own > 0.0 {
                *own * (1.0 + RIDGE)
            } else {
                1.0
            };
        }
        if let Ok(root) = Cholesky::new(&normal, inertial.len()) {
            root.solve(&mut right);
            for (column, value) in inertial.iter().zip(&right) {
                nearest[*column] = *value;
            }
        }
        nearest
    }
}
