//! What a file cannot say of what was written into it, as torque.

use super::{JointChange, Place};
use crate::evaluator::{States, rms};
use crate::robot::Robot;

/// RMS per joint, N·m, by which the robot `after` and its dry friction differ from `before` + Σ β x of the written columns.
pub(super) fn lost(
    states: &States,
    [before, after]: [&Robot; 2],
    joints: &[JointChange],
    held: &[Option<Place>],
    mut beta: Vec<f64>,
) -> Vec<f64> {
    // Dry friction is what the file says, in the shape of the column.
    let names = before.joint_names();
    for (beta, place) in beta.iter_mut().zip(held) {
        if let Some(Place::Coulomb(joint)) = place {
            let change = joints.iter().find(|change| change.joint == names[*joint]);
            *beta -= change.and_then(|change| change.friction).unwrap_or(0.0);
        }
    }
    let mut difference = states.torque(&beta);
    let nominal = states
        .nominal(before)
        .into_iter()
        .zip(states.nominal(after));
    for (d, (before, after)) in difference.iter_mut().zip(nominal) {
        *d += before - after;
    }
    rms(&difference)
}
