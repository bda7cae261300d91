//! Nominal torque per sample on one core, beside Pinocchio in the same run: `cargo bench -p twincal --bench inverse_dynamics`.

#![allow(
    clippy::print_stdout,
    reason = "a bench is a program that prints numbers"
)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use twincal::robot::{
    Motion, Robot, RobotDescription, Workspace, inverse_dynamics, nominal_torque,
};

/// Samples per call: the motion of six joints stays in the second-level cache.
const BATCH: usize = 4096;
const REPEATS: usize = 400;
const GOLDEN: &str = include_str!("../tests/reference/robot/pinocchio.json");

fn main() {
    let golden: Value = serde_json::from_str(GOLDEN).expect("the reference file is JSON");
    println!("nominal torque, one core, best of {REPEATS} batches of {BATCH}, ns per sample");
    println!(
        "{:<12} {:>4} {:>8} {:>12} {:>26}",
        "robot", "dof", "batch", "one by one", "Pinocchio called in Python"
    );
    for case in golden["cases"].as_array().expect("cases") {
        let description: RobotDescription =
            serde_json::from_value(case["description"].clone()).expect("a description");
        let (robot, _) = Robot::new(description, &BTreeMap::new()).expect("a valid robot");
        let name = case["name"].as_str().unwrap_or("?");
        let peer = pinocchio(case).map_or("-".into(), |ns| format!("{ns:.0}"));
        let (batch, one) = (batch(&robot), one(&robot));
        println!(
            "{name:<12} {:>4} {batch:>8.1} {one:>12.1} {peer:>26}",
            robot.dof()
        );
    }
}

fn wave(robot: &Robot, scale: f64, frequency: f64) -> Vec<f64> {
    (0..robot.dof() * BATCH)
        .map(|i| scale * (frequency * i as f64).sin())
        .collect()
}

/// Least time per sample of `work`, which does one batch.
fn least(mut work: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..REPEATS {
        let start = Instant::now();
        work();
        best = best.min(start.elapsed().as_secs_f64());
    }
    1e9 * best / BATCH as f64
}

fn batch(robot: &Robot) -> f64 {
    let (q, qd, qdd) = (
        wave(robot, 2.0, 0.013),
        wave(robot, 3.0, 0.021),
        wave(robot, 8.0, 0.034),
    );
    let mut tau = vec![0.0; q.len()];
    let motion = Motion {
        len: BATCH,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    least(|| nominal_torque(robot, motion, std::hint::black_box(&mut tau)))
}

fn one(robot: &Robot) -> f64 {
    let n = robot.dof();
    let (q, qd, qdd) = (
        wave(robot, 2.0, 0.013),
        wave(robot, 3.0, 0.021),
        wave(robot, 8.0, 0.034),
    );
    let (mut tau, mut workspace) = (vec![0.0; n], Workspace::new(robot));
    least(|| {
        for sample in 0..BATCH {
            let at = sample * n..(sample + 1) * n;
            let (q, qd, qdd) = (&q[at.clone()], &qd[at.clone()], &qdd[at]);
            inverse_dynamics(
                robot,
                &mut workspace,
                q,
                qd,
                qdd,
                std::hint::black_box(&mut tau),
            );
        }
    })
}

/// Pinocchio's time for the same robot (mimics taken as joints of their own), with the cost of a call from Python.
fn pinocchio(case: &Value) -> Option<f64> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = here.join("../../.venv/bin/python");
    let python = if own.exists() { own } else { "python3".into() };
    let run = Command::new(python)
        .arg(here.join("benches/peers/inverse_dynamics.py"))
        .arg(case["urdf"].as_str()?)
        .output()
        .ok()?;
    String::from_utf8(run.stdout).ok()?.trim().parse().ok()
}
