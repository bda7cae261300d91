//! Motions at which candidates are judged and measured: states that have nothing in particular in common.

use std::borrow::Borrow;

/// Position, velocity and acceleration of every joint.
pub(super) type Motions = Vec<[f64; 3]>;

/// Positions, velocities and accelerations of all states, `joint * states + state`.
pub(super) fn channels<S: Borrow<Motions>>(states: &[S], joints: usize) -> [Vec<f64>; 3] {
    std::array::from_fn(|k| {
        (0..joints)
            .flat_map(|joint| states.iter().map(move |state| state.borrow()[joint][k]))
            .collect()
    })
}

/// States that have nothing in particular in common: a Weyl sequence with irrational steps.
pub(super) fn random_motions(joints: usize) -> Vec<Motions> {
    const STATES: usize = 40;
    let value = |state: usize, joint: usize, k: usize| {
        let step = ((3 * joint + k + 2) as f64).sqrt() * std::f64::consts::E;
        2.0 * ((state as f64 + 1.0) * step).fract() - 1.0
    };
    (0..STATES)
        .map(|state| {
            (0..joints)
                .map(|joint| {
                    [
                        3.0 * value(state, joint, 0),
                        2.0 * value(state, joint, 1),
                        5.0 * value(state, joint, 2),
                    ]
                })
                .collect()
        })
        .collect()
}
