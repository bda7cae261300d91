//! Nulls, aliases and what is said about them (fault cases 85 and 86, as far as they are structural).

use super::super::{Family, LibrarySettings, Status};
use super::{all, bare, joints, only, planar, status_of};
use crate::error::Code;
use crate::error::{Error, Severity};

fn alias(of: &str) -> Status {
    Status::AliasOf(of.to_owned())
}

#[test]
fn case_85_identical_columns_keep_the_users_expression_then_friction_then_generic() {
    let (library, findings) = planar(2, &all(&["2*q1", "qd2^2*cos(q2)", "qd2^2*cos(q2)"])).unwrap();
    assert_eq!(status_of(&library, "qd1^2"), &alias("joint1.motor_inertia"));
    assert_eq!(status_of(&library, "qd2^2"), &alias("joint2.motor_inertia"));
    assert_eq!(status_of(&library, "joint1.offset"), &alias("2*q1"));
    assert_eq!(status_of(&library, "joint2.offset"), &Status::Candidate);
    let repeated: Vec<(Family, &Status)> = library
        .terms()
        .iter()
        .filter(|t| t.name == "qd2^2*cos(q2)")
        .map(|t| (t.family, &t.status))
        .collect();
    let same = alias("qd2^2*cos(q2)");
    assert_eq!(
        repeated,
        [
            (Family::User, &Status::Candidate),
            (Family::User, &same),
            (Family::Generic, &same)
        ]
    );
    // the user's own loss is a warning of its own, what is built in is one note
    let warned: Vec<&str> = findings
        .iter()
        .filter(|f| f.severity == Severity::Warning)
        .map(|f| f.subject.as_str())
        .collect();
    assert_eq!(warned, ["qd2^2*cos(q2)"]);
    let note = findings
        .iter()
        .find(|f| f.severity == Severity::Note)
        .unwrap();
    assert_eq!((note.code.as_str(), note.count), ("alias", 4));
    assert!(
        note.message.contains("qd1^2 (by joint1.motor_inertia)"),
        "{}",
        note.message
    );
}

#[test]
fn case_86_total_derivatives_are_nulls_with_a_reason() {
    let terms = [
        "qd1",
        "4",
        "qd1*exp(sin(q1))",
        "sin(2*q1) - 2*sin(q1)*cos(q1)",
        "qd1*q2 + q1*qd2",
        "cos(q1)",
    ];
    let (library, findings) = planar(2, &only(&terms)).unwrap();
    for term in &terms[..5] {
        assert_eq!(status_of(&library, term), &Status::NullLagrangian, "{term}");
        let finding = findings.iter().find(|f| f.subject == *term).unwrap();
        assert_eq!(
            (finding.code.as_str(), finding.severity),
            ("null_lagrangian", Severity::Warning)
        );
        let reason = if *term == "4" {
            "it is constant"
        } else {
            "time derivative of a function of q"
        };
        assert!(finding.message.contains(reason), "{}", finding.message);
    }
    assert_eq!(library.columns(), [5]);
    assert_eq!(library.columns_of_joint(0), [0]);
    assert!(library.columns_of_joint(1).is_empty());
}

#[test]
fn combinations_are_found_by_what_they_do_not_by_how_they_are_written() {
    let terms = [
        "sin(q1)^2",
        "cos(q1)^2",
        "sin(q1)*cos(q2)",
        "cos(q1)*sin(q2)",
        "sin(q1+q2)",
        "sin(q1-q2) + qd2*cos(q2)",
        "exp(log(2+q1^2))",
        "q1^2",
    ];
    let (library, findings) = planar(2, &only(&terms)).unwrap();
    for (term, expected) in [
        ("cos(q1)^2", alias("sin(q1)^2")),
        ("sin(q1+q2)", alias("sin(q1)*cos(q2), cos(q1)*sin(q2)")),
        (
            "sin(q1-q2) + qd2*cos(q2)",
            alias("sin(q1)*cos(q2), cos(q1)*sin(q2)"),
        ),
        ("q1^2", alias("exp(log(2+q1^2))")),
    ] {
        assert_eq!(status_of(&library, term), &expected, "{term}");
    }
    assert_eq!(library.columns(), [0, 2, 3, 6]);
    let said = &findings
        .iter()
        .find(|f| f.subject == "cos(q1)^2")
        .unwrap()
        .message;
    assert!(said.contains("-1 × `sin(q1)^2`"), "{said}");
}

#[test]
fn nothing_is_an_alias_that_is_only_similar() {
    // 1e-6 apart: far above rounding
    let (library, _) = planar(
        2,
        &only(&["sin(q1)", "sin(1.000001*q1)", "q1^2", "q1^2 + 1e-7*q1^4"]),
    )
    .unwrap();
    assert_eq!(library.columns().len(), 4);
}

#[test]
fn scales_do_not_matter() {
    let terms = [
        "1e-12*qd1^2",
        "1e12*cos(q1)",
        "1e-200*sin(q1)",
        "cos(q1) + qd1^2",
        "1e5*sin(q1)",
    ];
    let (library, _) = planar(2, &only(&terms)).unwrap();
    assert_eq!(library.columns(), [0, 1, 2]);
    assert_eq!(
        status_of(&library, terms[3]),
        &alias("1e-12*qd1^2, 1e12*cos(q1)")
    );
    assert_eq!(status_of(&library, terms[4]), &alias(terms[2]));
}

#[test]
fn a_term_that_is_nowhere_a_number_is_named() {
    for text in ["log(-1-q1^2)", "sqrt(-2+sin(q2))*qd1^2"] {
        match planar(2, &only(&["cos(q1)", text])) {
            Err(Error::Term { term, problem, .. }) => {
                assert_eq!(term, text);
                assert!(problem.contains("not a finite number"), "{problem}");
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn terms_with_a_domain_are_compared_inside_it() {
    let (library, findings) = planar(
        2,
        &only(&[
            "log(q1)",
            "log(q1^2)",
            "sqrt(q2)",
            "log(q1-9)",
            "q1*log(3)",
            "log(q1-9)*3",
        ]),
    )
    .unwrap();
    assert_eq!(status_of(&library, "log(q1^2)"), &alias("log(q1)"));
    assert_eq!(status_of(&library, "log(q1-9)*3"), &alias("log(q1-9)"));
    assert_eq!(status_of(&library, "q1*log(3)"), &Status::Candidate);
    assert!(
        findings.iter().all(|f| f.code == Code::Alias),
        "{findings:?}"
    );
    // no state at all has both: kept, and said
    let (library, findings) = planar(2, &only(&["log(q1)", "log(-q1)", "cos(q1)"])).unwrap();
    assert_eq!(library.columns().len(), 3);
    assert_eq!(
        findings
            .iter()
            .filter(|f| f.code == Code::AliasUnchecked)
            .count(),
        1
    );
}

#[test]
fn generic_family_of_three_hinges_loses_nothing_but_motor_inertia() {
    for parallel in [true, false] {
        let (library, _) = bare(&joints(&[false; 3]), parallel, &all(&[])).unwrap();
        for term in library
            .terms()
            .iter()
            .filter(|term| term.status != Status::Candidate)
        {
            assert!(matches!(&term.status, Status::AliasOf(_)), "{term:?}");
            assert_eq!(term.family, Family::Generic);
        }
        let dropped = library.terms().len() - library.columns().len();
        assert_eq!(dropped, 3, "parallel {parallel}");
    }
}

#[test]
fn limits_and_empty_libraries_are_settings_errors() {
    let six = joints(&[false; 6]);
    let many = LibrarySettings {
        generic: Some(true),
        ..LibrarySettings::default()
    };
    let empty = only(&[]);
    let nulls = only(&["qd1"]);
    let velocity = LibrarySettings {
        coulomb_velocity: f64::NAN,
        ..all(&[])
    };
    for (settings, key, words) in [
        (&many, "library.generic", "66359 terms for 6 joints"),
        (&empty, "library", "none of its 0 terms"),
        (&nulls, "library", "none of its 1 terms"),
        (&velocity, "library.coulomb_velocity", "NaN"),
    ] {
        match bare(&six, false, settings) {
            Err(Error::Setting {
                key: found,
                problem,
                ..
            }) => {
                assert!(
                    found == key && problem.contains(words),
                    "{found}: {problem}"
                );
            }
            other => panic!("{other:?}"),
        }
    }
    let unasked = LibrarySettings {
        families: vec![Family::Viscous],
        ..LibrarySettings::default()
    };
    let (library, findings) = bare(&six, false, &unasked).unwrap();
    assert_eq!(library.columns().len(), 6);
    assert_eq!(findings[0].code, Code::GenericFamilyOff);
}
