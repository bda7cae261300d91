//! The Euler–Lagrange row is minus the slope of the discrete action: calculus of variations, no derivative of ours.

use super::super::euler_lagrange::euler_lagrange;
use super::super::expression::{Graph, Variable, bounded_values, parse};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Random smooth Lagrangians of two joints, at most four operations deep.
fn lagrangian() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        (-20_i32..20).prop_map(|c| format!("({})", f64::from(c) / 10.0)),
        prop::sample::select(vec!["q1", "q2", "qd1", "qd2"]).prop_map(str::to_owned),
    ];
    leaf.prop_recursive(4, 24, 2, |inner| {
        prop_oneof![
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a} + {b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a} - {b})")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("{a}*{b}")),
            (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("{a}/(2+cos({b}))")),
            (inner.clone(), 2..4_i32).prop_map(|(a, e)| format!("({a})^{e}")),
            (
                prop::sample::select(vec!["sin", "cos", "tanh", "atan"]),
                inner
            )
                .prop_map(|(f, a)| format!("{f}({a})")),
        ]
    })
}

/// q(t) = q + q̇ t + q̈ t²/2 at three neighbouring times; slope of h·(φ₋ + φ₊) with respect to the middle q of `joint`.
fn action_slope(
    phi: impl Fn(&[f64; 2], &[f64; 2]) -> f64,
    motion: &[[f64; 3]; 2],
    joint: usize,
    h: f64,
) -> f64 {
    let at = |t: f64| motion.map(|[q, qd, qdd]| q + qd * t + 0.5 * qdd * t * t);
    let nudge = 1e-4 * h;
    let action = |by: f64| {
        let (before, mut middle, after) = (at(-h), at(0.0), at(h));
        middle[joint] += by;
        let step = |a: &[f64; 2], b: &[f64; 2]| {
            phi(
                &[0, 1].map(|j| 0.5 * (a[j] + b[j])),
                &[0, 1].map(|j| (b[j] - a[j]) / h),
            )
        };
        step(&before, &middle) + step(&middle, &after) // times h, divided by h below
    };
    (action(nudge) - action(-nudge)) / (2.0 * nudge)
}

/// 300 random Lagrangians, fixed seed. The two step sizes tell the discretisation error, so a right operator cannot fail
/// by bad luck of the draw; a wrong sign of any of its three sums fails in most cases (tried).
#[test]
fn row_is_the_variation_of_the_discrete_action() {
    let config = Config {
        cases: 300,
        failure_persistence: None,
        max_global_rejects: 5000,
        ..Config::default()
    };
    let mut runner =
        TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let number = -1.5..1.5;
    let motion = prop::array::uniform2([number.clone(), number.clone(), number]);
    let run = runner.run(&(lagrangian(), motion), |(text, motion)| {
        let mut graph = Graph::default();
        let id = parse(&mut graph, &text, &["a", "b"]).unwrap();
        let image = euler_lagrange(&mut graph, id);
        let value =
            |id: super::super::expression::Id, q: &[f64; 2], qd: &[f64; 2], qdd: &[f64; 2]| {
                let values = bounded_values(&graph, |variable| match variable {
                    Variable::Position(joint) => q[joint],
                    Variable::Velocity(joint) => qd[joint],
                    Variable::Acceleration(joint) => qdd[joint],
                    Variable::History(_) => f64::NAN,
                });
                values[id.0 as usize].value
            };
        for joint in 0..2 {
            let slopes = [4e-3, 2e-3]
                .map(|h| action_slope(|q, qd| value(id, q, qd, &[0.0; 2]), &motion, joint, h));
            let extrapolated = (4.0 * slopes[1] - slopes[0]) / 3.0;
            let (q, qd, qdd) = (
                motion.map(|m| m[0]),
                motion.map(|m| m[1]),
                motion.map(|m| m[2]),
            );
            let row = image
                .iter()
                .find(|(j, _)| *j == joint)
                .map_or(0.0, |&(_, id)| value(id, &q, &qd, &qdd));
            let size = value(id, &q, &qd, &qdd).abs().max(row.abs()).max(1.0);
            let settled = (slopes[0] - slopes[1]).abs() < 1e-2 * size;
            prop_assume!(settled && size < 1e3); // else too wild for these steps
            let tolerance = 1e-6 * size + 0.1 * (slopes[0] - slopes[1]).abs();
            prop_assert!(
                (extrapolated + row).abs() <= tolerance,
                "D_{}({text}) = {row}, action {}",
                joint + 1,
                -extrapolated
            );
        }
        Ok(())
    });
    run.unwrap();
}
