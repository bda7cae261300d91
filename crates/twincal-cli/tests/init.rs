//! `init`: the config that logs ask for, with which a log in other units, signs or order gives what a good one gives.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::faulty::{Fault, GOOD, LOOK, fitted, folder, log};
use crate::common::run;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fs;
use tempfile::TempDir;

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
fn init_fixes_units_signs_and_order_and_the_twin_reads_new_logs_likewise() {
    let good = fitted(&folder(GOOD), "look.toml", 0);
    let rmse = |result: &Value, joint: usize| {
        result["validation"]["joints"][joint]["rmse_calibrated"]
            .as_f64()
            .unwrap()
    };
    for (change, line) in faults() {
        let folder = folder(Fault { change, ..GOOD });
        let text = proposed(&folder);
        assert!(text.contains(line), "{line}: {text}");
        for left in ["fit refuses", "nothing was changed", "qdd ="] {
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

type Change = fn(&mut [f64; 7]);

/// What is done to a row of a log, and a line that the config gets by it.
fn faults() -> [(Change, &'static str); 9] {
    let degrees: Change = |row| row[1..5].iter_mut().for_each(|v| *v *= 360.0 / TAU);
    let one: Change = |row| [2, 4].into_iter().for_each(|k| row[k] *= 360.0 / TAU);
    let turned: Change = |row| {
        row[6] *= -1.0;
        [1, 3, 5].into_iter().for_each(|k| row[k] *= -1.0);
    };
    let position: Change = |row| row[1] *= -1.0;
    let velocity: Change = |row| row[3] *= -1.0;
    let thousandths: Change = |row| row[5..7].iter_mut().for_each(|v| *v *= 1e3);
    let exchanged: Change = |row| {
        row.swap(1, 2);
        row.swap(3, 4);
        row.swap(5, 6);
    };
    let all_at_once: Change = |row| {
        row[0] *= 1e3;
        row[1..5].iter_mut().for_each(|v| *v *= 360.0 / TAU);
        row[5] *= -1e3;
        row[6] *= 1e3;
    };
    [
        (all_at_once, "time_unit = \"ms\""),
        (all_at_once, "tau = { elbow = 0.001, shoulder = -0.001 }"),
        (
            degrees,
            "[columns.factor]\nq = 0.017453292519943295\nqd = 0.0174",
        ),
        (
            one,
            "[columns.factor]\nq = { elbow = 0.017453292519943295 }\n",
        ),
        (position, "[columns.factor]\nq = { shoulder = -1.0 }\n"),
        (velocity, "[columns.factor]\nqd = { shoulder = -1.0 }\n"),
        (thousandths, "[columns.factor]\ntau = 0.001\n"),
        (turned, "tau = -1.0\n"),
        (
            exchanged,
            "[columns.tau]\nelbow = \"tau1\"\nshoulder = \"tau2\"",
        ),
    ]
}
