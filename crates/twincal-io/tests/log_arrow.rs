//! Arrow IPC logs written by pyarrow: what is read, and files that lie about themselves.

#![allow(
    clippy::unwrap_used,
    reason = "a test stops where its files do not do what they should"
)]

use crate::common::logs::{arm, motion};
use crate::common::refusals::{contains, refused};
use std::io::Write;
use std::path::{Path, PathBuf};
use twincal::signal::Recording;
use twincal::{Code, Finding};
use twincal_io::Result;
use twincal_io::log::{LogOptions, read_header, read_log};

const NAMES: [&str; 3] = ["plain.arrow", "zstd.arrows", "lz4.feather"];

fn fixture(name: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/arrow");
    Path::new(folder).join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(fixture(name)).unwrap()
}

fn read(bytes: &[u8], options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    let mut file = tempfile::Builder::new()
        .suffix(".arrow")
        .tempfile()
        .unwrap();
    file.write_all(bytes).unwrap();
    read_log(file.path(), &arm(), options)
}

fn read_as_it_is(bytes: &[u8]) -> Result<(Recording, Vec<Finding>)> {
    read(bytes, &LogOptions::default())
}

#[test]
fn files_streams_and_feather_hold_what_pyarrow_wrote() {
    for name in NAMES {
        let (recording, findings) =
            read_log(&fixture(name), &arm(), &LogOptions::default()).unwrap();
        assert_eq!(recording.time.len(), 100, "{name}");
        for (i, time) in recording.time.iter().enumerate() {
            assert_eq!(*time, i as f64 / 100.0, "{name}");
            for (joint, channels) in recording.joints.iter().enumerate() {
                let [q, qd, qdd] = motion(joint, *time);
                let is = |value: f64, truth: f64| {
                    assert!((value - truth).abs() < 1e-12, "{name}: {value} for {truth}");
                };
                is(channels.q[i], q);
                is(channels.tau.as_ref().unwrap()[i], qdd + 0.5 * qd);
                let velocity = channels.qd.as_ref().unwrap()[i];
                // A null is NaN.
                if joint == 1 && i == 77 && name != "plain.arrow" {
                    assert!(velocity.is_nan(), "{name}: {velocity}");
                } else {
                    is(velocity, qd);
                }
            }
        }
        let said = findings.iter().any(|f| f.code == Code::TimestampType);
        assert_eq!(said, name != "plain.arrow", "{name}");
    }
}

#[test]
fn other_forms_of_numbers_are_read() {
    let mut options = LogOptions::default();
    options.columns.q = [("shoulder".into(), "q1_32".into())].into_iter().collect();
    options.columns.time = Some("step".into());
    for name in &NAMES[1..] {
        let (recording, _) = read_log(&fixture(name), &arm(), &options).unwrap();
        assert_eq!(recording.time[99], 99.0);
        let [q, ..] = motion(0, 0.99);
        assert_eq!(recording.joints[0].q[99], f64::from(q as f32), "{name}");
    }
}

#[test]
fn column_names_are_told_without_the_rows() {
    let header = read_header(&fixture("plain.arrow")).unwrap().unwrap();
    assert_eq!(
        (header[0].as_str(), header[1].as_str(), header.len()),
        ("t", "note", 19)
    );
    assert_eq!(
        read_header(&fixture("zstd.arrows")).unwrap().unwrap()[..19],
        header
    );
}

#[test]
fn case_48_columns_that_hold_no_numbers_are_refused_by_name() {
    for (column, what) in [
        ("note", "is text, not a number"),
        ("view", "is text, not a number"),
        ("label", "is dictionary-encoded"),
        ("list", "is a list"),
        ("six", "is a list"),
        ("pose", "is of type Struct, not a number"),
        ("flag", "is of type Bool"),
        ("nothing", "is of type Null"),
        ("half", "holds numbers of half precision"),
        ("runs", "is of type RunEndEncoded"),
        ("either", "is of type Union"),
        ("map", "is of type Map"),
    ] {
        let mut options = LogOptions::default();
        options.columns.q = [("elbow".into(), column.into())].into_iter().collect();
        let message = refused(read(&bytes("plain.arrow"), &options));
        contains(
            &message,
            &[&format!("column `{column}` {what}"), "[columns]"],
        );
    }
}

#[test]
fn case_46_files_that_are_cut_off_are_refused() {
    for name in NAMES {
        let bytes = bytes(name);
        for keep in [7, 8, 9, 20, 1000, bytes.len() / 2, bytes.len() - 9] {
            let message = refused(read_as_it_is(&bytes[..keep]));
            contains(&message, &["copy or export it again"]);
        }
    }
    let whole = bytes("plain.arrow");
    contains(
        &refused(read_as_it_is(&whole[..whole.len() - 1])),
        &["not a whole Arrow file"],
    );
}

/// Every count of 50 (rows of a batch) becomes another one.
fn with_rows(name: &str, rows: i64) -> Vec<u8> {
    let (mut bytes, fifty) = (bytes(name), 50_i64.to_le_bytes());
    let mut at = 0;
    while let Some(next) = bytes[at..].windows(8).position(|window| window == fifty) {
        at += next;
        bytes[at..at + 8].copy_from_slice(&rows.to_le_bytes());
    }
    bytes
}

#[test]
fn case_47_batches_that_declare_too_much_are_refused_before_anything_is_allocated() {
    contains(
        &refused(read_as_it_is(&with_rows("plain.arrow", 51))),
        &["column `t`", "51 values need 408 bytes, it has 400"],
    );
    for name in &NAMES[1..] {
        contains(
            &refused(read_as_it_is(&with_rows(name, 51))),
            &["column `t`", "holds fewer values than it declares"],
        );
    }
    for name in NAMES {
        for rows in [1 << 40, i64::MAX / 2] {
            let message = refused(read_as_it_is(&with_rows(name, rows)));
            let told = [
                "bytes, it has",
                "of memory",
                "values",
                "than can be counted",
            ];
            assert!(told.iter().any(|word| message.contains(word)), "{message}");
        }
        let message = refused(read_as_it_is(&with_rows(name, -1)));
        contains(&message, &["declares -1 rows"]);
    }
}

#[test]
fn impostors_are_named() {
    contains(
        &refused(read_as_it_is(b"FEA1\x00\x00\x00\x00FEA1")),
        &["Feather file of version 1", "write_feather"],
    );
    contains(
        &refused(read_as_it_is(b"t,q1\n0,1\n")),
        &["does not begin as an Arrow file does"],
    );
}

#[test]
fn any_bytes_in_an_arrow_log_end_in_a_refusal_or_in_numbers() {
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for name in NAMES {
        let bytes = bytes(name);
        for round in 0..1500 {
            let mut broken = bytes.clone();
            for _ in 0..1 + round % 3 {
                let (at, bit) = (random(broken.len()), random(256));
                broken[at] = bit as u8;
            }
            let _ = read_as_it_is(&broken);
        }
    }
}
