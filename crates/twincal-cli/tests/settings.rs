//! Which settings hold: `./twincal.toml` is read without being asked for, that is said, and result.json says which file it was.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{QUICK, fitted_copy, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use twincal_io::artifact::sha256;

const SAID: &str = "settings are read from ./twincal.toml; --no-config leaves it out";

/// A folder whose `twincal.toml` has the quick settings, the model and the log.
fn with_config() -> (TempDir, String) {
    let folder = folder();
    let text = format!("model = {{ file = \"arm.urdf\" }}\n{QUICK}\n[[log]]\nfile = \"run.csv\"\n");
    fs::write(folder.path().join("twincal.toml"), &text).unwrap();
    (folder, text)
}

fn result(folder: &Path, output: &str) -> Value {
    let text = fs::read_to_string(folder.join(output).join("result.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn the_config_that_lies_there_is_read_and_named_with_its_hash() {
    let (folder, text) = with_config();
    let fit = |more: &[&str]| run(folder.path(), ["fit"].iter().chain(more));
    fit(&["-o", "found"]).expect(0).says(&[SAID]);
    let config = &result(folder.path(), "found")["config"];
    assert_eq!(config["path"], "twincal.toml");
    assert_eq!(config["sha256"], sha256(text.as_bytes()));
    // The same as if it were asked for, byte for byte.
    let asked = fit(&["--config", "twincal.toml", "-o", "asked"]).expect(0);
    assert!(!asked.err.contains(SAID), "{}", asked.err);
    let bytes = |output: &str| fs::read(folder.path().join(output).join("result.json")).unwrap();
    assert_eq!(bytes("found"), bytes("asked"));
    // By an absolute path it has no folder in the result.
    let path = folder.path().join("twincal.toml").display().to_string();
    fit(&["--config", &path, "-o", "absolute"]).expect(0);
    assert_eq!(bytes("found"), bytes("absolute"));
    // A report that is written anew says the same.
    run(folder.path(), ["report", "--twin", "found", "--force"]).expect(0);
    assert_eq!(bytes("found"), bytes("asked"));
}

#[test]
fn no_config_leaves_it_out() {
    let (folder, _) = with_config();
    let base = ["fit", "run.csv", "--model", "arm.urdf"];
    let fit = |more: &[&str]| run(folder.path(), base.iter().chain(more));
    let quick = fit(&["--no-config", "--config", "quick.toml", "-o", "out"]);
    quick.expect(2).says(&["--no-config", "--config"]);
    run(folder.path(), ["fit", "--no-config"])
        .expect(2)
        .says(&["no log to fit"]);
    let done = run(
        folder.path(),
        ["inspect", "arm.urdf", "run.csv", "--no-config", "--json"],
    );
    assert!(!done.err.contains(SAID), "{}", done.err);
    // Settings from flags alone have no file.
    fit(&["--config", "quick.toml", "-o", "quick"]).expect(0);
    let config = &result(folder.path(), "quick")["config"];
    assert_eq!(config["path"], "quick.toml");
}

#[test]
fn a_broken_config_that_lies_there_is_an_error_at_its_place() {
    let folder = fitted_copy();
    fs::write(folder.path().join("twincal.toml"), "[signal]\ncutof = 3\n").unwrap();
    for verb in ["fit", "doctor", "inspect"] {
        run(folder.path(), [verb, "run.csv", "--model", "arm.urdf"])
            .expect(2)
            .says(&[SAID, "twincal.toml:2:1", "unknown key `cutof`"]);
    }
    // A twin has its own settings, and init may be about to write the file.
    common::write_later(folder.path());
    run(folder.path(), ["check", "later.csv", "--twin", "twin"]).expect(0);
    let init = ["init", "run.csv", "--model", "arm.urdf", "-o", "own.toml"];
    let done = run(folder.path(), init);
    assert_eq!(done.code, Some(0), "{}", done.err);
    done.says(&["./twincal.toml is not read"]);
}

#[test]
fn inspect_takes_a_model_for_a_model_beside_a_config() {
    let (folder, _) = with_config();
    let arm = fs::read_to_string(folder.path().join("arm.urdf")).unwrap();
    fs::write(
        folder.path().join("other.urdf"),
        arm.replace("shoulder", "base_yaw"),
    )
    .unwrap();
    let joints = |arguments: &[&str]| {
        let done = run(folder.path(), ["inspect", "--json"].iter().chain(arguments));
        let seen: Value =
            serde_json::from_str(&done.out).unwrap_or_else(|e| panic!("{e}: {}", done.err));
        (
            seen["joints"][0]["name"].as_str().unwrap().to_owned(),
            seen["logs"].as_array().unwrap().len(),
        )
    };
    assert_eq!(joints(&["other.urdf"]), ("base_yaw".into(), 0));
    assert_eq!(joints(&["run.csv"]), ("shoulder".into(), 1));
    // Without paths those of the config.
    assert_eq!(joints(&[]), ("shoulder".into(), 1));
    assert_eq!(
        joints(&["other.urdf", "--no-config"]),
        ("base_yaw".into(), 0)
    );
}
