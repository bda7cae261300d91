//! `twincal diff` on simulated arms of which one was changed by a known number.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{Run, csv, fit, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

/// Fits the log of an arm whose torque `change(q2, qd)` adds to, into `twin`.
fn twin(folder: &Path, twin: &str, config: &str, change: &dyn Fn(f64, [f64; 2]) -> [f64; 2]) {
    let log = csv(400, &|_, mut row| {
        let more = change(number(&row[2]), [number(&row[3]), number(&row[4])]);
        for (cell, more) in row[7..9].iter_mut().zip(more) {
            *cell = (number(cell) + more).to_string();
        }
        row
    });
    fs::write(folder.join("run.csv"), log).unwrap();
    fs::write(folder.join("quick.toml"), config).unwrap();
    fit(folder, &["-o", twin]).expect(0);
}

fn diff(folder: &Path, before: &str, after: &str) -> (Run, Value) {
    let words = run(folder, ["diff", before, after]).expect(0);
    let wide = words.out.lines().find(|line| line.chars().count() > 80);
    assert_eq!(wide, None, "{}", words.out);
    let json = run(folder, ["diff", before, after, "--json"]).expect(0);
    (words, serde_json::from_str(&json.out).unwrap())
}

fn component<'a>(json: &'a Value, name: &str) -> &'a Value {
    let mut all = json["components"].as_array().unwrap().iter();
    all.find(|c| c["name"] == name).unwrap()
}

/// The elbow's viscous friction grows from 0.2 to 0.5 N·m·s/rad, the potential 0.9 sin(q2) goes. Six sd either way: false alarm below 1e-8,
/// the noise's seed is fixed.
#[test]
fn each_change_is_told_with_both_values_and_the_difference() {
    let folder = folder();
    twin(folder.path(), "before", common::QUICK, &|_, _| [0.0, 0.0]);
    twin(folder.path(), "after", common::QUICK, &|q2, qd| {
        [0.0, 0.9 * q2.cos() + 0.3 * qd[1]]
    });
    let (words, json) = diff(folder.path(), "before", "after");
    for line in [
        "  gone: gravity-like potential sin(q2) (PIP >0.999 → ",
        "  changed: viscous friction on elbow (PIP >0.999 → >0.999)\n    +0.",
        " N·m·s/rad, difference +0.",
        "  1 component as before (--json has the numbers)\n  values: medians over all models",
    ] {
        assert!(
            words.out.contains(line),
            "{line:?} is missing in:\n{}",
            words.out
        );
    }
    assert!(!words.out.contains("shoulder"), "{}", words.out);
    let elbow = component(&json, "elbow.viscous");
    assert_eq!(
        (&elbow["became"], &elbow["comparable"]),
        (&"changed".into(), &true.into())
    );
    let value = &elbow["parameters"][0];
    let sd = value["sd"].as_f64().unwrap();
    for (found, truth) in [
        (&value["before"]["median"], 0.2),
        (&value["after"]["median"], 0.5),
        (&value["difference"], 0.3),
    ] {
        let found = found.as_f64().unwrap();
        assert!((found - truth).abs() < 6.0 * sd && sd < 0.01, "{value}");
    }
    let low = value["before"]["interval95"][0].as_f64().unwrap();
    assert!(low < 0.2 && low > 0.19, "{value}");
    // JSON has what is as before, too.
    assert_eq!(component(&json, "shoulder.viscous")["became"], "as_before");

    let (words, json) = diff(folder.path(), "after", "before");
    assert!(
        words
            .out
            .contains("  new: gravity-like potential sin(q2) (PIP "),
        "{}",
        words.out
    );
    assert!(words.out.contains("difference -0."), "{}", words.out);
    assert_eq!(component(&json, "sin(q2)")["became"], "new");

    let (words, _) = diff(folder.path(), "before", "before");
    let nothing = "  nothing that these logs can tell\n  3 components as before";
    assert!(words.out.contains(nothing), "{}", words.out);
    assert!(!words.out.contains("medians"), "{}", words.out);
}

/// A potential of a few standard errors is neither in nor out: beside none it is perhaps new or gone, beside a clear one it changed.
#[test]
fn what_one_twin_leaves_open_is_perhaps() {
    let folder = folder();
    let potential = |size: f64| move |q2: f64, _: [f64; 2]| [0.0, (0.9 - size) * q2.cos()];
    for (name, size) in [("none", 0.0), ("weak", WEAK), ("clear", 0.9)] {
        twin(folder.path(), name, common::QUICK, &potential(size));
    }
    for (before, after, mark, word) in [
        ("weak", "none", "perhaps gone", "perhaps_gone"),
        ("none", "weak", "perhaps new", "perhaps_new"),
        ("clear", "weak", "changed", "changed"),
    ] {
        let (words, json) = diff(folder.path(), before, after);
        let line = format!("  {mark}: gravity-like potential sin(q2) (PIP ");
        assert!(words.out.contains(&line), "{}", words.out);
        let own = component(&json, "sin(q2)");
        assert_eq!(own["became"], word);
        let status = &own["status"][usize::from(after == "weak")];
        assert_eq!(status, "tentative", "{own}");
    }
}

/// Potential that these 400 rows leave open, N·m: 3.4 standard errors, as the noise of the log takes 0.001 of it away.
const WEAK: f64 = 0.007;

/// Friction of two shapes: the same torque has other numbers, which stand last, under a heading.
#[test]
fn friction_of_another_shape_stands_apart() {
    let folder = folder();
    let dry = |_: f64, [v1, v2]: [f64; 2]| [0.8 * (v1 / 0.05).tanh(), 0.5 * (v2 / 0.05).tanh()];
    let config = |velocity: f64| {
        let more = format!("friction = [\"viscous\", \"coulomb\"]\ncoulomb_velocity = {velocity}");
        common::QUICK.replace("friction = [\"viscous\"]", &more)
    };
    twin(folder.path(), "sharp", &config(0.02), &dry);
    twin(folder.path(), "soft", &config(0.4), &dry);
    let (words, json) = diff(folder.path(), "sharp", "soft");
    let heading = "Not the same quantity: friction reverses within 0.02 → 0.4 rad/s (m/s)\n";
    let (first, last) = words.out.split_once(heading).unwrap();
    assert!(
        last.contains("changed: Coulomb friction on shoulder"),
        "{}",
        words.out
    );
    assert!(!first.contains("Coulomb"), "{}", words.out);
    assert!(
        last.contains("warning: friction reverses within 0.02"),
        "{}",
        words.out
    );
    for (name, comparable) in [("elbow.coulomb", false), ("elbow.viscous", true)] {
        assert_eq!(component(&json, name)["comparable"], comparable, "{name}");
    }
    assert_eq!(json["findings"][0]["code"], "coulomb_velocity_differs");

    let (words, json) = diff(folder.path(), "sharp", "sharp");
    assert!(!words.out.contains("Not the same"), "{}", words.out);
    assert_eq!(component(&json, "elbow.coulomb")["comparable"], true);
}
