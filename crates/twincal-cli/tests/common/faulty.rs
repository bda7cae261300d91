//! Logs of an upright arm of two joints with one thing wrong.

use super::{ARM, Run, run};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Gravity in the arm's plane, and few candidates: a fit in a moment, with filters.
pub(crate) const LOOK: &str = "[model]\ngravity = [0.0, -9.81, 0.0]\n[library]\nterms = [\"sin(q2)\"]\ngeneric = false\n\
                    friction = [\"viscous\"]\noffset = false\nmotor_inertia = false\n";
/// Samples per second, and s.
pub(crate) const RATE: f64 = 250.0;
pub(crate) const SECONDS: f64 = 24.0;
/// All joints are at rest every so many s.
pub(crate) const PERIOD: f64 = 4.0;

/// What is wrong with a log.
#[derive(Clone, Copy)]
pub(crate) struct Fault {
    /// Torque is this much late, s.
    pub(crate) lag: f64,
    /// From here all joints are held by brakes for two seconds, s.
    pub(crate) brakes: f64,
    /// No velocity is logged.
    pub(crate) bare: bool,
    /// Changes t, q1, q2, qd1, qd2, tau1, tau2.
    pub(crate) change: fn(&mut [f64; 7]),
}

pub(crate) const GOOD: Fault = Fault {
    lag: 0.0,
    brakes: f64::INFINITY,
    bare: false,
    change: |_| (),
};

/// Position, velocity and acceleration of both joints at `t` of the motion.
pub(crate) fn motion(t: f64) -> [[f64; 3]; 2] {
    let waves: [&[(f64, f64)]; 2] = [&[(0.5, 1.0), (0.25, 3.0)], &[(0.6, 2.0), (0.15, 5.0)]];
    waves.map(|waves| {
        let mut sum = [0.0; 3];
        for (amplitude, multiple) in waves {
            let w = TAU / PERIOD * multiple;
            let (sin, cos) = (w * t).sin_cos();
            sum[0] += amplitude * cos;
            sum[1] -= amplitude * w * sin;
            sum[2] -= amplitude * w * w * cos;
        }
        sum
    })
}

/// Torque of the upright arm in closed form, viscous friction of 0.4 and 0.2 N·m·s/rad, and a potential 0.9 sin(q2).
pub(crate) fn torque(t: f64) -> [f64; 2] {
    let [[q1, v1, a1], [q2, v2, a2]] = motion(t);
    let (far, near, cross) = (0.11 + 0.16 + 0.0325, 0.0325, 0.06);
    let (s, c) = q2.sin_cos();
    let fore = 0.15 * 9.81 * (q1 + q2).cos();
    [
        (far + 2.0 * cross * c) * a1 + (near + cross * c) * a2 - cross * s * v2 * (2.0 * v1 + v2)
            + 0.8 * 9.81 * q1.cos()
            + fore
            + 0.4 * v1,
        (near + cross * c) * a1 + near * a2 + cross * s * v1 * v1 + fore + 0.2 * v2 - 0.9 * c,
    ]
}

pub(crate) fn log(fault: Fault) -> String {
    let header = ["t,q1,q2,qd1,qd2,tau1,tau2", "t,q1,q2,tau1,tau2"];
    let mut text = format!("{}\n", header[usize::from(fault.bare)]);
    let mut state = 1_u64;
    let mut noise = || {
        // Knuth's linear congruential generator; twelve uniforms less six are almost normal, here of sd 0.02 N·m.
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        0.02 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)
    };
    for row in 0..(RATE * SECONDS) as usize {
        let t = row as f64 / RATE;
        let braked = t >= fault.brakes && t < fault.brakes + 2.0;
        // the motion waits while the brakes are on
        let at = if t < fault.brakes {
            t
        } else {
            (t - 2.0).max(fault.brakes)
        };
        let [[q1, v1, _], [q2, v2, _]] = motion(at);
        let [tau1, tau2] = torque(at - fault.lag);
        let on = if braked { 0.0 } else { 1.0 };
        let mut cells = [
            t,
            q1,
            q2,
            on * v1,
            on * v2,
            on * (tau1 + noise()),
            on * (tau2 + noise()),
        ];
        (fault.change)(&mut cells);
        let kept = |k: usize| !fault.bare || !(3..5).contains(&k);
        let cells: Vec<String> = (0..7)
            .filter(|k| kept(*k))
            .map(|k| cells[k].to_string())
            .collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

pub(crate) fn folder(fault: Fault) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.urdf"), ARM).unwrap();
    fs::write(folder.path().join("look.toml"), LOOK).unwrap();
    fs::write(folder.path().join("run.csv"), log(fault)).unwrap();
    folder
}

pub(crate) fn with_config(folder: &Path, verb: &str, config: &str, more: &[&str]) -> Run {
    let base = [verb, "run.csv", "--model", "arm.urdf", "--config", config];
    run(folder, base.iter().chain(more))
}

/// Fits with a config and gives result.json.
pub(crate) fn fitted(folder: &TempDir, config: &str, code: i32) -> Value {
    let output = format!("out-{config}");
    let done = with_config(folder.path(), "fit", config, &["-o", &output, "--json"]).expect(code);
    serde_json::from_str(&done.out).unwrap()
}
