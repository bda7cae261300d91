//! Logs and models that do not fit together, and files that lie: exit codes and words of the program.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{ARM, QUICK, Run, csv, fit, folder, run};
use serde_json::Value;
use std::fs;
use tempfile::TempDir;
use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};

/// The quick settings with gravity in the arm's plane.
fn upright() -> String {
    format!("{}[model]\ngravity = [0.0, -9.81, 0.0]\n", common::QUICK)
}

/// The log of the arm that stands upright: `t, q1, q2, qd1, qd2, qdd1, qdd2, tau1, tau2` per row, then `change`.
fn upright_log(change: impl Fn(usize, &mut [f64])) -> String {
    csv(400, &|number, row| {
        let mut cells: Vec<f64> = row.iter().map(|cell| cell.parse().unwrap()).collect();
        // m1 c1 + m2 l = 0.8 kg·m, m2 c2 = 0.15 kg·m
        let fore = 0.15 * 9.81 * (cells[1] + cells[2]).cos();
        cells[7] += 0.8 * 9.81 * cells[1].cos() + fore;
        cells[8] += fore;
        change(number, &mut cells);
        cells.iter().map(f64::to_string).collect()
    })
}

/// Fits such a log.
fn upright_fit(change: impl Fn(usize, &mut [f64])) -> (TempDir, Run) {
    let folder = folder();
    fs::write(folder.path().join("quick.toml"), upright()).unwrap();
    fs::write(folder.path().join("run.csv"), upright_log(change)).unwrap();
    let done = fit(folder.path(), &["-o", "out"]);
    (folder, done)
}

fn json(folder: &TempDir, path: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.path().join(path)).unwrap()).unwrap()
}

/// Findings of these codes: code, subject, count, message.
fn found(result: &Value, codes: &[&str]) -> Vec<(String, String, u64, String)> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    result["findings"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|f| codes.contains(&f["code"].as_str().unwrap()))
        .map(|f| {
            let count = f["count"].as_u64().unwrap();
            (
                text(&f["code"]),
                text(&f["subject"]),
                count,
                text(&f["message"]),
            )
        })
        .collect()
}

const CHECKS: [&str; 3] = ["torque_scale", "sign_flip", "joint_order"];

/// Code and subject of what `fit` and `inspect` both say about a log against its model.
fn self_check(change: impl Fn(usize, &mut [f64])) -> Vec<(String, String)> {
    let (folder, done) = upright_fit(change);
    let arguments = [
        "inspect",
        "run.csv",
        "--model",
        "arm.urdf",
        "--config",
        "quick.toml",
        "--json",
    ];
    let inspected = run(folder.path(), arguments);
    let codes = [inspected.code, done.code];
    let inspected = found(&serde_json::from_str(&inspected.out).unwrap(), &CHECKS);
    let fitted = found(&json(&folder, "out/result.json"), &CHECKS);
    assert_eq!(inspected, fitted);
    // What is fitted all the same counts as degraded.
    assert_eq!(codes, [Some(if fitted.is_empty() { 0 } else { 3 }); 2]);
    fitted.into_iter().map(|f| (f.0, f.1)).collect()
}

#[test]
fn a_log_that_fits_its_model_is_passed_in_silence() {
    assert_eq!(self_check(|_, _| ()), []);
}

#[test]
fn case_18_positions_in_degrees_are_refused_by_every_command() {
    let degrees = |_: usize, row: &mut [f64]| {
        row[1..7]
            .iter_mut()
            .for_each(|v| *v *= 180.0 / std::f64::consts::PI);
    };
    let (folder, done) = upright_fit(degrees);
    done.expect(2)
        .says(&["run.csv", "joint `shoulder`", "degrees", "π/180"]);
    assert!(!folder.path().join("out").exists());
    run(folder.path(), ["inspect", "run.csv", "--model", "arm.urdf"])
        .expect(2)
        .says(&["degrees"]);
    // Only the velocity.
    let (_, done) = upright_fit(|_, row| row[3] *= 180.0 / std::f64::consts::PI);
    done.expect(2)
        .says(&["velocity of joint `shoulder`", "degrees/s"]);
}

#[test]
fn case_19_and_20_torque_of_another_scale_is_named() {
    for gain in [1.0 / 11.3, 0.01, 1000.0] {
        let said = self_check(|_, row| row[7] *= gain);
        assert_eq!(said, [("torque_scale".into(), "shoulder".into())], "{gain}");
    }
}

#[test]
fn case_21_a_turned_sign_is_named() {
    for (column, joint) in [(7, "shoulder"), (8, "elbow")] {
        let said = self_check(|_, row| row[column] *= -1.0);
        assert_eq!(said, [("sign_flip".into(), joint.into())]);
    }
}

#[test]
fn case_22_exchanged_joints_are_named() {
    let folder = folder();
    fs::write(folder.path().join("quick.toml"), upright()).unwrap();
    let swapped = upright_log(|_, row| row.swap(7, 8));
    fs::write(folder.path().join("run.csv"), swapped).unwrap();
    let arguments = [
        "inspect",
        "arm.urdf",
        "run.csv",
        "--config",
        "quick.toml",
        "--json",
    ];
    let done = run(folder.path(), arguments).expect(3);
    let said = found(&serde_json::from_str(&done.out).unwrap(), &CHECKS);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0].0, "joint_order");
    assert!(
        said[0].3.contains("`shoulder` = torque of `elbow`"),
        "{said:?}"
    );
}

#[test]
fn case_26_saturated_torque_is_left_out_and_counted() {
    let limit = 8.0;
    let (folder, done) = upright_fit(|_, row| row[7] = row[7].min(limit));
    done.expect(0);
    let flat = upright_log(|_, row| row[7] = row[7].min(limit));
    let flat = flat
        .lines()
        .filter(|line| line.split(',').nth(7) == Some("8"));
    let flat = flat.count() as u64;
    assert!(flat > 50);
    let result = json(&folder, "out/result.json");
    let said = found(&result, &["saturated_torque"]);
    assert_eq!(said.len(), 1);
    assert!(
        said[0]
            .3
            .contains("joint `shoulder`: torque is flat at its limit of 8"),
        "{said:?}"
    );
    // Single samples at the limit between others are no flat run.
    assert!((flat - 20..=flat).contains(&said[0].2), "{flat} {said:?}");
    let rows = &result["logs"][0]["rows"];
    assert_eq!(rows[0].as_u64(), Some(400 - said[0].2));
    assert_eq!(rows[1].as_u64(), Some(400));
    // The clipped rows would pull the friction of the shoulder (0.4 N·m·s/rad) away from the truth.
    let viscous = result["terms"].as_array().unwrap().iter().find(|term| {
        let words = term["words"].as_str().unwrap_or("");
        words.contains("viscous") && words.contains("shoulder")
    });
    let viscous = viscous.unwrap();
    let (mean, sd) = (
        viscous["mean"].as_f64().unwrap(),
        viscous["sd"].as_f64().unwrap(),
    );
    assert!((mean - 0.4).abs() < 5.0 * sd + 0.005, "{mean} ± {sd}");
}

/// A log of four channels as Parquet.
fn parquet(rows: usize) -> Vec<u8> {
    let names = ["t", "q1", "q2", "tau1", "tau2"];
    let columns = names.map(|name| (name.to_owned(), ColumnKind::Number));
    let values: Vec<f64> = (0..rows).map(|i| i as f64 / 50.0).collect();
    let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &columns).unwrap();
    table.push(&[Values::Numbers(&values); 5]).unwrap();
    table.finish().unwrap()
}

fn with_parquet(bytes: &[u8]) -> Run {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), bytes).unwrap();
    let done = fit(folder.path(), &["-o", "out"]);
    assert!(!folder.path().join("out").exists());
    done
}

#[test]
fn case_47_a_parquet_page_that_declares_two_to_the_31_values_is_refused() {
    let bytes = parquet(60);
    // The data page header (a struct, field 5) counts its values in field 1: zigzag 120.
    let at = bytes
        .windows(3)
        .position(|w| w == [0x2C, 0x15, 120])
        .unwrap();
    let mut lying = bytes[..at + 2].to_vec();
    lying.extend([0xFE, 0xFF, 0xFF, 0xFF, 0x0F]);
    lying.extend(&bytes[at + 3..]);
    with_parquet(&lying)
        .expect(2)
        .says(&["run.csv", "column `t`", "declares 2147483647 values"]);
}

#[test]
fn case_48_a_parquet_column_that_is_no_number_is_refused() {
    let names = ["t", "q1", "q2", "tau1", "tau2"];
    let columns: Vec<(String, ColumnKind)> = names
        .iter()
        .map(|name| {
            let kind = if *name == "q1" {
                ColumnKind::Flag
            } else {
                ColumnKind::Number
            };
            ((*name).to_owned(), kind)
        })
        .collect();
    let numbers: Vec<f64> = (0..60).map(|i| f64::from(i) / 50.0).collect();
    let flags: Vec<bool> = (0..60).map(|i| i % 2 == 0).collect();
    let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &columns).unwrap();
    let mut block = [Values::Numbers(&numbers); 5];
    block[1] = Values::Flags(&flags);
    table.push(&block).unwrap();
    with_parquet(&table.finish().unwrap()).expect(2).says(&[
        "run.csv",
        "column `q1`",
        "not a number",
    ]);
}

/// Inspects a model of this text.
fn inspect(name: &str, text: &str) -> Run {
    let folder = folder();
    fs::write(folder.path().join(name), text).unwrap();
    run(folder.path(), ["inspect", name, "--json"])
}

#[test]
fn case_73_and_74_mimic_joints_and_axes() {
    let lost = ARM.replacen("<limit lower", "<mimic joint=\"elbwo\"/><limit lower", 1);
    inspect("arm.urdf", &lost)
        .expect(2)
        .says(&["arm.urdf", "`elbwo`", "elbow"]);
    let zero = ARM.replacen("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 0\"/>", 1);
    inspect("arm.urdf", &zero)
        .expect(2)
        .says(&["arm.urdf:7:", "joint `shoulder`", "axis"]);
    let long = ARM.replacen("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 2\"/>", 1);
    let done = inspect("arm.urdf", &long).expect(0);
    let result: Value = serde_json::from_str(&done.out).unwrap();
    assert_eq!(found(&result, &["axis_normalised"]).len(), 1);
}

#[test]
fn case_83_and_84_what_mjcf_does_not_know_and_other_formats() {
    let mjcf = "<mujoco><worldbody><body><joint name='a' armatur='1'/><inertial pos='0 0 1' mass='1' diaginertia='1 1 1'/>\
                </body></worldbody><koint/></mujoco>";
    let done = inspect("arm.xml", mjcf).expect(0);
    let result: Value = serde_json::from_str(&done.out).unwrap();
    let said = found(&result, &["unknown_elements"]);
    assert_eq!(said[0].2, 2);
    assert!(
        said[0].3.contains("<koint>") && said[0].3.contains("armatur"),
        "{said:?}"
    );
    inspect("arm.sdf", "<sdf version='1.9'><model name='m'/></sdf>")
        .expect(2)
        .says(&["SDF", "convert"]);
    inspect("arm.usda", "#usda 1.0\n")
        .expect(2)
        .says(&["USD", "convert"]);
}

#[test]
fn a_base_on_the_ceiling_turns_gravity() {
    let folder = folder();
    let config = "[model]\nbase = { rpy = [3.141592653589793, 0.0, 0.0] }\n";
    fs::write(folder.path().join("ceiling.toml"), config).unwrap();
    let arguments = ["inspect", "arm.urdf", "--config", "ceiling.toml", "--json"];
    let done = run(folder.path(), arguments).expect(0);
    let result: Value = serde_json::from_str(&done.out).unwrap();
    let gravity = [0, 1, 2].map(|k| result["gravity"][k].as_f64().unwrap());
    assert!(
        (gravity[2] - 9.81).abs() < 1e-12 && gravity[1].abs() < 1e-12,
        "{gravity:?}"
    );
}

#[test]
fn entries_of_the_config_are_the_logs_where_none_is_given() {
    let folder = folder();
    fs::create_dir(folder.path().join("logs")).unwrap();
    let text = fs::read_to_string(folder.path().join("run.csv")).unwrap();
    // The same motion with noise of its own: no copy.
    let other = common::csv(390, &|number, mut row| {
        let torque: f64 = row[7].parse().unwrap();
        row[7] = (torque + 0.3 * ((number * 7919 % 1009) as f64 / 1009.0 - 0.5)).to_string();
        let torque: f64 = row[8].parse().unwrap();
        row[8] = (torque + 0.3 * ((number * 104_729 % 1009) as f64 / 1009.0 - 0.5)).to_string();
        row
    });
    fs::write(folder.path().join("logs/a.csv"), &text).unwrap();
    fs::write(folder.path().join("logs/b.csv"), other).unwrap();
    let config = format!(
        "{}[[log]]\nfile = \"logs/a.csv\"\npayload = {{ mass = 1.2, com = [0.0, 0.0, 0.06] }}\n\
         [[log]]\nfile = \"logs/b.csv\"\nheldout = true\n",
        common::QUICK
    );
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    let base = ["fit", "--model", "arm.urdf", "--config", "quick.toml"];
    run(folder.path(), base.iter().chain(&["-o", "out"])).expect(3);
    let logs = |path: &str| -> Vec<(String, String)> {
        let result = json(&folder, path);
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let logs = result["logs"].as_array().unwrap();
        logs.iter()
            .map(|log| (text(&log["name"]), text(&log["role"])))
            .collect()
    };
    let pair = |name: &str, role: &str| (name.to_owned(), role.to_owned());
    assert_eq!(
        logs("out/result.json"),
        [pair("logs/a.csv", "fit"), pair("logs/b.csv", "heldout")]
    );
    // A log on the command line is what is fitted.
    run(
        folder.path(),
        base.iter().chain(&["run.csv", "-o", "other"]),
    )
    .expect(3);
    assert_eq!(logs("other/result.json")[0], pair("run.csv", "fit"));
    // Neither: usage.
    run(folder.path(), ["fit", "--model", "arm.urdf"])
        .expect(2)
        .says(&["no log", "[[log]]"]);
}

#[test]
fn one_column_for_two_joints_is_refused_with_both_names() {
    let folder = folder();
    let config = format!("{QUICK}[columns]\ntau = {{ elbow = \"tau1\" }}\n");
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(2).says(&[
        "run.csv: column `tau1` is taken as torque of joint `shoulder` and as torque of joint `elbow`",
        "[columns]",
    ]);
}

#[test]
fn an_error_in_a_term_says_where_it_stands_in_the_config() {
    let folder = folder();
    let config = QUICK.replace("[\"sin(q2)\"]", "[\"sin(q2)\",\n  \"sin(q2\"]");
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    let done = fit(folder.path(), &["-o", "out"]).expect(2);
    done.says(&["quick.toml:5:3: term `sin(q2`, column "]);
}

#[test]
fn a_rate_without_a_filter_is_said_to_have_no_effect() {
    let folder = folder();
    let config = QUICK.replace("[library]", "rate_hz = 10\n[library]");
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(0);
    let result = json(&folder, "out/result.json");
    let told = found(&result, &["rate_ignored"]);
    assert_eq!(told.len(), 1);
    assert!(
        told[0].3.contains("signal.rate_hz = 10 has no effect"),
        "{}",
        told[0].3
    );
}
