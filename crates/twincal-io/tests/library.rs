//! What a program that uses the library writes with files: model and log in, calibration out and in again.

use std::fmt::Write as _;
use twincal::prelude::*;
use twincal_io::{load, read_recording, read_robot, save};

/// A pendulum about y, 1 kg at 0.5 m; the real one has 1.5 kg and viscous friction.
const MODEL: &str = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;

fn csv(phase: f64) -> String {
    let mut text = String::from("t,pivot.q,pivot.qd,pivot.qdd,pivot.tau\n");
    let mut noise = twincal::random::Random::new(5, 0);
    for i in 0..4000 {
        let t = 0.005 * f64::from(i);
        let (a, b) = (1.3 * t + phase, 3.1 * t + 2.0 * phase);
        let q = 0.8 * a.sin() + 0.3 * b.sin();
        let qd = 0.8 * 1.3 * a.cos() + 0.3 * 3.1 * b.cos();
        let qdd = -0.8 * 1.3 * 1.3 * a.sin() - 0.3 * 3.1 * 3.1 * b.sin();
        let torque = (1.5 * 0.25 + 0.015) * qdd + 1.5 * 9.81 * 0.5 * q.sin() + 0.4 * qd;
        let torque = torque + 0.05 * noise.normal();
        let _ = writeln!(text, "{t},{q},{qd},{qdd},{torque}");
    }
    text
}

#[test]
fn from_files_to_a_calibration_and_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("arm.urdf"), MODEL).expect("a file");
    for (name, phase) in [("a.csv", 0.1), ("b.csv", 1.7)] {
        std::fs::write(path(name), csv(phase)).expect("a file");
    }
    let robot = read_robot(path("arm.urdf")).expect("a robot");
    let [log, other] =
        ["a.csv", "b.csv"].map(|name| read_recording(path(name), &robot).expect("a log"));
    let fit = Calibrate::new(&robot)
        .logs([log])
        .heldout([other])
        .run()
        .expect("a calibration");
    let viscous = fit
        .effects()
        .find(|effect| effect.name() == "pivot.viscous")
        .expect("friction");
    let friction = viscous.parameters()[0].clone();
    // Beyond 4.4 sd with a probability of 1e-5.
    assert!(
        (friction.mean - 0.4).abs() < 4.4 * friction.sd,
        "{friction:?}"
    );
    let torque = fit.twin.torque(&[0.3], &[0.5], &[-0.2]).expect("torque");
    let truth = (1.5 * 0.25 + 0.015) * -0.2 + 1.5 * 9.81 * 0.5 * 0.3_f64.sin() + 0.4 * 0.5;
    assert!((torque.mean[0] - truth).abs() < 0.02, "{torque:?} {truth}");
    save(&fit, path("twin")).expect("a twin");
    let again = load(path("twin")).expect("a calibration");
    assert_eq!(
        again.twin.torque(&[0.3], &[0.5], &[-0.2]).expect("torque"),
        torque
    );
    assert!(save(&fit, path("twin")).is_err(), "nothing is replaced");
    assert!(load(path("arm.urdf")).is_err());
    let page = path("twin").join("report.html").is_file();
    assert_eq!(page, cfg!(feature = "report"));
}
