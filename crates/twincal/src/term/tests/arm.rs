//! The library of a real `Robot`: Φ times the coefficients of its Lagrangian is its inverse dynamics.

use super::super::aliases::dependent;
use super::super::{Family, Library};
use super::{all, status_of};
use crate::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Motion, Robot, RobotDescription,
    nominal_torque,
};
use std::collections::BTreeMap;

/// Two hinges about y, links along x, gravity along −z.
fn arm(inertias: [Inertia; 2], length: f64) -> Robot {
    let names = ["base", "upper", "fore"];
    let links = [None, Some(inertias[0]), Some(inertias[1])];
    let links = names
        .iter()
        .zip(links)
        .map(|(name, inertia)| LinkDescription {
            name: (*name).to_owned(),
            inertia,
        });
    let joint = |name, i: usize, x| {
        let mut joint = JointDescription::new(name, JointKind::Revolute, names[i], names[i + 1]);
        joint.axis = [0.0, 1.0, 0.0];
        joint.placement.translation = [x, 0.0, 0.0];
        joint
    };
    let description = RobotDescription {
        name: "arm".to_owned(),
        gravity: [0.0, 0.0, -9.81],
        links: links.collect(),
        joints: vec![joint("shoulder", 0, 0.0), joint("elbow", 1, length)],
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

#[test]
fn coefficients_of_the_lagrangian_give_the_inverse_dynamics() {
    let link = |mass, x, about_y| Inertia {
        mass,
        com: [x, 0.0, 0.0],
        tensor: [
            [about_y, 0.0, 0.0],
            [0.0, about_y, 0.0],
            [0.0, 0.0, about_y],
        ],
    };
    let (m1, c1, i1, m2, c2, i2, length) = (2.3, 0.21, 0.04, 1.7, 0.17, 0.03, 0.45);
    let robot = arm([link(m1, c1, i1), link(m2, c2, i2)], length);
    let (library, _) = Library::propose(&robot, &all(&[])).unwrap();
    assert_eq!(library.terms()[17].name, "shoulder.viscous");

    // L = ½ A q̇₁² + ½ d (q̇₁+q̇₂)² + b cos q₂ q̇₁(q̇₁+q̇₂) + g₁ sin q₁ + g₂ sin(q₁+q₂); sin because z falls as y turns
    let (a, d, b) = (
        i1 + m1 * c1 * c1 + m2 * length * length,
        i2 + m2 * c2 * c2,
        m2 * length * c2,
    );
    let coefficients = [
        ("shoulder.motor_inertia", a + d),
        ("elbow.motor_inertia", d),
        ("qd1*qd2", d),
        ("qd1^2*cos(q2)", b),
        ("qd1*qd2*cos(q2)", b),
        ("sin(q1)", 9.81 * (m1 * c1 + m2 * length)),
        ("sin(q1+q2)", 9.81 * m2 * c2),
    ];
    let beta: Vec<f64> = library
        .columns()
        .iter()
        .map(|&term| {
            let name = &library.terms()[term].name;
            coefficients
                .iter()
                .find(|(known, _)| known == name)
                .map_or(0.0, |&(_, value)| value)
        })
        .collect();
    assert_eq!(
        beta.iter().filter(|beta| **beta != 0.0).count(),
        coefficients.len()
    );
    compare_torque(&robot, &library, &beta);
}

/// Φβ is the torque of the robot.
fn compare_torque(robot: &Robot, library: &Library, beta: &[f64]) {
    let len = 100;
    let wave = |f: f64| -> Vec<f64> { (0..2 * len).map(|i| 3.0 * (f * i as f64).sin()).collect() };
    let (q, qd, qdd) = (wave(0.7), wave(1.3), wave(2.1));
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut expected = vec![0.0; 2 * len];
    nominal_torque(robot, motion, &mut expected);
    let mut out = vec![Vec::new(); 2];
    library.evaluate(motion, &mut out);
    for joint in 0..2 {
        for sample in 0..len {
            let columns = library.columns_of_joint(joint).iter().enumerate();
            let torque: f64 = columns
                .map(|(i, &k)| beta[k] * out[joint][i * len + sample])
                .sum();
            let nominal = expected[joint * len + sample];
            assert!(
                (torque - nominal).abs() < 1e-12 * 100.0,
                "joint {joint}, sample {sample}: {torque} {nominal}"
            );
        }
    }
}

/// A chain with joints of these kinds and axes, lopsided links and a tilted base.
fn chain(joints: &[(JointKind, [f64; 3])]) -> Robot {
    let name = |i: usize| format!("link{i}");
    let link = |i: usize| {
        let x = i as f64;
        LinkDescription {
            name: name(i),
            inertia: (i > 0).then_some(Inertia {
                mass: 1.0 + 0.3 * x,
                com: [0.2, -0.1 * x, 0.15],
                tensor: [
                    [0.04, 0.005, -0.003],
                    [0.005, 0.05, 0.004],
                    [-0.003, 0.004, 0.03 + 0.001 * x],
                ],
            }),
        }
    };
    let (c, s) = (0.4_f64.cos(), 0.4_f64.sin());
    let joint = |(i, &(kind, axis)): (usize, &(JointKind, [f64; 3]))| {
        let mut joint =
            JointDescription::new(&format!("joint{}", i + 1), kind, &name(i), &name(i + 1));
        joint.axis = axis;
        joint.placement.translation = [0.3, 0.1, -0.2];
        if axis[2] != 1.0 {
            joint.placement.rotation = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]];
        }
        joint
    };
    let description = RobotDescription {
        name: "chain".to_owned(),
        gravity: [3.0, -2.0, -9.0],
        links: (0..=joints.len()).map(link).collect(),
        joints: joints.iter().enumerate().map(joint).collect(),
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

/// The claim of the generic family: its span holds the torque of any rigid chain, whatever its axes.
#[test]
fn generic_family_spans_the_inverse_dynamics_of_any_chain() {
    use JointKind::{Prismatic, Revolute};
    let (z, tilted, skew) = ([0.0, 0.0, 1.0], [1.0, 2.0, 0.5], [-0.3, 1.0, 2.0]);
    for (joints, parallel) in [
        (vec![(Revolute, z)], true),
        (vec![(Revolute, z); 3], true),
        (vec![(Revolute, z), (Prismatic, z), (Revolute, z)], true),
        (vec![(Revolute, z), (Revolute, tilted)], false),
        (vec![(Revolute, tilted), (Prismatic, skew)], false),
        (vec![(Prismatic, skew), (Revolute, tilted)], false),
        (
            vec![(Revolute, skew), (Revolute, z), (Revolute, tilted)],
            false,
        ),
    ] {
        let robot = chain(&joints);
        assert_eq!(robot.is_planar(), parallel);
        let mut settings = all(&[]);
        settings.families = vec![Family::MotorInertia];
        let (library, _) = Library::propose(&robot, &settings).unwrap();
        let (n, len) = (joints.len(), 260);
        let wave = |f: f64| -> Vec<f64> {
            (0..n * len)
                .map(|i| 2.0 * (f * (i * i) as f64).sin())
                .collect()
        };
        let (q, qd, qdd) = (wave(0.7), wave(1.3), wave(2.1));
        let motion = Motion {
            len,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        let mut out = vec![Vec::new(); n];
        library.evaluate(motion, &mut out);
        let mut columns = vec![vec![0.0; n * len]; library.columns().len()];
        for joint in 0..n {
            for (i, &k) in library.columns_of_joint(joint).iter().enumerate() {
                columns[k][joint * len..][..len].copy_from_slice(&out[joint][i * len..][..len]);
            }
        }
        let mut torque = vec![0.0; n * len];
        nominal_torque(&robot, motion, &mut torque);
        columns.push(torque);
        let last = columns.len() - 1;
        let found: Vec<usize> = dependent(columns)
            .iter()
            .map(|(position, _)| *position)
            .collect();
        assert_eq!(
            found,
            [last],
            "{joints:?}: only the torque itself lies in the span, to 1e-9"
        );
    }
}

/// The axis y is turned to z by half a right angle's sine and cosine, of which one is 6e-17: what that leaves of a torque that is zero by
/// structure must not stand for anything. `∂/∂q cos q` is the torque of a payload's moment along z, here a mass at the rod's centre of mass
/// without the moment of that along x; it has a tensor about the hinge, which the motor's inertia takes off.
#[test]
fn rounding_stands_for_nothing() {
    let inertia = Inertia {
        mass: 0.7,
        com: [0.02, 0.0, -0.4],
        tensor: [[0.003, 0.0, 0.0], [0.0, 0.003, 0.0], [0.0, 0.0, 0.001]],
    };
    let description = RobotDescription {
        name: "pendulum".to_owned(),
        gravity: [0.0, 0.0, -9.81],
        links: vec![
            LinkDescription {
                name: "base".to_owned(),
                inertia: None,
            },
            LinkDescription {
                name: "rod".to_owned(),
                inertia: Some(inertia),
            },
        ],
        joints: vec![JointDescription {
            axis: [0.0, 1.0, 0.0],
            ..JointDescription::new("hinge", JointKind::Revolute, "base", "rod")
        }],
        allow_unphysical: false,
    };
    let robot = Robot::new(description, &BTreeMap::new()).unwrap().0;
    let mut settings = all(&[]);
    settings.families.push(Family::Payload);
    let (library, _) = Library::propose(&robot, &settings).unwrap();
    assert_eq!(
        status_of(&library, "cos(q1)").to_string(),
        "alias_of:hinge.motor_inertia, payload.m, payload.h1"
    );
    assert_eq!(
        status_of(&library, "sin(q1)").to_string(),
        "alias_of:hinge.motor_inertia, payload.h1"
    );
}
