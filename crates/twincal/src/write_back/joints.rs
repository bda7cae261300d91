//! Friction, motor inertia and springs of joints.

use super::{Holds, Place};
use crate::robot::{JointDescription, Robot};
use serde::Serialize;

/// What changes on one joint; each value is the new total beside what else acts on the joint in the nominal model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointChange {
    /// Name of the joint.
    pub joint: String,
    /// Change of viscous friction against the nominal torque's, N·m·s/rad (N·s/m); the sum is not negative.
    pub damping: Option<f64>,
    /// Dry friction, N·m (N), not negative; the nominal torque has none. 0 where the file states one and none was found.
    pub friction: Option<f64>,
    /// Change of motor inertia, kg·m² (kg); the sum is not negative.
    pub armature: Option<f64>,
    /// New stiffness, N·m/rad (N/m), and rest position, rad (m).
    pub spring: Option<[f64; 2]>,
}

impl JointChange {
    /// Makes the change; dry friction has no place in a description.
    pub(super) fn apply(&self, joint: &mut JointDescription) {
        joint.damping += self.damping.unwrap_or(0.0);
        joint.armature += self.armature.unwrap_or(0.0);
        if let Some([stiffness, rest]) = self.spring {
            (joint.stiffness, joint.spring_reference) = (stiffness, rest);
        }
    }
}

/// What columns say of places in a file.
#[derive(Clone, Copy)]
pub(super) struct Said<'a> {
    /// Where each column goes, if it goes into the file.
    pub(super) held: &'a [Option<Place>],
    /// Coefficients of all columns.
    pub(super) beta: &'a [f64],
    /// Places at which the data see nothing.
    pub(super) absent: &'a [Place],
}

/// Changes of all joints that have one; friction that the file states and the data see to be absent becomes 0.
pub(super) fn changes(robot: &Robot, said: Said<'_>, holds: Holds) -> Vec<JointChange> {
    let Said { held, beta, absent } = said;
    let mut changes = Vec::new();
    for (index, name) in robot.joint_names().into_iter().enumerate() {
        let sum = |wanted: Place| -> Option<f64> {
            let own = held.iter().zip(beta);
            let own = own.filter(|(place, _)| place.as_ref() == Some(&wanted));
            own.map(|(_, beta)| *beta).reduce(|a, b| a + b)
        };
        let nominal = robot.joint(index);
        let none =
            |place: Place, stated: f64| (stated != 0.0 && absent.contains(&place)).then_some(0.0);
        let damping = sum(Place::Viscous(index)).map(|beta| beta.max(-nominal.damping));
        let friction = sum(Place::Coulomb(index)).map(|beta| beta.max(0.0));
        let change = JointChange {
            joint: name.to_owned(),
            damping: damping.or_else(|| none(Place::Viscous(index), nominal.unused_damping)),
            friction: friction.or_else(|| none(Place::Coulomb(index), nominal.unused_friction)),
            armature: sum(Place::Armature(index)).map(|beta| beta.max(-nominal.armature)),
            spring: spring(
                nominal,
                sum(Place::Stiffness(index)),
                sum(Place::Preload(index)),
            )
            .filter(|_| holds.more),
        };
        let empty = change.damping.is_none()
            && change.friction.is_none()
            && change.armature.is_none()
            && change.spring.is_none();
        if !empty {
            changes.push(change);
        }
    }
    changes
}

/// Both springs as one: k₀ (q − r) + k q + c = K (q − R) with K = k₀ + k, R = (k₀ r − c)/K.
fn spring(
    nominal: &JointDescription,
    stiffness: Option<f64>,
    preload: Option<f64>,
) -> Option<[f64; 2]> {
    if stiffness.is_none() && preload.is_none() {
        return None;
    }
    let sum = nominal.stiffness + stiffness.unwrap_or(0.0);
    let constant = nominal.stiffness * nominal.spring_reference - preload.unwrap_or(0.0);
    (sum > 0.0).then(|| [sum, constant / sum])
}
