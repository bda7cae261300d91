//! `doctor` and `init`: what is wrong with a log is named with its number and its mend, also where `fit` refuses.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

mod common;

use common::{ARM, Run, run};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Gravity in the arm's plane, and few candidates: a fit in a moment, with filters.
const LOOK: &str = "[model]\ngravity = [0.0, -9.81, 0.0]\n[library]\nterms = [\"sin(q2)\"]\ngeneric = false\n\
                    friction = [\"viscous\"]\noffset = false\nmotor_inertia = false\n";
/// Samples per second, and s.
const RATE: f64 = 250.0;
const SECONDS: f64 = 24.0;
/// All joints are at rest every so many s.
const PERIOD: f64 = 4.0;

/// What is wrong with a log.
#[derive(Clone, Copy)]
struct Fault {
    /// Torque is this much late, s.
    lag: f64,
    /// From here all joints are held by brakes for two seconds, s.
    brakes: f64,
    /// No velocity is logged.
    bare: bool,
    /// Changes t, q1, q2, qd1, qd2, tau1, tau2.
    change: fn(&mut [f64; 7]),
}

const GOOD: Fault = Fault {
    lag: 0.0,
    brakes: f64::INFINITY,
    bare: false,
    change: |_| (),
};

/// Position, velocity and acceleration of both joints at `t` of the motion.
fn motion(t: f64) -> [[f64; 3]; 2] {
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
fn torque(t: f64) -> [f64; 2] {
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

fn log(fault: Fault) -> String {
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

fn folder(fault: Fault) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.urdf"), ARM).unwrap();
    fs::write(folder.path().join("look.toml"), LOOK).unwrap();
    fs::write(folder.path().join("run.csv"), log(fault)).unwrap();
    folder
}

fn with_config(folder: &Path, verb: &str, config: &str, more: &[&str]) -> Run {
    let base = [verb, "run.csv", "--model", "arm.urdf", "--config", config];
    run(folder, base.iter().chain(more))
}

/// The diagnosis as JSON.
fn doctor(folder: &TempDir, code: i32) -> Value {
    let done = with_config(folder.path(), "doctor", "look.toml", &["--json"]).expect(code);
    let diagnosis: Value = serde_json::from_str(&done.out).unwrap();
    // whatever is wrong, there is something to do
    for mend in diagnosis["mends"].as_array().unwrap() {
        let how = mend["how"].as_str().unwrap();
        assert!(
            !how.is_empty() && !how.contains("read the message"),
            "{mend}"
        );
    }
    diagnosis
}

/// Findings above a note: code, severity, message.
fn warnings(result: &Value) -> Vec<[String; 3]> {
    let text = |finding: &Value, key: &str| finding[key].as_str().unwrap().to_owned();
    result["findings"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|finding| finding["severity"] != "note")
        .map(|f| [text(f, "code"), text(f, "severity"), text(f, "message")])
        .collect()
}

fn codes(result: &Value) -> Vec<String> {
    let all = warnings(result).into_iter();
    all.map(|[code, _, _]| code).collect()
}

/// Fits with a config and gives result.json.
fn fitted(folder: &TempDir, config: &str, code: i32) -> Value {
    let output = format!("out-{config}");
    let done = with_config(folder.path(), "fit", config, &["-o", &output, "--json"]).expect(code);
    serde_json::from_str(&done.out).unwrap()
}

fn add(folder: &TempDir, name: &str, lines: &str) {
    fs::write(folder.path().join(name), format!("{LOOK}{lines}")).unwrap();
}

fn first_mend(diagnosis: &Value) -> (&str, &str) {
    let mend = &diagnosis["mends"][0];
    (
        mend["problem"].as_str().unwrap(),
        mend["how"].as_str().unwrap(),
    )
}

#[test]
fn a_good_log_needs_no_mend_and_everything_is_told() {
    let folder = folder(GOOD);
    let diagnosis = doctor(&folder, 0);
    assert_eq!(codes(&diagnosis), [] as [&str; 0]);
    let log = &diagnosis["logs"][0];
    assert_eq!(log["columns"]["joints"][1]["torque"], "tau2");
    assert_eq!(log["columns"]["joints"][1]["acceleration"], Value::Null);
    assert_eq!(log["samples"], (RATE * SECONDS) as u64);
    assert!(log["velocity"][0]["r2"].as_f64().unwrap() > 0.999);
    let [lag, sd] = [0, 1].map(|k| log["lag"]["common"][k].as_f64().unwrap());
    assert!(lag.abs() < 0.3 / RATE && sd < 0.5 / RATE, "{lag} ± {sd}");
    assert!(diagnosis["joints"][0]["explained"].as_f64().unwrap() > 0.99);
    let printed = with_config(folder.path(), "doctor", "look.toml", &[]).expect(0);
    for line in printed.out.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    for word in [
        "arm.urdf: fit would go ahead",
        "shoulder",
        "tau1",
        "[model]",
    ] {
        assert!(printed.out.contains(word), "{word}:\n{}", printed.out);
    }
}

#[test]
fn case_17_torque_that_is_late_is_degraded_until_the_lag_is_said() {
    let folder = folder(Fault { lag: 0.02, ..GOOD });
    let diagnosis = doctor(&folder, 3);
    let said = warnings(&diagnosis);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0][..2], ["torque_lag", "degraded"]);
    assert!(said[0][2].contains("after the motion"), "{}", said[0][2]);
    let lag = diagnosis["logs"][0]["lag"]["common"][0].as_f64().unwrap();
    assert!((lag - 0.02).abs() < 0.3 / RATE, "{lag}");
    let (_, how) = first_mend(&diagnosis);
    assert!(
        how.starts_with("twincal.toml: [signal] lag = 0.02"),
        "{how}"
    );

    let late = fitted(&folder, "look.toml", 3);
    assert!(codes(&late).contains(&"torque_lag".to_owned()));
    add(&folder, "said.toml", "[signal]\nlag = 0.02\n");
    let moved = fitted(&folder, "said.toml", 0);
    assert_eq!(codes(&moved), [] as [&str; 0]);
    let rmse = |result: &Value| {
        let scores = &result["validation"];
        scores["rmse_calibrated"].as_f64().unwrap()
    };
    assert!(
        rmse(&moved) < 0.2 * rmse(&late),
        "{} {}",
        rmse(&moved),
        rmse(&late)
    );
    add(&folder, "none.toml", "[signal]\nlag = 0\n");
    let said = codes(&fitted(&folder, "none.toml", 0));
    assert!(said.contains(&"torque_lag".to_owned()), "{said:?}");
    add(&folder, "joint.toml", "[signal]\nlag = { elbo = 0.02 }\n");
    with_config(folder.path(), "fit", "joint.toml", &["-o", "no"])
        .expect(2)
        .says(&["elbo", "elbow"]);
}

#[test]
fn case_24_a_velocity_that_is_not_the_change_of_position_is_named_and_can_be_left_out() {
    let folder = folder(Fault {
        change: |row| row[4] *= 0.5,
        ..GOOD
    });
    let diagnosis = doctor(&folder, 0);
    assert_eq!(codes(&diagnosis), ["velocity_mismatch"]);
    let message = &warnings(&diagnosis)[0][2];
    // a slope of one half: R² = 1 − (1 − 0.5)²
    assert!(
        message.contains("`elbow`") && message.contains("R² 0.75"),
        "{message}"
    );
    let (_, how) = first_mend(&diagnosis);
    assert!(how.contains("velocity = \"position\""), "{how}");
    let config = diagnosis["config"].as_str().unwrap();
    assert!(config.contains("velocity = \"position\""), "{config}");
    let said = codes(&fitted(&folder, "look.toml", 0));
    assert!(said.contains(&"velocity_mismatch".to_owned()), "{said:?}");
    add(&folder, "said.toml", "[signal]\nvelocity = \"position\"\n");
    assert_eq!(codes(&fitted(&folder, "said.toml", 0)), [] as [&str; 0]);
}

#[test]
fn case_27_a_coarse_encoder_is_named_with_the_noise_it_leaves() {
    let step = TAU / 1024.0;
    let folder = folder(Fault {
        bare: true,
        change: |row| {
            for q in &mut row[1..3] {
                *q = (*q / (TAU / 1024.0)).round() * (TAU / 1024.0);
            }
        },
        ..GOOD
    });
    let diagnosis = doctor(&folder, 0);
    let said = warnings(&diagnosis);
    assert!(
        said.iter()
            .any(|[code, _, text]| code == "quantised_encoder"
                && text.contains(&format!("{step:.3e}"))
                && text.contains("in acceleration")),
        "{said:?}"
    );
    let found = diagnosis["logs"][0]["steps"][0]["position"]
        .as_f64()
        .unwrap();
    assert!((found / step - 1.0).abs() < 1e-3, "{found} {step}");
}

#[test]
fn case_29_a_contact_is_listed_and_left_out() {
    let folder = folder(Fault {
        change: |row| {
            let t = row[0];
            if (9.0..9.3).contains(&t) {
                let shape = ((t - 9.0) / 0.3 * std::f64::consts::PI).sin();
                row[5] += 25.0 * shape;
                row[6] += 10.0 * shape;
            }
        },
        ..GOOD
    });
    let diagnosis = doctor(&folder, 0);
    assert_eq!(codes(&diagnosis), ["torque_spike"]);
    let incident = &diagnosis["logs"][0]["incidents"][0];
    let [from, to] = [0, 1].map(|k| incident["span"][k].as_f64().unwrap());
    assert!((8.8..9.1).contains(&from) && (9.2..9.5).contains(&to));
    let result = fitted(&folder, "look.toml", 0);
    let said = codes(&result);
    assert!(said.contains(&"torque_spike".to_owned()), "{said:?}");
    // the terms are those of the log without the contact
    let clean = self::folder(GOOD);
    let clean = fitted(&clean, "look.toml", 0);
    for (ours, theirs) in
        (result["terms"].as_array().unwrap().iter()).zip(clean["terms"].as_array().unwrap())
    {
        let [ours, theirs] = [ours, theirs].map(|term| term["mean"].as_f64().unwrap());
        assert!((ours - theirs).abs() < 0.02, "{ours} {theirs}");
    }
}

#[test]
fn case_30_a_stop_with_brakes_is_said_and_left_out() {
    let folder = folder(Fault {
        brakes: 2.0 * PERIOD,
        ..GOOD
    });
    let diagnosis = doctor(&folder, 0);
    assert_eq!(codes(&diagnosis), ["drives_off"]);
    let incident = &diagnosis["logs"][0]["incidents"][0];
    let [from, to] = [0, 1].map(|k| incident["span"][k].as_f64().unwrap());
    assert!(
        (from - 8.0).abs() < 0.3 && (to - 10.0).abs() < 0.3,
        "{from} {to}"
    );
    assert_eq!(incident["kind"], "drives_off");
    let said = codes(&fitted(&folder, "look.toml", 0));
    assert!(said.contains(&"drives_off".to_owned()), "{said:?}");
}

#[test]
fn what_fit_refuses_is_told_and_looked_through_all_the_same() {
    let degrees = folder(Fault {
        change: |row| row[1..5].iter_mut().for_each(|v| *v *= 360.0 / TAU),
        ..GOOD
    });
    let diagnosis = doctor(&degrees, 2);
    assert!(first_mend(&diagnosis).0.contains("degrees"));
    assert!(
        diagnosis["converted"][0]
            .as_str()
            .unwrap()
            .contains("as degrees")
    );
    assert!(diagnosis["joints"][0]["explained"].as_f64().unwrap() > 0.99);
    let milliseconds = folder(Fault {
        change: |row| row[0] *= 1e3,
        ..GOOD
    });
    let diagnosis = doctor(&milliseconds, 2);
    assert!(first_mend(&diagnosis).1.contains("time_unit = \"ms\""));
    let config = diagnosis["config"].as_str().unwrap();
    assert!(config.contains("\n[columns]\ntime_unit = \"ms\"\n") && !config.contains("refuses"));
    let toml = milliseconds.path().join("ms.toml");
    fs::write(toml, format!("{config}\n[library]\ngeneric = false\n")).unwrap();
    let done = run(
        milliseconds.path(),
        ["fit", "--config", "ms.toml", "-o", "ms"],
    );
    assert!(matches!(done.code, Some(0 | 3)), "{}", done.err);
    assert!(
        diagnosis["converted"][0]
            .as_str()
            .unwrap()
            .contains("milliseconds")
    );
    let rate = diagnosis["logs"][0]["rate_hz"].as_f64().unwrap();
    assert!((rate - RATE).abs() < 1.0);
    // a column that cannot be read: nothing more can be said, but that is said
    let text = fs::read_to_string(milliseconds.path().join("run.csv")).unwrap();
    fs::write(
        milliseconds.path().join("run.csv"),
        text.replacen("0,", "x,", 1),
    )
    .unwrap();
    let diagnosis = doctor(&milliseconds, 2);
    assert!(first_mend(&diagnosis).0.contains("run.csv:2"));
}

#[test]
fn a_joint_that_is_not_logged_is_locked_for_the_look_and_in_the_config() {
    let folder = folder(GOOD);
    let text = fs::read_to_string(folder.path().join("run.csv")).unwrap();
    let columns = |line: &str| -> String {
        let cells: Vec<&str> = line.split(',').collect();
        [cells[0], cells[1], cells[3], cells[5]].join(",") + "\n"
    };
    let text: String = text.lines().map(columns).collect();
    fs::write(folder.path().join("run.csv"), text).unwrap();
    let diagnosis = doctor(&folder, 2);
    assert!(
        first_mend(&diagnosis)
            .1
            .contains("locked = { elbow = 0.0 }")
    );
    let columns = &diagnosis["logs"][0]["columns"];
    assert_eq!(columns["joints"].as_array().unwrap().len(), 1);
    let config = diagnosis["config"].as_str().unwrap();
    assert!(config.contains("locked = { elbow = 0.0 }"), "{config}");
}

#[test]
fn init_writes_a_config_that_fit_reads_and_never_over_another() {
    let folder = folder(Fault {
        lag: 0.02,
        change: |row| row[3] *= 0.5,
        ..GOOD
    });
    let init = |more: &[&str]| {
        let base = ["init", "run.csv", "--model", "arm.urdf"];
        run(folder.path(), base.iter().chain(more))
    };
    init(&[]).says(&["twincal fit --config twincal.toml"]);
    let path = folder.path().join("twincal.toml");
    let written = fs::read_to_string(&path).unwrap();
    let done = run(
        folder.path(),
        ["inspect", "run.csv", "--config", "twincal.toml"],
    );
    assert!(matches!(done.code, Some(0 | 3)), "{}", done.err);
    fs::write(&path, "# mine\n").unwrap();
    init(&[]).expect(2).says(&["exists already", "--force"]);
    assert_eq!(fs::read_to_string(&path).unwrap(), "# mine\n");
    init(&["--force"]);
    assert_eq!(fs::read_to_string(&path).unwrap(), written);
    // what cannot be read leaves nothing behind
    fs::write(folder.path().join("run.csv"), "t,a\n0,1\n").unwrap();
    init(&["-o", "other.toml"]).expect(2).says(&["run.csv"]);
    assert!(!folder.path().join("other.toml").exists());
    // logs that the config holds out stay held out
    let held = "[model]\nfile = \"arm.urdf\"\n[[log]]\nfile = \"run.csv\"\n[[log]]\nfile = \"other.csv\"\nheldout = true\n";
    fs::write(folder.path().join("held.toml"), held).unwrap();
    fs::write(folder.path().join("run.csv"), log(GOOD)).unwrap();
    let done = run(
        folder.path(),
        ["init", "--config", "held.toml", "-o", "new.toml"],
    );
    assert!(matches!(done.code, Some(0 | 3)), "{}", done.err);
    let proposed = fs::read_to_string(folder.path().join("new.toml")).unwrap();
    assert!(
        proposed.contains("file = \"other.csv\"\nheldout = true"),
        "{proposed}"
    );
    // paths stand as seen from the config
    fs::write(folder.path().join("run.csv"), log(GOOD)).unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    init(&["-o", "sub/a.toml"]);
    let done = run(
        folder.path(),
        ["inspect", "run.csv", "--config", "sub/a.toml"],
    );
    assert!(matches!(done.code, Some(0 | 3)), "{}", done.err);
}

/// What `init` writes for a log, behind it the candidates of the other tests.
fn proposed(folder: &TempDir) -> String {
    let path = folder.path();
    let done = run(
        path,
        [
            "init",
            "run.csv",
            "--model",
            "arm.urdf",
            "-o",
            "first.toml",
            "--config",
            "look.toml",
        ],
    );
    assert!(matches!(done.code, Some(0 | 3)), "{}", done.err);
    let text = fs::read_to_string(path.join("first.toml")).unwrap();
    let look = LOOK.replace("[model]\n", "");
    let model = format!("[model]\n{}", look.lines().next().unwrap());
    let library: Vec<&str> = look.lines().skip(1).collect();
    fs::write(
        path.join("first.toml"),
        format!(
            "{}\n{}\n",
            text.replacen("[model]", &model, 1),
            library.join("\n")
        ),
    )
    .unwrap();
    text
}

/// With the config that `init` writes, a log in other units, signs or order gives what the good log gives.
#[test]
fn init_mends_units_signs_and_order_and_the_twin_reads_new_logs_likewise() {
    let good = fitted(&folder(GOOD), "look.toml", 0);
    let rmse = |result: &Value, joint: usize| {
        result["validation"]["joints"][joint]["rmse_calibrated"]
            .as_f64()
            .unwrap()
    };
    let degrees: fn(&mut [f64; 7]) = |row| row[1..5].iter_mut().for_each(|v| *v *= 360.0 / TAU);
    let one: fn(&mut [f64; 7]) = |row| [2, 4].into_iter().for_each(|k| row[k] *= 360.0 / TAU);
    let turned: fn(&mut [f64; 7]) = |row| {
        row[6] *= -1.0;
        [1, 3, 5].into_iter().for_each(|k| row[k] *= -1.0);
    };
    let exchanged: fn(&mut [f64; 7]) = |row| {
        row.swap(1, 2);
        row.swap(3, 4);
        row.swap(5, 6);
    };
    for (change, line) in [
        (
            degrees,
            "[columns.factor]\nq = 0.017453292519943295\nqd = 0.0174",
        ),
        (
            one,
            "[columns.factor]\nq = { elbow = 0.017453292519943295 }\n",
        ),
        (turned, "tau = { elbow = -1.0, shoulder = -1.0 }"),
        (
            exchanged,
            "[columns.tau]\nelbow = \"tau1\"\nshoulder = \"tau2\"",
        ),
    ] {
        let folder = folder(Fault { change, ..GOOD });
        let text = proposed(&folder);
        assert!(text.contains(line), "{line}: {text}");
        for left in ["fit refuses", "nothing was changed"] {
            assert!(!text.contains(left), "{text}");
        }
        let result = fitted(&folder, "first.toml", 0);
        for joint in 0..2 {
            let (own, other) = (rmse(&result, joint), rmse(&good, joint));
            assert!(
                (own / other - 1.0).abs() < 1e-6,
                "{line}: {own} and {other}"
            );
        }
        // the twin takes new logs as those of its fit
        let check = ["check", "--twin", "out-first.toml", "run.csv", "--json"];
        let check = run(folder.path(), check);
        if line.contains("factor") {
            assert!(
                check.out.contains("factor_as_fitted"),
                "{}{}",
                check.out,
                check.err
            );
        }
    }
}

/// Too few rows for the candidates, which only the filters' choice decides.
#[test]
fn what_only_a_fit_can_tell_is_told_as_well() {
    let folder = folder(GOOD);
    let short: Vec<String> = log(GOOD).lines().take(3500).map(str::to_owned).collect();
    fs::write(folder.path().join("run.csv"), short.join("\n")).unwrap();
    let slow = "[model]\ngravity = [0.0, -9.81, 0.0]\n[signal]\ncutoff_hz = 2.0\n";
    fs::write(folder.path().join("slow.toml"), slow).unwrap();
    let fit = with_config(folder.path(), "fit", "slow.toml", &["-o", "out"]).expect(4);
    let done = with_config(folder.path(), "doctor", "slow.toml", &["--json"]).expect(4);
    let diagnosis: Value = serde_json::from_str(&done.out).unwrap();
    let (problem, how) = first_mend(&diagnosis);
    assert!(diagnosis["verdict"].as_str().unwrap().contains("refuse"));
    assert!(
        fit.err.contains(problem) && fit.err.contains(how),
        "{}{problem}{how}",
        fit.err
    );
}
