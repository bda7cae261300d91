//! The regressors against the recursive Newton–Euler equations and energy; against Pinocchio see `tests/python`.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]

use serde_json::Value;
use std::collections::BTreeMap;
use twincal::robot::{
    BLOCK, Motion, Regressor, Robot, RobotDescription, body_parameters, nominal_torque,
    to_body_frame,
};

/// Robots of the golden file (serial, sliders, trees, twelve joints, mimicking fingers), rigid bodies only.
fn robots() -> Vec<Robot> {
    let document: Value =
        serde_json::from_str(include_str!("reference/robot/pinocchio.json")).unwrap();
    let cases = document["cases"].as_array().unwrap();
    let mut robots = Vec::new();
    for case in cases {
        let mut description: RobotDescription =
            serde_json::from_value(case["description"].clone()).unwrap();
        for joint in &mut description.joints {
            (joint.armature, joint.damping, joint.stiffness) = (0.0, 0.0, 0.0);
        }
        robots.push(Robot::new(description, &BTreeMap::new()).unwrap().0);
    }
    assert!(robots.len() > 4);
    robots
}

/// Positions, velocities, accelerations of `len` samples.
fn motion(robot: &Robot, len: usize) -> [Vec<f64>; 3] {
    [(3, 2.0), (7, 3.0), (11, 8.0)].map(|(k, scale)| {
        (0..robot.dof() * len)
            .map(|i| scale * ((i * k) as f64 * 0.37).sin())
            .collect()
    })
}

#[test]
fn the_regressor_times_the_parameters_is_the_torque() {
    for robot in robots() {
        let (n, len) = (robot.dof(), 150);
        let [q, qd, qdd] = &motion(&robot, len);
        let motion = Motion { len, q, qd, qdd };
        let mut expected = vec![0.0; n * len];
        nominal_torque(&robot, motion, &mut expected);
        let scale = expected.iter().fold(0f64, |most, v| most.max(v.abs()));
        let regressor = Regressor::new(&robot);
        let mut block = regressor.block(&robot);
        // Blocks that are full, short, and in no order.
        for samples in [128..150, 0..64, 64..128, 3..4, 0..0] {
            let first = samples.start;
            regressor.evaluate(&robot, motion, samples.clone(), &mut block);
            let mut sum = vec![[0.0; BLOCK]; n];
            for (p, pair) in regressor.pairs().iter().enumerate() {
                let parameters = robot.parameters_of_body(pair.body);
                for k in 0..10 {
                    let column = block.column(p, k);
                    assert!(pair.present[k] || column.iter().all(|&v| v == 0.0));
                    assert!(column[samples.len()..].iter().all(|&v| v == 0.0));
                    for (sum, value) in sum[pair.coordinate].iter_mut().zip(column) {
                        *sum += value * parameters[k];
                    }
                }
            }
            for j in 0..n {
                for s in samples.clone() {
                    let (ours, theirs) = (sum[j][s - first], expected[j * len + s]);
                    assert!((ours - theirs).abs() <= 1e-13 * scale, "{ours} {theirs}");
                }
            }
        }
    }
}

#[test]
fn what_is_left_out_is_zero_for_a_reason() {
    for robot in robots() {
        let regressor = Regressor::new(&robot);
        for pair in regressor.pairs() {
            let own = robot.coordinate_of_body(pair.body) == pair.coordinate;
            let alone = (0..robot.bodies().len())
                .filter(|&body| robot.coordinate_of_body(body) == pair.coordinate)
                .count()
                == 1;
            let kind = robot.joint_kind(pair.coordinate);
            if kind == twincal::robot::JointKind::Prismatic {
                assert!(
                    pair.present[4..].iter().all(|&p| !p),
                    "a slider turns nothing"
                );
            } else if own && alone {
                assert!(!pair.present[0] && !pair.present[3], "mass on the own axis");
                assert!(pair.present[9], "Izz about the own axis");
            }
        }
    }
}

#[test]
fn links_find_their_bodies() {
    for robot in robots() {
        let mut totals = vec![[0.0; 10]; robot.bodies().len()];
        for link in &robot.description().links {
            let home = robot.body_of_link(&link.name);
            let Some((body, placement)) = home else {
                continue;
            };
            assert!(robot.links_of_body(body).contains(&link.name.as_str()));
            if let Some(inertia) = &link.inertia {
                let own = body_parameters(inertia, &twincal::robot::Placement::IDENTITY);
                let map = to_body_frame(&placement);
                for i in 0..10 {
                    totals[body][i] += (0..10).map(|k| map[i][k] * own[k]).sum::<f64>();
                }
            }
        }
        for (body, total) in totals.iter().enumerate() {
            let link = robot.bodies()[body];
            assert_eq!(robot.body_of_link(link).unwrap().0, body);
            for (a, b) in total.iter().zip(robot.parameters_of_body(body)) {
                assert!((a - b).abs() < 1e-14 * (1.0 + b.abs()), "{link}: {a} {b}");
            }
        }
        assert_eq!(robot.body_of_link("no such link"), None);
    }
}
