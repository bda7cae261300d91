//! Readings of a log: how the base stands, what the torque columns hold, which clock; no reading explains less than the log as it is.

use super::sample;
use super::testing::{INTERVAL, LEN, arm, log, log_of};
use super::*;
use crate::error::Code;
use std::f64::consts::{FRAC_PI_2, PI};

fn pipeline() -> Pipeline {
    Pipeline {
        cutoff_hz: 5.0,
        ..Pipeline::off(4)
    }
}

/// Code and subject of every finding above a note.
fn said(robot: &Robot, trajectory: &Trajectory) -> Vec<(String, String)> {
    let findings = self_check(robot, &pipeline(), [trajectory]).unwrap();
    let findings = findings.into_iter().filter(|f| f.severity > Severity::Note);
    findings.map(|f| (f.code.to_string(), f.subject)).collect()
}

fn only(code: &str, subject: &str) -> Vec<(String, String)> {
    vec![(code.to_owned(), subject.to_owned())]
}

fn rows(values: &mut [f64], joint: usize) -> &mut [f64] {
    &mut values[joint * LEN..(joint + 1) * LEN]
}

/// Gravity in the frame of a base that is turned by roll, then pitch about the world's fixed axes: `Rᵀ (0, 0, −9.81)`, written out.
fn gravity_of([roll, pitch, _]: [f64; 3]) -> [f64; 3] {
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    [9.81 * sp, -9.81 * sr * cp, -9.81 * cr * cp]
}

fn degrees_between(a: [f64; 3], b: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt())
        .clamp(-1.0, 1.0)
        .acos()
        .to_degrees()
}

/// Numbers drawn evenly from [-1, 1) by Knuth's generator.
fn draws(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[test]
fn a_robot_on_a_wall_or_a_ceiling_gets_its_base_proposed() {
    let mounted = [
        [PI, 0.0, 0.0],
        [FRAC_PI_2, 0.0, 0.0],
        [-FRAC_PI_2, 0.0, 0.0],
        [0.0, FRAC_PI_2, 0.0],
        [0.0, -FRAC_PI_2, 0.0],
    ];
    for rpy in mounted {
        for seed in 0..3 {
            let robot = arm(1.15).with_gravity(gravity_of(rpy));
            let log = log_of(&robot, f64::from(seed) * 3.1);
            let seen = look(&arm(1.0), &pipeline(), [&log]).unwrap();
            let codes: Vec<&str> = seen.findings.iter().map(|f| f.code.as_str()).collect();
            assert_eq!(codes, ["base_orientation"], "{rpy:?}: {:#?}", seen.findings);
            let base = seen.base.unwrap();
            assert!(
                degrees_between(base.gravity, gravity_of(rpy)) < 1e-6,
                "{rpy:?}: {base:?}"
            );
            assert!(
                degrees_between(gravity_of(base.rpy), gravity_of(rpy)) < 1e-6,
                "{base:?}"
            );
            let line = base.line();
            assert!(line.starts_with("base = { rpy = ["), "{line}");
            assert!(
                seen.findings[0].message.contains(&line),
                "{}",
                seen.findings[0].message
            );
            assert!(seen.findings[0].doubts_the_log());
        }
    }
    // A base that stands along no axis; the yaw is left 0.
    let robot = arm(1.15).with_gravity(gravity_of([0.8, 0.0, 0.0]));
    let base = look(&arm(1.0), &pipeline(), [&log_of(&robot, 0.0)])
        .unwrap()
        .base
        .unwrap();
    assert!(
        degrees_between(base.gravity, robot.description().gravity) < 5.0,
        "{base:?}"
    );
    assert_eq!(base.rpy[2], 0.0);
    // A model whose gravity was said: the line says gravity again.
    let wall = arm(1.0).with_gravity(gravity_of([0.0, FRAC_PI_2, 0.0]));
    let base = look(&wall, &pipeline(), [&log(0.0)]).unwrap().base.unwrap();
    assert_eq!(base.line(), "gravity = [0.0, 0.0, -9.81]");
}

/// A hand with seven times its weight: without a word on it that is another scale of the last joint's torque.
#[test]
fn a_payload_that_the_log_states_is_part_of_the_model() {
    let robot = arm(1.0);
    let (mass, com) = (30.0, [0.05, 0.0, 0.25]);
    let loaded = robot
        .carrying(&robot.joint(3).child, mass, com)
        .expect("a positive mass at a link of the arm");
    let mut log = log_of(&loaded, 0.0);
    let scale = |log: &Trajectory| {
        let said = said(&robot, log);
        said.iter().any(|(code, _)| code == "torque_scale")
    };
    assert!(scale(&log), "{:?}", said(&robot, &log));
    log.payload = crate::signal::Payload::Known { mass, com };
    assert_eq!(said(&robot, &log), []);
}

/// Robots, bases and mistakes at random: whatever is proposed explains at least as much of every joint's torque.
#[test]
fn no_reading_is_proposed_that_explains_less_on_any_joint() {
    let mut proposed = 0;
    for seed in 0..24_u64 {
        let mut draw = draws(seed);
        let mut description = arm(1.0).description().clone();
        for (joint, link) in description
            .joints
            .iter_mut()
            .zip(&mut description.links[1..])
        {
            joint.axis = [draw(), draw(), draw()];
            if let Some(inertia) = &mut link.inertia {
                inertia.com = [0.2 * draw(), 0.1 * draw(), 0.1 * draw()];
            }
        }
        let model = Robot::new(description, &std::collections::BTreeMap::new())
            .unwrap()
            .0;
        let base = [PI * draw(), FRAC_PI_2 * draw(), 0.0];
        let turned = model.with_gravity(if seed % 3 == 0 {
            [0.0, 0.0, -9.81]
        } else {
            gravity_of(base)
        });
        let mut trajectory = log_of(&turned, seed as f64);
        let s = &mut trajectory.segments[0];
        match seed % 4 {
            1 => rows(&mut s.tau, 1).iter_mut().for_each(|t| *t *= -1.0),
            2 => (0..LEN).for_each(|i| s.tau.swap(LEN + i, 2 * LEN + i)),
            3 => rows(&mut s.q, 2).iter_mut().for_each(|q| *q *= -1.0),
            _ => (),
        }
        let sample = Sample::take(&pipeline(), &trajectory, 1).unwrap();
        let of_many = Sample::take(&pipeline(), &trajectory, 500).expect("a log that moves");
        assert!(of_many.len <= sample::LEAST && of_many.len < sample.len);
        let as_logged = explain(&model, &sample, &Reading::as_logged(4));
        let read = Read::of(&model, &sample, &as_logged);
        let is_other = read.base.is_some() || !read.is_as_logged();
        proposed += usize::from(is_other);
        for (joint, (before, after)) in as_logged.iter().zip(&read.explained).enumerate() {
            let (before, after) = (before.unwrap(), after.unwrap());
            let less = after.left - before.left;
            // BY_FACTOR of the search: what friction and an unknown payload may make of it.
            assert!(
                less <= 0.03,
                "seed {seed}, joint {joint}: {before:?} → {after:?}"
            );
        }
    }
    assert!(proposed >= 8, "{proposed} of 24");
}

#[test]
fn torque_without_the_models_part_is_named() {
    let sized = |part: fn(&Robot) -> Robot| {
        let mut log = log(0.0);
        let s = &mut log.segments[0];
        let still = vec![0.0; 4 * LEN];
        let mut model = vec![0.0; 4 * LEN];
        let robot = part(&arm(1.0));
        let is_whole = robot.description().gravity == [0.0, 0.0, -9.81];
        let (qd, qdd) = if is_whole {
            (&s.qd, &s.qdd)
        } else {
            (&still, &still)
        };
        let motion = crate::robot::Motion {
            len: LEN,
            q: &s.q,
            qd,
            qdd,
        };
        crate::robot::nominal_torque(&arm(1.0), motion, &mut model);
        s.tau
            .iter_mut()
            .zip(&model)
            .for_each(|(tau, model)| *tau -= model);
        log
    };
    let less_model = sized(Robot::clone);
    assert_eq!(said(&arm(1.0), &less_model), only("model_torque", "run"));
    let less_gravity = sized(|robot| robot.with_gravity([0.0; 3]));
    assert_eq!(
        said(&arm(1.0), &less_gravity),
        only("gravity_compensated", "run")
    );
}

#[test]
fn a_factor_on_all_torque_or_on_inertia_alone_is_named() {
    let mut doubled = log(0.0);
    doubled.segments[0].tau.iter_mut().for_each(|t| *t *= 2.0);
    let findings = self_check(&arm(1.0), &pipeline(), [&doubled]).unwrap();
    assert_eq!(findings.len(), 1, "{findings:#?}");
    assert_eq!(
        (findings[0].code.as_str(), &*findings[0].subject),
        ("torque_scale", "")
    );
    // 2 × 1.15 of the model's is 2.3; the payload's columns take 1 % of it.
    let message = &findings[0].message;
    assert!(
        message.starts_with("torque is 2.28") || message.starts_with("torque is 2.3"),
        "{message}"
    );
    // Stamps 1.4 times too long: velocity and acceleration come out too small.
    let mut slow = log(0.0);
    let s = &mut slow.segments[0];
    s.time.iter_mut().for_each(|t| *t *= 1.4);
    s.interval *= 1.4;
    s.qd.iter_mut().for_each(|v| *v /= 1.4);
    s.qdd.iter_mut().for_each(|a| *a /= 1.96);
    assert_eq!(said(&arm(1.15), &slow), only("clock_scale", ""));
    // With the velocity as it was: that contradicts the change of position.
    let s = &mut slow.segments[0];
    s.qd.iter_mut().for_each(|v| *v *= 1.4);
    let findings = self_check(&arm(1.15), &pipeline(), [&slow]).unwrap();
    let clock = findings
        .iter()
        .find(|f| f.code == Code::ClockScale)
        .unwrap();
    assert!(
        clock.message.contains("1.400 times too long"),
        "{}",
        clock.message
    );
}

#[test]
fn one_joint_in_degrees_is_refused_by_its_name() {
    for joint in 1..3 {
        let mut one = log(0.0);
        let s = &mut one.segments[0];
        for values in [&mut s.q, &mut s.qd, &mut s.qdd] {
            rows(values, joint)
                .iter_mut()
                .for_each(|v| *v *= 180.0 / PI);
        }
        let error = self_check(&arm(1.0), &pipeline(), [&one])
            .unwrap_err()
            .to_string();
        let name = format!("positions of joint `j{}` look like degrees", joint + 1);
        assert!(error.contains(&name), "{error}");
    }
}

#[test]
fn torque_columns_that_are_no_measurement_are_named() {
    let mut copied = log(0.0);
    let tau = &mut copied.segments[0].tau;
    tau.copy_within(LEN..2 * LEN, 2 * LEN);
    let codes = said(&arm(1.0), &copied);
    assert!(
        codes.contains(&("torque_copied".into(), "j3".into())),
        "{codes:?}"
    );
    let mut constant = log(0.0);
    rows(&mut constant.segments[0].tau, 1).fill(3.25);
    let codes = said(&arm(1.0), &constant);
    assert!(
        codes.contains(&("torque_constant".into(), "j2".into())),
        "{codes:?}"
    );
}

/// The last link is so light that its torque alone does not say whether its joint has a drive.
#[test]
fn a_torque_of_zero_is_no_measurement_where_another_log_shows_a_drive() {
    let mut description = arm(1.15).description().clone();
    let light = (description.links[4].inertia.as_mut()).expect("an inertia of the last link");
    light.mass *= 1e-5;
    let elements = light.tensor.iter_mut().flatten();
    elements.for_each(|element| *element *= 1e-5);
    let (robot, _) = Robot::new(description, &Default::default()).expect("an arm");
    let mut logs = [0.0, 3.1].map(|seed| log_of(&robot, seed));
    let said = |logs: &[Trajectory]| -> Vec<String> {
        let found = self_check(&robot, &pipeline(), logs).expect("positions in radians");
        let constant = found.iter().filter(|own| own.code == Code::TorqueConstant);
        constant.map(|own| own.message.clone()).collect()
    };
    for joint in 0..4 {
        let kept = logs[1].clone();
        rows(&mut logs[1].segments[0].tau, joint).fill(0.0);
        let found = said(&logs);
        let place = format!(
            "joint `j{}` is 0.00 throughout while it changes in other logs",
            joint + 1
        );
        assert!(found.len() == 1 && found[0].contains(&place), "{found:?}");
        logs[1] = kept;
    }
    assert!(said(&logs).is_empty());
}

/// A recording of the arm's log, its torque changed.
fn recording(change: impl Fn(&mut [f64])) -> crate::signal::Recording {
    let log = log(0.0);
    let s = &log.segments[0];
    let of = |values: &[f64], joint: usize| values[joint * LEN..(joint + 1) * LEN].to_vec();
    let joints = (0..4).map(|joint| {
        let mut tau = of(&s.tau, joint);
        if joint == 1 {
            change(&mut tau);
        }
        crate::signal::Channels {
            q: of(&s.q, joint),
            qd: None,
            qdd: None,
            tau: Some(tau),
            temperature: None,
        }
    });
    crate::signal::Recording {
        unfolded: false,
        start_ns: 0,
        name: "run".into(),
        time: s.time.clone(),
        joints: joints.collect(),
        payload: crate::signal::Payload::None,
    }
}

#[test]
fn torque_that_is_held_while_its_joint_moves_is_named() {
    let said = |change: fn(&mut [f64])| -> Vec<(String, String, Severity)> {
        let logs = [recording(change)];
        let findings = crate::signal::constant_torque(&arm(1.0), &logs).unwrap();
        findings
            .into_iter()
            .map(|f| (f.code.to_string(), f.subject, f.severity))
            .collect()
    };
    let hold = (0.2 / INTERVAL) as usize;
    assert_eq!(hold, 40);
    assert_eq!(said(|_| ()), []);
    // Written anew every 200 ms.
    let held = said(|tau| tau.chunks_mut(40).for_each(|part| part.fill(part[0])));
    assert_eq!(
        held,
        [("torque_held".into(), "j2".into(), Severity::Degraded)]
    );
    // Once in 20 s.
    let once = said(|tau| {
        let stale = tau[1000];
        tau[1000..1040].fill(stale);
    });
    assert!(
        once.is_empty() || once == [("stale_torque".into(), "j2".into(), Severity::Note)],
        "{once:?}"
    );
    // A resolution of 2 N·m holds values, too, and for longer.
    assert_eq!(
        said(|tau| tau.iter_mut().for_each(|t| *t = 2.0 * (*t / 2.0).round())),
        []
    );
    assert_eq!(
        said(|tau| tau.iter_mut().for_each(|t| *t = 20.0 * (*t / 20.0).round())),
        []
    );
}
