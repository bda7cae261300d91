//! Stamps that repeat, jump, stand still, jitter or are in another unit.

use super::{AUTO, contains, is_true_motion, options, read_bytes, refused, run, says, silent};
use crate::common::logs::{LogText, arm, motion};
use twincal::Severity;
use twincal::signal::{Trajectory, align, choose_pipeline};
use twincal_io::log::LogOptions;

#[test]
fn case_08_a_step_back_in_time_cuts_and_is_counted() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    // The clock is set back by 30 ms once and goes on.
    log.map("t", |i, t| {
        if i < 2000 {
            t.into()
        } else {
            format!("{:.6}", t.parse::<f64>().unwrap() - 0.03)
        }
    });
    let (trajectory, findings) = run(&log.csv()).unwrap();
    assert_eq!(says(&findings, "time_steps_back").count, 1);
    assert_eq!(trajectory.segments.len(), 2);
    let second = trajectory.segments[1].clone();
    is_true_motion(
        &Trajectory {
            segments: vec![second],
            ..trajectory
        },
        1e-5,
        |t| t + 0.03,
    );
}

#[test]
fn case_09_a_jump_of_an_hour_cuts_without_a_derivative_across() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    log.map("t", |i, t| {
        if i < 1700 {
            t.into()
        } else {
            format!("{:.6}", t.parse::<f64>().unwrap() + 3600.0)
        }
    });
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "gaps");
    assert_eq!(said.count, 1);
    contains(&said.message, &["3600.005"]);
    assert_eq!(trajectory.segments.len(), 2);
    is_true_motion(
        &trajectory,
        1e-5,
        |t| if t > 3600.0 { t - 3600.0 } else { t },
    );
}

#[test]
fn case_10_duplicate_rows_are_dropped_and_counted() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    for at in [500, 1500, 2500] {
        let row = log.rows[at].clone();
        log.rows.insert(at, row);
    }
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "duplicate_rows");
    assert_eq!((said.count, said.severity), (3, Severity::Note));
    assert_eq!(trajectory.segments.len(), 1);
    is_true_motion(&trajectory, 1e-5, |t| t);
}

#[test]
fn case_11_contradicting_duplicates_keep_the_first() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    let mut row = log.rows[500].clone();
    row[1] = "77.0".into();
    log.rows.insert(501, row.clone());
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "contradicting_duplicates");
    assert_eq!((said.count, said.severity), (1, Severity::Warning));
    is_true_motion(&trajectory, 1e-5, |t| t);
    // 9 of 4009 rows: more than 0.1 %
    for at in (600..1400).step_by(100) {
        let mut row = log.rows[at].clone();
        row[1] = "77.0".into();
        log.rows.insert(at + 1, row);
    }
    let (_, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "contradicting_duplicates");
    assert_eq!((said.count, said.severity), (9, Severity::Degraded));
}

#[test]
fn case_12_stamps_that_are_all_zero_suggest_a_rate() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    log.map("t", |_, _| "0".into());
    contains(
        &refused(run(&log.csv())),
        &["run.csv", "every time stamp is 0", "--rate HZ"],
    );
    let mut backwards = LogText::moving(2, 200.0, 20.0);
    backwards.map("t", |row, _| (1.0 - 0.005 * row as f64).to_string());
    contains(
        &refused(run(&backwards.csv())),
        &[
            "run.csv",
            "time runs backwards",
            "fall from 1 to -",
            "--rate HZ",
        ],
    );
    // and the remedy works
    let with_rate = LogOptions {
        rate_hz: Some(200.0),
        ..options()
    };
    let (recording, findings) = read_bytes(log.csv().as_bytes(), &with_rate).unwrap();
    assert_eq!(recording.time[4], 0.02);
    says(&findings, "time_replaced");
    let (pipeline, _) = choose_pipeline(&arm(), std::slice::from_ref(&recording), &AUTO).unwrap();
    is_true_motion(
        &align(&arm(), &recording, &pipeline).unwrap().0,
        1e-5,
        |t| t,
    );
}

#[test]
fn case_13_other_units_of_time_are_told_not_scaled() {
    for (factor, unit, divide) in [
        (1e3, "milliseconds", "1000"),
        (1e6, "microseconds", "1000000"),
        (1e9, "nanoseconds", "1000000000"),
    ] {
        let mut log = LogText::moving(2, 200.0, 20.0);
        log.map("t", |i, _| format!("{}", i as f64 / 200.0 * factor));
        let message = refused(run(&log.csv()));
        contains(
            &message,
            &[
                "run.csv",
                unit,
                "200 Hz",
                &format!("divide by {divide}"),
                "--rate HZ",
            ],
        );
    }
}

#[test]
fn case_14_jitter_is_resampled_with_a_warning() {
    let mut log = LogText::moving(2, 500.0, 20.0);
    // ±30 % of the interval, fixed pattern; the values belong to the stamps
    for (i, row) in log.rows.iter_mut().enumerate() {
        let t = (i as f64 + 0.3 * (i as f64 * 2.4).sin()) / 500.0;
        row[0] = format!("{t:.9}");
        for joint in 0..2 {
            let [q, qd, qdd] = motion(joint, t);
            let values = [q, qd, qdd, qdd + 0.5 * qd].map(|v| format!("{v:.9}"));
            row[1 + 4 * joint..5 + 4 * joint].clone_from_slice(&values);
        }
    }
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "resampled");
    assert_eq!(said.severity, Severity::Warning);
    contains(&said.message, &["cubic spline"]);
    is_true_motion(&trajectory, 2e-5, |t| t);
    // Predictions still belong to the rows as logged.
    let logged = trajectory.segments[0].logged.as_ref().unwrap();
    assert!(logged.input_rows.windows(2).all(|w| w[1] == w[0] + 1));
    // 1 % of jitter is resampled too, but only noted.
    let mut quiet = LogText::moving(2, 500.0, 20.0);
    quiet.map("t", |i, _| {
        format!("{:.9}", (i as f64 + 0.01 * (i as f64 * 2.4).sin()) / 500.0)
    });
    let (_, findings) = run(&quiet.csv()).unwrap();
    assert_eq!(says(&findings, "resampled").severity, Severity::Note);
    // An even clock is left alone.
    let (trajectory, findings) = run(&LogText::moving(2, 500.0, 20.0).csv()).unwrap();
    silent(&findings, "resampled");
    assert!(trajectory.segments[0].logged.is_none());
}

#[test]
fn case_15_gaps_cut_and_short_segments_go() {
    let mut log = LogText::moving(2, 200.0, 30.0);
    // Between the gaps 0.1 s are left: shorter than the motion filter.
    log.rows.drain(2000..2100);
    log.rows.drain(2020..2200);
    let (trajectory, findings) = run(&log.csv()).unwrap();
    assert_eq!(says(&findings, "gaps").count, 2);
    let short = says(&findings, "short_segments");
    assert_eq!((short.count, short.severity), (20, Severity::Warning));
    assert_eq!(trajectory.segments.len(), 2);
    is_true_motion(&trajectory, 1e-5, |t| t);
}

#[test]
fn case_16_a_slower_topic_in_one_file_aligns_to_the_rows_that_hold_both() {
    // One table has one clock. Torque from a topic at half the rate leaves every second cell empty: the rows that hold
    // all channels are used at the slower rate, which is said, and the log is not cut at every missing cell.
    let mut log = LogText::moving(2, 400.0, 20.0);
    for name in ["tau1", "tau2"] {
        log.map(name, |i, cell| {
            if i % 2 == 0 {
                cell.into()
            } else {
                String::new()
            }
        });
    }
    let (trajectory, findings) = run(&log.csv()).unwrap();
    let said = says(&findings, "slower_channels");
    assert_eq!((said.count, said.severity), (4000, Severity::Warning));
    contains(
        &said.message,
        &[
            "torque of joint `shoulder`",
            "every 2nd row",
            "share one clock",
        ],
    );
    silent(&findings, "not_finite_rows");
    assert_eq!(trajectory.segments.len(), 1);
    assert!((trajectory.segments[0].interval - 0.005).abs() < 1e-9);
    is_true_motion(&trajectory, 1e-5, |t| t);
}
