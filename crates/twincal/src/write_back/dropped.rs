//! What the nominal model has on a joint and a format cannot hold: an MJCF's motor inertia and springs, where a URDF is written.

use super::{Holds, Place, Writer};
use crate::evaluator::rms;
use crate::robot::{JointDescription, Robot};
use serde::Serialize;

/// Share of the dropped torque that known columns may leave before its held-out error counts as unknown.
const LEFT: f64 = 1e-3;

/// Motor inertia and spring of one joint of the nominal model that the file is without.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Dropped {
    /// Name of the joint.
    pub joint: String,
    /// Motor inertia, kg·m² (kg).
    pub armature: f64,
    /// Stiffness, N·m/rad (N/m).
    pub stiffness: f64,
    /// Rest position of the spring, rad (m).
    pub spring_reference: f64,
}

/// Torque of what is dropped, in coefficients of the library's columns.
pub(super) struct DroppedTorque {
    /// One per column.
    pub(super) coefficients: Vec<f64>,
    /// Per moving joint: true where the coefficients are that torque.
    pub(super) is_known: Vec<bool>,
}

impl Dropped {
    /// Takes motor inertia and spring from a joint.
    pub(super) fn apply(joint: &mut JointDescription) {
        (joint.armature, joint.stiffness, joint.spring_reference) = (0.0, 0.0, 0.0);
    }
}

/// All joints of the model, moving, mimicking or locked, with a motor inertia or a spring that the format cannot hold.
#[must_use]
pub fn dropped(robot: &Robot, holds: Holds) -> Vec<Dropped> {
    let joints = robot.description().joints.iter();
    let loses = |joint: &&JointDescription| joint.armature != 0.0 || joint.stiffness != 0.0;
    let lost = joints.filter(|joint| !holds.more && loses(joint));
    lost.map(|joint| Dropped {
        joint: joint.name.clone(),
        armature: joint.armature,
        stiffness: joint.stiffness,
        spring_reference: joint.spring_reference,
    })
    .collect()
}

impl Writer<'_> {
    /// Coefficients of the dropped `torque`, `joint * STATES + state`, N·m (N).
    ///
    /// Motor inertia a, stiffness k and rest position r have columns q̈, q and 1 with a, k and −k r where these are candidates; what
    /// is left goes to the columns of inertias, as a motor inertia at the base does, whose column is that of a link's tensor.
    pub(super) fn dropped_coefficients(
        &self,
        dropped: &[Dropped],
        torque: &[f64],
    ) -> DroppedTorque {
        let names = self.calibration.twin.robot.joint_names();
        let mut beta = vec![0.0; self.library.columns().len()];
        if dropped.is_empty() {
            return DroppedTorque {
                coefficients: beta,
                is_known: vec![true; names.len()],
            };
        }
        for own in dropped {
            let Some(joint) = names.iter().position(|name| *name == own.joint) else {
                continue;
            };
            let places = [
                (Place::Armature(joint), own.armature),
                (Place::Stiffness(joint), own.stiffness),
                (Place::Preload(joint), -own.stiffness * own.spring_reference),
            ];
            for (place, value) in places {
                let wanted =
                    |column: &usize| self.place_in(*column, Holds::MJCF).as_ref() == Some(&place);
                if let Some(column) = (0..beta.len()).find(wanted) {
                    beta[column] += value;
                }
            }
        }
        let minus =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        let rest = minus(torque, &self.states.torque(&beta));
        for (beta, more) in beta.iter_mut().zip(self.projected(&rest)) {
            *beta += more;
        }
        let (all, left) = (rms(torque), rms(&minus(torque, &self.states.torque(&beta))));
        let is_known = all.iter().zip(left).map(|(all, left)| left <= LEFT * all);
        DroppedTorque {
            coefficients: beta,
            is_known: is_known.collect(),
        }
    }
}
