//! Parquet logs: what is read, and files that lie about themselves.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test stops where its files do not do what they should, and says what it skips"
)]

use crate::common::logs::{LogText, arm, robot};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use twincal::robot::JointKind;
use twincal::signal::Recording;
use twincal_io::Result;
use twincal_io::log::{LogOptions, read_csv, read_log};
use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};

/// The log as Parquet, all columns doubles.
fn parquet(log: &LogText) -> Vec<u8> {
    let columns: Vec<(String, ColumnKind)> = log
        .header
        .iter()
        .map(|h| (h.clone(), ColumnKind::Number))
        .collect();
    let values: Vec<Vec<f64>> = (0..columns.len())
        .map(|c| log.rows.iter().map(|row| row[c].parse().unwrap()).collect())
        .collect();
    let blocks: Vec<Values<'_>> = values.iter().map(|v| Values::Numbers(v)).collect();
    let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &columns).unwrap();
    table.push(&blocks).unwrap();
    table.finish().unwrap()
}

fn read(bytes: &[u8]) -> Result<Recording> {
    let mut file = tempfile::Builder::new()
        .suffix(".parquet")
        .tempfile()
        .unwrap();
    file.write_all(bytes).unwrap();
    let (mut recording, _) = read_log(file.path(), &arm(), &LogOptions::default())?;
    recording.name = "run".into();
    Ok(recording)
}

#[track_caller]
fn refused(bytes: &[u8], parts: &[&str]) {
    let message = read(bytes).expect_err("must be refused").to_string();
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

#[test]
fn parquet_and_csv_give_the_same_recording() {
    let log = LogText::moving(2, 200.0, 3.0);
    let text = log.csv();
    let (expected, _) =
        read_csv(text.as_bytes(), 0, "run", &arm(), &LogOptions::default()).unwrap();
    assert_eq!(read(&parquet(&log)).unwrap(), expected);
}

#[test]
fn case_46_a_truncated_file_is_refused() {
    let bytes = parquet(&LogText::moving(2, 200.0, 3.0));
    for keep in [4, 5, 100, bytes.len() / 2, bytes.len() - 1] {
        refused(
            &bytes[..keep],
            &["not a whole Parquet file", "copy or export it again"],
        );
    }
}

#[test]
fn case_47_pages_that_declare_too_much_are_refused_before_anything_is_allocated() {
    let mut log = LogText::moving(2, 200.0, 3.0);
    log.rows.truncate(60);
    let bytes = parquet(&log);
    // First page header: kind 0, sizes, then the data page header (field 5, a struct) whose field 1 counts values.
    let count = [0x2C_u8, 0x15, 120];
    let at = bytes
        .windows(3)
        .position(|w| w == count)
        .expect("60 values, zigzag 120");
    let mut lying = bytes[..at + 2].to_vec();
    lying.extend([0xFE, 0xFF, 0xFF, 0xFF, 0x0F]);
    lying.extend(&bytes[at + 3..]);
    refused(
        &lying,
        &["column `t`", "declares 2147483647 values", "has 60"],
    );
    // A page that claims to unpack to 2 GiB.
    assert_eq!(
        &bytes[4..7],
        &[0x15, 0x00, 0x15],
        "page header: kind 0, then the unpacked size"
    );
    let end = 7 + bytes[7..].iter().position(|b| b & 0x80 == 0).unwrap() + 1;
    let mut huge = bytes[..7].to_vec();
    huge.extend([0xFE, 0xFF, 0xFF, 0xFF, 0x0F]);
    huge.extend(&bytes[end..]);
    refused(&huge, &["column `t`", "claims 2147483647 bytes", "limit"]);
}

#[test]
fn case_48_a_column_of_text_is_refused_by_name() {
    use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    let schema = parse_message_type(
        "message log { required double t; required byte_array q1 (UTF8); optional double q2; }",
    )
    .unwrap();
    let mut file = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::default()).unwrap();
    let mut group = file.next_row_group().unwrap();
    for column in 0..3 {
        let mut writer = group.next_column().unwrap().unwrap();
        match column {
            1 => drop(
                writer
                    .typed::<ByteArrayType>()
                    .write_batch(&[ByteArray::from("a"), ByteArray::from("b")], None, None)
                    .unwrap(),
            ),
            2 => drop(
                writer
                    .typed::<DoubleType>()
                    .write_batch(&[0.5], Some(&[1, 0]), None)
                    .unwrap(),
            ),
            _ => drop(
                writer
                    .typed::<DoubleType>()
                    .write_batch(&[0.0, 0.1], None, None)
                    .unwrap(),
            ),
        }
        writer.close().unwrap();
    }
    group.close().unwrap();
    let bytes = file.into_inner().unwrap();
    refused(&bytes, &["column `q1`", "text or bytes, not a number"]);
    // A null is NaN.
    let one = robot(&[("elbow", JointKind::Revolute)]);
    let mut options = LogOptions::default();
    options.columns.q = [("elbow".into(), "q2".into())].into_iter().collect();
    let mut stored = tempfile::NamedTempFile::new().unwrap();
    stored.write_all(&bytes).unwrap();
    let (recording, _) = read_log(stored.path(), &one, &options).unwrap();
    assert_eq!(recording.time, [0.0, 0.1]);
    assert_eq!(recording.joints[0].q[0], 0.5);
    assert!(recording.joints[0].q[1].is_nan());
}

#[test]
fn flipped_bytes_end_in_a_refusal_or_in_numbers_never_in_a_panic() {
    let mut log = LogText::moving(2, 200.0, 3.0);
    log.rows.truncate(40);
    let bytes = parquet(&log);
    // A fixed walk over all bytes and a few values each.
    let mut state = 1_u64;
    for round in 0..1500 {
        let mut broken = bytes.clone();
        for _ in 0..1 + round % 3 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let at = (state >> 33) as usize % broken.len();
            broken[at] = (state >> 20) as u8;
        }
        let _ = read(&broken);
    }
}

#[test]
fn real_logs_read_as_pyarrow_reads_them() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let path = Path::new(data).join("kuka_kr300/run0.parquet");
    if !path.exists() {
        println!("skipped: {data} is absent");
        return;
    }
    let names = ["1", "2", "3", "4", "5", "6"].map(|n| (n, JointKind::Revolute));
    let (recording, _) = read_log(&path, &robot(&names), &LogOptions::default()).unwrap();
    // pyarrow 26.0.1: read_table(path)["q1"][1234], ["tau6"][2500], ["qd3"][777]
    assert_eq!(recording.time.len(), 2501);
    assert_eq!(recording.joints[0].q[1234], 0.8081811631673799);
    assert_eq!(
        recording.joints[5].tau.as_ref().unwrap()[2500],
        -143.88088998852382
    );
    assert_eq!(
        recording.joints[2].qd.as_ref().unwrap()[777],
        -0.3594208816320139
    );
}

/// Files of pyarrow: `tests/fixtures/parquet/make_parquet.py` wrote the same numbers as half floats, decimals of 5, 15 and 38 digits,
/// and doubles.
#[test]
fn half_floats_and_decimals_are_numbers() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/parquet");
    let read = |name: &str| {
        let path = Path::new(folder).join(name);
        let mut recording = read_log(&path, &arm(), &LogOptions::default()).unwrap().0;
        recording.name = "run".into();
        recording
    };
    let expected = read("doubles.parquet");
    assert_eq!(expected.joints[1].q[3], -1.375);
    let found = read("short.parquet");
    assert_eq!(found.time, expected.time);
    for (found, expected) in found.joints.iter().zip(&expected.joints) {
        assert_eq!(found.q[1..], expected.q[1..]);
        assert!(found.q[0].is_nan(), "a null");
        assert_eq!(found.tau, expected.tau);
    }
}
