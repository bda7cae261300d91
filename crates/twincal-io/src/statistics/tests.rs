//! Files of statistics: everything comes back, and nothing damaged is taken.

use super::*;
use std::fs;
use twincal::calibrate::{CalibrationSettings, plan};
use twincal::random::Random;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
};
use twincal::signal::{Log, Recording};
use twincal::term::Family;

/// A pendulum with friction, and statistics of a log of it.
fn pendulum() -> StatisticsFile {
    let link = |name: &str, mass: f64| LinkDescription {
        name: name.into(),
        inertia: (mass > 0.0).then_some(Inertia {
            mass,
            com: [0.5, 0.0, 0.0],
            tensor: [[0.0; 3]; 3],
        }),
    };
    let description = RobotDescription {
        name: "pendulum".into(),
        gravity: [0.0, -9.81, 0.0],
        links: vec![link("base", 0.0), link("bob", 2.0)],
        joints: vec![JointDescription::new(
            "pivot",
            JointKind::Revolute,
            "base",
            "bob",
        )],
        allow_unphysical: false,
    };
    let robot = Robot::new(description, &Default::default()).unwrap().0;
    let mut noise = Random::new(1, 0);
    let time: Vec<f64> = (0..2000).map(|i| 0.01 * f64::from(i)).collect();
    let q = |t: &f64| (1.3 * t + 0.04 * t * t).sin();
    let mut torque = |t: &f64| {
        let rate = 1.3 + 0.08 * t;
        let (sin, cos) = (1.3 * t + 0.04 * t * t).sin_cos();
        let (qd, qdd) = (rate * cos, 0.08 * cos - rate * rate * sin);
        0.5 * qdd + 9.81 * q(t).cos() + 0.4 * qd + 0.05 * noise.normal()
    };
    let tau: Vec<f64> = time.iter().map(&mut torque).collect();
    let log = Recording::new("log", time.clone());
    let positions: Vec<f64> = time.iter().map(q).collect();
    let log = log.joint(positions, tau).unwrap();
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![Family::Viscous, Family::Coulomb];
    let made = plan(&robot, std::slice::from_ref(&log), &settings, &|_| {});
    let plan = made.unwrap().0;
    StatisticsFile {
        statistics: Statistics::of(("one", &robot), &plan, &Log::from(&log), "").unwrap(),
        model: ModelFile {
            name: "pendulum.urdf".into(),
            stored_as: "model.urdf".into(),
            robot: "pendulum".into(),
            text: "<robot name=\"pendulum\"/>".into(),
        },
    }
}

fn bytes(file: &StatisticsFile) -> Vec<u8> {
    let mut bytes = Vec::new();
    file.write_to(&mut bytes).unwrap().unwrap();
    bytes
}

#[test]
fn a_file_gives_back_what_it_holds_and_is_the_same_bytes_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.arrow");
    let file = pendulum();
    fs::write(&path, bytes(&file)).unwrap();
    let back = StatisticsFile::read(&path).unwrap();
    assert_eq!(back, file);
    assert_eq!(bytes(&back), bytes(&file));
}

/// Every byte that is changed, and every end that is cut off, is an error or changes nothing that is read: padding alone may differ.
#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.arrow");
    let file = pendulum();
    let good = bytes(&file);
    let mut random = Random::new(2, 0);
    let mut refused = 0;
    for _ in 0..600 {
        let mut bad = good.clone();
        let at = (random.uniform() * bad.len() as f64) as usize;
        bad[at] ^= 1 << (random.uniform() * 8.0) as u32;
        fs::write(&path, bad).unwrap();
        match StatisticsFile::read(&path) {
            Ok(back) => assert_eq!(back, file, "byte {at}"),
            Err(_) => refused += 1,
        }
    }
    // The schema stands twice in such a file, and its first copy is not read.
    assert!(refused > 300, "{refused}");
    for share in [0.0, 0.01, 0.3, 0.7, 0.99, 0.9999] {
        fs::write(&path, &good[..(share * good.len() as f64) as usize]).unwrap();
        let error = StatisticsFile::read(&path).unwrap_err().to_string();
        assert!(error.contains("log.arrow"), "{error}");
    }
}
