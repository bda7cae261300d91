//! What the answer itself may do: scales, outliers, extrapolation; and our own bugs.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

mod common;

use common::{QUICK, command, csv, fit, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

fn result(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out/result.json")).unwrap()).unwrap()
}

#[test]
fn case_89_the_scale_of_a_candidate_does_not_matter() {
    let fitted = |term: &str| {
        let folder = folder();
        let config = QUICK.replace("\"sin(q2)\"", &format!("\"{term}\""));
        assert_ne!(config, QUICK.replace(term, ""));
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        fit(folder.path(), &["-o", "out"]).expect(0);
        let terms = result(folder.path())["terms"].clone();
        let number = |key: &str, index: usize| terms[index][key].as_f64().unwrap();
        let terms = terms.as_array().unwrap().len();
        (0..terms)
            .map(|i| [number("pip", i), number("mean", i), number("sd", i)])
            .collect::<Vec<_>>()
    };
    let plain = fitted("sin(q2)");
    for scale in [1e-12, 1e12] {
        let scaled = fitted(&format!("{scale}*sin(q2)"));
        assert_eq!(scaled.len(), plain.len());
        for (index, (a, b)) in plain.iter().zip(&scaled).enumerate() {
            let factor = if index == 0 { scale } else { 1.0 };
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(1e-12);
            let alike = near(a[0], b[0]) && near(a[1], b[1] * factor) && near(a[2], b[2] * factor);
            assert!(alike, "{scale}: {a:?} {b:?}");
        }
    }
}

#[test]
fn case_92_outliers_are_named_and_coverage_stays() {
    let folder = folder();
    // Every 20th torque is off by 25 sd, either way.
    let spoiled = csv(2000, &|number, mut row| {
        if number % 20 == 7 {
            let off = if number % 40 == 7 { 0.5 } else { -0.5 };
            row[7] = (row[7].parse::<f64>().unwrap() + off).to_string();
        }
        row
    });
    fs::write(folder.path().join("run.csv"), spoiled).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(0);
    let result = result(folder.path());
    let said: Vec<&Value> = result["findings"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|f| f["code"] == "heavy_tails")
        .collect();
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0]["subject"], "shoulder");
    assert_eq!(said[0]["count"], 100);
    for joint in result["validation"]["joints"].as_array().unwrap() {
        let coverage = joint["coverage95"].as_f64().unwrap();
        assert!((0.90..=0.99).contains(&coverage), "{joint}");
    }
}

#[test]
fn case_95_rows_outside_the_training_motion_are_flagged() {
    let folder = common::fitted_copy();
    let further = csv(400, &|number, mut row| {
        if number >= 300 {
            row[1] = (row[1].parse::<f64>().unwrap() + 2.0).to_string();
        }
        row
    });
    fs::write(folder.path().join("further.csv"), further).unwrap();
    let done = run(folder.path(), ["predict", "further.csv", "--twin", "twin"]).expect(0);
    for (number, line) in done.out.lines().skip(1).enumerate() {
        assert_eq!(line.ends_with("true"), number >= 300, "{number}: {line}");
    }
}

/// A clock that fails makes the standard library panic, as any bug of ours would.
#[test]
fn exit_code_70_is_our_bug_and_says_so() {
    let folder = folder();
    let source = "int clock_gettime(int id, void *time) { (void)id; (void)time; return -1; }\n";
    fs::write(folder.path().join("clock.c"), source).unwrap();
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-o", "clock.so", "clock.c"])
        .current_dir(folder.path())
        .stderr(Stdio::inherit())
        .status()
        .unwrap();
    assert!(compiled.success());
    let output = command(folder.path())
        .args(["fit", "run.csv", "--model", "arm.urdf", "-o", "out"])
        .env("LD_PRELOAD", folder.path().join("clock.so"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(70), "{said}");
    for words in [
        "our bug, not yours",
        "Please report it",
        env!("CARGO_PKG_VERSION"),
        "fit run.csv",
    ] {
        assert!(said.contains(words), "{words:?} is missing in:\n{said}");
    }
    assert!(!folder.path().join("out").exists());
}
