//! Terminal, page, result.json, `predict`, `export` and `diff` give one answer about one twin.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::{csv, fit, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What begins the sentence of each answer.
fn beginning(answer: &str) -> &'static str {
    match answer {
        "yes" => "Yes, to predict torque",
        "yes_within_limits" => "Yes, within limits: ",
        "not_yet" => "Not yet: ",
        "no" => "No: ",
        other => panic!("{other} is no answer"),
    }
}

/// Fits, and compares what every output says; the answer and its reason.
fn one_answer(folder: &Path, more: &[&str]) -> (String, String) {
    let done = fit(folder, &[more, &["-o", "out"]].concat());
    let text = fs::read_to_string(folder.join("out/result.json")).unwrap();
    let result: Value = serde_json::from_str(&text).unwrap();
    let assessment = &result["assessment"];
    let text = |key: &str| assessment[key].as_str().unwrap().to_owned();
    let (answer, reason) = (text("answer"), text("reason"));
    let claims = assessment["claims"].as_array().unwrap();
    assert!(
        reason == "passed" || claims[0]["code"] == reason.as_str(),
        "{reason} is claimed first: {claims:?}"
    );
    let lost = result["findings"].as_array().unwrap().iter();
    let lost = lost
        .clone()
        .any(|finding| finding["severity"] == "degraded");
    let expected = match answer.starts_with("yes") && !lost {
        true => 0,
        false => 3,
    };
    assert_eq!(done.code, Some(expected), "{answer}: {}", done.err);
    let headline = done.out.lines().next().unwrap().to_owned();
    let begins = headline.starts_with(beginning(&answer));
    assert!(begins, "{answer}: {headline}");
    let page = fs::read_to_string(folder.join("out/report.html")).unwrap();
    let page = page.replace("&#x27;", "'").replace("<wbr>", "");
    assert!(page.contains(&headline), "{headline}");
    doubt_is_said(folder, answer != "yes");
    check_follows_its_answer(folder);
    (answer, reason)
}

/// `predict`, `export` and `diff` ask whether a doubtful twin can be used, and only of such a one.
fn doubt_is_said(folder: &Path, doubtful: bool) {
    let commands: [&[&str]; 3] = [
        &["predict", "--twin", "out", "run.csv", "-o", "torque.csv"],
        &[
            "export",
            "--twin",
            "out",
            "--to",
            "csv",
            "-o",
            "effects.csv",
        ],
        &["diff", "out", "out"],
    ];
    for command in commands {
        let said = run(folder, command);
        assert!(
            matches!(said.code, Some(0 | 3)),
            "{command:?}: {}",
            said.err
        );
        let doubt = format!("{} {}", said.out, said.err);
        let doubt = doubt.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(
            doubt.contains("can this twin be used?"),
            doubtful,
            "{command:?}: {}",
            said.err
        );
    }
}

/// `check` of the fitted log: its exit code is that of its own answer.
fn check_follows_its_answer(folder: &Path) {
    let checked = run(folder, ["check", "run.csv", "--twin", "out", "--json"]);
    let told: Value = serde_json::from_str(&checked.out).unwrap();
    if !told["error"].is_null() {
        // A twin that was never tested has nothing to compare with.
        assert_eq!(checked.code, Some(2), "{told}");
        assert!(told.to_string().contains("was never tested"), "{told}");
        return;
    }
    let lost = told["findings"].as_array().unwrap().iter();
    let lost = lost
        .clone()
        .any(|finding| finding["severity"] == "degraded");
    let code = match told["assessment"]["answer"].as_str().unwrap() {
        "yes" | "yes_within_limits" if !lost => 0,
        "no" => 1,
        _ => 3,
    };
    assert_eq!(checked.code, Some(code), "{told}");
    assert_eq!(told["passed"], told["verdict"] == "passed");
    verdict_is_the_answer(folder, "run.csv");
}

/// The first line of `check` and its verdict are those of its answer, which is returned.
fn verdict_is_the_answer(folder: &Path, log: &str) -> String {
    let [text, json] = [&[][..], &["--json"]].map(|more| {
        let command = ["check", log, "--twin", "out"];
        run(folder, [&command[..], more].concat())
    });
    let told: Value = serde_json::from_str(&json.out).unwrap();
    let answer = told["assessment"]["answer"].as_str().unwrap();
    let verdict = match answer {
        "yes" | "yes_within_limits" => "passed",
        "no" => "failed",
        _ => "inconclusive",
    };
    assert_eq!(told["verdict"], verdict);
    assert_eq!(text.out.lines().next(), Some(verdict), "{}", text.out);
    answer.to_owned()
}

/// An encoder that is stuck for a second: the gates hold on the other rows, but the log is none that a verdict rests on.
#[test]
fn a_check_of_a_log_with_a_mistake_is_inconclusive() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(2000, &|_, row| row)).unwrap();
    fit(folder.path(), &["-o", "out"]);
    let held = std::cell::RefCell::new(String::new());
    let stuck = csv(2000, &|k, mut row| {
        match k {
            700 => *held.borrow_mut() = row[1].clone(),
            701..800 => row[1] = held.borrow().clone(),
            _ => (),
        }
        row
    });
    fs::write(folder.path().join("stuck.csv"), stuck).unwrap();
    let answer = verdict_is_the_answer(folder.path(), "stuck.csv");
    assert_eq!(answer, "not_yet");
}

/// Torque columns that measure nothing are no change of the robot, whatever the gates say of them.
#[test]
fn a_check_of_a_log_without_a_measurement_is_inconclusive() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(2000, &|_, row| row)).unwrap();
    fit(folder.path(), &["-o", "out"]);
    let dead = csv(2000, &|_, mut row| {
        row[7] = "0".into();
        row
    });
    let copied = csv(2000, &|_, mut row| {
        row[7] = row[8].clone();
        row
    });
    for (name, text, code) in [
        ("dead.csv", dead, "torque_constant"),
        ("copied.csv", copied, "torque_copied"),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
        assert_eq!(verdict_is_the_answer(folder.path(), name), "not_yet");
        let json = run(folder.path(), ["check", name, "--twin", "out", "--json"]);
        let told: Value = serde_json::from_str(&json.out).unwrap();
        assert_eq!(told["assessment"]["reason"], code, "{told}");
        assert_eq!(json.code, Some(3));
    }
    let done = fit(folder.path(), &["-o", "again", "dead.csv"]);
    assert!(done.out.starts_with("Not yet"), "{}", done.out);
}

/// A folder with a twin of `run.csv`, and these logs.
fn with_logs<const N: usize>(logs: [(&str, String); N]) -> tempfile::TempDir {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(2000, &|_, row| row)).expect("a file");
    fit(folder.path(), &["-o", "out"]);
    for (name, text) in logs {
        fs::write(folder.path().join(name), text).expect("a file");
    }
    folder
}

/// The reason of the answer of `check` to a log, what it is about, and how many changes are seen.
fn checked(folder: &Path, log: &str, exit_code: i32) -> (String, String, usize) {
    let json = run(folder, ["check", log, "--twin", "out", "--json"]);
    assert_eq!(json.code, Some(exit_code), "{log}: {}", json.out);
    let said: Value = serde_json::from_str(&json.out).expect("JSON");
    let text = |at: &str| said.pointer(at).and_then(Value::as_str).map(str::to_owned);
    let changes = said["changes"].as_array().expect("changes").iter();
    let changed = changes.filter(|change| change["changed"] == true).count();
    let reason = text("/assessment/reason").expect("a reason");
    let subject = text("/assessment/claims/0/subject/name").expect("a name");
    (reason, subject, changed)
}

/// Columns of torque that are turned, exchanged or late are no change of the robot.
#[test]
fn a_check_of_a_misread_log_is_inconclusive() {
    let turned = |columns: &'static [usize]| {
        csv(2000, &|_, mut row| {
            let turn = |cell: &String| (-cell.parse::<f64>().unwrap()).to_string();
            columns.iter().for_each(|&at| row[at] = turn(&row[at]));
            row
        })
    };
    let exchanged = csv(2000, &|_, mut row| {
        row.swap(7, 8);
        row
    });
    // Three rows of 20 ms.
    let before = std::cell::RefCell::new(std::collections::VecDeque::new());
    let late = csv(2000, &|_, mut row| {
        let mut before = before.borrow_mut();
        before.push_back(row[7..].to_vec());
        let own = match before.len() > 3 {
            true => before.pop_front(),
            false => None,
        };
        row.splice(7.., own.unwrap_or_else(|| before[0].clone()));
        row
    });
    let folder = with_logs([
        ("turned.csv", turned(&[7, 8])),
        ("elbow.csv", turned(&[8])),
        ("order.csv", exchanged),
        ("late.csv", late),
    ]);
    for (log, code, subject) in [
        ("turned.csv", "sign_flip", "turned.csv"),
        ("elbow.csv", "sign_flip", "elbow"),
        ("order.csv", "joint_order", "order.csv"),
        ("late.csv", "log_torque_lag", "late.csv"),
    ] {
        assert_eq!(
            verdict_is_the_answer(folder.path(), log),
            "not_yet",
            "{log}"
        );
        let found = checked(folder.path(), log, 3);
        assert_eq!(found, (code.to_owned(), subject.to_owned(), 0), "{log}");
    }
}

/// More viscous friction of the elbow is a change of the robot.
#[test]
fn a_check_of_a_robot_with_more_friction_fails() {
    let friction = csv(2000, &|_, mut row| {
        let number = |at: usize| row[at].parse::<f64>().unwrap();
        row[8] = (number(8) + 0.1 * number(4)).to_string();
        row
    });
    let turned = csv(2000, &|_, mut row| {
        for torque in &mut row[7..9] {
            *torque = (-torque.parse::<f64>().unwrap()).to_string();
        }
        row
    });
    let folder = with_logs([("rough.csv", friction), ("turned.csv", turned)]);
    assert_eq!(verdict_is_the_answer(folder.path(), "rough.csv"), "no");
    let (reason, subject, changed) = checked(folder.path(), "rough.csv", 1);
    assert_eq!(
        (reason.as_str(), subject.as_str()),
        ("error_above_gate", "elbow")
    );
    assert_eq!(changed, 1);
    // A log that is none of this robot's torque beside it excuses nothing, and counts in no score.
    let line = [
        "check",
        "turned.csv",
        "rough.csv",
        "--twin",
        "out",
        "--json",
    ];
    let both: Value = serde_json::from_str(&run(folder.path(), line).expect(1).out).expect("JSON");
    let alone = run(
        folder.path(),
        ["check", "rough.csv", "--twin", "out", "--json"],
    )
    .expect(1);
    let alone: Value = serde_json::from_str(&alone.out).expect("JSON");
    assert_eq!(both["gates"], alone["gates"]);
    let text = run(folder.path(), &line[..5]).expect(1);
    assert!(
        text.out
            .contains("Left out of all that follows: turned.csv"),
        "{}",
        text.out
    );
}

#[test]
fn a_good_twin() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(2000, &|_, row| row)).unwrap();
    let (answer, _) = one_answer(folder.path(), &[]);
    assert!(answer.starts_with("yes"), "{answer}");
}

#[test]
fn torque_of_the_opposite_sign() {
    let folder = folder();
    let turned = csv(2000, &|_, mut row| {
        for torque in &mut row[7..9] {
            *torque = (-torque.parse::<f64>().unwrap()).to_string();
        }
        row
    });
    fs::write(folder.path().join("run.csv"), turned).unwrap();
    let (answer, _) = one_answer(folder.path(), &[]);
    assert_eq!(answer, "not_yet");
}

#[test]
fn too_few_rows() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(60, &|_, row| row)).unwrap();
    let (answer, reason) = one_answer(folder.path(), &[]);
    assert_eq!(answer, "not_yet");
    assert!(
        ["not_tested", "few_held_out_rows"].contains(&reason.as_str()),
        "{reason}"
    );
}

#[test]
fn names_that_are_long_run_from_right_to_left_or_look_like_markup() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(2000, &|_, row| row)).unwrap();
    let model = fs::read_to_string(folder.path().join("arm.urdf")).unwrap();
    let joints = ["shoulder", "elbow"];
    let names = [
        "\u{5de}\u{5e4}\u{5e8}\u{5e7}&lt;b&gt;".to_owned(),
        "n".repeat(200),
    ];
    let renamed = joints
        .iter()
        .zip(&names)
        .fold(model.clone(), |text, (joint, name)| {
            text.replace(
                &format!("joint name=\"{joint}\""),
                &format!("joint name=\"{name}\""),
            )
        });
    assert_ne!(renamed, model, "the model's joints are renamed");
    fs::write(folder.path().join("arm.urdf"), renamed).unwrap();
    let (answer, _) = one_answer(folder.path(), &[]);
    assert!(answer.starts_with("yes"), "{answer}");
}

#[test]
fn a_held_out_log_that_the_twin_predicts_worse_than_the_model() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), csv(2000, &|_, row| row)).unwrap();
    // The elbow's friction and gravity act the other way round.
    let other = csv(1000, &|_, mut row| {
        let number = |k: usize, row: &[String]| row[k].parse::<f64>().unwrap();
        let (v1, v2, q2) = (number(3, &row), number(4, &row), number(2, &row));
        row[7] = (number(7, &row) - 0.8 * v1).to_string();
        row[8] = (number(8, &row) - 0.4 * v2 + 1.8 * q2.cos()).to_string();
        row
    });
    fs::write(folder.path().join("other.csv"), other).unwrap();
    let (answer, _) = one_answer(folder.path(), &["--heldout", "other.csv"]);
    assert!(["no", "not_yet"].contains(&answer.as_str()), "{answer}");
}
