//! `check` and `predict` read new logs as the fit read its own: every key of `[columns]`, where nobody says otherwise.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::{QUICK, Run, csv, fit, folder, run, shell};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// Names, milliseconds and degrees of a recorder, and a torque with the other sign on the elbow.
const HEADER: &str = "stamp,pos_0,pos_1,vel_0,vel_1,acc_0,acc_1,load_0,load_1";
const COLUMNS: &str = "[columns]\ntime = \"stamp\"\ntime_unit = \"ms\"\nq = \"pos_*\"\nqd = \"vel_*\"\nqdd = \"acc_*\"\n\
                       tau = \"load_*\"\n[columns.factor]\nq = 0.017453292519943295\nqd = 0.017453292519943295\n\
                       qdd = 0.017453292519943295\ntau = { elbow = -1.0 }\n";

/// A log with another header; each number `times` its factor.
fn log(header: &str, times: [f64; 9]) -> String {
    let text = csv(400, &|_, row| {
        let cells = row.iter().zip(times);
        cells
            .map(|(cell, by)| (cell.parse::<f64>().unwrap() * by).to_string())
            .collect()
    });
    let (_, rows) = text.split_once('\n').unwrap();
    format!("{header}\n{rows}")
}

fn recorder() -> [f64; 9] {
    let degrees = 1f64.to_degrees();
    let mut times = [degrees; 9];
    (times[0], times[7], times[8]) = (1e3, 1.0, -1.0);
    times
}

/// A folder with a twin of the recorder's log in `twin`, made once; tests add logs of their own names.
fn place() -> &'static Path {
    static PLACE: OnceLock<TempDir> = OnceLock::new();
    let place = PLACE.get_or_init(|| {
        let folder = folder();
        let path = folder.path();
        fs::write(path.join("run.csv"), log(HEADER, recorder())).unwrap();
        fs::write(path.join("quick.toml"), format!("{QUICK}{COLUMNS}")).unwrap();
        fit(path, &["-o", "twin"]).expect(0);
        folder
    });
    place.path()
}

fn check(log: &str, more: &[&str], code: i32) -> (Run, Vec<Value>) {
    let line = ["check", log, "--twin", "twin", "--json"];
    let done = run(place(), line.iter().chain(more)).expect(code);
    // An error has none.
    let json: Value = serde_json::from_str(&done.out).unwrap();
    let findings = json["findings"].as_array().cloned();
    (done, findings.unwrap_or_default())
}

/// Messages of one code.
fn said(findings: &[Value], code: &str) -> Vec<String> {
    let of = findings.iter().filter(|finding| finding["code"] == code);
    of.map(|finding| finding["message"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn a_log_of_the_same_recorder_needs_no_config() {
    // 3: it was fitted.
    let (_, findings) = check("run.csv", &[], 0);
    let kept = said(&findings, "columns_as_fitted");
    assert!(
        kept[0].contains("[columns] q, qd, qdd, tau, time, time_unit as"),
        "{kept:?}"
    );
    let factors = said(&findings, "factor_as_fitted");
    for words in ["q of shoulder, elbow by 0.0174532", "tau of elbow by -1"] {
        assert!(factors[0].contains(words), "{factors:?}");
    }
    for code in ["factor_in_doubt", "columns_not_as_fitted"] {
        assert_eq!(said(&findings, code), [""; 0]);
    }
    // torque as measured, with the sign of the model
    let rows = run(place(), ["predict", "run.csv", "--twin", "twin"])
        .expect(0)
        .out;
    let (head, first) = rows.split_once('\n').unwrap();
    let at = head
        .split(',')
        .position(|name| name == "elbow.tau_meas")
        .unwrap();
    let number = |line: &str, at: usize| line.split(',').nth(at).unwrap().parse::<f64>().unwrap();
    let logged = log(HEADER, recorder());
    let logged = number(logged.lines().nth(1).unwrap(), 8);
    assert!(
        (number(first.lines().next().unwrap(), at) + logged).abs() < 1e-9,
        "{first:.80}"
    );
    // A log that is only to be predicted has no torque.
    let text = log(HEADER, recorder()).replacen("load_0,load_1", "none_0,none_1", 1);
    fs::write(place().join("motion.csv"), text).unwrap();
    run(
        place(),
        [
            "predict",
            "motion.csv",
            "--twin",
            "twin",
            "-o",
            "motion_out.csv",
        ],
    )
    .expect(0);
}

#[test]
fn a_pipe_is_refused_with_the_remedy() {
    let words = [
        "is a pipe, not a file",
        "write what comes through it into a file, and give that file",
    ];
    let line = "\"$TWINCAL\" check <(cat run.csv) --twin twin";
    shell(place(), line).expect(2).says(&words);
    // One with a name is not waited for, though nobody writes.
    let line = "mkfifo named; timeout 60 \"$TWINCAL\" check named --twin twin";
    shell(place(), line).expect(2).says(&words);
    let line =
        "cat run.csv | \"$TWINCAL\" fit /dev/stdin --model arm.urdf --config quick.toml -o piped";
    shell(place(), line).expect(2).says(&words);
    assert!(!place().join("piped").exists());
}

#[test]
fn usual_names_are_taken_and_told_where_the_log_has_those() {
    let usual = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2";
    let mut times = recorder();
    times[0] = 1.0;
    fs::write(place().join("usual.csv"), log(usual, times)).unwrap();
    let (_, findings) = check("usual.csv", &[], 0);
    let told = said(&findings, "columns_not_as_fitted");
    assert!(
        told[0].contains("the log does not have the columns"),
        "{told:?}"
    );
    assert!(
        told[0].contains("[columns] q, qd, qdd, tau, time named"),
        "{told:?}"
    );
    assert_eq!(said(&findings, "columns_as_fitted"), [""; 0]);
    // neither names: the error is about those of the fit
    fs::write(
        place().join("odd.csv"),
        log(&HEADER.replace("pos", "angle"), recorder()),
    )
    .unwrap();
    let words = [
        "[columns] q = \"pos_*\"",
        "[columns] is that of the fit's logs",
        "--config",
    ];
    check("odd.csv", &[], 2).0.says(&words);
}

#[test]
fn what_a_config_says_wins_key_by_key() {
    // Only the positions have another name, and the elbow's torque its usual sign.
    let mut times = recorder();
    times[8] = 1.0;
    fs::write(
        place().join("own.csv"),
        log(&HEADER.replace("pos", "angle"), times),
    )
    .unwrap();
    let own = "[columns]\nq = \"angle_*\"\n[columns.factor]\ntau = { elbow = 1.0 }\n";
    fs::write(place().join("own.toml"), own).unwrap();
    let (_, findings) = check("own.csv", &["--config", "own.toml"], 0);
    let kept = said(&findings, "columns_as_fitted");
    assert!(
        kept[0].contains("[columns] qd, qdd, tau, time, time_unit as"),
        "{kept:?}"
    );
    let factors = said(&findings, "factor_as_fitted");
    assert!(
        factors[0].contains("q of shoulder, elbow") && !factors[0].contains("tau"),
        "{factors:?}"
    );
}

#[test]
fn a_factor_that_cannot_be_this_logs_is_doubted() {
    // Radians already: with the fit's factor the motion is 57 times smaller.
    let mut times = [1.0; 9];
    (times[0], times[8]) = (1e3, -1.0);
    fs::write(place().join("radians.csv"), log(HEADER, times)).unwrap();
    let (_, findings) = check("radians.csv", &[], 1);
    let doubts = said(&findings, "factor_in_doubt");
    assert_eq!(doubts.len(), 2, "{findings:?}");
    let subjects = findings
        .iter()
        .filter(|own| own["code"] == "factor_in_doubt");
    assert!(subjects.clone().all(|own| own["subject"] == "radians.csv"));
    for words in [
        "joint `elbow`",
        "0.017 of the 1.20",
        "q = { elbow = 1.0 }",
        "--config",
    ] {
        assert!(doubts[1].contains(words), "{words}: {doubts:?}");
    }
    // The remedy fixes it.
    let own = "[columns.factor]\nq = 1.0\nqd = 1.0\nqdd = 1.0\n";
    fs::write(place().join("radians.toml"), own).unwrap();
    let (_, findings) = check("radians.csv", &["--config", "radians.toml"], 0);
    assert_eq!(said(&findings, "factor_in_doubt"), [""; 0]);
    // A joint that stands still says nothing of units.
    let mut times = recorder();
    (1..7).step_by(2).for_each(|column| times[column] = 0.0);
    fs::write(place().join("still.csv"), log(HEADER, times)).unwrap();
    let line = [
        "predict",
        "still.csv",
        "--twin",
        "twin",
        "-o",
        "still_out.csv",
    ];
    let done = run(place(), line).expect(0);
    assert!(!(done.out + &done.err).contains("moves over"));
}
