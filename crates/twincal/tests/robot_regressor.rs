//! The regressors against the recursive Newton–Euler equations and energy; against Pinocchio see `tests/python`.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]

use serde_json::Value;
use std::collections::BTreeMap;
use twincal::robot::{
    BLOCK, BlockWorkspace, Instructions, Motion, Regressor, Robot, RobotDescription, STRIDE,
    Workspace, body_parameters, energy_regressor, gravity_regressor, inverse_dynamics,
    kinetic_energy, mass_matrices, mass_matrix, nominal_torque, nominal_torque_with,
    position_derivative, potential_energy, to_body_frame,
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
            let own = robot.motion_of_body(pair.body).0 == pair.coordinate;
            let alone = (0..robot.bodies().len())
                .filter(|&body| robot.motion_of_body(body).0 == pair.coordinate)
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

/// The nominal torque of one sample.
fn torque(robot: &Robot, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
    let mut tau = vec![0.0; robot.dof()];
    inverse_dynamics(robot, &mut Workspace::new(robot), q, qd, qdd, &mut tau);
    tau
}

fn pick(values: &[f64], len: usize, s: usize) -> Vec<f64> {
    values.iter().skip(s).step_by(len).copied().collect()
}

/// Robots as the golden file has them, with motors, dampers and springs.
fn full_robots() -> Vec<Robot> {
    let mut robots = robots();
    for robot in &mut robots {
        let mut description = robot.description().clone();
        for joint in &mut description.joints {
            (joint.armature, joint.damping, joint.stiffness) = (0.2, 0.4, 3.0);
        }
        *robot = Robot::new(description, &BTreeMap::new()).unwrap().0;
    }
    robots
}

#[test]
fn gravity_times_its_regressor_is_the_torque_at_rest() {
    for robot in robots() {
        let (n, len) = (robot.dof(), 70);
        let [q, _, _] = &motion(&robot, len);
        let motion = Motion {
            len,
            q,
            qd: q,
            qdd: q,
        };
        let mut workspace = BlockWorkspace::new(&robot);
        let mut out = vec![f64::NAN; 3 * n * STRIDE];
        for samples in [0..64, 64..70] {
            gravity_regressor(&robot, &mut workspace, motion, samples.clone(), &mut out);
            for s in samples.clone() {
                let expected = torque(&robot, &pick(q, len, s), &vec![0.0; n], &vec![0.0; n]);
                for j in 0..n {
                    let sum: f64 = (0..3)
                        .map(|k| {
                            out[(3 * j + k) * STRIDE + s - samples.start]
                                * robot.description().gravity[k]
                        })
                        .sum();
                    let scale = expected.iter().fold(1f64, |most, v| most.max(v.abs()));
                    assert!(
                        (sum - expected[j]).abs() < 1e-13 * scale,
                        "{sum} {expected:?}"
                    );
                }
            }
        }
    }
}

/// Fourth-order central difference with step h.
fn difference(h: f64, f: &dyn Fn(f64) -> f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

#[test]
fn the_position_derivative_is_the_difference_of_torques() {
    for robot in full_robots() {
        let (n, len) = (robot.dof(), 70);
        let [q, qd, qdd] = &motion(&robot, len);
        let motion = Motion { len, q, qd, qdd };
        let mut workspace = BlockWorkspace::new(&robot);
        let mut out = vec![f64::NAN; n * STRIDE];
        for coordinate in 0..n {
            position_derivative(&robot, &mut workspace, coordinate, motion, 3..67, &mut out);
            for s in [3, 10, 66] {
                let [q, qd, qdd] = [q, qd, qdd].map(|v| pick(v, len, s));
                let moved = |d: f64, j: usize| {
                    let mut q = q.clone();
                    q[coordinate] += d;
                    torque(&robot, &q, &qd, &qdd)[j]
                };
                let scale = (0..n).fold(1f64, |most, j| most.max(moved(0.0, j).abs()));
                for j in 0..n {
                    // Rounding 1e-16/h and h⁴ leave about 1e-11.
                    let expected = difference(1e-3, &|d| moved(d, j));
                    let ours = out[j * STRIDE + s - 3];
                    assert!((ours - expected).abs() < 1e-9 * scale, "{ours} {expected}");
                }
            }
        }
    }
}

/// Columns of the kinetic and of the potential energy of one state: q, q̇, q̈.
fn energy_columns(robot: &Robot, [q, qd, qdd]: [&[f64]; 3]) -> [Vec<f64>; 2] {
    let size = 10 * robot.bodies().len() * STRIDE;
    let mut workspace = BlockWorkspace::new(robot);
    let mut out = [vec![f64::NAN; size], vec![f64::NAN; size]];
    let [kinetic, potential] = &mut out;
    let motion = Motion { len: 1, q, qd, qdd };
    energy_regressor(robot, &mut workspace, motion, 0..1, kinetic, potential);
    out.map(|v| v.into_iter().step_by(STRIDE).collect())
}

#[test]
fn the_energy_regressor_gives_the_energies() {
    for robot in robots() {
        let [q, qd, qdd] = &motion(&robot, 1);
        let [kinetic, potential] = energy_columns(&robot, [q, qd, qdd]);
        let total = |columns: &[f64]| -> f64 {
            (0..robot.bodies().len())
                .flat_map(|b| robot.parameters_of_body(b))
                .zip(columns)
                .map(|(p, c)| p * c)
                .sum()
        };
        assert!((total(&kinetic) / kinetic_energy(&robot, q, qd) - 1.0).abs() < 1e-13);
        let expected = potential_energy(&robot, q);
        assert!((total(&potential) - expected).abs() < 1e-12 * (1.0 + expected.abs()));
    }
}

/// d/dt ∂L/∂q̇ − ∂L/∂q along q + q̇ t + ½ q̈ t².
#[test]
fn the_euler_lagrange_image_of_the_energy_regressor_is_the_regressor() {
    for robot in robots() {
        let n = robot.dof();
        let [q, qd, qdd] = &motion(&robot, 1);
        let regressor = Regressor::new(&robot);
        let mut block = regressor.block(&robot);
        let at = Motion { len: 1, q, qd, qdd };
        regressor.evaluate(&robot, at, 0..1, &mut block);
        let lagrangian = |q: &[f64], qd: &[f64], column: usize| {
            let [kinetic, potential] = energy_columns(&robot, [q, qd, qdd]);
            kinetic[column] - potential[column]
        };
        for (p, pair) in regressor.pairs().iter().enumerate() {
            // One robot in full is slow enough; of each pair one column of each kind is.
            for k in [0, 1 + pair.body % 3, 4 + (pair.body + pair.coordinate) % 6] {
                let (column, j) = (10 * pair.body + k, pair.coordinate);
                let momentum = |t: f64| {
                    let (mut q, mut qd) = (q.clone(), qd.clone());
                    for i in 0..n {
                        q[i] += qd[i] * t + 0.5 * qdd[i] * t * t;
                        qd[i] += qdd[i] * t;
                    }
                    // L is quadratic in q̇: the central difference is exact with any step.
                    let moved = |d: f64| {
                        let mut qd = qd.clone();
                        qd[j] += d;
                        lagrangian(&q, &qd, column)
                    };
                    0.5 * (moved(1.0) - moved(-1.0))
                };
                let slope = |d: f64| {
                    let mut q = q.clone();
                    q[j] += d;
                    lagrangian(&q, qd, column)
                };
                let image = difference(1e-3, &momentum) - difference(1e-3, &slope);
                let scale = qd.iter().chain(qdd).fold(10f64, |most, v| most.max(v * v)) * n as f64;
                let ours = block.column(p, k)[0];
                assert!(
                    (ours - image).abs() < 1e-8 * scale,
                    "{pair:?} {k}: {ours} {image}"
                );
            }
        }
    }
}

/// The same bytes wherever a sample stands and however many stand beside it, one alone included.
#[test]
fn a_regressor_does_not_depend_on_the_samples_beside() {
    for robot in full_robots() {
        let len = 64;
        let [q, qd, qdd] = &motion(&robot, len);
        let motion = Motion { len, q, qd, qdd };
        let regressor = Regressor::new(&robot);
        let (mut whole, mut some) = (regressor.block(&robot), regressor.block(&robot));
        regressor.evaluate(&robot, motion, 0..len, &mut whole);
        for samples in [17..18, 0..2, 30..34, 5..10, 40..49, 63..64] {
            regressor.evaluate(&robot, motion, samples.clone(), &mut some);
            for p in 0..regressor.pairs().len() {
                for k in 0..10 {
                    let (a, b) = (&whole.column(p, k)[samples.clone()], some.column(p, k));
                    assert_eq!(
                        a,
                        &b[..samples.len()],
                        "pair {p}, parameter {k}, {samples:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn mass_matrices_of_a_block_are_those_of_its_samples() {
    for robot in full_robots() {
        let (n, len) = (robot.dof(), 20);
        let [q, qd, qdd] = &motion(&robot, len);
        let motion = Motion { len, q, qd, qdd };
        let mut out = vec![f64::NAN; n * n * STRIDE];
        mass_matrices(
            &robot,
            &mut BlockWorkspace::new(&robot),
            motion,
            2..20,
            &mut out,
        );
        let mut expected = vec![0.0; n * n];
        for s in 2..20 {
            let q = pick(q, len, s);
            mass_matrix(&robot, &mut Workspace::new(&robot), &q, &mut expected);
            let scale = expected.iter().fold(0f64, |most, v| most.max(v.abs()));
            for i in 0..n * n {
                assert!((out[i * STRIDE + s - 2] - expected[i]).abs() < 1e-13 * scale);
            }
        }
    }
}

#[test]
fn all_instructions_agree() {
    for robot in robots() {
        let len = 64;
        let [q, qd, qdd] = &motion(&robot, len);
        let motion = Motion { len, q, qd, qdd };
        let regressor = Regressor::new(&robot);
        let run = |set: Instructions| {
            let mut tau = vec![0.0; robot.dof() * len];
            nominal_torque_with(set, &robot, motion, &mut tau);
            let mut block = regressor.block(&robot);
            regressor.evaluate_with(set, &robot, motion, 0..len, &mut block);
            for pair in 0..regressor.pairs().len() {
                tau.extend_from_slice(block.pair(pair));
            }
            tau
        };
        let reference = run(Instructions::Portable);
        let scale = reference.iter().fold(0f64, |most, v| most.max(v.abs()));
        for set in [Instructions::Avx2, Instructions::Widest] {
            for (a, b) in run(set).iter().zip(&reference) {
                // The portable copy has no fused multiply-add.
                assert!((a - b).abs() <= 1e-13 * scale, "{set:?}: {a} {b}");
            }
        }
    }
}
