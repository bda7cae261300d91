//! The program computes what the recursion and the library compute.

use super::columns::{Columns, parameters};
use super::coordinates::{Coordinate, Coordinates};
use super::dynamics;
use super::trace::{Step, Trace, values};
use crate::robot::testing::tree;
use crate::robot::{Motion, nominal_torque, regrouped};
use crate::term::{Family, Function, Library, LibrarySettings};

fn value(t: &Trace, id: u32, q: &[f64]) -> f64 {
    let at = |id: u32| value(t, id, q);
    match t.steps[id as usize] {
        Step::Constant(value) => value,
        Step::Position(joint) => q[joint],
        Step::Add(a, b) => at(a) + at(b),
        Step::Subtract(a, b) => at(a) - at(b),
        Step::Multiply(a, b) => at(a) * at(b),
        Step::Negate(a) => -at(a),
        Step::Apply(function, a) => function.value(at(a)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn equal_steps_are_one_and_constants_fold() {
    let mut t = Trace::default();
    let (x, y) = (t.step(Step::Position(0)), t.step(Step::Position(1)));
    assert_eq!(t.add(x, y), t.add(y, x));
    assert_eq!(t.subtract(x, x), t.number(0.0));
    let zero = t.number(-0.0);
    assert_eq!(t.multiply(zero, y), t.number(0.0));
    let minus = t.scale(-1.0, y);
    assert_eq!(t.add(x, minus), t.subtract(x, y));
    let sum = t.multiply(minus, x);
    let plus = t.multiply(x, y);
    assert_eq!(sum, t.negate(plus));
}

/// sin 2x and cos 2x by products, and derivatives, against closed forms.
#[test]
fn double_angles_and_derivatives_are_those_of_closed_forms() {
    let mut t = Trace::default();
    let (x, y) = (t.step(Step::Position(0)), t.step(Step::Position(1)));
    let double = t.scale(2.0, x);
    let (s, c) = (
        t.apply(Function::Sin, double),
        t.apply(Function::Cos, double),
    );
    let product = t.multiply(s, y);
    let f = t.subtract(product, c);
    let change = t.position_derivative(0, &[f]);
    for (a, b) in [(0.3, -1.2), (2.0, 0.7), (-4.0, 3.0)] {
        let q: [f64; 2] = [a, b];
        let wanted = (2.0 * a).sin() * b - (2.0 * a).cos();
        assert!((value(&t, f, &q) - wanted).abs() < 1e-14);
        let wanted = 2.0 * (2.0 * a).cos() * b + 2.0 * (2.0 * a).sin();
        assert!((value(&t, change[0], &q) - wanted).abs() < 1e-14);
    }
}

/// A state without round numbers.
fn state(joints: usize, which: usize) -> [Vec<f64>; 3] {
    [1.7, 2.3, 4.1].map(|scale: f64| {
        (0..joints)
            .map(|j| scale * (0.3 + 1.9 * j as f64 + 5.7 * scale + 0.77 * which as f64).sin())
            .collect()
    })
}

/// Regrouped parameters give the torque of the batch recursion, which knows nothing of them, and fewer of them are not zero.
#[test]
fn regrouped_parameters_give_the_same_torque() {
    let robot = tree();
    let mut t = Trace::default();
    let moving = dynamics::motion(&mut t, &robot, robot.description().gravity, true);
    let fewer = regrouped(&robot, parameters(&robot));
    let count = |all: &[[f64; 10]]| all.iter().flatten().filter(|x| **x != 0.0).count();
    assert_eq!(count(&parameters(&robot)), 70);
    // Seven of a body that turns, four of one that slides; its tensor goes to its parent.
    assert_eq!(count(&fewer), 5 * 7 + 2 * 4);
    let loads = dynamics::loads(&mut t, &moving, &fewer);
    let torque = dynamics::torque(&mut t, &robot, &moving, loads);
    for which in 0..20 {
        let [q, qd, qdd] = state(robot.dof(), which);
        let mut expected = vec![0.0; robot.dof()];
        let motion = Motion {
            len: 1,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        nominal_torque(&robot, motion, &mut expected);
        let all = values(&t.steps, &q, &qd, &qdd);
        for (joint, expected) in expected.iter().enumerate() {
            let torque = all[torque[joint] as usize];
            assert!(
                (torque - expected).abs() < 1e-10,
                "joint {joint}: {torque} {expected}"
            );
        }
    }
}

/// zᵀ Cov[z] z of the coordinates is βᵀ-side x ᵀ Cov[β] x of the library's columns: a covariance in which every column is tied to
/// every other.
#[test]
fn the_variance_in_coordinates_is_that_in_columns() {
    let robot = tree();
    let settings = LibrarySettings {
        families: vec![
            Family::Payload,
            Family::MassMoments,
            Family::Tensor,
            Family::Viscous,
        ],
        generic: Some(false),
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(&robot, &settings).unwrap();
    let count = library.columns().len();
    let covariance = tied(count);
    let coordinates = Coordinates::new(&robot, &library, &covariance);
    let inertial = coordinates
        .all
        .iter()
        .filter(|c| matches!(c, Coordinate::Parameter(..)));
    assert!(inertial.count() <= 5 * 7 + 2 * 4);
    let mut t = Trace::default();
    let mut columns = Columns::new(&mut t, &robot, &library);
    let steps: Vec<Vec<(usize, u32)>> = (0..coordinates.all.len())
        .map(|which| coordinates.torque(&mut t, &mut columns, which))
        .collect();
    for which in 0..5 {
        let [q, qd, qdd] = state(robot.dof(), which);
        let motion = Motion {
            len: 1,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        let mut out = vec![Vec::new(); robot.dof()];
        library.evaluate(motion, &mut out);
        let all = values(&t.steps, &q, &qd, &qdd);
        for joint in 0..robot.dof() {
            let own = library.columns_of_joint(joint);
            let between = |i: usize, k: usize| covariance[own[i] * count + own[k]];
            let expected = quadratic_form(&out[joint][..own.len()], &between);
            let z: Vec<f64> = (steps.iter())
                .map(|steps| {
                    let step = steps.iter().find(|(j, _)| *j == joint);
                    step.map_or(0.0, |(_, x)| all[*x as usize])
                })
                .collect();
            let variance = quadratic_form(&z, &|a, b| coordinates.covariance(a, b));
            assert!(
                (variance - expected).abs() < 1e-9 * expected,
                "joint {joint}: {variance} {expected}"
            );
        }
    }
}

/// A covariance of `count` columns, each of them tied to every other.
fn tied(count: usize) -> Vec<f64> {
    (0..count * count)
        .map(|k| {
            let (a, b) = (k / count, k % count);
            let tied: f64 = (0..3)
                .map(|f| (((a + 1) * (f + 2)) as f64).sin() * (((b + 1) * (f + 2)) as f64).sin())
                .sum();
            tied + if a == b { 0.1 } else { 0.0 }
        })
        .collect()
}

/// xᵀ C x.
fn quadratic_form(x: &[f64], covariance: &dyn Fn(usize, usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for (a, x_a) in x.iter().enumerate() {
        for (b, x_b) in x.iter().enumerate() {
            sum += x_a * covariance(a, b) * x_b;
        }
    }
    sum
}
