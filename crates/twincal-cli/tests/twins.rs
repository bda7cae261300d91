//! What a stored twin answers, and what logs with too little in them get instead of one.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a broken test may panic, a skipped one is said"
)]

use crate::common;
use crate::common::{Run, csv, fit, folder, run, shell};
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
        let elbow = gates.filter(|gate| {
            let of_error = gate["gate"] == "rmse" || gate["gate"] == "coverage";
            gate["joint"] == "elbow" && of_error
        });
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

#[test]
fn check_says_which_gate_failed() {
    let folder = common::fitted_copy();
    common::write_later(folder.path());
    let new = run(folder.path(), ["check", "later.csv", "--twin", "twin"]).expect(0);
    let judged = "What the gates judge: rows in which the joint moves";
    assert!(
        new.out.contains(judged) && new.out.contains(" ≤ 0.0"),
        "{}",
        new.out
    );
    let louder = csv(400, &|_, mut row| {
        row[8] = (row[8].parse::<f64>().unwrap() + 0.5).to_string();
        row
    });
    fs::write(folder.path().join("drifted.csv"), louder).unwrap();
    let done = run(folder.path(), ["check", "drifted.csv", "--twin", "twin"]).expect(1);
    assert!(
        done.out.contains("joint `elbow`: RMSE 0.5") && !done.out.contains("`shoulder`: RMSE"),
        "{}",
        done.out
    );
    assert!(done.out.contains("of the twin on the") && !done.out.contains("fitted to"));
    let rows: Vec<&str> = done.out.lines().filter(|line| line.contains('≤')).collect();
    assert!(
        rows.len() == 2 && rows[0].ends_with("passed") && rows[1].ends_with("failed"),
        "{rows:?}"
    );
    let done = run(
        folder.path(),
        ["check", "drifted.csv", "--twin", "twin", "--json"],
    )
    .expect(1);
    let result: serde_json::Value = serde_json::from_str(&done.out).unwrap();
    assert_eq!(result["passed"], false);
    assert_eq!(result["gates"][0]["rows"], "moving");
    fs::write(
        folder.path().join("gates.toml"),
        "[check]\nrmse_ratio = 1000\ncoverage = [0, 1]\n",
    )
    .unwrap();
    run(
        folder.path(),
        [
            "check",
            "drifted.csv",
            "--twin",
            "twin",
            "--config",
            "gates.toml",
        ],
    )
    .expect(0);
}

/// What the twin was fitted to or judged by is no evidence where the gates hold, alone; where they do not hold the robot changed all the same.
#[test]
fn a_log_that_the_twin_knows_passes_and_is_named() {
    let folder = folder();
    common::write_later(folder.path());
    common::fit(folder.path(), &["--heldout", "later.csv", "-o", "twin"]).expect(0);
    let new = csv(700, &|_, row| row);
    fs::write(folder.path().join("new.csv"), new).unwrap();
    fs::write(
        folder.path().join("narrow.toml"),
        "[check]\nrmse_ratio = 0.5\n",
    )
    .unwrap();
    let check = |logs: &[&str], more: &[&str], code: i32| -> Value {
        let line = [&["check"], logs, &["--twin", "twin"], more].concat();
        let done = run(folder.path(), line.iter().chain(&["--json"])).expect(code);
        let json: Value = serde_json::from_str(&done.out).unwrap();
        json["assessment"].clone()
    };
    for (logs, known) in [
        (&["run.csv"][..], &["log_was_fitted"][..]),
        (&["later.csv"], &["log_was_heldout"]),
        (
            &["later.csv", "run.csv"],
            &["log_was_heldout", "log_was_fitted"],
        ),
        (&["new.csv", "run.csv"], &["log_was_fitted"]),
        (&["new.csv"], &[]),
    ] {
        let assessment = check(logs, &[], 0);
        assert_eq!(assessment["reason"], "passed", "{logs:?}");
        assert_eq!(assessment["answer"], "yes", "{logs:?}");
        let claims = assessment["claims"].as_array().unwrap().iter();
        let codes = claims.filter_map(|claim| claim["code"].as_str());
        let said: Vec<&str> = codes.filter(|code| code.starts_with("log_was")).collect();
        assert_eq!(said, known, "{logs:?}");
    }
    let failed = check(&["run.csv"], &["--config", "narrow.toml"], 1);
    assert_eq!(failed["reason"], "error_above_gate");
    let done = run(folder.path(), ["check", "run.csv", "--twin", "twin"]).expect(0);
    let words = done.out.split_whitespace().collect::<Vec<_>>().join(" ");
    let said = "passed run.csv: this log is one that the twin was fitted to: no independent check; check a log that is new to the twin";
    assert!(words.starts_with(said), "{}", done.out);
    assert_eq!(done.out.matches("fitted to").count(), 1, "{}", done.out);
}

/// A log with the torque of motors, fifty times smaller than at the joints, and its config.
fn motors() -> (String, String) {
    let log = csv(400, &|_, mut row| {
        for cell in &mut row[7..9] {
            *cell = (number(cell) / 50.0).to_string();
        }
        row
    });
    let torque = "[log]\ntorque = \"motor\"\ngear_ratio = { shoulder = 50.0, elbow = 50.0 }\n";
    (log, format!("{}{torque}", common::QUICK))
}

/// `check` and `predict` take torque as the fit did, and say so.
#[test]
fn new_logs_are_read_as_those_of_the_fit_were() {
    let (motors, config) = motors();
    let (folder, done) = fitted_with(&motors, &config);
    done.expect(0);
    fs::write(
        folder.path().join("gates.toml"),
        "[check]\ncoverage = [0.5, 1.0]\n",
    )
    .unwrap();
    fs::write(
        folder.path().join("joint.toml"),
        "[log]\ntorque = \"joint\"\n",
    )
    .unwrap();
    let checked = |config: &[&str], code: i32| -> Value {
        let line = ["check", "run.csv", "--twin", "out", "--json"];
        let done = run(folder.path(), line.iter().chain(config)).expect(code);
        serde_json::from_str(&done.out).unwrap()
    };
    let said = |checked: &Value| {
        let findings = checked["findings"].as_array().unwrap().iter();
        let mut said = findings.filter(|finding| finding["code"] == "torque_as_fitted");
        said.next()
            .map(|finding| finding["message"].as_str().unwrap().to_owned())
    };
    for config in [&[][..], &["--config", "gates.toml"]] {
        let words = said(&checked(config, 0)).unwrap();
        assert!(
            words.contains("torque of the motors, with the gear ratios"),
            "{words}"
        );
    }
    assert_eq!(said(&checked(&["--config", "joint.toml"], 1)), None);
    let predicted = run(folder.path(), ["predict", "run.csv", "--twin", "out"]).expect(0);
    let lines: Vec<Vec<&str>> = predicted
        .out
        .lines()
        .map(|l| l.split(',').collect())
        .collect();
    let column = lines[0]
        .iter()
        .position(|name| *name == "shoulder.tau_meas")
        .unwrap();
    let row = motors.lines().nth(1).unwrap().split(',').nth(7).unwrap();
    assert!((number(lines[1][column]) - 50.0 * number(row)).abs() < 1e-9);
}

/// See also `as_fitted.rs`.
#[test]
fn columns_of_new_logs_are_those_of_the_fit() {
    let (motors, config) = motors();
    let folder = folder();
    fs::write(
        folder.path().join("other.csv"),
        motors.replacen("q1", "angle", 1),
    )
    .unwrap();
    let columns = format!("{config}[columns]\nq = {{ shoulder = \"angle\" }}\n");
    fs::write(folder.path().join("columns.toml"), columns).unwrap();
    let line = "fit other.csv --model arm.urdf --config columns.toml -o named";
    run(folder.path(), line.split(' ')).expect(0);
    run(folder.path(), ["check", "other.csv", "--twin", "named"]).expect(0);
    let line = "check other.csv --twin named --config columns.toml";
    run(folder.path(), line.split(' ')).expect(0);
}

#[test]
fn rows_without_measured_torque_are_predicted_all_the_same() {
    let (folder, done) = fitted_with(&csv(1000, &|_, row| row), FILTERED);
    done.expect(0);
    let holes = csv(1000, &|number, mut row| {
        match number {
            300..340 => row[8] = "nan".into(),
            500 => row[8] = "inf".into(),
            600 => row[7] = String::new(),
            _ => {}
        }
        row
    });
    fs::write(folder.path().join("holes.csv"), holes).unwrap();
    let predict = |log: &str| run(folder.path(), ["predict", log, "--twin", "out"]).expect(0);
    let (whole, holed) = (predict("run.csv"), predict("holes.csv"));
    let rows = |done: &Run| -> Vec<Vec<String>> {
        let lines = done.out.lines();
        lines
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect()
    };
    let (whole, mut rest) = (rows(&whole), rows(&holed));
    assert_eq!(rest.len(), whole.len());
    let mut empty = 0;
    for (row, given) in rest.iter_mut().zip(&whole) {
        for column in [1, 6] {
            if row[column].is_empty() {
                empty += 1;
                row[column].clone_from(&given[column]);
            }
        }
        assert_eq!(row, given);
    }
    assert_eq!(empty, 42);
    holed.says(&["holes.csv", "joint `shoulder`: 1, joint `elbow`: 41"]);
}

#[test]
fn rows_without_motion_are_cuts_of_a_prediction() {
    let (folder, done) = fitted_with(&csv(1000, &|_, row| row), FILTERED);
    done.expect(0);
    let holed = csv(1000, &|number, mut row| {
        if number == 500 {
            row[2] = "nan".into();
        }
        row
    });
    fs::write(folder.path().join("holed.csv"), holed).unwrap();
    let predict = |log: &str| run(folder.path(), ["predict", log, "--twin", "out"]).expect(0);
    let (whole, holed) = (predict("run.csv"), predict("holed.csv"));
    let lost = whole.out.lines().count() - holed.out.lines().count();
    assert!(lost > 2, "{lost} rows lost");
    holed.says(&["1 of 1000 rows", "position of joint `elbow`: 1"]);
}

#[test]
fn a_result_that_cannot_be_printed_is_complete_and_says_where() {
    if !Path::new("/dev/full").exists() {
        println!("skipped: there is no /dev/full");
        return;
    }
    for json in ["--json", ""] {
        let folder = folder();
        let line = format!(
            "\"$TWINCAL\" fit run.csv --model arm.urdf --config quick.toml -o out {json} > /dev/full"
        );
        shell(folder.path(), &line).expect(3).says(&[
            "cannot write the summary to standard output",
            "the result in out is complete",
        ]);
        common::write_later(folder.path());
        run(folder.path(), ["check", "later.csv", "--twin", "out"]).expect(0);
    }
}

#[test]
fn result_says_the_rate_of_the_rows_that_were_kept() {
    let config = FILTERED.replace("[library]", "rate_hz = 17.5\n[library]");
    let (folder, done) = fitted_with(&csv(1000, &|_, row| row), &config);
    done.expect(0);
    let one = result(folder.path());
    // Every third sample of 50 Hz.
    for rate in [&one["signal"]["rate_hz"], &one["logs"][0]["kept_rate_hz"]] {
        assert!((rate.as_f64().unwrap() - 50.0 / 3.0).abs() < 1e-9, "{rate}");
    }
    let text = csv(1000, &|_, row| row);
    let lines: Vec<&str> = text.lines().collect();
    let half: Vec<&str> = [lines[0]]
        .into_iter()
        .chain(lines[1..].iter().copied().step_by(2))
        .collect();
    fs::write(folder.path().join("half.csv"), half.join("\n")).unwrap();
    let more = ["half.csv", "-o", "out", "--force"];
    fit(folder.path(), &more).expect(0);
    let two = result(folder.path());
    assert_eq!(two["signal"]["rate_hz"], 17.5);
    let kept = &two["logs"][1]["kept_rate_hz"];
    assert!((kept.as_f64().unwrap() - 25.0).abs() < 1e-9, "{kept}");
}

#[test]
fn a_joint_that_stands_still_throughout_is_not_asked_for_rows() {
    let still = csv(1000, &|number, mut row| {
        for column in [2, 4, 6, 8] {
            row[column] = "0".into();
        }
        // The arm stretched out: one body about the shoulder, viscous friction and a little noise.
        let noise = ((number * 7919) % 1000) as f64 / 1000.0 - 0.5;
        let (v1, a1): (f64, f64) = (row[3].parse().unwrap(), row[5].parse().unwrap());
        row[7] = ((0.3025 + 0.12) * a1 + 0.4 * v1 + 0.05 * noise).to_string();
        row
    });
    let (folder, done) = fitted_with(&still, FILTERED);
    done.expect(0);
    let noise = &result(folder.path())["noise"];
    assert_eq!(noise[1]["n"], 0.0);
    assert!(noise[0]["n_eff"].as_f64().unwrap() > 10.0);
}

#[test]
fn a_joint_whose_rows_are_all_alike_is_named_beside_joints_that_answer() {
    // Without torque of its own, what is left of the elbow is the motion itself.
    let silent = csv(400, &|_, mut row| {
        row[8] = "0".into();
        row
    });
    let (folder, done) = fitted_with(&silent, common::QUICK);
    // And a dead column is no measurement.
    done.expect(3);
    let result = result(folder.path());
    let findings = result["findings"].as_array().unwrap().iter();
    let few: Vec<&Value> = findings
        .filter(|f| f["code"] == "few_effective_rows")
        .collect();
    assert_eq!((few.len(), &few[0]["subject"]), (1, &"elbow".into()));
    let words = few[0]["message"].as_str().unwrap();
    assert!(
        words.starts_with("the 400 rows of joint `elbow` count as "),
        "{words}"
    );
    assert!(result["noise"][0]["n_eff"].as_f64().unwrap() >= 10.0);
}

#[test]
fn case_07_a_joint_without_candidates_does_not_hide_rows_that_are_all_alike() {
    // What is left of the shoulder is white, and nothing is asked of it.
    let silent = csv(400, &|_, mut row| {
        row[7] = (number(&row[7]) - 0.4 * number(&row[3])).to_string();
        row[8] = "0".into();
        row
    });
    let config = "[signal]\ncutoff_hz = 0\n[library]\nterms = [\"sin(q2)\"]\ngeneric = false\nfamilies = []\n";
    let (folder, done) = fitted_with(&silent, config);
    done.expect(4)
        .says(&["the 400 rows of joint `elbow` count as ", "10 are needed"]);
    assert!(!folder.path().join("out").exists());
}

/// An encoder that is reset in the middle: what follows from it stands before the refusal, so that nobody looks for
/// longer logs where the encoder is at fault.
#[test]
fn a_refusal_says_what_was_found_before_it() {
    let reset = csv(400, &|number, mut row| {
        if number >= 200 {
            row[2] = (self::number(&row[2]) + 1.5).to_string();
        }
        // No noise and nothing to explain it: rows that are all alike.
        row[7] = "0".into();
        row[8] = "0".into();
        row
    });
    let config = "[signal]\ncutoff_hz = 0\n[library]\nterms = [\"sin(q2)\"]\ngeneric = false\nfamilies = []\n";
    let (folder, done) = fitted_with(&reset, config);
    let done = done.expect(4).says(&["count as ", "10 are needed"]);
    let step = done.err.find("position steps from one sample");
    let refusal = done.err.find("error: ");
    assert!(step.is_some() && step < refusal, "{}", done.err);
    assert_eq!(done.out, "");
    assert!(!folder.path().join("out").exists());
}

/// Constant torque is named with its joints: a warning for one, which may be a passive one, degraded for all. The elbow's motion needs torque by
/// the model: it is none without a drive, which is degraded.
#[test]
fn torque_that_never_changes_is_named() {
    let folder = folder();
    let told = |columns: &'static [usize]| {
        let silent = csv(400, &move |_, mut row| {
            columns.iter().for_each(|column| row[*column] = "0".into());
            row
        });
        fs::write(folder.path().join("run.csv"), silent).unwrap();
        let line = "doctor run.csv --model arm.urdf --config quick.toml --json --trial";
        let done = run(folder.path(), line.split(' '));
        let findings = serde_json::from_str::<Value>(&done.out).unwrap()["findings"].clone();
        let mut all = findings.as_array().unwrap().clone();
        all.retain(|f| f["code"] == "constant_torque");
        assert_eq!(all.len(), 1, "{findings}");
        let text = |key: &str| all[0][key].as_str().unwrap().to_owned();
        (done.code, text("severity"), text("message"))
    };
    let (code, severity, words) = told(&[8]);
    assert_eq!((code, severity.as_str()), (Some(3), "warning"));
    assert!(words.contains("`elbow` is 0 throughout"), "{words}");
    let (code, severity, words) = told(&[7, 8]);
    // nothing is left to fit, as fit says as well
    assert_eq!((code, severity.as_str()), (Some(4), "degraded"));
    let line = "fit run.csv --model arm.urdf --config quick.toml -o none";
    run(folder.path(), line.split(' ')).expect(4);
    assert!(words.contains("`shoulder` is 0, `elbow` is 0"), "{words}");
    assert!(words.contains("[columns] tau"), "{words}");
}

#[test]
fn case_105_no_limit_of_the_address_space_ends_in_an_abort() {
    let folder = folder();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    // The system does not load the program itself in less.
    for kb in [40_000, 60_000, 80_000, 100_000, 120_000, 200_000] {
        let line = format!(
            "ulimit -c 0; ulimit -v {kb}; \"$TWINCAL\" fit {0}/train1.parquet --model {0}/arm.urdf -o out --force --threads 2",
            assets.display()
        );
        let done = shell(folder.path(), &line);
        match done.code {
            Some(0) => {}
            Some(2) => assert!(done.err.contains("memory"), "{kb}: {}", done.err),
            code => panic!("{kb} kB: {code:?}\n{}", done.err),
        }
    }
}

#[test]
fn predictions_never_replace_what_they_are_made_from() {
    let folder = common::fitted_copy();
    fs::write(folder.path().join("c.csv"), "").unwrap();
    let before = fs::read(folder.path().join("run.csv")).unwrap();
    for output in ["run.csv", "./run.csv", "twin/twin.json", "c.csv"] {
        let line = format!("predict run.csv --twin twin --config c.csv --force -o {output}");
        let done = run(folder.path(), line.split(' ')).expect(2);
        done.says(&["is read by this command", "-o"]);
    }
    assert_eq!(fs::read(folder.path().join("run.csv")).unwrap(), before);
    common::write_later(folder.path());
    run(folder.path(), ["check", "later.csv", "--twin", "twin"]).expect(0);
}
