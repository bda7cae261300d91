//! What a stored twin answers, and what logs with too little in them get instead of one.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a broken test may panic, a skipped one is said"
)]

mod common;

use common::{Run, csv, fit, folder, run, shell};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The quick settings with the filter on: rows at the borders of a cut are lost.
const FILTERED: &str = "[signal]\ncutoff_hz = 5\n[library]\nterms = [\"sin(q2)\"]\ngeneric = false\n\
                        friction = [\"viscous\"]\noffset = false\nmotor_inertia = false\n";

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

fn result(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out/result.json")).unwrap()).unwrap()
}

/// `fit run.csv -o out` with a log and a config of one's own.
fn fitted_with(log: &str, config: &str) -> (TempDir, Run) {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), log).unwrap();
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    let done = fit(folder.path(), &["-o", "out"]);
    (folder, done)
}

#[test]
fn a_gate_that_the_config_does_not_give_stays_as_the_twin_has_it() {
    let open = format!(
        "{}[check]\nrmse_ratio = 1000\ncoverage = [0, 1]\n",
        common::QUICK
    );
    let (folder, done) = fitted_with(&csv(400, &|_, row| row), &open);
    done.expect(0);
    let drifted = csv(400, &|_, mut row| {
        row[8] = (number(&row[8]) + 0.5).to_string();
        row
    });
    fs::write(folder.path().join("drifted.csv"), drifted).unwrap();
    let check = |config: &str, code: i32| -> Vec<(String, bool)> {
        fs::write(folder.path().join("gates.toml"), config).unwrap();
        let line = "check drifted.csv --twin out --config gates.toml --json";
        let done = run(folder.path(), line.split(' ')).expect(code);
        let checked: Value = serde_json::from_str(&done.out).unwrap();
        let gates = checked["gates"].as_array().unwrap().iter();
        let elbow = gates.filter(|gate| gate["joint"] == "elbow");
        elbow
            .map(|gate| {
                let name = gate["gate"].as_str().unwrap().to_owned();
                (name, gate["passed"].as_bool().unwrap())
            })
            .collect()
    };
    let gates = |rmse, coverage| vec![("rmse".to_owned(), rmse), ("coverage".to_owned(), coverage)];
    assert_eq!(check("[log]\nstrict = false\n", 0), gates(true, true));
    assert_eq!(check("[check]\nrmse_ratio = 1.2\n", 1), gates(false, true));
    let coverage = "[check]\ncoverage = [0.9, 0.99]\n";
    assert_eq!(check(coverage, 1), gates(true, false));
}
