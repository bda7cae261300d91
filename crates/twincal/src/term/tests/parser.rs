//! What the grammar takes, and how it refuses.

use super::super::Family;
use super::super::expression::{Graph, Variable, bounded_values, parse};
use super::{only, planar};
use crate::error::Error;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

fn value(text: &str) -> f64 {
    let mut graph = Graph::default();
    let id = parse(&mut graph, text, &["a", "b"]).unwrap();
    let values = bounded_values(&graph, |variable| match variable {
        Variable::Position(joint) => [0.3, -0.7][joint],
        Variable::Velocity(joint) => [1.1, 0.4][joint],
        Variable::Acceleration(_) | Variable::History(_) => f64::NAN,
    });
    values[id.0 as usize].value
}

fn refused(text: &str) -> (usize, String, String) {
    match planar(2, &only(&[text])) {
        Err(Error::Term {
            column,
            problem,
            remedy,
            ..
        }) => (column, problem, remedy),
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn arithmetic_as_in_school() {
    let (q1, q2, qd1) = (0.3_f64, -0.7_f64, 1.1_f64);
    for (text, expected) in [
        ("1+2*3", 7.0),
        ("2^3^2", 512.0),
        ("-q1^2", -q1 * q1),
        ("2^-1*q1", 0.5 * q1),
        ("q1 - q2 - 1", q1 - q2 - 1.0),
        ("8/2/2*q1", 2.0 * q1),
        ("-(-(q1))", q1),
        ("+q1 - -q2", q1 + q2),
        (" sin ( q1 ) ^ 2 ", q1.sin() * q1.sin()),
        ("1.5e-1*q1 + .5 + 2.", 0.15 * q1 + 2.5),
        ("cos(2*pi)*qd1", qd1),
        ("(q1^2)^0.5", 0.3),
        ("q1*q1*q1/q1^3", 1.0),
        ("qd1^1030/qd1^1029", qd1),
    ] {
        assert!(
            (value(text) - expected).abs() < 1e-14,
            "{text} = {}, not {expected}",
            value(text)
        );
    }
}

#[test]
fn errors_point_at_the_character_and_help() {
    for (text, column, problem, remedy) in [
        ("", 1, "empty", "cos(q1)"),
        (
            "q3^2",
            1,
            "there is no `q3`: the robot has 2 moving joints",
            "use q1 to q2 (q1 = joint1, q2 = joint2)",
        ),
        ("1+qd0", 3, "no `qd0`", "qd1 to qd2"),
        ("q1*qdd1", 4, "no acceleration", "q and qd"),
        ("sin(q1", 4, "never closed", ")"),
        ("sin(q1))", 8, "closes nothing", "delete"),
        ("2q1", 2, "expected an operator", "2*q1*cos(q2)"),
        ("q1 + * q2", 6, "found `*`", "grammar"),
        ("q1 +", 5, "found the end", "complete"),
        ("sen(q1)", 1, "`sen` is unknown", "`sin`"),
        ("cos(thet1)", 5, "unknown", "known are"),
        ("cos(theta1)", 5, "unknown", "`q1`"),
        ("dq2^2", 1, "unknown", "`qd2`"),
        ("joint2^2", 1, "unknown", "joint `joint2` is q2"),
        ("abs(q1)", 1, "unknown", "twice differentiable"),
        ("ln(q1)", 1, "unknown", "`log`"),
        ("cos*q1", 1, "needs an argument", "cos(q1)"),
        ("q1^q2", 4, "exponent must be a number", "exp(b*log(a))"),
        ("q1**2", 4, "`**`", "`^`"),
        ("q1/0", 3, "division by zero", ""),
        ("0^-1", 3, "zero to a negative power", ""),
        ("log(-1)*q1", 1, "NaN", ""),
        ("1e999*q1", 1, "not a number that fits", "1e-3"),
        ("1e200*1e200*q1", 1, "not a finite number", ""),
        ("é*q1", 1, "unknown", ""),
        ("2*(q1-é)", 7, "unknown", ""),
        ("q1 + cos(q2) + $", 16, "found `$`", ""),
        ("q1\u{1b}[31m", 3, "found `\\u{1b}`", ""),
    ] {
        let (at, said, help) = refused(text);
        assert!(
            at == column && said.contains(problem) && help.contains(remedy),
            "{text}: column {at}: {said}; {help}"
        );
    }
}

#[test]
fn depth_and_length_are_limited() {
    let deep = |open: &str, n: usize, close: &str| open.repeat(n) + "q1" + &close.repeat(n);
    for text in [
        deep("(", 100_000, ")"),
        deep("-", 100_000, ""),
        deep("sin(", 100_000, ")"),
        "2^".repeat(100_000) + "2",
    ] {
        let (_, said, _) = refused(&text);
        assert!(said.contains("characters, the limit is 10000"), "{said}");
    }
    for text in [
        deep("(", 101, ")"),
        deep("-", 101, ""),
        deep("sin(", 101, ")"),
        "2^".repeat(101) + "2",
    ] {
        let (_, said, _) = refused(&text);
        assert!(said.contains("nested deeper than 100 levels"), "{said}");
    }
    assert!(
        planar(
            2,
            &only(&[&deep("(", 99, ")"), &("q1+".repeat(3000) + "q2^2")])
        )
        .is_ok()
    );
}

#[test]
fn derivatives_that_explode_are_refused_and_not_computed() {
    // 900 different factors: the second derivative has 810 000 products of 900
    let factors: Vec<String> = (0..900).map(|i| format!("(qd1+{i})")).collect();
    let (_, said, _) = refused(&factors.join("*"));
    assert!(said.contains("more than two million operations"), "{said}");
}

/// 3000 random strings of the grammar's own pieces, fixed seed: an answer or an error, never a panic.
#[test]
fn random_text_never_panics() {
    let config = Config {
        cases: 3000,
        failure_persistence: None,
        ..Config::default()
    };
    let mut runner =
        TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let piece = r"(q1|q2|qd1|qd2|q9|sin\(|log\(|sqrt\(|exp\(|tan\(|\(|\)|\+|-|\*|/|\^|2|0|1e9|\.|pi|e| |é|\PC){0,14}";
    runner
        .run(&proptest::string::string_regex(piece).unwrap(), |text| {
            let mut settings = only(&[&text]);
            settings.families = vec![Family::MotorInertia];
            match planar(2, &settings) {
                Ok((library, _)) => assert_eq!(library.terms()[0].name, text),
                Err(error) => assert!(matches!(error, Error::Term { .. }), "{text}: {error}"),
            }
            Ok(())
        })
        .unwrap();
}
