//! Values that are missing, infinite, wrapped, at rest or to be derived.

use super::{AUTO, contains, is_true_motion, options, read, refused, run, says, silent};
use crate::common::logs::{LogText, arm, motion, robot};
use std::f64::consts::{PI, TAU};
use twincal::robot::JointKind;
use twincal::signal::{
    Auto, DerivedFrom, Pipeline, SignalSettings, Trajectory, align, choose_pipeline,
};
use twincal::{Code, Finding, Severity};
use twincal_io::log::read_csv;

#[test]
fn case_01_nan_in_q_is_dropped_counted_and_cuts() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    log.set(2000, "q1", "nan").set(2001, "q2", "");
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "not_finite_rows");
    assert_eq!((said.count, said.severity), (2, Severity::Warning));
    contains(
        &said.message,
        &[
            "position of joint `shoulder`: 1",
            "position of joint `elbow`: 1",
        ],
    );
    assert_eq!(trajectory.segments.len(), 2);
    is_true_motion(&trajectory, 1e-5, |t| t);

    // 2 % lost in one stretch: degraded (exit code 3)
    log.rows[500..580]
        .iter_mut()
        .for_each(|row| row[1] = "NaN".into());
    let (_, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "not_finite_rows");
    assert_eq!((said.count, said.severity), (82, Severity::Degraded));
}

#[test]
fn case_02_infinite_torque_is_dropped_like_nan() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    log.set(1000, "tau2", "inf").set(3000, "tau1", "-Infinity");
    // No measurement in any unit: its squares would overflow.
    log.set(2000, "tau1", "1e300");
    let (trajectory, findings) = run(&log.csv()).unwrap();
    assert_eq!(says(&findings, "not_finite_rows").count, 3);
    assert_eq!(trajectory.segments.len(), 4);
    assert!(
        trajectory
            .segments
            .iter()
            .all(|s| s.tau.iter().all(|v| v.is_finite()))
    );
}

#[test]
fn case_03_a_column_of_nan_is_refused_by_name() {
    let mut log = LogText::moving(2, 100.0, 5.0);
    log.map("qd2", |_, _| "nan".into());
    contains(
        &refused(read(&log.csv())),
        &["run.csv", "column `qd2`", "all 500 rows"],
    );
}

#[test]
fn case_04_an_empty_file_is_refused() {
    contains(&refused(read("")), &["run.csv", "empty"]);
}

#[test]
fn case_05_a_header_without_rows_is_refused() {
    contains(
        &refused(read("t,q1,q2,tau1,tau2\n")),
        &["run.csv", "header but no rows"],
    );
}

#[test]
fn case_06_one_sample_is_refused_with_the_number_needed() {
    let mut log = LogText::moving(2, 100.0, 5.0);
    log.rows.truncate(1);
    contains(
        &refused(run(&log.csv())),
        &["run.csv", "1 sample", "needs at least 10"],
    );
}

#[test]
fn case_23_a_wrapped_angle_is_unfolded_and_counted_a_slider_never() {
    let turning = |i: usize| 3.0 * i as f64 / 200.0 + 0.4 * (TAU * 0.5 * i as f64 / 200.0).sin();
    let folded = |i: usize| (turning(i) + PI).rem_euclid(TAU) - PI;
    let mut log = LogText::moving(2, 200.0, 20.0).without(&["qd1", "qdd1", "qd2", "qdd2"]);
    log.map("q1", |i, _| format!("{:.9}", folded(i)));
    log.map("q2", |i, _| format!("{:.9}", folded(i)));
    let robot = robot(&[
        ("spin", JointKind::Continuous),
        ("slide", JointKind::Prismatic),
    ]);
    let text = log.csv();
    let (recording, _) = read_csv(text.as_bytes(), 0, "run.csv", &robot, &options()).unwrap();
    let pipeline = Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        rate_hz: 12.5,
        motion_interval: 0.0,
        coulomb_velocity: 0.02,
        standstill_velocity: vec![0.02; 2],
        derived_from: vec![DerivedFrom::Position; 2],
        velocity_from: Vec::new(),
        corrections: twincal::signal::Corrections::default(),
        history: Vec::new(),
    };
    let (trajectory, findings) = align(&robot, &recording, &pipeline).unwrap();
    let turns = ((turning(3999) + PI) / TAU).floor() as u64;
    let said: Vec<&Finding> = findings
        .iter()
        .filter(|f| f.code == Code::WrappedAngle)
        .collect();
    assert_eq!(said.len(), 1, "{findings:#?}");
    assert_eq!(said[0].count, turns);
    contains(&said[0].message, &["`spin`"]);
    // The slider keeps its jumps: as no slider moves so, the log is cut there and says it.
    let jumps: Vec<&Finding> = findings
        .iter()
        .filter(|f| f.code == Code::PositionStep)
        .collect();
    assert_eq!(jumps.len(), 1, "{findings:#?}");
    assert_eq!(jumps[0].count, turns);
    contains(&jumps[0].message, &["`slide`", "-6.27"]);
    for segment in &trajectory.segments {
        let len = segment.time.len();
        for (i, &row) in segment.input_rows.iter().enumerate() {
            assert!((segment.q[i] - turning(row)).abs() < 1e-6);
            assert!((segment.q[len + i] - folded(row)).abs() < 1e-6);
        }
    }
}

#[test]
fn a_position_that_is_wrong_in_one_sample_is_named_and_left_out() {
    for size in [0.5, 1e5] {
        let mut log = LogText::moving(2, 200.0, 20.0).without(&["qd1", "qdd1", "qd2", "qdd2"]);
        let (clean, _) = run(&log.csv()).unwrap();
        log.map("q1", |i, q| {
            let q: f64 = q.parse().unwrap();
            format!("{:.12}", if i == 1503 { q + size } else { q })
        });
        let (trajectory, findings) = run(&log.csv()).unwrap();
        let said = says(&findings, "motion_spike");
        assert_eq!(said.count, 1);
        let leaves = format!("+{size:.3} rad");
        contains(&said.message, &["position", &leaves, "7.515 s", "once"]);
        assert_eq!(trajectory.segments.len(), 2);
        // What is left of motion and of its noise is as if it had not been there.
        let still = |trajectory: &Trajectory| -> usize {
            let all = trajectory.segments.iter().flat_map(|s| &s.standstill);
            all.filter(|still| **still).count()
        };
        assert!(still(&trajectory) <= still(&clean));
        let smooth = &clean.segments[0];
        for segment in &trajectory.segments {
            for (i, row) in segment.input_rows.iter().enumerate() {
                let at = smooth.input_rows.binary_search(row).unwrap();
                assert!((segment.q[i] - smooth.q[at]).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn case_25_a_missing_acceleration_is_derived_and_its_noise_stated() {
    let log = LogText::moving(2, 200.0, 20.0).without(&["qd1", "qdd1", "qd2", "qdd2"]);
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "derived_acceleration");
    contains(
        &said.message,
        &["joint `shoulder`", "position, twice", "noise"],
    );
    is_true_motion(&trajectory, 1e-5, |t| t);
    let log = LogText::moving(2, 200.0, 20.0).without(&["qdd1", "qdd2"]);
    let (trajectory, findings) = run(&log.csv()).unwrap();
    contains(
        &says(&findings, "derived_acceleration").message,
        &["the logged velocity"],
    );
    is_true_motion(&trajectory, 1e-5, |t| t);
    // With the filter off there is nothing to derive with: refused, with the remedy.
    let (recording, _) = read(&log.csv()).unwrap();
    let off = SignalSettings {
        cutoff_hz: Auto::Value(0.0),
        ..AUTO
    };
    let message = choose_pipeline(&arm(), &[recording], &off)
        .unwrap_err()
        .to_string();
    contains(
        &message,
        &[
            "run.csv",
            "joint `shoulder` has no acceleration",
            "cutoff_hz",
        ],
    );
}

#[test]
fn case_28_a_robot_that_stands_still_is_refused_with_its_joints() {
    let mut log = LogText::moving(2, 200.0, 20.0).without(&["qd1", "qdd1", "qd2", "qdd2"]);
    // Encoder noise of one step, nothing else.
    let noise = |i: usize| {
        format!(
            "{:.9}",
            0.5 + 1e-4 * f64::from(u8::from((i * i * 31 + i * 7) % 97 < 40))
        )
    };
    log.map("q1", |i, _| noise(i))
        .map("q2", |i, _| noise(3 * i + 1));
    let message = refused(run(&log.csv()));
    contains(&message, &["no excitation", "`shoulder`", "`elbow`"]);
    // One joint still: go on and say so.
    let mut log = LogText::moving(2, 200.0, 20.0).without(&["qd1", "qdd1", "qd2", "qdd2"]);
    log.map("q2", |i, _| noise(i));
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "joint_not_excited");
    assert_eq!(said.subject, "elbow");
    assert!(
        trajectory.segments[0].standstill[trajectory.segments[0].time.len()..]
            .iter()
            .all(|s| *s)
    );
}

#[test]
fn case_26_saturated_torque_is_masked_with_what_the_filter_mixes_with_it() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    let limit = 4.0;
    log.map("tau1", |_, cell| {
        format!("{:.9}", cell.parse::<f64>().unwrap().min(limit))
    });
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said: Vec<&Finding> = findings
        .iter()
        .filter(|f| f.code == Code::SaturatedTorque)
        .collect();
    assert_eq!(said.len(), 1, "{findings:#?}");
    assert_eq!(said[0].severity, Severity::Warning);
    contains(
        &said[0].message,
        &[
            "joint `shoulder`",
            "limit of 4",
            "scores over all rows contain them",
        ],
    );
    // Closed form: where 4 N·m was asked for and not given.
    let asked = |t: f64| {
        let [_, qd, qdd] = motion(0, t);
        qdd + 0.5 * qd
    };
    let flat = (0..4000)
        .filter(|i| asked(f64::from(*i) / 200.0) >= limit)
        .count();
    assert_eq!(said[0].count, flat as u64);
    let segment = &trajectory.segments[0];
    let len = segment.time.len();
    let period = 1.0 / 5.0;
    for (i, masked) in segment.standstill[..len].iter().enumerate() {
        let t = segment.time[i];
        let near = |margin: f64| {
            (-200..=200).any(|k| {
                let other = t + f64::from(k) / 200.0 * margin;
                asked(other) >= limit
            })
        };
        assert!(*masked || !near(0.9 * period), "{t} s must be masked");
        assert!(!*masked || near(1.1 * period), "{t} s must not be masked");
    }
    assert!(segment.standstill[len..].iter().all(|m| !m));
    let (_, findings) = run(&LogText::moving(2, 200.0, 20.0).csv()).unwrap();
    silent(&findings, "saturated_torque");
}
