//! What one physical model cannot say of what was written into it, as torque.

use super::{JointChange, Place};
use crate::evaluator::States;
use crate::robot::{Change, Robot};

/// Coefficients of columns that the file holds; 0 of all others.
pub(super) fn held_alone(held: &[Option<Place>], beta: &[f64]) -> Vec<f64> {
    let written = beta.iter().zip(held);
    written
        .map(|(beta, place)| if place.is_some() { *beta } else { 0.0 })
        .collect()
}

/// Torque per joint and state, N·m, by which `before` with the written effects, inertias and gravity acting together, differs from the
/// robot `after` and its dry friction.
pub(super) fn difference(
    states: &States,
    [before, after]: [&Robot; 2],
    joints: &[JointChange],
    held: &[Option<Place>],
    beta: &[f64],
) -> Vec<f64> {
    let (mut change, mut rest) = (Change::default(), held_alone(held, beta));
    for (place, beta) in held.iter().zip(&mut rest) {
        match place {
            Some(Place::Inertia { body, weights }) => {
                let added = weights.map(|weight| *beta * weight);
                change.inertia.push((*body, added));
            }
            Some(Place::Gravity(axis)) => change.gravity[*axis] += *beta,
            _ => continue,
        }
        *beta = 0.0;
    }
    let together = before.changed(&change);
    beyond(states, [&together, after], joints, held, &rest)
}

/// Torque per joint and state, N·m, that `before` + Σ β x has and the robot `after` with its dry friction has not.
pub(super) fn beyond(
    states: &States,
    [before, after]: [&Robot; 2],
    joints: &[JointChange],
    held: &[Option<Place>],
    beta: &[f64],
) -> Vec<f64> {
    // Dry friction is what the file says, in the shape of the column.
    let names = before.joint_names();
    let mut beta: Vec<f64> = beta.to_vec();
    for (beta, place) in beta.iter_mut().zip(held) {
        if let Some(Place::Coulomb(joint)) = place {
            let change = joints.iter().find(|change| change.joint == names[*joint]);
            *beta -= change.and_then(|change| change.friction).unwrap_or(0.0);
        }
    }
    let mut difference = states.torque(&beta);
    let nominal = nominal_difference(states, [before, after]);
    for (d, nominal) in difference.iter_mut().zip(nominal) {
        *d += nominal;
    }
    difference
}

/// Nominal torque per joint and state, N·m, that `before` has and `after` has not.
pub(super) fn nominal_difference(states: &States, [before, after]: [&Robot; 2]) -> Vec<f64> {
    let nominal = states.nominal(before).into_iter();
    let nominal = nominal.zip(states.nominal(after));
    nominal.map(|(before, after)| before - after).collect()
}
