//! Euler–Lagrange columns per second, on one core, beside NumPy in the same run: `cargo bench -p twincal --bench euler_lagrange`.

#![allow(
    clippy::print_stdout,
    reason = "a bench is a program that prints numbers"
)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Motion, Robot, RobotDescription,
};
use twincal::term::{Family, Library, LibrarySettings, Scratch};

/// Samples per call for two joints; fewer for the big library, so that all columns of a call stay in the cache, as they do
/// where rows are streamed.
const BATCH: usize = 2048;
/// The same for the big library.
const SMALL_BATCH: usize = 256;
/// q1 q2 qd1 qd2 qdd1 qdd2 = c sin(f k + p); the same in the peer.
const WAVES: [[f64; 3]; 6] = [
    [2.0, 0.010, 0.3],
    [1.5, 0.017, 0.9],
    [3.0, 0.023, 0.1],
    [2.5, 0.031, 0.7],
    [9.0, 0.041, 0.5],
    [8.0, 0.053, 1.1],
];

fn main() {
    let generic = LibrarySettings {
        generic: Some(true),
        ..LibrarySettings::default()
    };
    let whole = LibrarySettings {
        families: Family::JOINT.to_vec(),
        coulomb_velocity: 0.02,
        ..generic.clone()
    };
    println!("Euler-Lagrange columns, one core, best of 2000 batches");
    println!(
        "{:<44} {:>8} {:>12} {:>10} {:>9}",
        "library", "entries", "M samples/s", "ns/sample", "ns/entry"
    );
    let sums = measure("planar 2R, 17 generic terms", BATCH, 2, true, &generic);
    measure("planar 2R, all families", BATCH, 2, true, &whole);
    measure(
        "3R, axes in all directions, generic",
        SMALL_BATCH,
        3,
        false,
        &generic,
    );
    beside_numpy(&sums);
}

/// Prints one line; returns Σ|entry| over the batch for each entry, ascending.
fn measure(
    what: &str,
    batch: usize,
    joints: usize,
    parallel: bool,
    settings: &LibrarySettings,
) -> Vec<f64> {
    let robot = chain(joints, parallel);
    let (library, _) = Library::propose(&robot, settings).expect("the settings above are valid");
    let wave = |kind: usize| -> Vec<f64> {
        (0..joints * batch)
            .map(|i| {
                let [c, f, p] = WAVES[2 * kind + (i / batch) % 2];
                c * (f * (i % batch) as f64 + p + (i / batch / 2) as f64).sin()
            })
            .collect()
    };
    let (q, qd, qdd) = (wave(0), wave(1), wave(2));
    let motion = Motion {
        len: batch,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let (mut out, mut scratch) = (vec![Vec::new(); joints], Scratch::default());
    let mut best = f64::INFINITY;
    for _ in 0..2000 {
        let start = Instant::now();
        library.evaluate_with(motion, std::hint::black_box(&mut out), &mut scratch);
        best = best.min(start.elapsed().as_secs_f64());
    }
    let entries: usize = (0..joints)
        .map(|joint| library.columns_of_joint(joint).len())
        .sum();
    let seconds = best / batch as f64;
    line(what, entries, seconds);
    let mut sums: Vec<f64> = out
        .iter()
        .flat_map(|rows| rows.chunks(batch))
        .map(|row| row.iter().map(|x| x.abs()).sum())
        .collect();
    sums.sort_by(f64::total_cmp);
    sums
}

fn line(what: &str, entries: usize, seconds: f64) {
    let nanoseconds = 1e9 * seconds;
    let per_entry = nanoseconds / entries as f64;
    println!(
        "{what:<44} {entries:>8} {:>12.1} {nanoseconds:>10.2} {per_entry:>9.3}",
        1e-6 / seconds
    );
}

/// The same columns by NumPy, if there is one.
fn beside_numpy(sums: &[f64]) {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = here.join("benches/peers/euler_lagrange.py");
    let own = here.join("../../.venv/bin/python");
    let python = if own.exists() { own } else { "python3".into() };
    let waves = serde_json::to_string(&WAVES).expect("numbers are JSON");
    let run = Command::new(python)
        .arg(script)
        .args([BATCH.to_string(), "2000".to_owned(), waves])
        .output();
    let answer = run.ok().filter(|run| run.status.success());
    let Some(answer) =
        answer.and_then(|run| serde_json::from_slice::<serde_json::Value>(&run.stdout).ok())
    else {
        println!("skipped: no python with numpy found for the peer");
        return;
    };
    let seconds = answer["seconds_per_sample"].as_f64().unwrap_or(f64::NAN);
    line(
        &format!(
            "NumPy {}, the same 24 entries by hand",
            answer["numpy"].as_str().unwrap_or("?")
        ),
        24,
        seconds,
    );
    let theirs: Vec<f64> = answer["sums"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(serde_json::Value::as_f64)
        .collect();
    let worst = sums
        .iter()
        .zip(&theirs)
        .map(|(a, b)| (a / b - 1.0).abs())
        .fold(0.0, f64::max);
    assert_eq!(sums.len(), theirs.len(), "both have the same entries");
    println!("largest relative difference of the sums: {worst:.1e}");
}

/// Links of 1 kg on hinges about y, or about z, y, x in turn.
fn chain(joints: usize, parallel: bool) -> Robot {
    let inertia = Inertia {
        mass: 1.0,
        com: [0.2, 0.0, 0.0],
        tensor: [[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]],
    };
    let name = |i: usize| format!("link{i}");
    let link = |i: usize| LinkDescription {
        name: name(i),
        inertia: (i > 0).then_some(inertia),
    };
    let joint = |i: usize| {
        let mut joint = JointDescription::new(
            &format!("joint{}", i + 1),
            JointKind::Revolute,
            &name(i),
            &name(i + 1),
        );
        let direction = if parallel { 1 } else { 2 - i % 3 };
        joint.axis = [0, 1, 2].map(|k| f64::from(u8::from(k == direction)));
        joint.placement.translation = [0.4, 0.0, 0.0];
        joint
    };
    let description = RobotDescription {
        name: "chain".to_owned(),
        gravity: [0.0, 0.0, -9.81],
        links: (0..=joints).map(link).collect(),
        joints: (0..joints).map(joint).collect(),
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new())
        .expect("a chain of solid links is a robot")
        .0
}
