//! A long log in chapters is the log in memory, number by number, whatever its form. (A log is long from 1 MiB on here.)

#[path = "../../tests/common/logs.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod logs;
#[path = "../../tests/log_bags/write.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod write;

use super::*;
use crate::config::PerJoint;
use crate::table::{ColumnKind, TableFormat, TableWriter, Values};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use std::fmt::Write as _;
use std::io::Write as _;
use twincal::Code;
use twincal::robot::JointKind;
use twincal::signal::LongLog;
use write::{Bag, Message};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const ROWS: usize = 40_000;
const NAMES: [&str; 2] = ["shoulder", "elbow"];

fn robot() -> Robot {
    logs::robot(&NAMES.map(|name| (name, JointKind::Revolute)))
}

/// Column `column` of `t,q1,qd1,tau1,q2,qd2,tau2`; one value in a thousand is missing.
fn value(column: usize, row: usize) -> f64 {
    match column {
        0 => row as f64 * 1e-3,
        _ if (row + 100 * column).is_multiple_of(1000) => f64::NAN,
        _ => (column as f64) + (0.01 * row as f64).sin(),
    }
}

const HEADER: [&str; 7] = ["t", "q1", "qd1", "tau1", "q2", "qd2", "tau2"];

/// Reads a file whole and in chapters; the chapters must be many and equal to the whole, and say the same.
fn compare(bytes: &[u8], ending: &str, options: &LogOptions) -> LongLog {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("run.{ending}"));
    std::fs::File::create(&path)
        .unwrap()
        .write_all(bytes)
        .unwrap();
    let (whole, said) = read_log(&path, &robot(), options).unwrap();
    let (log, also_said) = open_log(&path, &robot(), options).unwrap();
    assert_eq!(said, also_said);
    let Log::Long(long) = log else {
        panic!("{ending}: not in chapters");
    };
    assert!(long.chapters() >= 5, "{} chapters", long.chapters());
    assert_eq!(long.samples().iter().sum::<usize>(), whole.time.len());
    let joined = long.whole().unwrap();
    assert!(bits(&joined) == bits(&whole), "{ending}: other numbers");
    assert_eq!((joined.name, joined.payload), (whole.name, whole.payload));
    long
}

/// The numbers of a recording, bit by bit.
fn bits(recording: &Recording) -> Vec<Vec<u64>> {
    let joints = recording.joints.iter();
    let channels = joints.flat_map(|j| {
        [
            Some(&j.q),
            j.qd.as_ref(),
            j.qdd.as_ref(),
            j.tau.as_ref(),
            j.temperature.as_ref(),
        ]
    });
    let all = std::iter::once(&recording.time).chain(channels.flatten());
    all.map(|values| values.iter().map(|v| v.to_bits()).collect())
        .collect()
}

fn csv() -> String {
    let mut text = HEADER.join(",") + "\n";
    for row in 0..ROWS {
        let cells: Vec<String> = (0..HEADER.len())
            .map(|column| match value(column, row) {
                gap if gap.is_nan() => String::new(),
                value => format!("{value:.9}"),
            })
            .collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    text
}

#[test]
fn csv_comes_in_chapters() {
    let text = csv();
    compare(text.as_bytes(), "csv", &LogOptions::default());
    // What is said of rows counts all of them, and time by the rate goes on from chapter to chapter.
    let mut options = LogOptions {
        rate_hz: Some(500.0),
        lenient: true,
        ..LogOptions::default()
    };
    let spoilt = text.replacen("\n5.000000000,", "\nx,", 1);
    let long = compare(spoilt.as_bytes(), "csv", &options);
    let last = long.chapter(long.chapters() - 1).unwrap();
    assert_eq!(last.time.last(), Some(&((ROWS - 2) as f64 / 500.0)));
    // Torque as it is told, in every chapter.
    options.torque.source = Some(TorqueSource::Motor);
    options.torque.gear_ratio = [("shoulder", 100.0), ("elbow", 50.0)]
        .map(|(joint, ratio)| (joint.to_owned(), ratio))
        .into();
    let long = compare(spoilt.as_bytes(), "csv", &options);
    let late = long.chapters() - 2;
    let tau = long
        .chapter(late)
        .unwrap()
        .joints
        .swap_remove(1)
        .tau
        .unwrap();
    let row = long.samples()[..late].iter().sum::<usize>() + 7;
    // One row was dropped before.
    assert!((tau[7] - 50.0 * value(6, row + 1)).abs() < 1e-6);
}

/// Factors in every chapter, in positions that are read alone, and never in silence; what makes no sense is refused by its key.
#[test]
fn numbers_are_multiplied_as_told() {
    let mut options = LogOptions::default();
    let factor = &mut options.columns.factor;
    factor.q = PerJoint::All(0.5);
    factor.tau = PerJoint::ByJoint([("elbow".to_owned(), -2.0)].into());
    let text = csv();
    let long = compare(text.as_bytes(), "csv", &options);
    let late = long.chapters() - 1;
    let row = long.samples()[..late].iter().sum::<usize>() + 3;
    let chapter = long.chapter(late).unwrap();
    let [shoulder, elbow] = &chapter.joints[..] else {
        panic!("two joints");
    };
    let is = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-8, "{found}");
    is(shoulder.q[3], 0.5 * value(1, row));
    is(elbow.q[3], 0.5 * value(4, row));
    is(shoulder.tau.as_ref().unwrap()[3], value(3, row));
    is(elbow.tau.as_ref().unwrap()[3], -2.0 * value(6, row));
    is(elbow.qd.as_ref().unwrap()[3], value(5, row));
    let alone = long.source().positions(late, 1).unwrap();
    let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
    assert!(alone.len() == elbow.q.len() && alone.iter().zip(&elbow.q).all(same));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    std::fs::write(
        &path,
        &text[..5000 - text[..5000].lines().last().unwrap().len()],
    )
    .unwrap();
    let (_, said) = read_log(&path, &robot(), &options).unwrap();
    let told = said
        .iter()
        .find(|finding| finding.code == Code::ColumnFactor);
    assert_eq!(
        told.unwrap().message,
        "logged numbers are multiplied, as told: q of shoulder 0.5, q of elbow 0.5, tau of elbow -2"
    );
    for (joint, number, words) in [
        ("elbow", 0.0, "is 0"),
        ("elbow", f64::INFINITY, "is inf"),
        ("elbw", 2.0, "`elbw`"),
    ] {
        options.columns.factor.qd = PerJoint::ByJoint([(joint.to_owned(), number)].into());
        let error = read_log(&path, &robot(), &options).unwrap_err().to_string();
        assert!(
            error.contains("columns.factor.qd") && error.contains(words),
            "{error}"
        );
    }
}

fn parquet() -> Vec<u8> {
    let columns: Vec<(String, ColumnKind)> = HEADER
        .map(|name| (name.to_owned(), ColumnKind::Number))
        .to_vec();
    let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &columns).unwrap();
    for block in 0..4 {
        let rows = block * ROWS / 4..(block + 1) * ROWS / 4;
        let values: Vec<Vec<f64>> = (0..HEADER.len())
            .map(|column| rows.clone().map(|row| value(column, row)).collect())
            .collect();
        let values: Vec<Values<'_>> = values
            .iter()
            .map(|column| Values::Numbers(column))
            .collect();
        table.push(&values).unwrap();
    }
    table.finish().unwrap()
}

#[test]
fn parquet_comes_in_chapters() {
    compare(&parquet(), "parquet", &LogOptions::default());
}

/// Arrays of NumPy: time, position and torque of both joints row by row, velocity column by column.
fn npz(method: CompressionMethod) -> Vec<u8> {
    let mut file = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let row_by_row = |columns: &[usize]| -> Vec<f64> {
        let rows = (0..ROWS).flat_map(|row| columns.iter().map(move |column| (*column, row)));
        rows.map(|(column, row)| value(column, row)).collect()
    };
    let velocity = [2, 5]
        .iter()
        .flat_map(|column| (0..ROWS).map(move |row| value(*column, row)));
    for (key, fortran, shape, values) in [
        ("t", "False", format!("({ROWS},)"), row_by_row(&[0])),
        ("q", "False", format!("({ROWS}, 2)"), row_by_row(&[1, 4])),
        ("qd", "True", format!("({ROWS}, 2)"), velocity.collect()),
        ("tau", "False", format!("({ROWS}, 2)"), row_by_row(&[3, 6])),
    ] {
        let options = SimpleFileOptions::default().compression_method(method);
        file.start_file(format!("{key}.npy"), options).unwrap();
        let header =
            format!("{{'descr': '<f8', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        file.write_all(b"\x93NUMPY\x01\x00").unwrap();
        file.write_all(&(header.len() as u16).to_le_bytes())
            .unwrap();
        file.write_all(header.as_bytes()).unwrap();
        for value in values {
            file.write_all(&value.to_le_bytes()).unwrap();
        }
    }
    file.finish().unwrap().into_inner()
}

#[test]
fn npz_comes_in_chapters() {
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let long = compare(&npz(method), "npz", &LogOptions::default());
        let Recording { time, joints, .. } = long.whole().unwrap();
        for row in [0, 7, ROWS / 2, ROWS - 1] {
            let [a, b] = [&joints[0], &joints[1]];
            let got = [
                time[row],
                a.q[row],
                a.qd.as_ref().unwrap()[row],
                a.tau.as_ref().unwrap()[row],
                b.q[row],
                b.qd.as_ref().unwrap()[row],
                b.tau.as_ref().unwrap()[row],
            ];
            for (column, got) in got.into_iter().enumerate() {
                assert!(got == value(column, row) || got.is_nan() && value(column, row).is_nan());
            }
        }
    }
}

fn bag(topics: &[(&str, &[&str])], late: bool) -> Vec<u8> {
    let mut bag = Bag::with_chunks(None, 64 << 10);
    for (topic, _) in topics {
        bag.topic(topic, Some(write::JOINT_STATE), "cdr");
    }
    for i in 0..ROWS as u64 {
        // Every thousandth message comes three later than its stamp says.
        let i = match i % 1000 {
            500..503 if late => i + 1,
            503 if late => i - 3,
            _ => i,
        };
        for (topic, names) in topics {
            let mut message = Message::moving(i, names);
            message.stamp = 1_700_000_000_000_000_000 + i * 1_000_000;
            bag.message(topic, &message);
        }
    }
    bag.finish()
}

#[test]
fn bags_come_in_chapters_in_the_order_of_their_stamps() {
    let long = compare(
        &bag(&[("/joint_states", &NAMES)], true),
        "mcap",
        &LogOptions::default(),
    );
    let time = long.whole().unwrap().time;
    assert!(time.len() == ROWS && time.windows(2).all(|pair| pair[0] < pair[1]));
}

/// Joints in messages of their own: the shoulder a thousand times a second, the elbow half as often and 0.3 ms later, each silent for a while, which
/// is longer than a chapter; some messages come late.
fn bag_in_parts([left, right]: [&str; 2]) -> Vec<u8> {
    let mut bag = Bag::with_chunks(None, 64 << 10);
    for i in 0..60_000_u64 {
        let i = match i % 1000 {
            500..503 => i + 1,
            503 => i - 3,
            _ => i,
        };
        let mut message = |topic: &str, joint: &str, ns: u64| {
            let mut message = Message::moving(i, &[joint]);
            message.stamp = 1_700_000_000_000_000_001 + ns + i * 1_000_000;
            bag.message(topic, &message);
        };
        if !(12_000..17_000).contains(&i) {
            message(left, NAMES[0], 0);
        }
        if i % 2 == 1 && !(25_000..36_000).contains(&i) {
            message(right, NAMES[1], 300_000);
        }
    }
    bag.finish()
}

#[test]
fn bags_in_parts_come_in_chapters() {
    let options = LogOptions {
        topics: vec!["/left".into(), "/right".into()],
        ..LogOptions::default()
    };
    let long = compare(&bag_in_parts(["/left", "/right"]), "mcap", &options);
    let Recording {
        start_ns,
        time,
        joints,
        ..
    } = long.whole().unwrap();
    assert_eq!(time.len(), 30_000 - 5_500);
    let start = (start_ns - 1_700_000_000_000_000_000) as f64 / 1e6;
    for (row, time) in time.iter().enumerate() {
        let ms = start + time * 1e3;
        let lost = (11_999.1..16_999.9).contains(&ms) || ms > 59_999.1;
        let q = joints[0].q[row];
        assert_eq!(q.is_nan(), lost, "{ms} ms");
        // Message i holds the motion at i / 100 s; h²/8·max|q̈| of what lies between.
        let [expected, ..] = logs::motion(0, ms / 100.0);
        assert!(
            lost || (q - expected).abs() < 1e-3,
            "{ms} ms: {q} {expected}"
        );
    }
}

#[test]
fn a_column_without_numbers_is_named_whether_the_log_is_long_or_not() {
    let text: String = csv()
        .lines()
        .map(|line| {
            format!(
                "{line},{}\n",
                if line.starts_with('t') { "qdd1" } else { "" }
            )
        })
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    std::fs::write(&path, text).unwrap();
    let options = LogOptions::default();
    let whole = read_log(&path, &robot(), &options).unwrap_err().to_string();
    let long = open_log(&path, &robot(), &options).unwrap_err().to_string();
    assert!(
        whole.contains("column `qdd1` is NaN or empty in all 40000 rows"),
        "{whole}"
    );
    assert_eq!(whole, long);
}

/// Long files with changed bytes, cut or doubled in part: what is said of them is the same in chapters and in memory, and the numbers are, where
/// there are any.
#[test]
fn damage_is_read_in_chapters_as_in_memory() {
    let topics: [(&str, &[&str]); 1] = [("/joint_states", &NAMES)];
    let files = [
        ("csv", csv().into_bytes()),
        ("parquet", parquet()),
        ("mcap", bag(&topics, true)),
        ("mcap", bag_in_parts(["/joint_states"; 2])),
        ("npz", npz(CompressionMethod::Stored)),
    ];
    // Sliders: a changed angle may look folded, and chapters come unfolded.
    let robot = logs::robot(&NAMES.map(|name| (name, JointKind::Prismatic)));
    let folder = tempfile::tempdir().unwrap();
    let mut runner = TestRunner::new_with_rng(
        ProptestConfig::default(),
        TestRng::deterministic_rng(RngAlgorithm::ChaCha),
    );
    let (mut read, mut long) = (0, 0);
    for (ending, good) in &files {
        let path = folder.path().join(format!("run.{ending}"));
        for case in 0..40 {
            std::fs::write(&path, damaged(good, case, runner.rng())).unwrap();
            for lenient in [false, true] {
                let options = LogOptions {
                    lenient,
                    ..LogOptions::default()
                };
                let whole = read_log(&path, &robot, &options);
                let chapters = open_log(&path, &robot, &options);
                match (whole, chapters) {
                    (Ok((whole, said)), Ok((log, also_said))) => {
                        assert_eq!(said, also_said, "{ending} {case}");
                        read += 1;
                        let joined = match log {
                            Log::Whole(recording) => recording.into_owned(),
                            Log::Long(log) => {
                                long += 1;
                                log.whole().unwrap()
                            }
                        };
                        assert!(bits(&joined) == bits(&whole), "{ending} {case}");
                    }
                    (Err(one), Err(other)) => {
                        assert_eq!(one.to_string(), other.to_string(), "{ending} {case}");
                    }
                    (one, other) => panic!(
                        "{ending} {case}: {:?} in memory, {:?} in chapters",
                        one.map(|_| ()),
                        other.map(|_| ())
                    ),
                }
            }
        }
    }
    assert!(read > 60 && long > 50, "{read} read, {long} in chapters");
}

/// One to five changed bytes; every eighth file is cut, every eighth has a part twice.
fn damaged(good: &[u8], case: usize, rng: &mut TestRng) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..rng.random_range(1..6) {
        let at = rng.random_range(0..bytes.len());
        bytes[at] = rng.random();
    }
    let at = rng.random_range(0..bytes.len());
    match case % 8 {
        0 => bytes.truncate(at),
        1 => {
            let part = bytes[at..bytes.len().min(at + 5000)].to_vec();
            bytes.splice(at..at, part);
        }
        _ => {}
    }
    bytes
}
