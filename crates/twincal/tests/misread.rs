//! Torque that is turned, exchanged or late is named as that, and a robot that changed is not. Truth is an arm in closed form.

use crate::changes::{FRICTION, Robot, SAME, TIP, VELOCITY, errors, fitted, log};
use crate::two_link;
use twincal::calibrate::Calibration;
use twincal::random::Random;
use twincal::robot::{Workspace, inverse_dynamics};
use twincal::signal::Recording;
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

/// 20 s in which the elbow swings at 1 Hz while the shoulder rests, with `viscous` more friction of the elbow, N·m·s/rad: a lag in such a motion.
fn swinging(seed: u64, viscous: f64) -> Recording {
    let mut log = good(seed, SAME);
    let real = two_link::arm(TIP).expect("an arm");
    let (mut workspace, mut noise) = (Workspace::new(&real), Random::new(seed, 1));
    let rate = std::f64::consts::TAU;
    for (row, time) in log.time.iter().enumerate() {
        let (sin, cos) = (rate * time).sin_cos();
        let (q, qd, qdd) = (
            [0.0, 0.3 * sin],
            [0.0, 0.3 * rate * cos],
            [0.0, -0.3 * rate * rate * sin],
        );
        let mut tau = [0.0; 2];
        inverse_dynamics(&real, &mut workspace, &q, &qd, &qdd, &mut tau);
        let hidden = 0.8 * (q[0] - q[1]).cos();
        let friction = FRICTION[0] * qd[1] + FRICTION[1] * (qd[1] / VELOCITY).tanh();
        tau[0] += 0.1 * noise.normal() - hidden;
        tau[1] += 0.1 * noise.normal() + hidden + friction + viscous * qd[1];
        for (joint, channels) in log.joints.iter_mut().enumerate() {
            channels.q[row] = q[joint];
            let all = [&mut channels.qd, &mut channels.qdd, &mut channels.tau];
            for (values, own) in all.into_iter().zip([qd[joint], qdd[joint], tau[joint]]) {
                values.as_mut().expect("values")[row] = own;
            }
        }
    }
    log
}

/// Friction explains such a log as well as a lag does: the change is named.
#[test]
fn more_friction_in_a_motion_of_one_frequency_is_no_late_log() {
    let twin = fitted();
    for viscous in [1.0, 2.0, 4.0] {
        for seed in SEEDS {
            let (found, changes) = read(&twin, &[swinging(seed, viscous)]);
            assert_eq!(found[0], [], "{viscous}, seed {seed}");
            assert_eq!(changes, 1, "{viscous}, seed {seed}");
        }
    }
}

/// A lag beyond the last one that is tried has no number.
#[test]
fn a_lag_at_the_end_of_the_search_is_at_least_that() {
    let twin = fitted();
    let (found, _) = read(&twin, &[late(swinging(300, 0.0), 40)]);
    assert!(
        found[0]
            .iter()
            .all(|own| own.message.contains("at least 2")),
        "{found:?}"
    );
    let (found, _) = read(&twin, &[late(swinging(300, 0.0), 20)]);
    assert!(
        found[0]
            .iter()
            .all(|own| own.message.contains("200 ± 1 ms")),
        "{found:?}"
    );
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
