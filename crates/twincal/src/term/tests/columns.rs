//! Order, names, units and values of the columns.

use super::super::candidate::Joint;
use super::super::expression::{Graph, Slot, Tape, TapeScratch, Variable, bounded_values, parse};
use super::super::{Family, Scratch, Status, Term};
use super::{all, bare, joints, only, planar};
use crate::robot::Motion;

#[test]
fn order_and_names_are_the_contract() {
    let (library, _) = planar(2, &all(&["q2^4"])).unwrap();
    let names: Vec<&str> = library
        .terms()
        .iter()
        .map(|term| term.name.as_str())
        .collect();
    assert_eq!(
        (names.len(), names[0], names[1], names[17]),
        (26, "q2^4", "qd1^2", "q2^2")
    );
    assert_eq!(
        names[18..],
        [
            "joint1.viscous",
            "joint2.viscous",
            "joint1.coulomb",
            "joint2.coulomb",
            "joint1.offset",
            "joint2.offset",
            "joint1.motor_inertia",
            "joint2.motor_inertia"
        ]
    );
    let units: Vec<&str> = [0, 1, 10, 16, 18, 20, 22, 24]
        .map(|k| library.terms()[k].unit.as_str())
        .to_vec();
    assert_eq!(
        units,
        [
            "N·m/rad³",
            "kg·m²",
            "N·m",
            "N·m/rad",
            "N·m·s/rad",
            "N·m",
            "N·m",
            "kg·m²"
        ]
    );
    assert!(library.columns().is_sorted());
}

#[test]
fn sliders_have_their_own_units() {
    let (library, _) = bare(&joints(&[false, true]), false, &all(&[])).unwrap();
    let unit = |name: &str| {
        library
            .terms()
            .iter()
            .find(|term| term.name == name)
            .unwrap()
            .unit
            .clone()
    };
    for (name, expected) in [
        ("joint2.viscous", "N·s/m"),
        ("joint2.coulomb", "N"),
        ("joint2.offset", "N"),
        ("joint2.motor_inertia", "kg"),
        ("qd1^2*q2^2", "kg"),
        ("qd1^2*q2", "kg·m"),
        ("qd1*qd2", "kg·m"),
        ("cos(q1)*q2", "N"),
        ("q2^2", "N/m"),
    ] {
        assert_eq!(unit(name), expected, "{name}");
    }
}

/// A deterministic motion that visits everything.
fn motion(n: usize, len: usize) -> [Vec<f64>; 3] {
    let wave = |step: f64| {
        (0..n * len)
            .map(|i| 2.0 * (i as f64 * step + 0.3).sin())
            .collect()
    };
    [wave(0.37), wave(0.53), wave(0.71)]
}

#[test]
fn built_in_columns_are_what_they_say() {
    for (v_s, expected) in [
        (0.0, [0.0, 1.0, -1.0]),
        (0.5, [0.0, 0.8_f64.tanh(), (-2e-9_f64).tanh()]),
    ] {
        let mut settings = all(&[]);
        settings.generic = Some(false);
        settings.coulomb_velocity = v_s;
        let (library, _) = planar(1, &settings).unwrap();
        let (q, qd, qdd) = ([1.0, 2.0, 3.0], [0.0, 0.4, -1e-9], [5.0, -6.0, 7.0]);
        let mut out = [Vec::new()];
        library.evaluate(
            Motion {
                len: 3,
                q: &q,
                qd: &qd,
                qdd: &qdd,
            },
            &mut out,
        );
        assert_eq!(library.columns_of_joint(0), [0, 1, 2, 3]);
        let columns: Vec<&[f64]> = out[0].chunks(3).collect();
        assert_eq!(
            (columns[0], columns[2], columns[3]),
            (&qd[..], &[1.0; 3][..], &qdd[..])
        );
        for sample in 0..3 {
            assert!(
                (columns[1][sample] - expected[sample]).abs() <= 1e-15,
                "v_s = {v_s}"
            );
        }
        // Lagrangian of the offset is −q, of the motor ½ q̇², friction has none
        assert_eq!(library.lagrangian(2, &[3.0], &[0.0]), Some(-3.0));
        assert_eq!(library.lagrangian(3, &[0.0], &[4.0]), Some(8.0));
        assert_eq!(library.lagrangian(0, &[0.0], &[4.0]), None);
    }
}

/// q̇ |q̇| in both directions, whatever v_s is, and its units on a hinge and a slider.
#[test]
fn quadratic_friction_is_the_square_of_the_speed_against_the_motion() {
    let mut settings = only(&[]);
    settings.families = vec![Family::QuadraticFriction];
    settings.coulomb_velocity = 0.5;
    let (library, _) = bare(&joints(&[false, true]), false, &settings).unwrap();
    let qd = [0.3, -2.0, 0.0, -0.3, 4.0, 1e-3];
    let mut out = [Vec::new(), Vec::new()];
    let zeros = [0.0; 6];
    let motion = Motion {
        len: 3,
        q: &zeros,
        qd: &qd,
        qdd: &zeros,
    };
    library.evaluate(motion, &mut out);
    for (got, v) in out.concat().iter().zip(qd) {
        assert!((got - v * v.abs()).abs() < 1e-15, "{got} at {v}");
    }
    let units: Vec<&str> = library.terms().iter().map(|term| &*term.unit).collect();
    assert_eq!(units, ["N·m·s²/rad²", "N·s²/m²"]);
    assert_eq!(library.lagrangian(0, &[0.0; 2], &[1.0; 2]), None);
    assert!(!Family::QuadraticFriction.turns_round() && Family::QuadraticFriction.is_friction());
}

/// Kinetic energy ½ (q̇₂ ± q̇₃)² of a rotor: its acceleration on both joints, on the second with the sign.
#[test]
fn a_coupled_rotor_is_accelerated_by_both_joints() {
    let mut settings = only(&[]);
    settings.families = vec![Family::CoupledInertia];
    let (library, _) = bare(&joints(&[false; 6]), false, &settings).unwrap();
    let pairs = [(3, 4, 1.0), (3, 4, -1.0), (4, 5, 1.0), (4, 5, -1.0)];
    let names: Vec<String> = pairs
        .iter()
        .map(|(a, b, sign)| {
            let mark = if *sign > 0.0 { '+' } else { '-' };
            format!("joint{}{mark}joint{}.coupled_inertia", a + 1, b + 1)
        })
        .collect();
    let terms = library.terms();
    assert!(terms.iter().map(|term| &term.name).eq(&names));
    assert!(terms.iter().all(|term| term.unit == "kg·m²"));
    let qd = [0.1, 0.2, -0.3, 0.7, -1.1, 1.9];
    let qdd = [5.0, -6.0, 7.0, 0.25, -3.0, 2.0];
    let mut out = [const { Vec::new() }; 6];
    let motion = Motion {
        len: 1,
        q: &[0.4; 6],
        qd: &qd,
        qdd: &qdd,
    };
    library.evaluate(motion, &mut out);
    for (column, (a, b, sign)) in pairs.into_iter().enumerate() {
        let turned = qdd[a] + sign * qdd[b];
        for (joint, torque) in out.iter().enumerate() {
            let place = library
                .columns_of_joint(joint)
                .iter()
                .position(|c| *c == column);
            let expected = [(a, turned), (b, sign * turned)].into_iter();
            let expected = expected.into_iter().find(|(of, _)| *of == joint);
            let got = place.map(|place| (joint, torque[place]));
            assert_eq!(got, expected, "{} on joint {joint}", names[column]);
        }
        let speed = qd[a] + sign * qd[b];
        let energy = library.lagrangian(column, &[0.4; 6], &qd).unwrap();
        assert!((energy - 0.5 * speed * speed).abs() < 1e-15);
    }
}

#[test]
fn any_batch_length_gives_the_same_bytes() {
    let (library, _) = planar(
        2,
        &all(&["log(3+sin(q1))*qd2^2/(1+q2^2)", "(1.5+cos(q1))^0.5"]),
    )
    .unwrap();
    let len = 150;
    let channels = motion(2, len);
    let mut whole = vec![Vec::new(); 2];
    library.evaluate(of(&channels), &mut whole);
    let mut scratch = Scratch::default();
    for step in [1, 7, 64, 65, 149] {
        let mut start = 0;
        while start < len {
            let width = step.min(len - start);
            let some = channels.each_ref().map(|x| -> Vec<f64> {
                (0..2)
                    .flat_map(|joint| x[joint * len + start..][..width].to_vec())
                    .collect()
            });
            let mut out = vec![vec![f64::NAN; 3]; 2];
            library.evaluate_with(of(&some), &mut out, &mut scratch);
            for joint in 0..2 {
                for i in 0..library.columns_of_joint(joint).len() {
                    let expected = &whole[joint][i * len + start..][..width];
                    assert_eq!(
                        &out[joint][i * width..][..width],
                        expected,
                        "joint {joint} entry {i} from {start}"
                    );
                }
            }
            start += width;
        }
    }
    library.evaluate(of(&Default::default()), &mut whole);
    assert!(whole.iter().all(Vec::is_empty));
}

/// A motion of two joints.
fn of([q, qd, qdd]: &[Vec<f64>; 3]) -> Motion<'_> {
    Motion {
        len: q.len() / 2,
        q,
        qd,
        qdd,
    }
}

#[test]
fn the_tape_computes_what_the_graph_says() {
    // every instruction: all functions, negative and real powers, division, shared parts, constants
    let text = "tan(q1/9)*qd1^-3 + exp(q2)/(q1+5) - log(9+q1) + sqrt(4+q2)*sinh(q1)*cosh(q2) + tanh(q1)^7 + atan(q2) \
                - 1/(qd2*(3+q1)) + (5+q2)^1.5 + 2*(q1+q2)^2 - q1 - 3 + cos(q1+q2)*sin(q1+q2)*sin(q1)";
    let mut graph = Graph::default();
    let id = parse(&mut graph, text, &["a", "b"]).unwrap();
    let tape = Tape::new(&graph, &[(id, Slot { table: 0, row: 0 })]);
    let len = 131;
    let [q, qd, qdd] = motion(2, len);
    let mut out = [vec![0.0; len]];
    tape.evaluate(
        Motion {
            len,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        },
        len,
        &mut out,
        &mut TapeScratch::default(),
    );
    for sample in 0..len {
        let values = bounded_values(&graph, |variable| match variable {
            Variable::Position(joint) => q[joint * len + sample],
            Variable::Velocity(joint) => qd[joint * len + sample],
            Variable::Acceleration(joint) => qdd[joint * len + sample],
            Variable::History(_) => f64::NAN,
        });
        let walked = values[id.0 as usize];
        // two evaluation orders: both within the bound
        assert!(
            (out[0][sample] - walked.value).abs() <= 2.0 * walked.error,
            "sample {sample}"
        );
    }
}

#[test]
fn zero_columns_leave_and_the_others_move_up() {
    let (library, _) = planar(2, &all(&[])).unwrap();
    let len = 70;
    let [q, qd, qdd] = motion(2, len);
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut before = vec![Vec::new(); 2];
    library.evaluate(motion, &mut before);
    let rest = library.without_columns(&[0, 3]);
    assert_eq!(rest.columns().len(), library.columns().len() - 2);
    for gone in [0, 3] {
        assert_eq!(
            rest.terms()[library.columns()[gone]].status,
            Status::ZeroColumn
        );
    }
    let mut after = vec![Vec::new(); 2];
    rest.evaluate(motion, &mut after);
    for joint in 0..2 {
        for (i, &column) in rest.columns_of_joint(joint).iter().enumerate() {
            let old = library
                .columns()
                .iter()
                .position(|&term| term == rest.columns()[column])
                .unwrap();
            let at = library
                .columns_of_joint(joint)
                .iter()
                .position(|&c| c == old)
                .unwrap();
            assert_eq!(
                after[joint][i * len..][..len],
                before[joint][at * len..][..len]
            );
        }
    }
}

#[test]
fn joint_names_are_free_text() {
    let odd = |index, name: &str| Joint {
        index,
        name: name.to_owned(),
        slides: false,
    };
    let named = [
        odd(0, "<script>alert(1)</script>"),
        odd(1, "q1, \"é\"\n=cmd()"),
    ];
    let (library, _) = bare(&named, true, &all(&["cos(q1)"])).unwrap();
    let alias = library
        .terms()
        .iter()
        .find(|term| term.name == "qd2^2")
        .unwrap();
    let json = serde_json::to_string(alias).unwrap();
    assert_eq!(serde_json::from_str::<Term>(&json).unwrap(), *alias);
    assert_eq!(
        alias.status,
        Status::AliasOf("q1, \"é\"\n=cmd().motor_inertia".to_owned())
    );
}

#[test]
fn words_tell_what_it_is() {
    let (library, _) = planar(2, &all(&["q2^4", " (1+q1^2)/exp(q1) "])).unwrap();
    let said = |name: &str| {
        let term = library
            .terms()
            .iter()
            .position(|term| term.name == name)
            .unwrap();
        library.words(term, 0.12, 0.01, None)
    };
    for (name, expected) in [
        (
            "joint2.viscous",
            "viscous friction on joint2: +0.120 ± 0.010 N·m·s/rad",
        ),
        (
            "joint1.coulomb",
            "Coulomb friction on joint1: +0.120 ± 0.010 N·m",
        ),
        (
            "joint1.offset",
            "constant torque offset on joint1: +0.120 ± 0.010 N·m",
        ),
        (
            "joint1.motor_inertia",
            "motor inertia on joint1: +0.120 ± 0.010 kg·m²",
        ),
        (
            "qd1*qd2*cos(q2)",
            "kinetic coupling qd1*qd2*cos(q2): +0.120 ± 0.010 kg·m²",
        ),
        (
            "qd1^2*sin(q2)",
            "kinetic term qd1^2*sin(q2): +0.120 ± 0.010 kg·m²",
        ),
        (
            "sin(q1+q2)",
            "gravity-like potential sin(q1+q2): +0.120 ± 0.010 N·m",
        ),
        (
            "q2^4",
            "spring-like potential q2^4: +0.120 ± 0.010 N·m/rad³",
        ),
        (
            " (1+q1^2)/exp(q1) ",
            "potential (1+q1^2)/exp(q1): +0.120 ± 0.010 N·m/rad",
        ),
    ] {
        assert_eq!(said(name), expected);
    }
    assert_eq!(library.terms()[0].family, Family::User);
    assert!(
        planar(1, &only(&["qd1*qd1 + sin(q1)"])).unwrap().0.terms()[0]
            .unit
            .contains("J per unit")
    );
}
