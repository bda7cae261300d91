//! Exit codes and words for bad logs, models, settings and questions: one named test per case of the fault list.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{ARM, Row, Run, csv, fit, folder, run};
use std::fs;
use tempfile::TempDir;

/// Fits a log of this text.
fn with_log(text: impl AsRef<[u8]>) -> (TempDir, Run) {
    with_log_and(text, &[])
}

fn with_log_and(text: impl AsRef<[u8]>, more: &[&str]) -> (TempDir, Run) {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), text).unwrap();
    let done = fit(folder.path(), &[&["-o", "out"], more].concat());
    let written = folder.path().join("out/result.json").exists();
    assert_eq!(
        written,
        matches!(done.code, Some(0 | 3)),
        "exit {:?} and result.json: {written}\n{}",
        done.code,
        done.err
    );
    (folder, done)
}

/// Fits with a model of this text.
fn with_model(text: &str) -> Run {
    let folder = folder();
    fs::write(folder.path().join("arm.urdf"), text).unwrap();
    let done = fit(folder.path(), &["-o", "out"]);
    assert_eq!(folder.path().join("out").exists(), done.code == Some(0));
    done
}

/// Row changes: one cell of rows `from..to` is replaced.
fn cell(column: usize, from: usize, to: usize, value: &str) -> String {
    let value = value.to_owned();
    csv(400, &move |number, mut row: Row| {
        if (from..to).contains(&number) {
            row[column] = value.clone();
        }
        row
    })
}

fn findings(folder: &TempDir) -> Vec<(String, u64)> {
    let text = fs::read_to_string(folder.path().join("out/result.json")).unwrap();
    let result: serde_json::Value = serde_json::from_str(&text).unwrap();
    let finding = |f: &serde_json::Value| {
        (
            f["code"].as_str().unwrap().to_owned(),
            f["count"].as_u64().unwrap(),
        )
    };
    result["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(finding)
        .collect()
}

#[test]
fn case_01_nan_rows_are_dropped_and_counted() {
    let (folder, done) = with_log(cell(1, 100, 103, "nan"));
    done.expect(0);
    assert!(
        findings(&folder).contains(&("not_finite_rows".into(), 3)),
        "{:?}",
        findings(&folder)
    );
    let (_, done) = with_log(cell(1, 100, 110, "nan"));
    done.expect(3);
}

#[test]
fn case_02_infinite_torque_is_dropped_and_counted() {
    let (folder, done) = with_log(cell(7, 50, 52, "-inf"));
    done.expect(0);
    assert!(
        findings(&folder).contains(&("not_finite_rows".into(), 2)),
        "{:?}",
        findings(&folder)
    );
    let (_, done) = with_log(cell(8, 100, 110, "inf"));
    done.expect(3);
}

#[test]
fn degraded_data_is_refused_when_strict() {
    let (_, done) = with_log_and(cell(1, 100, 110, "nan"), &["--strict"]);
    done.expect(2).says(&["--strict"]);
}

#[test]
fn case_03_column_of_nan() {
    with_log(cell(2, 0, 400, "nan"))
        .1
        .expect(2)
        .says(&["run.csv", "q2"]);
}

#[test]
fn case_04_empty_file() {
    with_log("").1.expect(2).says(&["run.csv", "empty"]);
}

#[test]
fn case_05_header_only() {
    with_log("t,q1,q2,tau1,tau2\n")
        .1
        .expect(2)
        .says(&["run.csv", "no rows"]);
}

#[test]
fn case_06_one_sample() {
    with_log(csv(1, &|_, row| row))
        .1
        .expect(2)
        .says(&["run.csv"]);
}

#[test]
fn case_07_too_few_rows_are_refused_with_the_counts() {
    with_log(csv(5, &|_, row| row))
        .1
        .expect(4)
        .says(&["refused", "5 rows"]);
}

/// Who reads standard output learns as much as who reads the terminal.
#[test]
fn json_holds_the_error_where_there_is_no_result() {
    let (_, done) = with_log_and(csv(5, &|_, row| row), &["--json"]);
    let done = done.expect(4);
    let said: serde_json::Value = serde_json::from_str(&done.out).unwrap();
    assert_eq!(said["error"]["exit_code"], 4);
    let [problem, remedy] = ["problem", "remedy"].map(|key| said["error"][key].as_str().unwrap());
    assert!(
        problem.contains("5 rows") && done.err.contains("5 rows"),
        "{said}"
    );
    assert!(remedy.contains("log"), "{said}");
}

#[test]
fn case_12_stamps_that_are_all_zero() {
    with_log(cell(0, 0, 400, "0"))
        .1
        .expect(2)
        .says(&["run.csv", "--rate"]);
    let (_, done) = with_log_and(cell(0, 0, 400, "0"), &["--rate", "50"]);
    done.expect(0);
}

#[test]
fn case_13_stamps_in_milliseconds() {
    let text = csv(400, &|_, mut row| {
        row[0] = (row[0].parse::<f64>().unwrap() * 1e3).to_string();
        row
    });
    let folder = folder();
    fs::write(folder.path().join("run.csv"), text).unwrap();
    run(folder.path(), ["fit", "run.csv", "--model", "arm.urdf"])
        .expect(2)
        .says(&["run.csv", "milliseconds", "time_unit = \"ms\""]);
}

#[test]
fn case_28_a_robot_that_stands_still_is_refused() {
    let still = csv(1000, &|_, mut row| {
        for cell in &mut row[1..] {
            *cell = "0.5".into();
        }
        row[3..7].fill("0".into());
        row
    });
    let folder = folder();
    fs::write(folder.path().join("run.csv"), still).unwrap();
    let done = run(folder.path(), ["fit", "run.csv", "--model", "arm.urdf"]).expect(4);
    done.says(&["shoulder", "elbow"]);
    assert!(!folder.path().join("twincal-out").exists());
}

#[test]
fn case_36_any_delimiter() {
    for delimiter in [" ", ";", "\t"] {
        with_log(csv(400, &|_, row| row).replace(',', delimiter))
            .1
            .expect(0);
    }
}

#[test]
fn case_37_decimal_comma() {
    let text = csv(400, &|_, row| row).replace(',', ";").replace('.', ",");
    with_log(text).1.expect(0);
}

#[test]
fn case_38_byte_order_mark_and_line_ends() {
    let text = csv(400, &|_, row| row).replace('\n', ",\r\n");
    with_log(format!("\u{feff}{text}")).1.expect(0);
}

#[test]
fn case_39_ragged_row() {
    let text = csv(400, &|number, mut row| {
        if number == 7 {
            row.pop();
        }
        row
    });
    with_log(&text).1.expect(2).says(&["run.csv:9"]);
    let (folder, done) = with_log_and(&text, &["--lenient"]);
    done.expect(0);
    assert!(
        findings(&folder).contains(&("unreadable_rows".into(), 1)),
        "{:?}",
        findings(&folder)
    );
}

#[test]
fn case_40_text_in_a_number() {
    with_log(cell(3, 5, 6, "fast"))
        .1
        .expect(2)
        .says(&["run.csv:7:", "fast"]);
}

#[test]
fn case_41_duplicate_columns() {
    with_log(csv(400, &|_, row| row).replace("t,q1,q2", "t,q1,q1"))
        .1
        .expect(2)
        .says(&["run.csv:1", "q1"]);
}

#[test]
fn case_42_utf_16() {
    let bytes: Vec<u8> = std::iter::once(0xfeff)
        .chain(csv(10, &|_, row| row).encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    with_log(bytes).1.expect(2).says(&["UTF-16"]);
}

#[test]
fn case_46_and_47_parquet_that_lies() {
    let whole = fs::read(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/assets/train1.parquet"
    ))
    .unwrap();
    with_log(&whole[..whole.len() / 2])
        .1
        .expect(2)
        .says(&["run.csv", "Parquet"]);
    let mut bytes = whole.clone();
    let length = bytes.len();
    // The footer's length field claims 2 GiB.
    bytes[length - 8..length - 4].copy_from_slice(&0x7fff_ffff_u32.to_le_bytes());
    with_log(bytes).1.expect(2).says(&["run.csv"]);
}

#[test]
fn case_71_and_72_joints_of_log_and_model_differ() {
    let text = csv(400, &|_, row| row);
    let renamed = text.replace(
        "q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2",
        "sholder.q,elbow.q,sholder.qd,elbow.qd,sholder.qdd,elbow.qdd,sholder.tau,elbow.tau",
    );
    with_log(renamed)
        .1
        .expect(2)
        .says(&["run.csv", "sholder", "shoulder"]);
    // The elbow is clamped at 0 and not logged: shoulder inertia 0.11 + 0.16 + 0.0325 + 2 · 0.06 kg·m².
    let clamped = |(number, line): (usize, &str)| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let noise = 0.02 * ((number * 7919 % 101) as f64 / 50.0 - 1.0);
        let torque = 0.4225 * cells[5] + 0.4 * cells[3] + noise;
        format!(
            "{},{},{},{},{torque}\n",
            cells[0], cells[1], cells[3], cells[5]
        )
    };
    let lacking: String = text.lines().skip(1).enumerate().map(clamped).collect();
    let lacking = format!("t,q1,qd1,qdd1,tau1\n{lacking}");
    let (folder, done) = with_log(&lacking);
    done.expect(2).says(&["elbow", "locked"]);
    let config = format!(
        "{}[model]\nlocked = {{ elbow = 0.0 }}\n",
        common::QUICK.replace("[\"sin(q2)\"]", "[]")
    );
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(0);
}

#[test]
fn case_75_and_76_document_types_are_refused() {
    let laughs = "<!DOCTYPE robot [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;&a;\">]>";
    let file = "<!DOCTYPE robot [<!ENTITY x SYSTEM \"file:///etc/passwd\">]>";
    for doctype in [laughs, file] {
        let done = with_model(&format!("{doctype}\n{ARM}"))
            .expect(2)
            .says(&["arm.urdf:1:"]);
        assert!(!done.err.contains("root:"), "a file was opened");
    }
}

#[test]
fn case_77_deep_nesting_does_not_abort() {
    let deep = format!(
        "<robot name=\"r\">{}{}</robot>",
        "<a>".repeat(20_000),
        "</a>".repeat(20_000)
    );
    with_model(&deep).expect(2).says(&["arm.urdf:1:", "256"]);
}

#[test]
fn case_78_and_79_sizes_are_limited() {
    let many: String = (0..400_000).map(|i| format!(" a{i}=\"\"")).collect();
    with_model(&format!("<robot name=\"r\"{many}/>"))
        .expect(2)
        .says(&["64"]);
    let long = format!("{}<!-- {} -->", ARM, "x".repeat(33 << 20));
    with_model(&long).expect(2).says(&["arm.urdf", "32"]);
}

#[test]
fn case_87_zero_residual_is_nothing_to_correct() {
    let folder = common::fitted_copy();
    let predicted = run(folder.path(), ["predict", "run.csv", "--twin", "twin"])
        .expect(0)
        .out;
    let nominal: Vec<Vec<&str>> = predicted
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let perfect = csv(400, &|number, mut row| {
        row[7] = nominal[number][2].into();
        row[8] = nominal[number][7].into();
        row
    });
    fs::write(folder.path().join("run.csv"), perfect).unwrap();
    let done = fit(folder.path(), &["-o", "out"]).expect(0);
    let answer = done.out.lines().next().unwrap();
    assert!(
        answer.starts_with("Yes, within limits: nothing to correct"),
        "{}",
        done.out
    );
    let text = fs::read_to_string(folder.path().join("out/result.json")).unwrap();
    let result: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(
        result["terms"]
            .as_array()
            .unwrap()
            .iter()
            .all(|term| term["pip"].as_f64().is_some_and(|pip| pip < 0.5))
    );
}

#[test]
fn case_88_more_candidates_than_rows_is_answered_or_refused() {
    let terms: Vec<String> = (1..=30).map(|k| format!("\"sin({k}*q1)*qd1^2\"")).collect();
    for rows in [20, 95, 130] {
        let folder = folder();
        let config = format!(
            "[signal]\ncutoff_hz = 0\n[library]\nterms = [{}]\n[inference]\ndraws = 200\n",
            terms.join(", ")
        );
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        fs::write(folder.path().join("run.csv"), csv(rows, &|_, row| row)).unwrap();
        let done = fit(
            folder.path(),
            &["-o", "out", "--allow", "disagreeing-chains"],
        );
        assert!(
            matches!(done.code, Some(0 | 3 | 4)),
            "{rows} rows: {:?}\n{}",
            done.code,
            done.err
        );
    }
}

#[test]
fn case_111_unknown_key() {
    let folder = folder();
    fs::write(folder.path().join("quick.toml"), "[signal]\ncutof_hz = 0\n").unwrap();
    let done = fit(folder.path(), &["-o", "out"]).expect(2);
    done.says(&[
        "quick.toml:2:1: unknown key `cutof_hz` in [signal]",
        "did you mean `cutoff_hz`?",
    ]);
}

#[test]
fn flags_override_their_keys() {
    let folder = folder();
    let config = format!(
        "{}[inference]\nseed = 5\n[output]\ndirectory = \"by-config\"\n",
        common::QUICK
    );
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    fit(folder.path(), &[]).expect(0);
    fit(folder.path(), &["-o", "by-flag", "--seed", "6"]).expect(0);
    for (output, seed) in [("by-config", 5), ("by-flag", 6)] {
        let text = fs::read_to_string(folder.path().join(output).join("result.json")).unwrap();
        let result: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(result["inference"]["seed"], seed);
    }
}

#[test]
fn predict_writes_one_row_per_input_row() {
    let folder = common::fitted_copy();
    let done = run(folder.path(), ["predict", "run.csv", "--twin", "twin"]).expect(0);
    let log = fs::read_to_string(folder.path().join("run.csv")).unwrap();
    assert_eq!(done.out.lines().count(), log.lines().count());
    let header = "t,shoulder.tau_meas,shoulder.tau_nom,shoulder.tau,shoulder.tau_low95,shoulder.tau_high95,elbow.tau_meas,\
                  elbow.tau_nom,elbow.tau,elbow.tau_low95,elbow.tau_high95,extrapolating";
    assert_eq!(done.out.lines().next().unwrap(), header);
    for (ours, given) in done.out.lines().zip(log.lines()).skip(1) {
        let (ours, given): (Vec<_>, Vec<_>) =
            (ours.split(',').collect(), given.split(',').collect());
        assert_eq!((ours[0], ours[1], ours[6]), (given[0], given[7], given[8]));
    }
}

#[test]
fn inspect_lists_joints_in_coordinate_order() {
    let folder = folder();
    for arguments in [
        vec!["inspect", "arm.urdf", "run.csv", "--json"],
        vec!["inspect", "run.csv", "--model", "arm.urdf", "--json"],
    ] {
        let done = run(folder.path(), arguments).expect(0);
        let result: serde_json::Value = serde_json::from_str(&done.out).unwrap();
        let names: Vec<_> = result["joints"]
            .as_array()
            .unwrap()
            .iter()
            .map(|j| j["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, ["shoulder", "elbow"]);
        assert_eq!(
            (&result["joints"][0]["type"], &result["joints"][0]["mimic"]),
            (&"revolute".into(), &serde_json::Value::Null)
        );
        assert_eq!(
            (
                result["links"].as_array().unwrap().len(),
                &result["logs"][0]["samples"]
            ),
            (3, &400.into())
        );
    }
}

#[test]
fn fit_prints_its_result_file_as_json() {
    let folder = folder();
    let done = fit(folder.path(), &["-o", "out", "--json"]).expect(0);
    assert_eq!(
        done.out,
        fs::read_to_string(folder.path().join("out/result.json")).unwrap()
    );
}

#[test]
fn schema_prints_the_published_files() {
    let folder = folder();
    for (words, file) in [
        (&["schema"][..], "twincal"),
        (&["schema", "limits"], "limits"),
        (&["schema", "design"], "design"),
    ] {
        let schemas = concat!(env!("CARGO_MANIFEST_DIR"), "/../../schema");
        let published = fs::read_to_string(format!("{schemas}/{file}.schema.json")).unwrap();
        assert_eq!(run(folder.path(), words).expect(0).out, published);
    }
}

/// A log without torque can be predicted, not fitted and not held out; `doctor` says so before.
#[test]
fn logs_without_torque_are_refused_by_name() {
    let folder = folder();
    let text = csv(400, &|_, row: Row| row);
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let kept: Vec<usize> = (0..header.len())
        .filter(|&i| !header[i].starts_with("tau"))
        .collect();
    assert!(kept.len() < header.len(), "{header:?}");
    let bare: Vec<String> = text
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let kept: Vec<&str> = kept.iter().map(|&i| cells[i]).collect();
            kept.join(",")
        })
        .collect();
    fs::write(folder.path().join("bare.csv"), bare.join("\n")).unwrap();
    let words = ["bare.csv", "has no torque of joint", "[columns] tau"];
    let fits: [&[&str]; 3] = [
        &["fit", "bare.csv", "--model", "arm.urdf", "-o", "out"],
        &[
            "fit", "run.csv", "bare.csv", "--model", "arm.urdf", "-o", "out",
        ],
        &[
            "fit",
            "run.csv",
            "--heldout",
            "bare.csv",
            "--model",
            "arm.urdf",
            "-o",
            "out",
        ],
    ];
    for line in fits {
        run(folder.path(), line).expect(2).says(&words);
        assert!(!folder.path().join("out").exists(), "{line:?}");
    }
    let look = run(folder.path(), ["doctor", "bare.csv", "--model", "arm.urdf"]);
    let look = look.expect(2);
    for words in ["fit would refuse", "has no torque of joint"] {
        assert!(look.out.contains(words), "{}", look.out);
    }
}

/// A held-out log that was fitted proves nothing; a copy is no experiment of its own.
#[test]
fn every_log_counts_once() {
    let folder = folder();
    fs::copy(
        folder.path().join("run.csv"),
        folder.path().join("copy.csv"),
    )
    .unwrap();
    let base = ["--model", "arm.urdf", "-o", "out"];
    let heldout = [&["fit", "run.csv", "--heldout", "copy.csv"][..], &base].concat();
    run(folder.path(), heldout)
        .expect(2)
        .says(&["`copy.csv` is fitted and held out", "does not see"]);
    let twice = [&["fit", "run.csv", "copy.csv"][..], &base].concat();
    run(folder.path(), twice)
        .expect(2)
        .says(&["`copy.csv` has the same bytes", "once"]);
    let all = [&["fit", "--model", "arm.urdf", "--heldout", "run.csv"][..]].concat();
    run(folder.path(), all)
        .expect(2)
        .says(&["no log to fit", "--heldout takes every path behind it"]);
}
