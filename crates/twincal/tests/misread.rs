//! Torque that is turned, exchanged or late is named as that, and a robot that changed is not. Truth is an arm in closed form.

use crate::changes::{Robot, SAME, TIP, errors, fitted, log};
use crate::two_link;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::robot::{JointKind, Workspace, inverse_dynamics};
use twincal::signal::{Auto, Channels, Payload, Recording};
use twincal::term::Family;
use twincal::validate::{Changes, least_share};
use twincal::{Code, Finding};

const RATIO: f64 = 1.2;
const SEEDS: std::ops::Range<u64> = 300..310;

fn good(seed: u64, robot: Robot) -> Recording {
    log("new", 0.1 * (seed % 17) as f64, seed, robot)
}

/// What is said of each log, and how many changes are seen in those that speak of the robot.
fn read(twin: &Calibration, logs: &[Recording]) -> (Vec<Vec<Finding>>, usize) {
    let library = twin.twin.library().expect("a library");
    let mut changes = Changes::new(&twin.twin, &library, &errors(twin)).expect("columns");
    let each = logs.iter().map(|log| {
        let (trajectory, _) = twin.twin.align(log).expect("a motion");
        let mut own = changes.alone();
        own.take(&trajectory).expect("rows");
        let found = own.misread(&log.name, RATIO);
        if found.is_empty() {
            changes.join(own);
        }
        found
    });
    let each = each.collect();
    let all = changes.finish(least_share(RATIO));
    (each, all.iter().filter(|change| change.changed).count())
}

fn turned(mut log: Recording, joints: &[usize]) -> Recording {
    for &joint in joints {
        let torque = log.joints[joint].tau.iter_mut().flatten();
        torque.for_each(|tau| *tau = -*tau);
    }
    log
}

fn exchanged(mut log: Recording) -> Recording {
    let elbow = log.joints[1].tau.take();
    log.joints[1].tau = std::mem::replace(&mut log.joints[0].tau, elbow);
    log
}

/// With the torque of `rows` rows before, of 10 ms each.
fn late(mut log: Recording, rows: isize) -> Recording {
    for joint in &mut log.joints {
        let torque = joint.tau.take().expect("torque");
        let last = torque.len() as isize - 1;
        let at = |row: isize| torque[(row - rows).clamp(0, last) as usize];
        joint.tau = Some((0..=last).map(at).collect());
    }
    log
}

/// Code and subject of what is said of a log of the unchanged robot, the same in ten logs; no change is seen then.
#[track_caller]
fn named(
    twin: &Calibration,
    make: &dyn Fn(Recording) -> Recording,
) -> (Code, String, Vec<Finding>) {
    let mut all: Vec<Finding> = Vec::new();
    for seed in SEEDS {
        let (found, changes) = read(twin, &[make(good(seed, SAME))]);
        let [one] = &found[0][..] else {
            panic!("seed {seed}: {:?}", found[0]);
        };
        assert_eq!(changes, 0);
        all.push(one.clone());
    }
    let same = |own: &Finding| own.code == all[0].code && own.subject == all[0].subject;
    assert!(all.iter().all(same), "{all:?}");
    (all[0].code, all[0].subject.clone(), all)
}

#[test]
fn torque_that_is_turned_exchanged_or_late_is_named() {
    let twin = fitted();
    let (code, subject, all) = named(&twin, &|log| turned(log, &[0, 1]));
    assert_eq!((code, subject.as_str()), (Code::SignFlip, "new"));
    for found in all {
        let shares = ["explained_before", "explained"].map(|name| found.evidence.get(name));
        assert!(
            shares[0] == Some(0.0) && shares[1] > Some(0.98),
            "{found:?}"
        );
    }
    for (joint, name) in ["shoulder", "elbow"].into_iter().enumerate() {
        let (code, subject, _) = named(&twin, &|log| turned(log, &[joint]));
        assert_eq!((code, subject.as_str()), (Code::SignFlip, name));
    }
    let (code, subject, all) = named(&twin, &exchanged);
    assert_eq!((code, subject.as_str()), (Code::JointOrder, "new"));
    assert!(all.iter().all(|found| found.count == 2));
    let message = &all[0].message;
    assert!(
        message.contains("`shoulder` = torque of `elbow`"),
        "{message}"
    );
    let (code, _, all) = named(&twin, &|log| turned(exchanged(log), &[0]));
    assert_eq!(code, Code::JointOrder);
    let message = &all[0].message;
    let both = "`shoulder` = torque of `elbow`, `elbow` = the negative of torque of `shoulder`";
    assert!(message.contains(both), "{message}");
    for rows in [3, 6, -6, 20] {
        let (code, subject, all) = named(&twin, &|log| late(log, rows));
        assert_eq!((code, subject.as_str()), (Code::LogTorqueLag, "new"));
        for found in all {
            let [lag, sd] =
                ["lag", "lag_sd"].map(|name| found.evidence.get(name).expect("a number"));
            let off = (lag - 0.01 * rows as f64).abs();
            assert!(off < 0.002 && sd < 0.002, "{rows} rows: {found:?}");
        }
    }
}

/// Small and large ones, in ten logs each.
#[test]
fn a_changed_robot_is_no_misread_log() {
    let twin = fitted();
    let degrees = |zero: f64| Robot {
        zero: zero.to_radians(),
        ..SAME
    };
    let friction = |friction: f64| Robot { friction, ..SAME };
    let load = |load: f64| Robot { load, ..SAME };
    let robots = [
        SAME,
        friction(1.5),
        friction(0.0),
        friction(6.0),
        load(0.28),
        load(-1.5),
        load(5.0),
        degrees(1.0),
        degrees(-10.0),
    ];
    for (k, robot) in robots.into_iter().enumerate() {
        for seed in SEEDS {
            let (found, _) = read(&twin, &[good(seed, robot)]);
            assert_eq!(found[0], [], "robot {k}, seed {seed}");
        }
    }
}

/// The elbow alone: the shoulder is fixed.
fn pendulum() -> twincal::robot::Robot {
    let mut description = two_link::arm(TIP).expect("an arm").description().clone();
    description.joints[0].kind = JointKind::Fixed;
    twincal::robot::Robot::new(description, &Default::default())
        .expect("a pendulum")
        .0
}

/// 20 s of the pendulum, swinging at these frequencies, Hz, with `viscous` friction, N·m·s/rad.
fn swinging(name: &str, seed: u64, frequencies: &[f64], viscous: f64) -> Recording {
    let real = pendulum();
    let (mut workspace, mut noise) = (Workspace::new(&real), Random::new(seed, 1));
    let mut channels = [(); 4].map(|()| Vec::new());
    let time: Vec<f64> = (0..2000).map(|row| 0.01 * f64::from(row)).collect();
    for t in &time {
        let mut state = [0.0; 3];
        for frequency in frequencies {
            let rate = std::f64::consts::TAU * frequency;
            let (sin, cos) = (rate * t).sin_cos();
            let own = [sin, rate * cos, -rate * rate * sin];
            (state.iter_mut().zip(own)).for_each(|(sum, own)| *sum += 0.3 * own);
        }
        let [q, qd, qdd] = state;
        let mut tau = [0.0];
        inverse_dynamics(&real, &mut workspace, &[q], &[qd], &[qdd], &mut tau);
        let torque = tau[0] + 0.1 * noise.normal() + viscous * qd;
        (channels.iter_mut().zip([q, qd, qdd, torque])).for_each(|(all, own)| all.push(own));
    }
    let [q, qd, qdd, tau] = channels;
    let [qd, qdd, tau] = [qd, qdd, tau].map(Some);
    let elbow = Channels {
        q,
        qd,
        qdd,
        tau,
        temperature: None,
    };
    Recording {
        unfolded: false,
        start_ns: 0,
        name: name.into(),
        time,
        joints: vec![elbow],
        payload: Payload::None,
    }
}

/// In a motion of one frequency friction explains a log as well as a lag does: the change is named.
#[test]
fn more_friction_in_a_motion_of_one_frequency_is_no_late_log() {
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![Family::Viscous, Family::MotorInertia];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    let several = [0.4, 1.0, 1.7];
    let [training, heldout] =
        [("training", 1), ("held-out", 2)].map(|(name, seed)| swinging(name, seed, &several, 0.2));
    let twin =
        calibrate(&pendulum(), &[training], &[heldout], &settings, &|_| {}).expect("a calibration");
    for viscous in [0.4, 0.6, 1.0] {
        for seed in SEEDS {
            let (found, changes) = read(&twin, &[swinging("new", seed, &[1.0], viscous)]);
            assert_eq!(found[0], [], "{viscous}, seed {seed}");
            assert_eq!(changes, 1, "{viscous}, seed {seed}");
        }
    }
}

/// A lag beyond the last one that is tried has no number; the logs sweep over frequencies, so that no friction looks like it.
#[test]
fn a_lag_at_the_end_of_the_search_is_at_least_that() {
    let twin = fitted();
    for (rows, said) in [
        (32, "is written at least 240 ms later"),
        (20, "is written 200 ± 1 ms later"),
    ] {
        let (_, _, all) = named(&twin, &|log| late(log, rows));
        let has = |own: &Finding| own.message.contains(said);
        assert!(all.iter().all(has), "{rows} rows: {all:?}");
    }
}

/// How many findings each log has.
fn lengths(found: &[Vec<Finding>]) -> Vec<usize> {
    found.iter().map(Vec::len).collect()
}

/// The change of the second log is seen, and nothing of the first.
#[test]
fn a_misread_log_says_nothing_beside_another_one() {
    let twin = fitted();
    let changed = Robot { load: 0.28, ..SAME };
    let first = turned(good(300, SAME), &[0, 1]);
    let (found, changes) = read(&twin, &[first.clone(), good(301, changed)]);
    assert_eq!(lengths(&found), [1, 0]);
    assert_eq!(changes, 1);
    let (found, changes) = read(&twin, &[first, good(301, SAME)]);
    assert_eq!(lengths(&found), [1, 0]);
    assert_eq!(changes, 0);
}
