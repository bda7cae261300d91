//! Do log and model speak of the same robot? Silence on five real robots and on the study's logs; planted mistakes are named.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test stops where its files do not do what they should, and says what it skips"
)]

use std::collections::BTreeMap;
use std::path::Path;
use twincal::robot::Robot;
use twincal::self_check::self_check;
use twincal::signal::{Auto, Channels, Recording, SignalSettings, align, choose_pipeline};
use twincal::{Error, Finding};
use twincal_io::log::{LogOptions, read_log};
use twincal_io::model::{ModelSettings, read_model};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
const STUDY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../twincal-cli/assets");

/// Model and logs; `None` (and said) where the data are absent.
fn load(folder: &Path, model: &str, files: &[&str]) -> Option<(Robot, Vec<Recording>)> {
    if !folder.exists() {
        println!("skipped: {} is absent", folder.display());
        return None;
    }
    let settings = ModelSettings {
        allow_unphysical: true,
        ..ModelSettings::default()
    };
    let model = read_model(&folder.join(model), &settings).unwrap();
    let (robot, _) = model.robot(&BTreeMap::new()).unwrap();
    let read = |file: &&str| read_log(&folder.join(file), &robot, &LogOptions::default());
    let logs = files.iter().map(|file| read(file).unwrap().0).collect();
    Some((robot, logs))
}

fn real(name: &str, model: &str, files: &[&str]) -> Option<(Robot, Vec<Recording>)> {
    load(&Path::new(DATA).join(name), model, files)
}

/// The way that `fit` goes, as far as the check.
fn check(robot: &Robot, logs: &[Recording], cutoff: Auto) -> Result<Vec<Finding>, Error> {
    let settings = SignalSettings {
        cutoff_hz: cutoff,
        rate_hz: Auto::Auto,
        coulomb_velocity: None,
        corrections: twincal::signal::Corrections::default(),
        every_sample: false,
    };
    let (pipeline, _) = choose_pipeline(robot, logs, &settings)?;
    let mut trajectories = Vec::new();
    for log in logs {
        trajectories.push(align(robot, log, &pipeline)?.0);
    }
    self_check(robot, &pipeline, &trajectories)
}

const PENDULUM: [&str; 8] = [
    "run0.csv", "run1.csv", "run2.csv", "run3.csv", "run4.csv", "run5.csv", "run6.csv", "run7.csv",
];

#[test]
fn good_logs_are_passed_in_silence() {
    let study = [
        "train1.parquet",
        "train2.parquet",
        "train3.parquet",
        "heldout1.parquet",
        "heldout2.parquet",
    ];
    let cases = [
        load(Path::new(STUDY), "arm.urdf", &study),
        real("double_pendulum", "model.urdf", &PENDULUM),
        real("double_pendulum", "model_as_published.urdf", &PENDULUM),
        real(
            "simple_pendulum",
            "model.urdf",
            &["run0.csv", "run1.csv", "run5.csv"],
        ),
        real("ur10", "model.urdf", &["run0.parquet"]),
        real(
            "kuka_kr300",
            "model.urdf",
            &["run0.parquet", "run1.parquet"],
        ),
        real("staubli_tx40", "model.urdf", &["run0.parquet"]),
    ];
    let mut said = Vec::new();
    for (robot, logs) in cases.into_iter().flatten() {
        for log in &logs {
            said.extend(check(&robot, std::slice::from_ref(log), Auto::Auto).unwrap());
        }
        said.extend(check(&robot, &logs, Auto::Auto).unwrap());
    }
    assert!(said.is_empty(), "{said:#?}");
}

fn turn(values: &mut Option<Vec<f64>>, factor: f64) {
    values.iter_mut().flatten().for_each(|v| *v *= factor);
}

fn turn_motion(channels: &mut Channels, factor: f64) {
    channels.q.iter_mut().for_each(|v| *v *= factor);
    turn(&mut channels.qd, factor);
    turn(&mut channels.qdd, factor);
}

/// Code and subject of every finding on the UR10's log after `spoil`.
fn spoiled(spoil: impl Fn(&mut Recording)) -> Option<Result<Vec<(String, String)>, String>> {
    let (robot, mut logs) = real("ur10", "model.urdf", &["run0.parquet"])?;
    spoil(&mut logs[0]);
    let said = |f: Finding| {
        println!("{}", f.message);
        (f.code.to_string(), f.subject)
    };
    Some(
        check(&robot, &logs, Auto::Auto)
            .map(|findings| findings.into_iter().map(said).collect())
            .map_err(|error| error.to_string()),
    )
}

fn named(code: &str, subject: &str) -> Vec<(String, String)> {
    vec![(code.to_owned(), subject.to_owned())]
}

#[test]
fn case_18_a_real_log_in_degrees_is_refused() {
    let degrees = 180.0 / std::f64::consts::PI;
    let Some(all) = spoiled(|log| {
        for joint in &mut log.joints {
            turn_motion(joint, degrees);
        }
    }) else {
        return;
    };
    let message = all.unwrap_err();
    assert!(
        message.contains("degrees") && message.contains("π/180"),
        "{message}"
    );
    // Only positions, only velocities.
    for positions in [true, false] {
        let one = spoiled(|log| {
            for joint in &mut log.joints {
                if positions {
                    joint.q.iter_mut().for_each(|v| *v *= degrees);
                } else {
                    turn(&mut joint.qd, degrees);
                }
            }
        });
        let message = one.unwrap().unwrap_err();
        assert!(message.contains("`shoulder_pan_joint`"), "{message}");
    }
}

#[test]
fn case_19_and_20_torque_that_is_a_current_or_of_the_motors_side_is_named() {
    for gain in [1.0 / 11.3, 0.01] {
        let Some(said) = spoiled(|log| turn(&mut log.joints[1].tau, gain)) else {
            return;
        };
        assert_eq!(said.unwrap(), named("torque_scale", "shoulder_lift_joint"));
    }
}

#[test]
fn case_21_a_turned_sign_is_named_with_its_joint() {
    let names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ];
    for (joint, name) in names.into_iter().enumerate() {
        for motion in [false, true] {
            let Some(said) = spoiled(|log| {
                if motion {
                    turn_motion(&mut log.joints[joint], -1.0);
                } else {
                    turn(&mut log.joints[joint].tau, -1.0);
                }
            }) else {
                return;
            };
            assert_eq!(said.unwrap(), named("sign_flip", name), "motion: {motion}");
        }
    }
}

/// Friction, motor inertia and a model's torque that may be left out explain much of another joint's torque too.
#[test]
fn case_20_to_22_mistakes_that_friction_hides_are_named_on_real_robots() {
    let Some((pendulum, runs)) = real("double_pendulum", "model.urdf", &PENDULUM) else {
        return;
    };
    let (tx40, tx40_log) = real("staubli_tx40", "model.urdf", &["run0.parquet"]).unwrap();
    let of = |robot: &Robot, logs: &[Recording], spoil: &dyn Fn(&mut Recording)| {
        let mut logs = logs.to_vec();
        logs.iter_mut().for_each(spoil);
        let findings = check(robot, &logs, Auto::Auto).unwrap();
        let said = findings
            .into_iter()
            .map(|f| (f.code.to_string(), f.subject));
        said.collect::<Vec<_>>()
    };
    let thousandths = |log: &mut Recording| {
        let torque = log.joints.iter_mut().map(|joint| &mut joint.tau);
        torque.for_each(|tau| turn(tau, 1e3));
    };
    let exchanged = |log: &mut Recording| log.joints.swap(0, 1);
    for logs in [&runs[..1], &runs] {
        let scale = named("torque_scale", "");
        assert_eq!(of(&pendulum, logs, &thousandths), scale);
        let order = named("joint_order", "");
        assert_eq!(of(&pendulum, logs, &exchanged), order);
    }
    // The first run's torque on joint 1 is 0.4 of the model's: with all runs its sign can be told.
    for (joint, name) in pendulum.joint_names().into_iter().enumerate() {
        let flip = |log: &mut Recording| turn(&mut log.joints[joint].tau, -1.0);
        assert_eq!(of(&pendulum, &runs, &flip), named("sign_flip", name));
    }
    let order = named("joint_order", "");
    assert_eq!(of(&tx40, &tx40_log, &exchanged), order);
}

#[test]
fn case_22_exchanged_joints_are_named() {
    for (a, b) in [(0, 1), (1, 2), (2, 3), (0, 5)] {
        for torque_only in [false, true] {
            let Some(said) = spoiled(|log| {
                if torque_only {
                    let tau = log.joints[a].tau.take();
                    log.joints[a].tau = std::mem::replace(&mut log.joints[b].tau, tau);
                } else {
                    log.joints.swap(a, b);
                }
            }) else {
                return;
            };
            let said = said.unwrap();
            let order = named("joint_order", "");
            // Friction explains joints 1 and 6 of this robot either way, one of them a little better as exchanged: then no reading is proposed, as
            // none is that explains less on a joint.
            let silent = (a, b) == (0, 5) && said.is_empty();
            assert!(silent || said == order, "{a} {b} {torque_only}: {said:?}");
        }
    }
}
