//! Terminal, page, result.json, `predict`, `export` and `diff` give one answer about one twin.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

mod common;

use common::{csv, fit, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What begins the sentence of each answer.
fn beginnings(answer: &str) -> &'static [&'static str] {
    match answer {
        "yes" => &["Yes, to predict torque"],
        "yes_within_limits" => &[
            "Yes",
            "The torque yes",
            "While joints move",
            "With care",
            "Better than",
            "Nothing to correct",
        ],
        "not_yet" => &["Not yet", "Hard to say", "Hardly", "Perhaps"],
        "no" => &["No:"],
        other => panic!("{other} is no answer"),
    }
}

/// Fits, and compares what every output says; the answer and its reason.
fn one_answer(folder: &Path, more: &[&str]) -> (String, String) {
    let done = fit(folder, &[more, &["-o", "out"]].concat());
    assert!(matches!(done.code, Some(0 | 3)), "{}", done.err);
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
    let headline = done.out.lines().next().unwrap().to_owned();
    let fits = beginnings(&answer)
        .iter()
        .any(|own| headline.starts_with(own));
    assert!(fits, "{answer}: {headline}");
    let page = fs::read_to_string(folder.join("out/report.html")).unwrap();
    let page = page.replace("&#x27;", "'").replace("<wbr>", "");
    assert!(page.contains(&headline), "{headline}");
    let doubtful = answer != "yes";
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
    (answer, reason)
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
