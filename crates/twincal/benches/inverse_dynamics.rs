//! Inverse dynamics and regressor on one core, ns per sample, beside Pinocchio in C++ in the same run:
//! `cargo bench -p twincal --bench inverse_dynamics`.
//!
//! The peer is built against the `pin` wheel (`peers/inverse_dynamics.py`; needs g++ and the packages of
//! requirements-check.txt) and runs the same robots, one state after the other as its interface has it. Batches take many
//! states at once, which a log allows; "one by one" is the like-for-like column. All include sine and cosine. Times are
//! the least of many repeats: on a loaded machine both sides suffer alike.

#![allow(
    clippy::print_stdout,
    reason = "a bench is a program that prints numbers"
)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use twincal::robot::{
    BLOCK, Instructions, Motion, Regressor, Robot, RobotDescription, Workspace, inverse_dynamics,
    nominal_torque_with,
};

/// Samples per call: the motion of six joints stays in the second-level cache.
const BATCH: usize = 1024;
const REPEATS: usize = 1000;
const ROBOTS: &str = include_str!("peers/robots.json");
const INSTRUCTIONS: [(&str, Instructions); 3] = [
    ("widest", Instructions::Widest),
    ("AVX2", Instructions::Avx2),
    ("portable", Instructions::Portable),
];

fn main() {
    let document: Value = serde_json::from_str(ROBOTS).expect("the file of robots is JSON");
    println!(
        "one core, ns per sample (times faster than Pinocchio); widest: {}",
        widest()
    );
    print!("{:<7} {:<17} {:>9}", "robot", "what", "Pinocchio");
    for (name, _) in INSTRUCTIONS {
        print!(" {:>15}", format!("batch {name}"));
    }
    println!(" {:>15}", "one by one");
    for case in document["cases"].as_array().expect("cases") {
        let description: RobotDescription =
            serde_json::from_value(case["description"].clone()).expect("a description");
        let (robot, _) = Robot::new(description, &BTreeMap::new()).expect("a valid robot");
        let name = case["name"].as_str().unwrap_or("?");
        let peer = pinocchio(name);
        let torque = INSTRUCTIONS.map(|(_, set)| torque_batch(&robot, set));
        let columns = INSTRUCTIONS.map(|(_, set)| regressor(&robot, set, BLOCK));
        let one = regressor(&robot, Instructions::Widest, 1);
        line(
            name,
            "inverse dynamics",
            peer.map(|p| p[0]),
            torque,
            torque_one(&robot),
        );
        line(name, "regressor", peer.map(|p| p[1]), columns, one);
    }
}

/// The instruction set that the run-time dispatch finds here.
fn widest() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if pulp::x86::V4::try_new().is_some() {
            return "AVX-512";
        }
        if pulp::x86::V3::try_new().is_some() {
            return "AVX2";
        }
    }
    "the portable one or NEON"
}

fn line(robot: &str, what: &str, peer: Option<f64>, batches: [f64; 3], one: f64) {
    let peer_text = peer.map_or("-".into(), |ns| format!("{ns:.0}"));
    print!("{robot:<7} {what:<17} {peer_text:>9}");
    for ns in batches.into_iter().chain([one]) {
        let ratio = peer.map_or(String::new(), |peer| format!(" ({:.1})", peer / ns));
        print!(" {:>15}", format!("{ns:.1}{ratio}"));
    }
    println!();
}

/// Positions, velocities, accelerations of one batch.
fn waves(robot: &Robot) -> [Vec<f64>; 3] {
    [(2.0, 0.013), (3.0, 0.021), (8.0, 0.034)].map(|(scale, frequency)| {
        (0..robot.dof() * BATCH)
            .map(|i| scale * (frequency * i as f64).sin())
            .collect()
    })
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

fn torque_batch(robot: &Robot, instructions: Instructions) -> f64 {
    let [q, qd, qdd] = &waves(robot);
    let mut tau = vec![0.0; q.len()];
    let motion = Motion {
        len: BATCH,
        q,
        qd,
        qdd,
    };
    least(|| nominal_torque_with(instructions, robot, motion, black_box(&mut tau)))
}

fn torque_one(robot: &Robot) -> f64 {
    let n = robot.dof();
    let [q, qd, qdd] = &waves(robot);
    let (mut tau, mut workspace) = (vec![0.0; n], Workspace::new(robot));
    least(|| {
        for sample in 0..BATCH {
            let at = sample * n..(sample + 1) * n;
            let (q, qd, qdd) = (&q[at.clone()], &qd[at.clone()], &qdd[at]);
            inverse_dynamics(robot, &mut workspace, q, qd, qdd, black_box(&mut tau));
        }
    })
}

/// In blocks of `size` samples.
fn regressor(robot: &Robot, instructions: Instructions, size: usize) -> f64 {
    let [q, qd, qdd] = &waves(robot);
    let motion = Motion {
        len: BATCH,
        q,
        qd,
        qdd,
    };
    let regressor = Regressor::new(robot);
    let mut block = regressor.block(robot);
    least(|| {
        for first in (0..BATCH).step_by(size) {
            let samples = first..first + size;
            regressor.evaluate_with(instructions, robot, motion, samples, &mut block);
            black_box(&mut block);
        }
    })
}

/// Pinocchio's times for inverse dynamics and regressor of the same robot.
fn pinocchio(robot: &str) -> Option<[f64; 2]> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = here.join("../../.venv/bin/python");
    let python = if own.exists() { own } else { "python3".into() };
    let run = Command::new(python)
        .arg(here.join("benches/peers/inverse_dynamics.py"))
        .arg(robot)
        .arg(env!("CARGO_TARGET_TMPDIR"))
        .output()
        .ok()?;
    let text = String::from_utf8(run.stdout).ok()?;
    let mut numbers = text.split_whitespace().map(|word| word.parse::<f64>());
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}
