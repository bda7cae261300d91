//! What one physical model cannot say of what was written into it, as torque.

use super::{JointChange, Place, WriteBack};
use crate::error::Result;
use crate::evaluator::States;
use crate::linear_algebra::Cholesky;
use crate::robot::Robot;

/// Torque per joint and state, N·m, by which `before` + Σ β x of the written columns differs from the robot `after` and its
/// dry friction.
pub(super) fn difference(
    states: &States,
    [before, after]: [&Robot; 2],
    joints: &[JointChange],
    held: &[Option<Place>],
    beta: &[f64],
) -> Vec<f64> {
    let written = beta.iter().zip(held);
    let written: Vec<f64> = written
        .map(|(beta, place)| if place.is_some() { *beta } else { 0.0 })
        .collect();
    lacks(states, [before, after], joints, held, &written)
}

/// Torque per joint and state, N·m, that `before` + Σ β x of ALL columns has and the robot `after` with its dry friction has not.
pub(super) fn lacks(
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
    let nominal = states
        .nominal(before)
        .into_iter()
        .zip(states.nominal(after));
    for (d, (before, after)) in difference.iter_mut().zip(nominal) {
        *d += before - after;
    }
    difference
}

/// The gravity with which the changed robot comes nearest to the twin: the columns are torque per unit of gravity on the
/// NOMINAL robot, and in one model changed gravity acts on changed inertias.
pub(super) fn fitted_gravity(
    states: &States,
    nominal: &Robot,
    change: &WriteBack,
    difference: &[f64],
) -> Result<Option<[f64; 3]>> {
    let Some(gravity) = change.gravity else {
        return Ok(None);
    };
    let here = states.nominal(&change.robot(nominal)?);
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for axis in 0..3 {
        let mut moved = change.clone();
        moved.gravity.get_or_insert(gravity)[axis] += 1.0;
        let there = states.nominal(&moved.robot(nominal)?);
        columns.push(there.iter().zip(&here).map(|(a, b)| a - b).collect());
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut normal = vec![0.0; 9];
    let mut right: Vec<f64> = columns.iter().map(|c| dot(c, difference)).collect();
    for i in 0..3 {
        for k in 0..3 {
            normal[3 * i + k] = dot(&columns[i], &columns[k]);
        }
    }
    // What no joint feels stays as it is.
    let size = normal[0] + normal[4] + normal[8];
    (0..3).for_each(|i| normal[4 * i] += 1e-9 * size);
    let Ok(root) = Cholesky::new(&normal, 3) else {
        return Ok(Some(gravity));
    };
    root.solve(&mut right);
    Ok(Some([0, 1, 2].map(|axis| gravity[axis] + right[axis])))
}
