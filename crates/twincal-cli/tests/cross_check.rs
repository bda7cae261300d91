//! Logs that are no recordings of their own get no "Yes" and no guarantee.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::{csv, folder, run};
use serde_json::Value;
use std::fs;

/// Rows from 40 on, half an hour later, with noise of half the own sd of 0.02 N·m on both torques.
fn copy() -> String {
    let text = csv(400, &|number, mut row| {
        let time: f64 = row[0].parse().unwrap();
        row[0] = (time + 1800.0).to_string();
        for (column, factor) in [(7, 7919), (8, 104_729)] {
            let torque: f64 = row[column].parse().unwrap();
            // Uniform: sd 0.0346/√12 = 0.01.
            let noise = (number * factor % 1009) as f64 / 1009.0 - 0.5;
            row[column] = (torque + 0.0346 * noise).to_string();
        }
        row
    });
    let mut lines: Vec<&str> = text.lines().collect();
    lines.drain(1..41);
    lines.join("\n") + "\n"
}

#[test]
fn a_held_out_copy_ends_with_3_and_is_named_with_its_original() {
    let folder = folder();
    fs::write(folder.path().join("again.csv"), copy()).unwrap();
    let line = "fit run.csv --heldout again.csv --model arm.urdf --config quick.toml -o out";
    let done = run(folder.path(), line.split(' ')).expect(3);
    for words in [
        "log `again.csv` is a copy of `run.csv`",
        "Not yet: one log is a copy",
    ] {
        assert!(done.out.contains(words), "{words}:\n{}", done.out);
    }
    assert!(
        !done.out.contains("guaranteed") && !done.out.contains("Yes"),
        "{}",
        done.out
    );
    let text = fs::read_to_string(folder.path().join("out/result.json")).unwrap();
    let result: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(result["validation"]["conformal"], Value::Null);
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(!page.contains("trajectory, guaranteed)"));
    // So says the look before the fit.
    let line = "inspect run.csv again.csv --model arm.urdf --config quick.toml --json";
    let done = run(folder.path(), line.split(' ')).expect(3);
    assert!(done.out.contains("copied_log"), "{}", done.out);
}
