//! Bags of ROS: other people's files are read to the numbers that were written, broken ones are refused or told.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

mod containers;
mod folders;
mod mapped;
mod messages;
mod mutations;
mod same_as_csv;
mod write;

use crate::common::logs;
use crate::common::logs::{arm, motion};
use crate::common::refusals::{contains, refused};
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::signal::Recording;
use twincal_io::Result;
use twincal_io::log::{LogOptions, read_log};

/// First stamp of the carried bags, s.
const START: f64 = 1.7e9;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures/bags")
        .join(name)
}

fn read(path: &Path) -> Result<(Recording, Vec<Finding>)> {
    read_with(path, &LogOptions::default())
}

fn read_with(path: &Path, options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    read_log(path, &arm(), options)
}

/// Reads a file of these bytes.
fn read_bytes(bytes: &[u8]) -> Result<(Recording, Vec<Finding>)> {
    read_bytes_with(bytes, &LogOptions::default())
}

fn read_bytes_with(bytes: &[u8], options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, bytes).unwrap();
    read_with(&path, options)
}

/// Stamp of a row, s.
fn stamp(recording: &Recording, row: usize) -> f64 {
    recording.start_ns as f64 / 1e9 + recording.time[row]
}

#[track_caller]
fn says<'a>(findings: &'a [Finding], code: &str) -> &'a Finding {
    findings
        .iter()
        .find(|f| f.code.as_str() == code)
        .unwrap_or_else(|| panic!("no finding `{code}` in {findings:#?}"))
}

/// Every row is the motion at its stamp, in the robot's order, and the stamps tick by 10 ms.
#[track_caller]
fn is_the_motion(recording: &Recording, count: usize, start: f64) {
    assert_eq!(recording.time.len(), count);
    assert_eq!(recording.start_ns, (start * 1e9) as i64);
    for (i, time) in recording.time.iter().enumerate() {
        let t = i as f64 / 100.0;
        // The doubles of a CSV that counts from 0.
        assert_eq!(*time, t, "row {i}");
        for (joint, channels) in recording.joints.iter().enumerate() {
            let [q, qd, qdd] = motion(joint, t);
            let read = [
                channels.q[i],
                channels.qd.as_ref().unwrap()[i],
                channels.tau.as_ref().unwrap()[i],
            ];
            for (read, written) in read.iter().zip([q, qd, qdd + 0.5 * qd]) {
                assert!((read - written).abs() < 1e-11, "joint {joint}, row {i}");
            }
        }
    }
}
