//! A bag and the table it was written from are the same log: stamps since 1970 lose no nanosecond.

use super::write::{Bag, JOINT_STATE, Message};
use std::fmt::Write as _;
use std::path::Path;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::robot::Robot;
use twincal::signal::Recording;
use twincal_io::log::{LogOptions, read_log};
use twincal_io::model::{ModelSettings, read_model};

/// First stamp of the bag, ns: 2023-11-14.
const FIRST: u64 = 1_700_000_000_123_456_789;

/// ns of each row from the first on, with a clock that jitters by up to 0.1 ms.
fn ticks(recording: &Recording) -> Vec<u64> {
    let mut state = 1_u64;
    let stamps = recording.time.iter().enumerate().map(|(row, t)| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let jitter = if row == 0 { 0 } else { (state >> 33) % 100_000 };
        ((t - recording.time[0]) * 1e9).round() as u64 + jitter
    });
    stamps.collect()
}

/// The channels of a row: position, velocity, torque of all joints.
fn row(recording: &Recording, row: usize) -> [Vec<f64>; 3] {
    let joints = &recording.joints;
    [
        joints.iter().map(|joint| joint.q[row]).collect(),
        joints
            .iter()
            .map(|joint| joint.qd.as_ref().unwrap()[row])
            .collect(),
        joints
            .iter()
            .map(|joint| joint.tau.as_ref().unwrap()[row])
            .collect(),
    ]
}

fn table(recording: &Recording, names: &[&str]) -> String {
    let mut text = String::from("t");
    for channel in ["q", "qd", "tau"] {
        names
            .iter()
            .for_each(|name| text += &format!(",{name}.{channel}"));
    }
    for (number, ns) in ticks(recording).iter().enumerate() {
        let _ = write!(text, "\n{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
        for value in row(recording, number).iter().flatten() {
            let _ = write!(text, ",{value}");
        }
    }
    text + "\n"
}

fn bag(recording: &Recording, names: &[&str]) -> Vec<u8> {
    let mut bag = Bag::new(None);
    bag.topic("/joint_states", Some(JOINT_STATE), "cdr");
    for (number, ns) in ticks(recording).iter().enumerate() {
        let message = Message {
            stamp: FIRST + ns,
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            lists: row(recording, number),
        };
        bag.raw("/joint_states", message.stamp + 40_000, &message.cdr());
    }
    bag.finish()
}

fn fit(robot: &Robot, recording: Recording) -> Calibration {
    let settings = CalibrationSettings::default();
    calibrate(robot, &[recording], &[] as &[Recording], &settings, &|_| {}).unwrap()
}

#[test]
fn a_bag_and_its_table_give_the_same_probabilities() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../twincal-cli/assets");
    let model = read_model(&assets.join("arm.urdf"), &ModelSettings::default()).unwrap();
    let (robot, _) = model.robot(&Default::default()).unwrap();
    let read = |path: &Path| {
        let (mut recording, _) = read_log(path, &robot, &LogOptions::default()).unwrap();
        recording.name = "run".into();
        recording
    };
    let source = read(&assets.join("train1.parquet"));
    let names = robot.joint_names();
    let folder = tempfile::tempdir().unwrap();
    let [csv, mcap] = ["run.csv", "run.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&csv, table(&source, &names)).unwrap();
    std::fs::write(&mcap, bag(&source, &names)).unwrap();
    let (of_table, of_bag) = (read(&csv), read(&mcap));
    assert_eq!(of_bag.time, of_table.time);
    assert_eq!((of_table.start_ns, of_bag.start_ns), (0, FIRST as i64));
    let pips = |recording| fit(&robot, recording).twin.posterior.inclusion;
    let (a, b) = (pips(of_table), pips(of_bag));
    assert!(a.len() > 3);
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() <= 1e-9, "{a} {b}");
    }
}
