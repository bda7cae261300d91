//! Torque images and Lagrangians against SymPy (`tests/reference/term/make.py`).

use super::super::euler_lagrange::euler_lagrange;
use super::super::expression::{
    Graph, Id, Slot, Tape, TapeScratch as Scratch, Variable, bounded_values, parse,
};
use super::super::{Family, LibrarySettings};
use super::{only, planar};
use crate::robot::Motion;
use serde::Deserialize;

#[derive(Deserialize)]
struct Reference {
    joints: usize,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    expression: String,
    states: Vec<State>,
}

#[derive(Deserialize)]
struct State {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    phi: f64,
    torque: Vec<f64>,
}

fn reference() -> Reference {
    let text = include_str!(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/reference/term/euler_lagrange.json"
    ));
    serde_json::from_str(text).unwrap()
}

/// Relative to the value where it is large, absolute below 1.
fn assert_close(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() <= 1e-13 * expected.abs().max(1.0) * 10.0,
        "{what}: {found:e}, SymPy {expected:e}"
    );
}

#[test]
fn thirty_lagrangians_have_sympys_torque() {
    let reference = reference();
    let names = vec!["joint"; reference.joints];
    let mut compared = 0;
    for case in &reference.cases {
        let mut graph = Graph::default();
        let phi = parse(&mut graph, &case.expression, &names).unwrap();
        let image = euler_lagrange(&mut graph, phi);
        let out = batch(&graph, &image, case, reference.joints);
        for (s, state) in case.states.iter().enumerate() {
            // and the scalar walk with its error bound
            let values = bounded_values(&graph, |variable| match variable {
                Variable::Position(joint) => state.q[joint],
                Variable::Velocity(joint) => state.qd[joint],
                Variable::Acceleration(joint) => state.qdd[joint],
                Variable::History(_) => f64::NAN,
            });
            for joint in 0..reference.joints {
                let what = format!("D_{}({}) at state {s}", joint + 1, case.expression);
                assert_close(out[joint][s], state.torque[joint], &what);
                let walked = image
                    .iter()
                    .find(|(j, _)| *j == joint)
                    .map(|(_, id)| values[id.0 as usize]);
                if let Some(walked) = walked {
                    // the reference is itself rounded once
                    let bound = walked.error + f64::EPSILON * state.torque[joint].abs();
                    assert!(
                        (walked.value - state.torque[joint]).abs() <= bound,
                        "{what}: outside its error bound"
                    );
                }
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 30 * 4 * 3);
}

/// Torque of every joint by the tape, all states in one batch.
fn batch(graph: &Graph, image: &[(usize, Id)], case: &Case, joints: usize) -> Vec<Vec<f64>> {
    let outputs: Vec<_> = image
        .iter()
        .map(|&(joint, id)| {
            (
                id,
                Slot {
                    table: joint,
                    row: 0,
                },
            )
        })
        .collect();
    let tape = Tape::new(graph, &outputs);
    let len = case.states.len();
    let rows = |pick: fn(&State) -> &Vec<f64>| -> Vec<f64> {
        (0..joints)
            .flat_map(|j| case.states.iter().map(move |state| pick(state)[j]))
            .collect()
    };
    let (q, qd, qdd) = (rows(|s| &s.q), rows(|s| &s.qd), rows(|s| &s.qdd));
    let mut out = vec![vec![0.0; len]; joints];
    tape.evaluate(
        Motion {
            len,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        },
        len,
        &mut out,
        &mut Scratch::default(),
    );
    out
}

#[test]
fn the_lagrangian_itself_is_sympys() {
    let reference = reference();
    // motor inertia keeps the library alive where the expression is a total derivative
    let settings = |text: &str| LibrarySettings {
        families: vec![Family::MotorInertia],
        ..only(&[text])
    };
    for case in &reference.cases {
        let (library, _) = planar(reference.joints, &settings(&case.expression)).unwrap();
        for state in &case.states {
            let phi = library.lagrangian(0, &state.q, &state.qd).unwrap();
            assert_close(phi, state.phi, &case.expression);
        }
    }
}
