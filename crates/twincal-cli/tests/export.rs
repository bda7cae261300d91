//! `twincal export` on a small exact twin: what is written, refused, and left alone.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

mod common;

use common::{ARM, files, fitted, fitted_copy, run};
use std::fs;

fn export<'a>(more: &[&'a str]) -> Vec<&'a str> {
    ["export", "--twin", "twin"]
        .iter()
        .chain(more)
        .copied()
        .collect()
}

/// True friction 0.4 and 0.2 N·m·s/rad goes into the file; the potential stays beside it. Nothing else changes.
#[test]
fn friction_is_written_and_the_rest_is_named() {
    let folder = fitted_copy();
    let done = run(folder.path(), export(&["--to", "urdf", "-o", "new.urdf"])).expect(0);
    let words: Vec<&str> = done.out.split_whitespace().collect();
    let words = words.join(" ");
    assert!(words.contains("a URDF cannot hold energy terms"), "{words}");
    assert!(
        done.out.lines().all(|line| line.chars().count() <= 80),
        "{}",
        done.out
    );
    let text = fs::read_to_string(folder.path().join("new.urdf")).unwrap();
    let mut damping = Vec::new();
    let mut rest = text.clone();
    while let Some(at) = rest.find("\n    <dynamics damping=\"") {
        let line = rest[at + 1..].lines().next().unwrap().to_owned();
        damping.push(line.split('"').nth(1).unwrap().parse::<f64>().unwrap());
        rest = rest.replacen(&format!("\n{line}"), "", 1);
    }
    assert_eq!(damping.len(), 2);
    assert!(
        (damping[0] - 0.4).abs() < 0.02 && (damping[1] - 0.2).abs() < 0.02,
        "{damping:?}"
    );
    assert_eq!(
        rest.replace(char::is_whitespace, ""),
        ARM.replace(char::is_whitespace, "")
    );
    // To standard output: the same bytes and nothing else.
    let shown = run(folder.path(), export(&["--to", "urdf"])).expect(0);
    assert_eq!(shown.out, text);
}

#[test]
fn the_model_comes_from_the_twin_and_not_from_where_it_was() {
    let folder = fitted_copy();
    fs::remove_file(folder.path().join("arm.urdf")).unwrap();
    run(folder.path(), export(&["--to", "urdf", "-o", "new.urdf"])).expect(0);
    fs::remove_file(folder.path().join("twin/model.urdf")).unwrap();
    let done = run(folder.path(), export(&["--to", "urdf", "-o", "other.urdf"])).expect(2);
    done.says(&["model.urdf", "fit"]);
    assert!(!folder.path().join("other.urdf").exists());
}

#[test]
fn outputs_are_never_overwritten_without_force() {
    let folder = fitted_copy();
    let arguments = export(&["--to", "c", "-o", "arm.c"]);
    run(folder.path(), arguments.clone()).expect(0);
    run(folder.path(), arguments.clone())
        .expect(2)
        .says(&["exists already", "--force"]);
    run(folder.path(), arguments.iter().copied().chain(["--force"])).expect(0);
    let draws = export(&["--to", "urdf", "--draws", "3", "-o", "models"]);
    run(folder.path(), draws.clone()).expect(0);
    let written = files(&folder.path().join("models"));
    let names: Vec<_> = written
        .iter()
        .map(|path| path.to_string_lossy().into_owned())
        .collect();
    assert_eq!(
        names,
        ["draw0.urdf", "draw1.urdf", "draw2.urdf", "manifest.json"]
    );
    let first = fs::read(folder.path().join("models/draw1.urdf")).unwrap();
    run(folder.path(), draws.clone())
        .expect(2)
        .says(&["exists already"]);
    run(
        folder.path(),
        draws.iter().copied().chain(["--force", "--seed", "1"]),
    )
    .expect(0);
    assert_eq!(
        fs::read(folder.path().join("models/draw1.urdf")).unwrap(),
        first
    );
    run(
        folder.path(),
        draws.iter().copied().chain(["--force", "--seed", "2"]),
    )
    .expect(0);
    assert_ne!(
        fs::read(folder.path().join("models/draw1.urdf")).unwrap(),
        first
    );
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let folder = fitted();
    for (arguments, words) in [
        (vec!["--to", "urdf", "--draws", "2"], "-o"),
        (vec!["--to", "urdf", "--json"], "-o"),
        (vec!["--to", "c", "--draws", "2", "-o", "x"], "model files"),
        (
            vec!["--to", "urdf", "--beyond", "urdf", "-o", "x"],
            "--to c",
        ),
        (vec!["--to", "urdf", "--draws", "0", "-o", "x"], "--draws 0"),
        (vec!["--to", "mjcf", "-o", "x"], "not of that kind"),
        (vec!["--to", "urfd", "-o", "x"], "urdf"),
    ] {
        run(folder, export(&arguments)).expect(2).says(&[words]);
        assert!(!folder.join("x").exists());
    }
}

#[test]
fn json_says_what_was_written() {
    let folder = fitted_copy();
    let done = run(
        folder.path(),
        export(&["--to", "urdf", "-o", "new.urdf", "--json"]),
    )
    .expect(0);
    let told: serde_json::Value = serde_json::from_str(&done.out).unwrap();
    assert_eq!(told["schema"], 1);
    assert_eq!(told["output"], "new.urdf");
    assert_eq!(told["joints"].as_array().unwrap().len(), 2);
    assert_eq!(told["written"].as_array().unwrap().len(), 2);
    assert_eq!(told["residual"][0]["component"], "sin(q2)");
}
