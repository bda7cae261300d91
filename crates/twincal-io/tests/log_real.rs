//! The signal pipeline on logs of real robots: what it chooses, and that motion derived from positions is what the drives logged.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test stops where its files do not do what they should, and says what it skips"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use twincal::Code;
use twincal::Severity;
use twincal::robot::Robot;
use twincal::signal::{
    Auto, DerivedFrom, Recording, SignalSettings, align, choose_pipeline, hardly_driven,
};
use twincal_io::log::{LogOptions, read_log};
use twincal_io::model::{ModelSettings, read_model};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
const AUTO: SignalSettings = SignalSettings {
    cutoff_hz: Auto::Auto,
    rate_hz: Auto::Auto,
    coulomb_velocity: None,
    corrections: twincal::signal::Corrections {
        lag: twincal::signal::Lag::Unsaid,
        velocity: None,
    },
    every_sample: false,
};

/// Model and logs of a robot; `None` (and said) where the data are absent.
fn load(folder: &str, files: &[&str]) -> Option<(Robot, Vec<Recording>)> {
    let folder: PathBuf = Path::new(DATA).join(folder);
    if !folder.exists() {
        println!("skipped: {} is absent", folder.display());
        return None;
    }
    let settings = ModelSettings {
        allow_unphysical: true,
        ..ModelSettings::default()
    };
    let model = read_model(&folder.join("model.urdf"), &settings).unwrap();
    let (robot, _) = Robot::new(model.description, &BTreeMap::new()).unwrap();
    let logs = files
        .iter()
        .map(|file| {
            read_log(&folder.join(file), &robot, &LogOptions::default())
                .unwrap()
                .0
        })
        .collect();
    Some((robot, logs))
}

const PENDULUM: [&str; 8] = [
    "run0.csv", "run1.csv", "run2.csv", "run3.csv", "run4.csv", "run5.csv", "run6.csv", "run7.csv",
];

#[test]
fn the_automatic_cutoff_is_near_what_experts_chose() {
    // Double pendulum and KR300 5 Hz, UR10 10 Hz, TX40 40 Hz (the data's README); ours is the motion's, not below 5 Hz.
    for (folder, files, low, high) in [
        ("double_pendulum", &PENDULUM[..], 5.0, 6.0),
        ("ur10", &["run0.parquet"], 5.0, 10.0),
        ("staubli_tx40", &["run0.parquet"], 5.0, 40.0),
        ("kuka_kr300", &["run0.parquet", "run1.parquet"], 5.0, 6.0),
    ] {
        let Some((robot, logs)) = load(folder, files) else {
            return;
        };
        let (pipeline, _) = choose_pipeline(&robot, &logs, &AUTO).unwrap();
        println!("{folder}: {} Hz", pipeline.cutoff_hz);
        assert!(
            (low..=high).contains(&pipeline.cutoff_hz),
            "{folder}: {} Hz",
            pipeline.cutoff_hz
        );
        for log in &logs {
            let (trajectory, findings) = align(&robot, log, &pipeline).unwrap();
            assert_eq!(trajectory.segments.len(), 1, "{folder}: {findings:#?}");
            assert!(findings.iter().all(|f| f.severity < Severity::Degraded));
        }
    }
}

#[test]
fn a_passive_elbow_and_one_that_rests_are_told() {
    let Some((robot, logs)) = load("double_pendulum", &PENDULUM) else {
        return;
    };
    let (pipeline, _) = choose_pipeline(&robot, &logs, &AUTO).unwrap();
    let rests: Vec<usize> = (0..8)
        .filter(|&run| {
            let (_, findings) = align(&robot, &logs[run], &pipeline).unwrap();
            findings
                .iter()
                .any(|f| f.code == Code::JointStandsStill && f.message.contains("`joint2`"))
        })
        .collect();
    assert_eq!(rests, [5]);
    let said = hardly_driven(&robot, &logs[..]).unwrap();
    let passive = |joint: &str| -> Vec<usize> {
        let named = format!("`{joint}`");
        (0..8)
            .filter(|&run| {
                said.iter()
                    .any(|f| f.subject == logs[run].name && f.message.contains(&named))
            })
            .collect()
    };
    assert_eq!(passive("joint1"), [3, 4]);
    assert_eq!(passive("joint2"), [5, 6, 7]);
}

#[test]
fn velocity_derived_from_position_is_the_logged_one() {
    // KR300: q and q̇ come from the same controller (its q̇ lags by one 4 ms sample, which is most of what is left).
    let Some((robot, logs)) = load("kuka_kr300", &["run0.parquet"]) else {
        return;
    };
    let (pipeline, _) = choose_pipeline(&robot, &logs, &AUTO).unwrap();
    let mut without = logs[0].clone();
    without.joints.iter_mut().for_each(|joint| joint.qd = None);
    let (logged, _) = align(&robot, &logs[0], &pipeline).unwrap();
    let (derived, _) = align(&robot, &without, &pipeline).unwrap();
    let (a, b) = (&logged.segments[0], &derived.segments[0]);
    let len = a.time.len();
    for joint in 0..6 {
        let range = joint * len..(joint + 1) * len;
        let (mut difference, mut size) = (0.0, 0.0);
        for (x, y) in a.qd[range.clone()].iter().zip(&b.qd[range]) {
            difference += (x - y).powi(2);
            size += x * x;
        }
        assert!(
            difference < 1e-3 * size,
            "joint {joint}: {}",
            difference / size
        );
    }
}

/// White noise of 0.1 rad/s in q̇ of the UR10, of which the motion filter leaves √(2 f_q / rate): its q̇ is taken from q, which has none.
/// Logged velocities of real robots are kept.
#[test]
fn a_noisy_velocity_is_taken_from_position_and_no_other() {
    let good = [
        ("ur10", &["run0.parquet"][..]),
        ("kuka_kr300", &["run0.parquet", "run1.parquet"]),
        ("double_pendulum", &PENDULUM),
        ("simple_pendulum", &["run0.csv", "run1.csv", "run5.csv"]),
    ];
    for (name, files) in good {
        let Some((robot, logs)) = load(name, files) else {
            return;
        };
        let (pipeline, said) = choose_pipeline(&robot, &logs, &AUTO).unwrap();
        assert_eq!(pipeline.velocity_from, [], "{name}: {said:#?}");
        if name != "ur10" {
            continue;
        }
        let mut noisy = logs.clone();
        let qd = noisy[0].joints[1].qd.as_mut().unwrap();
        let mut state = 1_u64;
        for v in qd {
            let mut uniform = || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            *v += 0.1
                * (-2.0 * (1.0 - uniform()).ln()).sqrt()
                * (std::f64::consts::TAU * uniform()).cos();
        }
        let (pipeline, said) = choose_pipeline(&robot, &noisy, &AUTO).unwrap();
        let mut expected = vec![DerivedFrom::Velocity; 6];
        expected[1] = DerivedFrom::Position;
        assert_eq!(pipeline.velocity_from, expected);
        let said = said.iter().find(|f| f.code == Code::NoisyVelocity).unwrap();
        let stated = said.message.split("noise of ").nth(1).unwrap();
        let stated: f64 = stated.split(' ').next().unwrap().parse().unwrap();
        let left = 0.1 * (2.0 * pipeline.motion_cutoff_hz / 125.0).sqrt();
        assert!(
            (stated / left - 1.0).abs() < 0.15,
            "{stated} instead of {left}"
        );
        // The motion is what position says, and what was said is kept to.
        let (from_noisy, _) = align(&robot, &noisy[0], &pipeline).unwrap();
        let mut without = logs[0].clone();
        without.joints[1].qd = None;
        let (from_position, _) = align(&robot, &without, &pipeline).unwrap();
        assert_eq!(from_noisy.segments[0].qd, from_position.segments[0].qd);
        let mut stated = AUTO.clone();
        stated.corrections.velocity = Some(DerivedFrom::Velocity);
        let (pipeline, said) = choose_pipeline(&robot, &noisy, &stated).unwrap();
        assert_eq!(pipeline.velocity_from, []);
        assert!(said.iter().all(|f| f.code != Code::NoisyVelocity));
    }
}
