//! Broken logs, one test per numbered case of the fault list: what is refused, what goes on, and what is said.

#[path = "common/logs.rs"]
#[allow(
    dead_code,
    reason = "other test files use other parts of these generators"
)]
mod logs;

use logs::{LogText, arm, motion, robot};
use std::f64::consts::{PI, TAU};
use twincal::robot::JointKind;
use twincal::signal::{
    Auto, DerivedFrom, Pipeline, Recording, SignalSettings, Trajectory, align, choose_pipeline,
};
use twincal::{Finding, Severity};
use twincal_io::Result;
use twincal_io::log::{LogOptions, read_csv};

const AUTO: SignalSettings = SignalSettings {
    cutoff_hz: Auto::Auto,
    rate_hz: Auto::Auto,
    coulomb_velocity: None,
};

fn options() -> LogOptions {
    LogOptions::default()
}

fn read(text: &str) -> Result<(Recording, Vec<Finding>)> {
    read_bytes(text.as_bytes(), &options())
}

fn read_bytes(bytes: &[u8], options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    read_csv(bytes, bytes.len() as u64, "run.csv", &arm(), options)
}

/// The whole way to a trajectory with the automatic pipeline, with everything that was said.
fn run(text: &str) -> Result<(Trajectory, Vec<Finding>)> {
    let (recording, mut findings) = read(text)?;
    let logs = [recording];
    let (pipeline, said) = choose_pipeline(&arm(), &logs, &AUTO)?;
    findings.extend(said);
    let (trajectory, said) = align(&arm(), &logs[0], &pipeline)?;
    findings.extend(said);
    Ok((trajectory, findings))
}

fn refused<T: std::fmt::Debug>(result: Result<T>) -> String {
    result.expect_err("must be refused").to_string()
}

fn says<'a>(findings: &'a [Finding], code: &str) -> &'a Finding {
    findings
        .iter()
        .find(|f| f.code == code)
        .unwrap_or_else(|| panic!("no finding `{code}` in {findings:#?}"))
}

fn silent(findings: &[Finding], code: &str) {
    assert!(
        !findings.iter().any(|f| f.code == code),
        "unexpected `{code}` in {findings:#?}"
    );
}

#[track_caller]
fn contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

/// Motion of a trajectory is the truth everywhere, so nothing was differentiated across a cut.
#[track_caller]
fn is_true_motion(trajectory: &Trajectory, tolerance: f64, clock: impl Fn(f64) -> f64) {
    for segment in &trajectory.segments {
        let len = segment.time.len();
        for joint in 0..trajectory.dof {
            for i in 0..len {
                let [q, qd, qdd] = motion(joint, clock(segment.time[i]));
                let at = joint * len + i;
                let error = [
                    segment.q[at] - q,
                    (segment.qd[at] - qd) / 5.0,
                    (segment.qdd[at] - qdd) / 30.0,
                ];
                assert!(
                    error.iter().all(|e| e.abs() < tolerance),
                    "joint {joint} at {} s: {error:?}",
                    segment.time[i]
                );
            }
        }
    }
}

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
    let (trajectory, findings) = run(&log.csv()).unwrap();
    assert_eq!(says(&findings, "not_finite_rows").count, 2);
    assert_eq!(trajectory.segments.len(), 3);
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
        coulomb_velocity: 0.02,
        standstill_velocity: vec![0.02; 2],
        derived_from: vec![DerivedFrom::Position; 2],
    };
    let (trajectory, findings) = align(&robot, &recording, &pipeline).unwrap();
    let turns = ((turning(3999) + PI) / TAU).floor() as u64;
    let said: Vec<&Finding> = findings
        .iter()
        .filter(|f| f.code == "wrapped_angle")
        .collect();
    assert_eq!(said.len(), 1, "{findings:#?}");
    assert_eq!(said[0].count, turns);
    contains(&said[0].message, &["`spin`"]);
    let segment = &trajectory.segments[0];
    let len = segment.time.len();
    for (i, &row) in segment.input_rows.iter().enumerate() {
        assert!((segment.q[i] - turning(row)).abs() < 1e-6);
    }
    // the slider keeps its jumps, so its velocity has them
    assert!(segment.qd[len..].iter().any(|v| v.abs() > 50.0));
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
fn case_36_delimiters_are_found_and_named() {
    let log = LogText::moving(2, 200.0, 2.0);
    let (expected, _) = read(&log.csv()).unwrap();
    for (delimiter, word) in [
        (",", "commas"),
        (";", "semicolons"),
        ("\t", "tabs"),
        (" ", "spaces"),
        ("   ", "spaces"),
        ("|", "vertical bars"),
    ] {
        let (recording, findings) = read(&log.delimited(delimiter)).unwrap();
        assert_eq!(recording, expected, "{word}");
        contains(&says(&findings, "delimiter").message, &[word]);
    }
    // as numpy.savetxt writes it: the header is a comment
    let (recording, _) = read(&format!("# {}", log.delimited(" "))).unwrap();
    assert_eq!(recording, expected);
    // comments and blank lines anywhere
    let commented = format!("# recorded on arm 3\n\n{}# end\n\n", log.csv());
    assert_eq!(read(&commented).unwrap().0, expected);
}

#[test]
fn case_37_a_decimal_comma_is_detected() {
    let log = LogText::moving(2, 200.0, 2.0);
    let (expected, _) = read(&log.csv()).unwrap();
    for delimiter in [";", "\t", " "] {
        let text = log.delimited(delimiter).replace('.', ",");
        let (recording, findings) = read(&text).unwrap();
        assert_eq!(recording, expected);
        says(&findings, "decimal_comma");
    }
    // with commas between the fields too nothing can be told apart
    let text = log.csv().replace('.', ",");
    contains(
        &refused(read(&text)),
        &["run.csv:2", "18 fields, the header has 9", "decimal comma"],
    );
}

#[test]
fn case_38_marks_line_ends_and_trailing_delimiters_do_no_harm() {
    let log = LogText::moving(2, 200.0, 2.0);
    let (expected, _) = read(&log.csv()).unwrap();
    let text = log.csv();
    assert_eq!(read(&format!("\u{feff}{text}")).unwrap().0, expected);
    assert_eq!(read(&text.replace('\n', "\r\n")).unwrap().0, expected);
    assert_eq!(read(&text.replace('\n', ",\n")).unwrap().0, expected);
    assert_eq!(read(&text.replace('\n', ",\r\n")).unwrap().0, expected);
    assert_eq!(read(text.trim_end()).unwrap().0, expected);
    let quoted: String = log
        .rows
        .iter()
        .map(|row| format!("\"{}\"\n", row.join("\",\"")))
        .collect();
    assert_eq!(
        read(&format!("\"{}\"\n{quoted}", log.header.join("\",\"")))
            .unwrap()
            .0,
        expected
    );
}

#[test]
fn case_39_a_ragged_row_is_refused_by_line_or_dropped_and_counted() {
    let mut log = LogText::moving(2, 200.0, 20.0);
    log.rows[99].pop();
    log.rows[1234].push("1.0".into());
    contains(
        &refused(read(&log.csv())),
        &["run.csv:101", "8 fields, the header has 9", "--lenient"],
    );
    let lenient = LogOptions {
        lenient: true,
        ..options()
    };
    let (recording, findings) = read_bytes(log.csv().as_bytes(), &lenient).unwrap();
    let said = says(&findings, "unreadable_rows");
    assert_eq!((said.count, said.severity), (2, Severity::Warning));
    contains(&said.message, &["run.csv:101"]);
    assert_eq!(recording.time.len(), 3998);
}

#[test]
fn case_40_text_in_a_number_is_refused_by_line_and_column() {
    let mut log = LogText::moving(2, 200.0, 2.0);
    log.rows[7] = ["0.035", "1", "2", "ö3", "4", "5", "6", "7", "8"]
        .map(str::to_owned)
        .to_vec();
    contains(
        &refused(read(&log.csv())),
        &["run.csv:9:11", "`ö3`", "column `qdd1`"],
    );
    // columns that are not used may hold anything
    let mut log = LogText::moving(2, 200.0, 2.0);
    log.header.push("mode".into());
    log.rows.iter_mut().for_each(|row| row.push("auto".into()));
    assert_eq!(
        read(&log.csv()).unwrap().0,
        read(&LogText::moving(2, 200.0, 2.0).csv()).unwrap().0
    );
}

#[test]
fn case_41_duplicate_column_names_are_refused() {
    let mut log = LogText::moving(2, 200.0, 2.0);
    let at = log.column("qd2");
    log.header[at] = "q1".into();
    contains(
        &refused(read(&log.csv())),
        &["run.csv:1", "`q1`", "number 2 and 7"],
    );
}

#[test]
fn case_42_to_45_other_encodings_and_endless_lines_are_refused_with_flat_memory() {
    let utf16: Vec<u8> = std::iter::once(0xFEFF)
        .chain("t,q1\n0,1\n".encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    contains(
        &refused(read_bytes(&utf16, &options())),
        &["run.csv", "UTF-16"],
    );
    contains(
        &refused(read(
            "version https://git-lfs.github.com/spec/v1\noid sha256:1\n",
        )),
        &["Git LFS pointer"],
    );
    let wide: String = (0..120_000).map(|i| format!("c{i},")).collect();
    contains(
        &refused(read(&format!("t,{wide}\n"))),
        &["run.csv:1", "limit"],
    );
    // endless sources: only a reader that stops at its limit comes back
    let endless = std::io::repeat(b'7');
    let message = refused(read_csv(
        std::io::Read::chain(&b"t,q1,q2\n"[..], endless),
        0,
        "run.csv",
        &arm(),
        &options(),
    ));
    contains(&message, &["run.csv:2", "longer than 1 MiB"]);
    struct Newlines;
    impl std::io::Read for Newlines {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            buffer.fill(b'\n');
            Ok(buffer.len())
        }
    }
    let bomb = std::io::Read::chain(&b"t,q1,q2\n0,\"1"[..], Newlines);
    contains(
        &refused(read_csv(bomb, 0, "run.csv", &arm(), &options())),
        &["run.csv:2", "quotation mark"],
    );
}

#[test]
fn case_71_a_joint_that_the_model_lacks_is_refused_with_near_names() {
    let mut log = LogText::moving(2, 200.0, 2.0);
    for (from, to) in [("q1", "shoulder.q"), ("q2", "elbw.q")] {
        let at = log.column(from);
        log.header[at] = to.into();
    }
    contains(
        &refused(read(&log.csv())),
        &["run.csv", "`elbw.q`", "did you mean `elbow`"],
    );
    let three = LogText::moving(3, 200.0, 2.0);
    contains(
        &refused(read(&three.csv())),
        &["run.csv", "`q3`", "only 2 moving joints"],
    );
}

#[test]
fn case_72_a_joint_that_the_log_lacks_has_to_be_locked() {
    let log = LogText::moving(1, 200.0, 2.0);
    contains(
        &refused(read(&log.csv())),
        &["run.csv", "joint `elbow` (q2)", "locked = { elbow = 0.0 }"],
    );
}

#[test]
fn columns_named_after_joints_win_over_numbers() {
    let mut log = LogText::moving(2, 200.0, 2.0);
    let (numbered, _) = read(&log.csv()).unwrap();
    // The numbers now belong to the other joint: names decide.
    for (from, to) in [
        ("q1", "pos_shoulder"),
        ("qd1", "Shoulder_Velocity"),
        ("qdd1", "shoulder/acceleration"),
        ("tau1", "shoulder.effort"),
        ("q2", "elbow"),
        ("qd2", "elbow.qd"),
        ("qdd2", "elbow:acc"),
        ("tau2", "torque.elbow"),
    ] {
        let at = log.column(from);
        log.header[at] = to.into();
    }
    assert_eq!(read(&log.csv()).unwrap().0, numbered);
    // explicit mapping wins over everything
    let mut mapped = options();
    mapped
        .columns
        .q
        .insert("elbow".into(), "pos_shoulder".into());
    let (recording, _) = read_bytes(log.csv().as_bytes(), &mapped).unwrap();
    assert_eq!(recording.joints[1].q, numbered.joints[0].q);
    mapped
        .columns
        .q
        .insert("elbow".into(), "pos_shoulde".into());
    contains(
        &refused(read_bytes(log.csv().as_bytes(), &mapped)),
        &["no column `pos_shoulde`", "pos_shoulder"],
    );
}
