//! What a log says of a robot that changed since its twin was fitted, and of one that did not. Truth is an arm in closed form.

use crate::two_link;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::signal::{Auto, Recording};
use twincal::term::Family;
use twincal::validate::{Change, ChangeKind, Changes, least_share};

/// Mass at the tip, and all that moves, kg.
pub(crate) const TIP: f64 = 2.6;
const MOVED: f64 = 3.0 + TIP;
/// Viscous and Coulomb friction of the elbow.
const FRICTION: [f64; 2] = [0.3, 0.4];
const VELOCITY: f64 = 0.02;

/// What changed: factor on the elbow's friction, kg more at the tip, and by how much the elbow's encoder reads too much, rad.
#[derive(Clone, Copy)]
pub(crate) struct Robot {
    pub(crate) friction: f64,
    pub(crate) load: f64,
    pub(crate) zero: f64,
}

pub(crate) const SAME: Robot = Robot {
    friction: 1.0,
    load: 0.0,
    zero: 0.0,
};

pub(crate) fn log(name: &str, phase: f64, seed: u64, robot: Robot) -> Recording {
    let real = two_link::arm(TIP + robot.load).expect("an arm");
    let mut log = two_link::log(name, phase, &real, &mut Random::new(seed, 0));
    let elbow = &mut log.joints[1];
    let velocity = elbow.qd.clone().expect("a velocity");
    for (tau, v) in elbow.tau.iter_mut().flatten().zip(&velocity) {
        let friction = FRICTION[0] * v + FRICTION[1] * (v / VELOCITY).tanh();
        *tau += robot.friction * friction;
    }
    elbow.q.iter_mut().for_each(|q| *q += robot.zero);
    log
}

pub(crate) fn fitted() -> Calibration {
    let nominal = two_link::arm(2.0).expect("an arm");
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Payload, Family::Viscous, Family::Coulomb];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    let (training, heldout) = (log("training", 0.3, 1, SAME), log("held-out", 1.9, 2, SAME));
    calibrate(&nominal, &[training], &[heldout], &settings, &|_| {}).expect("a calibration")
}

/// The twin's held-out error of each joint.
pub(crate) fn errors(twin: &Calibration) -> Vec<f64> {
    let scores = twin.validation.moving.joints.iter();
    scores.map(|joint| joint.rmse_calibrated).collect()
}

/// What a twin says of a log.
fn changes(twin: &Calibration, log: &Recording) -> Vec<Change> {
    let error = errors(twin);
    let library = twin.twin.library().expect("a library");
    let mut changes = Changes::new(&twin.twin, &library, &error).expect("columns");
    let (trajectory, _) = twin.twin.align(log).expect("a motion");
    changes.take(&trajectory).expect("rows");
    changes.finish(least_share(1.2))
}

fn named(all: &[Change]) -> Vec<(ChangeKind, &str)> {
    let changed = all.iter().filter(|change| change.changed);
    changed
        .map(|change| (change.kind, change.subject.as_str()))
        .collect()
}

/// 40 logs of an unchanged robot at 1 % each: three alarms or more have probability 0.0075; the seeds are fixed. The log of the fit is
/// one of them.
#[test]
fn an_unchanged_robot_passes() {
    let twin = fitted();
    assert_eq!(named(&changes(&twin, &log("training", 0.3, 1, SAME))), []);
    let phase = |seed: u64| 0.1 * (seed % 17) as f64;
    let alarm = |seed: &u64| {
        let all = changes(&twin, &log("new", phase(*seed), *seed, SAME));
        assert!(all.len() >= 4, "{all:?}");
        all.iter().any(|change| change.changed)
    };
    let alarms = (100..140).filter(alarm).count();
    assert!(alarms <= 2, "{alarms} alarms");
}

/// Each change in ten logs; nine or more are named, and the number is within 5 of its standard errors.
#[test]
fn friction_payload_and_joint_zero_are_named_with_their_numbers() {
    let twin = fitted();
    let degree = 1f64.to_radians();
    let cases = [
        (
            Robot {
                friction: 1.5,
                ..SAME
            },
            (ChangeKind::Friction, "elbow"),
            0.5 * FRICTION[0],
        ),
        (
            Robot {
                load: 0.05 * MOVED,
                ..SAME
            },
            (ChangeKind::Payload, "payload"),
            0.05 * MOVED,
        ),
        (
            Robot {
                zero: degree,
                ..SAME
            },
            (ChangeKind::JointZero, "elbow"),
            degree,
        ),
    ];
    for (robot, (kind, subject), truth) in cases {
        let mut found = 0;
        for seed in 200..210 {
            let all = changes(&twin, &log("new", 0.1 * (seed % 17) as f64, seed, robot));
            let own = all
                .iter()
                .find(|change| change.kind == kind && change.subject == subject);
            let own = own.expect("a change of that name");
            if !own.changed {
                continue;
            }
            found += 1;
            let number = &own.numbers[0];
            // An encoder that reads too much: the robot stands at less than it says. Its column counts the model's own masses: the number is off by
            // the share that these lack, a third here.
            let off = number.value.abs() - truth;
            let share = if kind == ChangeKind::JointZero {
                0.4
            } else {
                0.1
            };
            assert!(
                off.abs() < (5.0 * number.sd).max(share * truth),
                "{kind:?}: {own:?}"
            );
        }
        assert!(found >= 9, "{kind:?} in {found} of 10 logs");
    }
}

/// A mass at the tip, half a metre along the link that carries it, in ten logs: mass and place are within 4.5 standard errors (probability of an alarm
/// 2e-4 for 30 numbers).
#[test]
fn a_payload_has_mass_and_centre_of_mass_in_its_frame() {
    let twin = fitted();
    let load = 0.1 * MOVED;
    let loaded = Robot { load, ..SAME };
    for seed in 200..210 {
        let all = changes(&twin, &log("new", 0.1 * (seed % 17) as f64, seed, loaded));
        let own = all.iter().find(|change| change.kind == ChangeKind::Payload);
        let own = own.expect("a payload");
        assert_eq!(own.frame.as_deref(), Some("fore"));
        let names: Vec<&str> = own.numbers.iter().map(|own| own.name.as_str()).collect();
        assert_eq!(names, ["payload.mass", "payload.com_x", "payload.com_y"]);
        for (number, truth) in own.numbers.iter().zip([load, 0.5, 0.0]) {
            assert!((number.value - truth).abs() < 4.5 * number.sd, "{own:?}");
            assert!(number.sd < 0.1, "{own:?}");
        }
    }
}
