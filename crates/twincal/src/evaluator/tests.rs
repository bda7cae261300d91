//! The program computes what the recursion and the library compute.

use super::trace::{Step, Trace};
use crate::term::Function;

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
