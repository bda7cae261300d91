//! Delimiters, marks, encodings, broken rows, and which column is which joint.

use super::{contains, options, read, read_bytes, refused, says};
use crate::common::logs::{LogText, arm};
use twincal::Severity;
use twincal_io::log::{LogOptions, read_csv};

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

/// Units in the place of names, or in a line below them.
#[test]
fn lines_of_units_are_named_as_such() {
    let text = LogText::moving(2, 200.0, 2.0).csv();
    let (header, rows) = text.split_once('\n').unwrap();
    let units = header.split(',').map(|name| match name {
        "t" => "s",
        name if name.contains("tau") => "Nm",
        _ => "rad",
    });
    let units = units.collect::<Vec<_>>().join(",");
    contains(
        &refused(read(&format!("{units}\n{rows}"))),
        &[
            "run.csv:1",
            "the names of columns are units",
            "`t,q1,qd1,tau1`",
        ],
    );
    contains(
        &refused(read(&format!("{header}\n{units}\n{rows}"))),
        &[
            "run.csv:2:1",
            "this line holds no number: `s` in column `t`",
            "delete it if it holds units",
        ],
    );
    let mixed = text.replacen("\n0.000000,", "\nx,", 1);
    contains(
        &refused(read(&mixed)),
        &["`x` in column `t` is not a number", "fix the cell"],
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
    let columns = |elbow: &str| {
        [
            ("shoulder".into(), "elbow".into()),
            ("elbow".into(), elbow.into()),
        ]
    };
    mapped.columns.q = columns("pos_shoulder").into_iter().collect();
    let (recording, _) = read_bytes(log.csv().as_bytes(), &mapped).unwrap();
    assert_eq!(recording.joints[0].q, numbered.joints[1].q);
    assert_eq!(recording.joints[1].q, numbered.joints[0].q);
    mapped.columns.q = columns("pos_shoulde").into_iter().collect();
    contains(
        &refused(read_bytes(log.csv().as_bytes(), &mapped)),
        &["no column `pos_shoulde`", "pos_shoulder"],
    );
}
