//! Planted mistakes on a simulated arm with friction, noise and a wrong model: each is named, and nothing else.

use super::testing::{INTERVAL, LEN, arm, log};
use super::*;
use crate::error::Code;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

fn filtered() -> Pipeline {
    Pipeline {
        cutoff_hz: 5.0,
        ..Pipeline::off(4)
    }
}

fn check(trajectory: &Trajectory) -> Result<Vec<Finding>> {
    self_check(&arm(1.0), &filtered(), [trajectory])
}

fn said(trajectory: &Trajectory) -> Vec<(String, String)> {
    let findings = check(trajectory).unwrap();
    findings
        .into_iter()
        .map(|f| (f.code.to_string(), f.subject))
        .collect()
}

/// The rows of one joint in a channel.
fn rows(values: &mut [f64], joint: usize) -> &mut [f64] {
    &mut values[joint * LEN..(joint + 1) * LEN]
}

fn swap(values: &mut [f64], a: usize, b: usize) {
    for i in 0..LEN {
        values.swap(a * LEN + i, b * LEN + i);
    }
}

#[test]
fn a_good_log_is_passed_in_silence() {
    for seed in 0..10 {
        assert_eq!(said(&log(f64::from(seed) * 3.1)), []);
    }
}

/// Torque of which nothing is the model's: other readings only make the model's smaller.
#[test]
fn noise_for_torque_is_no_other_order() {
    for size in [0.1, 1.0, 10.0, 100.0] {
        let mut noise = log(0.0);
        let mut state = 3_u64;
        for tau in &mut noise.segments[0].tau {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            *tau = size * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
        }
        let codes: Vec<String> = said(&noise).into_iter().map(|(code, _)| code).collect();
        assert!(
            codes.iter().all(|code| code == "torque_scale"),
            "{size}: {codes:?}"
        );
    }
}

#[test]
fn case_18_degrees_are_refused() {
    let mut degrees = log(0.0);
    let s = &mut degrees.segments[0];
    for values in [&mut s.q, &mut s.qd, &mut s.qdd] {
        values.iter_mut().for_each(|v| *v *= 180.0 / PI);
    }
    let message = check(&degrees).unwrap_err().to_string();
    assert!(
        message.contains("log `run`: positions look like degrees") && message.contains("π/180"),
        "{message}"
    );
    // Radians beyond a turn are none.
    let mut turned = log(0.0);
    rows(&mut turned.segments[0].q, 0)
        .iter_mut()
        .for_each(|q| *q += 4.0 * TAU);
    assert_eq!(said(&turned), []);
}

#[test]
fn case_19_and_20_torque_of_another_unit_or_side_is_named_with_its_gain() {
    for (gain, words) in [
        (1.0 / 11.3, "looks like gain "),
        (0.01, "motor's side"),
        (1000.0, "N·mm"),
    ] {
        let mut scaled = log(0.0);
        rows(&mut scaled.segments[0].tau, 1)
            .iter_mut()
            .for_each(|t| *t *= gain);
        let findings = check(&scaled).unwrap();
        assert_eq!(findings.len(), 1, "{findings:#?}");
        assert_eq!(
            (findings[0].code.as_str(), &*findings[0].subject),
            ("torque_scale", "j2")
        );
        assert!(findings[0].message.contains(words), "{findings:#?}");
    }
    // 11.3 A per 1.15 N·m of the model: the stated number is 11.3 / 1.15.
    let mut scaled = log(0.0);
    rows(&mut scaled.segments[0].tau, 1)
        .iter_mut()
        .for_each(|t| *t /= 11.3);
    let message = &check(&scaled).unwrap()[0].message;
    let after = message.split("looks like gain ").nth(1).unwrap();
    let stated: f64 = after.split(' ').next().unwrap().parse().unwrap();
    assert!((stated / (11.3 / 1.15) - 1.0).abs() < 0.05, "{message}");
}

/// The first `len` samples of a log.
fn beginning(mut log: Trajectory, len: usize) -> Trajectory {
    let segment = &mut log.segments[0];
    let cut = |values: &[f64]| -> Vec<f64> {
        let joints = values.chunks(LEN);
        joints.flat_map(|own| own[..len].to_vec()).collect()
    };
    for values in [
        &mut segment.q,
        &mut segment.qd,
        &mut segment.qdd,
        &mut segment.tau,
    ] {
        *values = cut(values);
    }
    segment.time.truncate(len);
    segment.input_rows.truncate(len);
    segment.standstill.truncate(4 * len);
    log
}

/// A few seconds may look like another unit by chance: only thousandths are so far off that they are told.
#[test]
fn a_few_seconds_tell_no_factor_but_thousandths() {
    let of = |gain: f64, seconds: f64| {
        let mut scaled = log(0.0);
        rows(&mut scaled.segments[0].tau, 1)
            .iter_mut()
            .for_each(|t| *t *= gain);
        let pipeline = Pipeline {
            cutoff_hz: 2.6,
            ..Pipeline::off(4)
        };
        let log = beginning(scaled, (seconds / INTERVAL) as usize);
        let findings = self_check(&arm(1.0), &pipeline, [&log]).unwrap();
        let told = findings
            .into_iter()
            .map(|f| (f.code.to_string(), f.subject));
        told.collect::<Vec<_>>()
    };
    let told = [("torque_scale".to_owned(), "j2".to_owned())];
    // 104 and 83 half periods of the cut-off.
    assert_eq!(of(1.0 / 11.3, 20.0), told);
    assert_eq!(of(1.0 / 11.3, 16.0), []);
    assert_eq!(of(1000.0, 16.0), told);
}

/// Torque that the model does not explain at all, of a size that no missing effect has.
#[test]
fn case_19_and_20_torque_of_all_joints_of_quite_another_size_is_named_without_its_shape() {
    let on = |robot: &Robot, factor: f64, friction: f64| {
        let mut log = log(0.0);
        let segment = &mut log.segments[0];
        for (i, tau) in segment.tau.iter_mut().enumerate() {
            // Of another motion, and friction.
            let other = (0.013 * i as f64).sin() + 0.5 * (0.031 * i as f64).cos();
            *tau = factor * 100.0 * other + friction * segment.qd[i];
        }
        let findings = self_check(robot, &filtered(), [&log]).unwrap();
        let said = findings
            .into_iter()
            .map(|f| (f.code.to_string(), f.subject));
        said.collect::<Vec<_>>()
    };
    let of = |factor: f64, friction: f64| on(&arm(1.0), factor, friction);
    let told = [("torque_scale".to_owned(), String::new())];
    assert_eq!(of(1e-3, 0.0), told);
    assert_eq!(of(1e3, 0.0), told);
    assert_eq!(of(1.0, 0.0), []);
    // A slow arm's friction is many times its nominal torque, but for what holds a weight.
    let mut weightless = arm(1.0).description().clone();
    weightless.gravity = [0.0; 3];
    let weightless = Robot::new(weightless, &BTreeMap::new()).unwrap().0;
    assert_eq!(on(&weightless, 0.0, 1e5), []);
    assert_eq!(of(0.0, 1e5), told);
}

/// The arm with the effort limits of its joints, N·m.
fn limited(efforts: [f64; 4]) -> Robot {
    let mut description = arm(1.0).description().clone();
    for (joint, effort) in description.joints.iter_mut().zip(efforts) {
        joint.limits.effort = Some(effort);
    }
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

/// Friction explains all of a torque whose model's part is small; a model that says what drives can do still tells thousandths.
#[test]
fn case_20_torque_far_beyond_the_models_effort_limit_is_in_another_unit() {
    let of = |robot: &Robot, factor: f64| {
        let mut log = log(0.0);
        let s = &mut log.segments[0];
        for i in 3 * LEN..4 * LEN {
            s.tau[i] = factor * (1.5 * s.qd[i] + 2.0 * (s.qd[i] / 0.01).tanh());
        }
        look(robot, &filtered(), [&log]).unwrap()
    };
    let robot = limited([100.0, 100.0, 100.0, 10.0]);
    assert_eq!(of(&robot, 1.0).findings, []);
    // 5.3 N·m at most: three times the limit is a drive's peak, eighteen times is none.
    assert_eq!(of(&robot, 6.0).findings, []);
    let seen = of(&robot, 33.0);
    assert_eq!(seen.findings.len(), 1, "{:#?}", seen.findings);
    let message = &seen.findings[0].message;
    assert!(message.contains("another unit or side"), "{message}");
    assert!(
        seen.joints
            .iter()
            .all(|joint| joint.torque_factor.is_none())
    );
    let seen = of(&robot, 1000.0);
    assert_eq!(seen.findings.len(), 1, "{:#?}", seen.findings);
    let said = &seen.findings[0];
    assert_eq!((said.code.as_str(), &*said.subject), ("torque_scale", "j4"));
    assert!(said.message.contains("the effort limit of the model (10)"));
    let factors = seen.joints.iter().map(|joint| joint.torque_factor);
    assert!(factors.eq([None, None, None, Some(1e-3)]));
    // Limits that nothing keeps are made up.
    assert_eq!(of(&limited([1e-3; 4]), 1.0).findings, []);
    assert_eq!(of(&limited([1.0, 1.0, 1.0, 0.05]), 1.0).findings, []);
}

/// One finding, with a factor for every joint.
#[test]
fn case_20_torque_of_all_joints_far_beyond_their_effort_limits_is_named_once() {
    let robot = limited([100.0, 100.0, 100.0, 10.0]);
    let mut all = log(0.0);
    all.segments[0].tau.iter_mut().for_each(|tau| *tau *= 1e3);
    let seen = look(&robot, &filtered(), [&all]).unwrap();
    assert_eq!(seen.findings.len(), 1, "{:#?}", seen.findings);
    assert_eq!(
        (seen.findings[0].code.as_str(), &*seen.findings[0].subject),
        ("torque_scale", "")
    );
    let factors = seen.joints.iter().map(|joint| joint.torque_factor);
    assert!(factors.eq([Some(1e-3); 4]));
    // The same where friction explains all torque, by limits that differ.
    all.segments[0].tau = (all.segments[0].qd.iter())
        .map(|qd| 1e3 * (1.5 * qd + 2.0 * (qd / 0.01).tanh()))
        .collect();
    let effort = |robot: &Robot| look(robot, &filtered(), [&all]).unwrap().findings;
    let said = effort(&limited([20.0, 20.0, 20.0, 10.0]));
    assert!(
        said.len() == 1 && said[0].message.contains("on every joint"),
        "{said:#?}"
    );
    // Limits that are all alike say nothing; but no drive that holds a weight has friction of hundreds of times it.
    let said = effort(&limited([20.0; 4]));
    assert!(
        said.len() == 1 && said[0].message.contains("of all joints together is"),
        "{said:#?}"
    );
}

#[test]
fn case_21_a_turned_sign_is_named_with_its_joint() {
    for joint in 0..4 {
        let mut torque = log(0.0);
        rows(&mut torque.segments[0].tau, joint)
            .iter_mut()
            .for_each(|t| *t *= -1.0);
        let findings = check(&torque).unwrap();
        assert_eq!(findings.len(), 1, "{joint}: {findings:#?}");
        assert_eq!(findings[0].subject, format!("j{}", joint + 1));
        assert!(
            findings[0].message.contains("its torque has"),
            "{findings:#?}"
        );
    }
    // Motion of joint 2 turned: its gravity torque and what it does to the others tell.
    let mut motion = log(0.0);
    let s = &mut motion.segments[0];
    for values in [&mut s.q, &mut s.qd, &mut s.qdd] {
        rows(values, 1).iter_mut().for_each(|v| *v *= -1.0);
    }
    let findings = check(&motion).unwrap();
    assert_eq!(findings.len(), 1, "{findings:#?}");
    assert_eq!(findings[0].subject, "j2");
    assert!(
        findings[0].message.contains("its position and velocity"),
        "{findings:#?}"
    );
    // All drives count the other way.
    let mut all = log(0.0);
    all.segments[0].tau.iter_mut().for_each(|t| *t *= -1.0);
    let flips = ["j1", "j2", "j3", "j4"].map(|j| ("sign_flip".to_owned(), j.to_owned()));
    assert_eq!(said(&all), flips);
}

/// Position alone, or velocity alone (with the acceleration that comes of it): that they do not fit each other tells that one of them is
/// turned, torque which.
#[test]
fn case_21_a_turned_sign_of_position_or_velocity_alone_is_named_with_its_joint() {
    for joint in 0..4 {
        for (position, words) in [
            (
                true,
                "its position has the opposite sign, its velocity has not",
            ),
            (
                false,
                "its velocity has the opposite sign, its position has not",
            ),
        ] {
            let mut one = log(0.0);
            let s = &mut one.segments[0];
            let channels = match position {
                true => vec![&mut s.q],
                false => vec![&mut s.qd, &mut s.qdd],
            };
            for values in channels {
                rows(values, joint).iter_mut().for_each(|v| *v *= -1.0);
            }
            let findings = check(&one).unwrap();
            assert_eq!(findings.len(), 1, "{joint}, {position}: {findings:#?}");
            assert_eq!(findings[0].subject, format!("j{}", joint + 1));
            assert!(findings[0].message.contains(words), "{findings:#?}");
        }
    }
}

#[test]
fn case_22_exchanged_joints_are_named_with_the_order_to_try() {
    // Two joints exchanged in all columns, in torque only, and three in a ring.
    for (swaps, all, words) in [
        (
            &[(1, 2)][..],
            true,
            "`j2` = all columns of `j3`, `j3` = all columns of `j2`",
        ),
        (
            &[(0, 1)],
            false,
            "`j1` = torque of `j2`, `j2` = torque of `j1`",
        ),
        (
            &[(0, 1), (1, 2)],
            true,
            "`j1` = all columns of `j3`, `j2` = all columns of `j1`, `j3` = all columns of `j2`",
        ),
    ] {
        let mut mixed = log(0.0);
        let s = &mut mixed.segments[0];
        for &(a, b) in swaps {
            swap(&mut s.tau, a, b);
            if all {
                swap(&mut s.q, a, b);
                swap(&mut s.qd, a, b);
                swap(&mut s.qdd, a, b);
            }
        }
        let findings = check(&mixed).unwrap();
        assert_eq!(findings.len(), 1, "{findings:#?}");
        assert_eq!(findings[0].code, Code::JointOrder);
        assert!(findings[0].message.contains(words), "{findings:#?}");
    }
}

#[test]
fn a_joint_that_is_only_damped_is_no_turned_sign() {
    // Joint 3 swings under gravity and inertia; its drive takes a little energy out, which is friction with a minus.
    let mut passive = log(0.0);
    let s = &mut passive.segments[0];
    for i in 2 * LEN..3 * LEN {
        s.tau[i] = -0.3 * s.qd[i];
    }
    assert_eq!(said(&passive), []);
}
