//! The dynamics against Pinocchio, closed forms, energy balance and Lagrange's equations by differences.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]

use proptest::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Mimic, Motion, Robot, RobotDescription,
    Workspace, inverse_dynamics, kinetic_energy, mass_matrix, nominal_torque, potential_energy,
};

fn build(description: RobotDescription) -> Robot {
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

fn torque(robot: &Robot, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
    let mut tau = vec![0.0; robot.dof()];
    inverse_dynamics(robot, &mut Workspace::new(robot), q, qd, qdd, &mut tau);
    tau
}

fn golden() -> Vec<Value> {
    let document: Value =
        serde_json::from_str(include_str!("reference/robot/pinocchio.json")).unwrap();
    document["cases"].as_array().unwrap().clone()
}

/// Robots of the golden file: serial, with sliders, trees, a chain of twelve, mimicking fingers.
fn golden_robots() -> Vec<Robot> {
    golden()
        .iter()
        .map(|case| build(serde_json::from_value(case["description"].clone()).unwrap()))
        .collect()
}

fn floats(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

#[test]
fn torque_and_energy_are_pinocchios() {
    for (case, robot) in golden().iter().zip(golden_robots()) {
        let mut first = None;
        for sample in case["samples"].as_array().unwrap() {
            let [q, qd, qdd, expected] = ["q", "qd", "qdd", "tau"].map(|k| floats(&sample[k]));
            let tau = torque(&robot, &q, &qd, &qdd);
            let largest = expected.iter().fold(0f64, |m, v| m.max(v.abs()));
            for j in 0..robot.dof() {
                assert!(
                    (tau[j] - expected[j]).abs() <= 1e-12 * largest,
                    "{}: {tau:?} {expected:?}",
                    case["name"]
                );
            }
            let kinetic = sample["kinetic"].as_f64().unwrap();
            assert!(
                (kinetic_energy(&robot, &q, &qd) / kinetic - 1.0).abs() < 1e-12,
                "{}",
                case["name"]
            );
            // The zero of the potential is free.
            let difference = potential_energy(&robot, &q) - sample["potential"].as_f64().unwrap();
            let zero = *first.get_or_insert(difference);
            assert!(
                (difference - zero).abs() < 1e-11 * (1.0 + zero.abs()),
                "{}",
                case["name"]
            );
        }
    }
}

/// The same link with a point mass at `com`, by hand: masses add, the centre is their mean, and either part's inertia is
/// moved to the common centre by Steiner's theorem.
fn merged(link: Option<Inertia>, mass: f64, com: [f64; 3]) -> Inertia {
    let link = link.unwrap_or(Inertia {
        mass: 0.0,
        com: [0.0; 3],
        tensor: [[0.0; 3]; 3],
    });
    let total = link.mass + mass;
    let centre = [0, 1, 2].map(|k| (link.mass * link.com[k] + mass * com[k]) / total);
    let mut tensor = link.tensor;
    for (mass, at) in [(link.mass, link.com), (mass, com)] {
        let d = [0, 1, 2].map(|k| at[k] - centre[k]);
        let square: f64 = d.iter().map(|x| x * x).sum();
        for i in 0..3 {
            for j in 0..3 {
                let own = if i == j { square } else { 0.0 };
                tensor[i][j] += mass * (own - d[i] * d[j]);
            }
        }
    }
    Inertia {
        mass: total,
        com: centre,
        tensor,
    }
}

/// At every link of every golden robot, also the fixed ones, which move with another: torque is that of the model in which
/// the load was merged into the link by hand.
#[test]
fn a_known_load_is_the_link_with_the_load_merged_in() {
    let (mass, com) = (1.3, [0.11, -0.07, 0.23]);
    let mut moved = 0;
    for (case, robot) in golden().iter().zip(golden_robots()) {
        let description: RobotDescription =
            serde_json::from_value(case["description"].clone()).unwrap();
        for link in 0..description.links.len() {
            let mut by_hand = description.clone();
            let name = by_hand.links[link].name.clone();
            by_hand.links[link].inertia = Some(merged(by_hand.links[link].inertia, mass, com));
            let (loaded, by_hand) = (robot.carrying(&name, mass, com).unwrap(), build(by_hand));
            for sample in case["samples"].as_array().unwrap() {
                let [q, qd, qdd] = ["q", "qd", "qdd"].map(|k| floats(&sample[k]));
                let (a, b) = (
                    torque(&loaded, &q, &qd, &qdd),
                    torque(&by_hand, &q, &qd, &qdd),
                );
                let largest = b.iter().fold(0f64, |m, v| m.max(v.abs()));
                for (a, b) in a.iter().zip(&b) {
                    let close = (a - b).abs() <= 1e-12 * largest;
                    assert!(close, "{} at {name}: {a} {b}", case["name"]);
                }
                let bare = torque(&robot, &q, &qd, &qdd);
                moved += usize::from(a.iter().zip(&bare).any(|(a, b)| (a - b).abs() > 1e-3));
            }
        }
    }
    assert!(moved > 100, "only {moved} samples feel the load");
}

#[test]
fn a_load_that_is_none_is_refused() {
    let robot = build(pendulum());
    for (link, mass, com, word) in [
        ("rod", 0.0, [0.0; 3], "mass is 0 kg"),
        ("rod", f64::NAN, [0.0; 3], "mass is NaN kg"),
        ("rod", 1.0, [0.0, f64::INFINITY, 0.0], "centre of mass is"),
        ("hand", 1.0, [0.0; 3], "no such link"),
    ] {
        let error = robot.carrying(link, mass, com).unwrap_err().to_string();
        assert!(error.contains(word) && error.contains(link), "{error}");
    }
}

/// A rod of length l on a hinge about y, hanging at q = 0, with every passive term.
fn pendulum() -> RobotDescription {
    let mut hinge = JointDescription::new("hinge", JointKind::Continuous, "base", "rod");
    hinge.axis = [0.0, 2.0, 0.0];
    (
        hinge.armature,
        hinge.damping,
        hinge.stiffness,
        hinge.spring_reference,
    ) = (0.03, 0.2, 1.5, 0.4);
    RobotDescription {
        name: "pendulum".into(),
        gravity: [0.0, 0.0, -9.81],
        links: vec![
            LinkDescription {
                name: "base".into(),
                inertia: None,
            },
            LinkDescription {
                name: "rod".into(),
                inertia: Some(Inertia {
                    mass: 2.0,
                    com: [0.0, 0.0, -0.35],
                    tensor: [[0.08, 0.0, 0.0], [0.0, 0.08, 0.0], [0.0, 0.0, 0.001]],
                }),
            },
        ],
        joints: vec![hinge],
        allow_unphysical: false,
    }
}

#[test]
fn pendulum_is_the_closed_form() {
    let (robot, findings) = Robot::new(pendulum(), &BTreeMap::new()).unwrap();
    let codes: Vec<&str> = findings.iter().map(|f| f.code.as_str()).collect();
    assert_eq!(codes, ["axis_normalised"]);
    for (q, qd, qdd) in [(0.0, 0.0, 0.0), (0.7, -1.3, 4.0), (-2.5, 3.0, -7.0)] {
        // τ = (I + m c² + armature) q̈ + m g c sin q + d q̇ + k (q − q_ref)
        let expected = (0.08 + 2.0 * 0.35 * 0.35 + 0.03) * qdd
            + 2.0 * 9.81 * 0.35 * f64::sin(q)
            + 0.2 * qd
            + 1.5 * (q - 0.4);
        let tau = torque(&robot, &[q], &[qd], &[qdd])[0];
        assert!((tau - expected).abs() < 1e-13, "{tau} {expected}");
        let kinetic = 0.5 * (0.08 + 2.0 * 0.35 * 0.35 + 0.03) * qd * qd;
        assert!((kinetic_energy(&robot, &[q], &[qd]) - kinetic).abs() < 1e-14);
        let potential = -2.0 * 9.81 * 0.35 * f64::cos(q) + 0.75 * (q - 0.4) * (q - 0.4);
        assert!((potential_energy(&robot, &[q]) - potential).abs() < 1e-14);
    }
}

#[test]
fn a_batch_is_its_samples_whatever_their_place() {
    for robot in golden_robots() {
        let n = robot.dof();
        let wave = |k: usize, scale: f64| {
            (0..n * 131)
                .map(|i| scale * ((i * k) as f64 * 0.37).sin())
                .collect::<Vec<_>>()
        };
        let (q, qd, qdd) = (wave(3, 2.0), wave(7, 3.0), wave(11, 8.0));
        let mut whole = vec![f64::NAN; n * 131];
        nominal_torque(
            &robot,
            Motion {
                len: 131,
                q: &q,
                qd: &qd,
                qdd: &qdd,
            },
            &mut whole,
        );
        for (start, len) in [(0, 1), (5, 3), (60, 71), (130, 1), (64, 8)] {
            let cut = |v: &[f64]| {
                (0..n)
                    .flat_map(|j| v[j * 131 + start..][..len].to_vec())
                    .collect::<Vec<_>>()
            };
            let mut part = vec![f64::NAN; n * len];
            nominal_torque(
                &robot,
                Motion {
                    len,
                    q: &cut(&q),
                    qd: &cut(&qd),
                    qdd: &cut(&qdd),
                },
                &mut part,
            );
            assert_eq!(part, cut(&whole), "the same bytes wherever a sample stands");
        }
        for sample in [0, 77] {
            let pick = |v: &[f64]| (0..n).map(|j| v[j * 131 + sample]).collect::<Vec<_>>();
            let one = torque(&robot, &pick(&q), &pick(&qd), &pick(&qdd));
            for (a, b) in one.iter().zip(pick(&whole)) {
                assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()), "{a} {b}");
            }
        }
    }
}

#[test]
fn mass_matrix_is_symmetric_and_gives_the_kinetic_energy() {
    for robot in golden_robots() {
        let n = robot.dof();
        let q: Vec<f64> = (0..n).map(|i| (i as f64 * 1.7).sin()).collect();
        let qd: Vec<f64> = (0..n).map(|i| (i as f64 * 0.9).cos()).collect();
        let mut mass = vec![0.0; n * n];
        mass_matrix(&robot, &mut Workspace::new(&robot), &q, &mut mass);
        let mut energy = 0.0;
        for i in 0..n {
            for j in 0..n {
                assert!(
                    (mass[i * n + j] - mass[j * n + i]).abs()
                        < 1e-12 * mass[i * n + i].abs().max(1.0)
                );
                energy += 0.5 * qd[i] * mass[i * n + j] * qd[j];
            }
        }
        assert!((energy / kinetic_energy(&robot, &q, &qd) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_robot_survives_its_file() {
    for robot in golden_robots() {
        let text = serde_json::to_string(&robot).unwrap();
        assert_eq!(serde_json::from_str::<Robot>(&text).unwrap(), robot);
    }
    // What is read is checked: nobody can smuggle an impossible robot in.
    let text = serde_json::to_string(&build(pendulum()))
        .unwrap()
        .replace("\"mass\":2.0", "\"mass\":-2.0");
    assert!(
        serde_json::from_str::<Robot>(&text)
            .unwrap_err()
            .to_string()
            .contains("link `rod`")
    );
}

/// A state of four joints.
const STATE: [[f64; 4]; 3] = [
    [0.1, 0.2, 0.3, 0.4],
    [1.0, -2.0, 0.5, 3.0],
    [4.0, 5.0, -6.0, 1.0],
];

#[track_caller]
fn close(tau: &[f64], expected: &[f64]) {
    for (a, b) in tau.iter().zip(expected) {
        assert!(
            (a - b).abs() < 1e-12 * b.abs().max(1.0),
            "{tau:?} {expected:?}"
        );
    }
}

#[test]
fn locking_is_what_it_says() {
    let description: RobotDescription =
        serde_json::from_value(golden()[0]["description"].clone()).unwrap();
    let full = build(description.clone());
    let locked = BTreeMap::from([("joint2".to_string(), 0.8), ("joint4".to_string(), -0.3)]);
    let (part, _) = Robot::new(description, &locked).unwrap();
    assert_eq!(part.joint_names(), ["joint0", "joint1", "joint3", "joint5"]);
    let [q, qd, qdd] = STATE;
    let spread = |v: [f64; 4], a: f64, b: f64| [v[0], v[1], a, v[2], b, v[3]];
    let whole = torque(
        &full,
        &spread(q, 0.8, -0.3),
        &spread(qd, 0.0, 0.0),
        &spread(qdd, 0.0, 0.0),
    );
    let tau = torque(&part, &q, &qd, &qdd);
    close(&tau, &[whole[0], whole[1], whole[3], whole[5]]);
}

/// A chain of mimics: joint5 = 2 (−0.5 joint1 + 0.1) + 0.3.
#[test]
fn mimicking_is_what_it_says() {
    let description: RobotDescription =
        serde_json::from_value(golden()[0]["description"].clone()).unwrap();
    let full = build(description.clone());
    let mut chained = description;
    chained.joints[3].mimic = Some(Mimic {
        joint: "joint1".into(),
        multiplier: -0.5,
        offset: 0.1,
    });
    chained.joints[5].mimic = Some(Mimic {
        joint: "joint3".into(),
        multiplier: 2.0,
        offset: 0.3,
    });
    let robot = build(chained);
    let [q, qd, qdd] = STATE;
    let spread =
        |v: [f64; 4], o: [f64; 2]| [v[0], v[1], v[2], -0.5 * v[1] + o[0], v[3], -v[1] + o[1]];
    let whole = torque(
        &full,
        &spread(q, [0.1, 0.5]),
        &spread(qd, [0.0; 2]),
        &spread(qdd, [0.0; 2]),
    );
    let tau = torque(&robot, &q, &qd, &qdd);
    let second = whole[1] - 0.5 * whole[3] - whole[5];
    close(&tau, &[whole[0], second, whole[2], whole[4]]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        failure_persistence: None, ..ProptestConfig::default() })]

    /// Power balance: along any motion, the energy changes by what the joints deliver, d(T + U)/dt = q̇ᵀτ.
    /// Lagrange: τ_i = d/dt ∂L/∂q̇_i − ∂L/∂q_i with L = T − U from the energies alone.
    #[test]
    fn torque_balances_power_and_follows_from_the_lagrangian(
        which in 0usize..5,
        motion in prop::collection::vec(-1.5f64..1.5, 36),
    ) {
        let robot = &golden_robots()[which];
        let n = robot.dof();
        let (q, qd, qdd) = (&motion[..n], &motion[12..12 + n], &motion[24..24 + n]);
        let tau = torque(robot, q, qd, qdd);
        let scale = tau.iter().fold(1.0f64, |m, v| m.max(v.abs()));
        let along = |t: f64| -> (Vec<f64>, Vec<f64>) {
            let position = (0..n).map(|j| q[j] + qd[j] * t + 0.5 * qdd[j] * t * t).collect();
            (position, (0..n).map(|j| qd[j] + qdd[j] * t).collect())
        };
        let energy = |t: f64| {
            let (q, qd) = along(t);
            kinetic_energy(robot, &q, &qd) + potential_energy(robot, &q)
        };
        // Fourth-order central difference; with h = 1e-3 its error is near 1e-10 of the energy's scale.
        let difference = |f: &dyn Fn(f64) -> f64| {
            let h = 1e-3;
            (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
        };
        let power: f64 = qd.iter().zip(&tau).map(|(v, t)| v * t).sum();
        let change = difference(&energy);
        prop_assert!((power - change).abs() < 1e-6 * scale * n as f64, "{power} {change}");

        let lagrangian = |q: &[f64], qd: &[f64]| kinetic_energy(robot, q, qd) - potential_energy(robot, q);
        for i in 0..n {
            let momentum = |t: f64| {
                let (q, qd) = along(t);
                difference(&|s| {
                    let mut moved = qd.clone();
                    moved[i] += s;
                    lagrangian(&q, &moved)
                })
            };
            let slope = difference(&|s| {
                let mut moved = q.to_vec();
                moved[i] += s;
                lagrangian(&moved, qd)
            });
            let lagrange = difference(&momentum) - slope;
            prop_assert!((lagrange - tau[i]).abs() < 1e-5 * scale, "joint {i}: {lagrange} {}", tau[i]);
        }
    }
}
