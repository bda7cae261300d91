//! A simulated arm with friction, noise and a wrong model, for the tests of what looks at logs.

use crate::robot::{
    Change, Inertia, JointDescription, JointKind, LinkDescription, Motion, Robot, RobotDescription,
    nominal_torque,
};
use crate::signal::{Payload, Segment, Trajectory};
use std::collections::BTreeMap;

pub(crate) const LEN: usize = 4000;
pub(crate) const INTERVAL: f64 = 0.005;

/// A four-joint arm: vertical axis, two horizontal ones, a twisted wrist. `heavier` scales the masses.
pub(crate) fn arm(heavier: f64) -> Robot {
    let axes = [
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.3, 0.0],
    ];
    let mut links = vec![LinkDescription {
        name: "base".into(),
        inertia: None,
    }];
    let mut joints = Vec::new();
    for (i, axis) in axes.into_iter().enumerate() {
        let (parent, child) = (links[i].name.clone(), format!("link{i}"));
        let mut joint =
            JointDescription::new(&format!("j{}", i + 1), JointKind::Revolute, &parent, &child);
        joint.axis = axis;
        joint.placement.translation = [0.3, 0.0, 0.1];
        joints.push(joint);
        let mass = heavier * (6.0 - 1.2 * i as f64);
        links.push(LinkDescription {
            name: child,
            inertia: Some(Inertia {
                mass,
                com: [0.15, 0.05, 0.04],
                tensor: [
                    [0.02 * mass, 0.0, 0.0],
                    [0.0, 0.03 * mass, 0.0],
                    [0.0, 0.0, 0.03 * mass],
                ],
            }),
        });
    }
    let description = RobotDescription {
        name: "arm".into(),
        gravity: [0.0, 0.0, -9.81],
        links,
        joints,
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

/// The arm with its base leaning by some degrees, and 4 kg at its wrist.
pub(crate) fn leaning_and_loaded(degrees: f64) -> Robot {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (mass, com) = (4.0, [0.2, 0.02, 0.05]);
    let [x, y, z] = com;
    let payload = [
        mass,
        mass * x,
        mass * y,
        mass * z,
        mass * (y * y + z * z),
        -mass * x * y,
        -mass * x * z,
        mass * (x * x + z * z),
        -mass * y * z,
        mass * (x * x + y * y),
    ];
    arm(1.0).changed(&Change {
        inertia: vec![(3, payload)],
        gravity: [9.81 * 0.6 * sin, 9.81 * 0.8 * sin, 9.81 * (1.0 - cos)],
        ..Change::default()
    })
}

/// What the log of a robot 15 % heavier than the model with friction looks like; joints are independent.
pub(crate) fn log(seed: f64) -> Trajectory {
    log_of(&arm(1.15), seed)
}

/// What the log of such a robot with friction looks like.
pub(crate) fn log_of(robot: &Robot, seed: f64) -> Trajectory {
    let dof = 4;
    let wave = |k: usize| -> Vec<f64> {
        let mut all = Vec::new();
        for joint in 0..dof {
            let (w, v) = (0.9 + 0.37 * joint as f64, 2.3 - 0.41 * joint as f64);
            for i in 0..LEN {
                let t = i as f64 * INTERVAL + seed + joint as f64;
                all.push(match k {
                    0 => 0.9 * (w * t).sin() + 0.4 * (v * t).cos() - 0.3,
                    1 => 0.9 * w * (w * t).cos() - 0.4 * v * (v * t).sin(),
                    _ => -0.9 * w * w * (w * t).sin() - 0.4 * v * v * (v * t).cos(),
                });
            }
        }
        all
    };
    let [q, qd, qdd] = [wave(0), wave(1), wave(2)];
    let mut tau = vec![0.0; dof * LEN];
    let motion = Motion {
        len: LEN,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    nominal_torque(robot, motion, &mut tau);
    let mut state = 7_u64;
    for (i, tau) in tau.iter_mut().enumerate() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let noise = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        *tau += 1.5 * qd[i] + 2.0 * (qd[i] / 0.01).tanh() + 0.7 + noise;
    }
    let segment = Segment {
        time: (0..LEN).map(|i| i as f64 * INTERVAL).collect(),
        input_rows: (0..LEN).collect(),
        logged: None,
        q,
        qd,
        qdd,
        tau,
        standstill: vec![false; dof * LEN],
        history: Vec::new(),
        interval: INTERVAL,
        logged_interval: INTERVAL,
    };
    Trajectory {
        name: "run".into(),
        dof,
        segments: vec![segment],
        payload: Payload::None,
        payload_acts: true,
    }
}

/// Makes friction of this size remember the motion before a velocity reversal over a way of `length`, rad: presliding.
pub(crate) fn remember(trajectory: &mut Trajectory, size: f64, length: f64) {
    let segment = &mut trajectory.segments[0];
    for joint in 0..trajectory.dof {
        let (mut way, mut before) = (f64::INFINITY, segment.qd[joint * LEN]);
        for i in joint * LEN..(joint + 1) * LEN {
            if segment.qd[i] * before < 0.0 {
                way = 0.0;
            }
            before = segment.qd[i];
            way += before.abs() * INTERVAL;
            segment.tau[i] -= 2.0 * size * before.signum() * (-way / length).exp();
        }
    }
}
