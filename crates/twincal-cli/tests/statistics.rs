//! `twincal statistics`, `merge` and `fit --statistics`: the numbers of the fit to the logs, files that are kept, and refusals.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{csv, files, folder, run};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tempfile::TempDir;
use twincal_io::statistics::StatisticsFile;

/// A folder with four logs that differ by when they begin.
fn logs() -> TempDir {
    let folder = folder();
    let whole = csv(1600, &|_, row| row);
    let mut lines = whole.lines();
    let head = lines.next().unwrap();
    let rows: Vec<&str> = lines.collect();
    for (number, rows) in rows.chunks(400).enumerate() {
        let text = format!("{head}\n{}\n", rows.join("\n"));
        fs::write(folder.path().join(format!("run{number}.csv")), text).unwrap();
    }
    folder
}

fn made(folder: &Path) {
    let line = "statistics run0.csv run1.csv run2.csv --model arm.urdf --config quick.toml -o st";
    run(folder, line.split(' ')).expect(0);
}

fn result(folder: &Path, twin: &str) -> Value {
    let text = fs::read_to_string(folder.join(twin).join("result.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Every number below two values, which have the same form.
fn compare(a: &Value, b: &Value, place: &str) {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= 1e-9 * (1e-6 + b.abs()), "{place}: {a} {b}");
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            let pairs = a.iter().zip(b).enumerate();
            pairs.for_each(|(at, (a, b))| compare(a, b, &format!("{place}/{at}")));
        }
        (Value::Object(a), Value::Object(b)) => {
            assert!(a.keys().eq(b.keys()), "{place}");
            a.iter()
                .for_each(|(key, a)| compare(a, &b[key], &format!("{place}/{key}")));
        }
        (a, b) => assert_eq!(a, b, "{place}"),
    }
}

/// What needs no row has the same numbers; with held-out logs the scores have too; without them the answer is that nothing was tested.
#[test]
fn a_fit_to_statistics_is_the_fit_to_the_logs() {
    let folder = logs();
    let at = folder.path();
    made(at);
    let fit = |more: &str| {
        let all = "st/run0.csv.arrow st/run1.csv.arrow st/run2.csv.arrow";
        let line = format!("fit --statistics {all} --config quick.toml {more}");
        run(at, line.split(' '))
    };
    assert_eq!(
        files(&at.join("st")),
        [
            "plan.json",
            "run0.csv.arrow",
            "run1.csv.arrow",
            "run2.csv.arrow"
        ]
        .map(Path::new)
    );
    let line = "fit run0.csv run1.csv run2.csv --model arm.urdf --config quick.toml --heldout run3.csv -o whole";
    run(at, line.split(' ')).expect(0);
    fit("--heldout run3.csv -o own").expect(0);
    let (own, whole) = (result(at, "own"), result(at, "whole"));
    for key in [
        "components",
        "terms",
        "groups",
        "noise",
        "prior",
        "validation",
        "curves",
        "logs",
    ] {
        compare(&own[key], &whole[key], key);
    }
    assert_eq!(own["validation"]["split"], "heldout_logs");
    // The model goes back into the user's file.
    run(at, "export --twin own --to urdf -o own.urdf".split(' ')).expect(0);
    run(at, "export --twin whole --to urdf -o whole.urdf".split(' ')).expect(0);
    assert_eq!(
        fs::read(at.join("own.urdf")).unwrap(),
        fs::read(at.join("whole.urdf")).unwrap()
    );
    // Nothing held out.
    let done = fit("-o alone").expect(3);
    assert!(
        done.out.contains("Torque error: not tested"),
        "{}",
        done.out
    );
    assert_eq!(result(at, "alone")["validation"]["split"], "not_tested");
    compare(&result(at, "alone")["terms"], &whole["terms"], "terms");
    let line = "check run3.csv --twin alone";
    run(at, line.split(' '))
        .expect(2)
        .says(&["was never tested", "--heldout LOG"]);
}

/// What is done is kept, byte for byte; a log that changed, or another plan, is not mixed in.
#[test]
fn what_is_done_is_kept() {
    let folder = logs();
    let at = folder.path();
    made(at);
    let content = || -> Vec<_> {
        let all = files(&at.join("st")).into_iter();
        all.map(|path| fs::read(at.join("st").join(path)).unwrap())
            .collect()
    };
    let before = content();
    let line = "statistics run0.csv run1.csv run2.csv run3.csv --model arm.urdf --config quick.toml -o st --json";
    let done = run(at, line.split(' ')).expect(0);
    let said: Value = serde_json::from_str(&done.out).unwrap();
    let flags: Vec<bool> = (said["files"].as_array().unwrap().iter())
        .map(|file| file["made"].as_bool().unwrap())
        .collect();
    assert_eq!(flags, [false, false, false, true]);
    assert_eq!(content()[..4], before[..]);
    // The same bytes on one thread, elsewhere, under the same plan.
    let line = "statistics run0.csv --model arm.urdf --config quick.toml --plan st/plan.json -o two --threads 1";
    run(at, line.split(' ')).expect(0);
    assert_eq!(
        fs::read(at.join("two/run0.csv.arrow")).unwrap(),
        fs::read(at.join("st/run0.csv.arrow")).unwrap()
    );
    fs::copy(at.join("run3.csv"), at.join("run1.csv")).unwrap();
    let line = "statistics run1.csv --model arm.urdf --config quick.toml -o st";
    run(at, line.split(' '))
        .expect(2)
        .says(&["is there, of another log", "--force"]);
    let plan = fs::read_to_string(at.join("st/plan.json")).unwrap();
    fs::write(
        at.join("old.json"),
        plan.replacen("\"version\": 2", "\"version\": 0", 1),
    )
    .unwrap();
    let line = "statistics run1.csv --model arm.urdf --plan old.json -o three";
    run(at, line.split(' '))
        .expect(2)
        .says(&["the plan has version 0"]);
    fs::write(
        at.join("other.json"),
        plan.replacen("_unknown\": false", "_unknown\": true", 1),
    )
    .unwrap();
    let line = "statistics run1.csv --model arm.urdf --plan other.json -o st";
    run(at, line.split(' '))
        .expect(2)
        .says(&["st holds another plan"]);
    fs::write(at.join("no.json"), "{}").unwrap();
    let line = "statistics run1.csv --model arm.urdf --plan no.json -o three";
    run(at, line.split(' '))
        .expect(2)
        .says(&["no.json: is no plan"]);
}

#[test]
fn merged_files_are_the_same_bytes_in_any_order_and_nothing_foreign_is_merged() {
    let folder = logs();
    let at = folder.path();
    made(at);
    let merge = |from: &str, to: &str| run(at, format!("merge {from} -o {to}").split(' '));
    let [a, b, c] = [0, 1, 2].map(|log| format!("st/run{log}.csv.arrow"));
    merge(&format!("{a} {b} {c}"), "all.arrow").expect(0);
    merge(&format!("{c} {a}"), "some.arrow").expect(0);
    merge(&format!("{b} some.arrow"), "again.arrow").expect(0);
    assert_eq!(
        fs::read(at.join("all.arrow")).unwrap(),
        fs::read(at.join("again.arrow")).unwrap()
    );
    for (from, words) in [
        (format!("{a} all.arrow"), "log `run0.csv` is there twice"),
        ("run.csv".into(), "run.csv"),
        ("arm.urdf".into(), "arm.urdf"),
        ("st/plan.json".into(), "st/plan.json"),
    ] {
        merge(&from, "no.arrow").expect(2).says(&[words]);
        assert!(!at.join("no.arrow").exists());
    }
    let line = "statistics run3.csv --model arm.urdf --config quick.toml --plan st/plan.json --robot two -o two";
    run(at, line.split(' ')).expect(0);
    let foreign = format!("{a} two/run3.csv.arrow");
    merge(&foreign, "no.arrow")
        .expect(2)
        .says(&["of robot `two`, the others of `arm`"]);
    // No output replaces what is read.
    let before = fs::read(at.join(&a)).unwrap();
    run(at, format!("merge {a} {b} -o {a} --force").split(' '))
        .expect(2)
        .says(&["would be overwritten"]);
    assert_eq!(fs::read(at.join(&a)).unwrap(), before);
}

#[test]
fn damaged_files_and_wrong_words_are_refused() {
    let folder = logs();
    let at = folder.path();
    made(at);
    let good = fs::read(at.join("st/run0.csv.arrow")).unwrap();
    for (name, bytes) in [
        ("empty", Vec::new()),
        ("half", good[..good.len() / 2].to_vec()),
        ("flipped", {
            let mut bad = good.clone();
            let middle = bad.len() * 3 / 4;
            bad[middle] ^= 4;
            bad
        }),
    ] {
        fs::write(at.join(name), bytes).unwrap();
        run(at, ["fit", "--statistics", name, "-o", "no"])
            .expect(2)
            .says(&[name]);
        assert!(!at.join("no").exists());
    }
    let line = "fit --statistics st/run0.csv.arrow --heldout run0.csv --config quick.toml -o no";
    run(at, line.split(' '))
        .expect(2)
        .says(&["`run0.csv` is fitted and held out"]);
    let line = "fit run1.csv --statistics st/run0.csv.arrow -o no";
    run(at, line.split(' ')).expect(2);
    let line = "fit --statistics st/run0.csv.arrow --model arm.urdf -o no";
    run(at, line.split(' ')).expect(2);
    fs::write(
        at.join("robust.toml"),
        format!("{}[noise]\nrobust = true\n", common::QUICK),
    )
    .unwrap();
    let line = "fit --statistics st/run0.csv.arrow --config robust.toml -o no";
    run(at, line.split(' '))
        .expect(2)
        .says(&["weigh rows one by one"]);
}

/// Files that are kept were read as they would be now; those of other settings, and damaged ones, are named with what helps.
#[test]
fn a_file_of_other_settings_or_damaged_is_not_kept() {
    let folder = logs();
    let at = folder.path();
    made(at);
    let factor = format!("{}[columns.factor]\ntau = 2\n", common::QUICK);
    fs::write(at.join("factor.toml"), factor).unwrap();
    let again = "statistics run0.csv --model arm.urdf -o st";
    for other in ["--config factor.toml", "--config quick.toml --rate 10"] {
        let line = format!("{again} {other}");
        run(at, line.split(' ')).expect(2).says(&[
            "run0.csv.arrow is there, of the log as other settings read it",
            "--force",
        ]);
    }
    run(at, format!("{again} --config quick.toml").split(' ')).expect(0);
    let target = at.join("st/run0.csv.arrow");
    let good = fs::read(&target).unwrap();
    for bytes in [&good[..good.len() / 2], &good[..9], &[]] {
        fs::write(&target, bytes).unwrap();
        run(at, format!("{again} --config quick.toml").split(' '))
            .expect(2)
            .says(&["st/run0.csv.arrow: ", "twincal statistics"]);
        let half = run(at, format!("{again} --config quick.toml").split(' '));
        assert!(!half.err.contains("export it again"), "{}", half.err);
    }
    let line = format!("{again} --config quick.toml --force");
    run(at, line.split(' ')).expect(0);
    assert_eq!(fs::read(&target).unwrap(), good);
}

/// A run that is killed while it makes a file leaves whole files and its part; the next one goes on, and no other file stays.
#[test]
fn a_killed_run_goes_on() {
    let folder = logs();
    let at = folder.path();
    made(at);
    fs::write(at.join("long.csv"), csv(40_000, &|_, row| row)).unwrap();
    let line = "statistics run0.csv long.csv --model arm.urdf --config quick.toml -o st";
    let mut command = common::command(at);
    command.args(line.split(' ')).stderr(Stdio::null());
    let mut child = command.stdout(Stdio::null()).spawn().unwrap();
    let is_part = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "staging");
    let mut seen = false;
    while !seen && child.try_wait().unwrap().is_none() {
        seen = files(&at.join("st")).iter().any(is_part);
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(seen, "it ended before it wrote");
    let kept = files(&at.join("st"));
    let whole = |path: &&PathBuf| path.to_string_lossy().ends_with(".arrow");
    for path in kept.iter().filter(whole) {
        let path = at.join("st").join(path);
        StatisticsFile::read(&path).expect("a whole file");
    }
    run(at, line.split(' ')).expect(0);
    assert_eq!(
        files(&at.join("st")),
        [
            "long.csv.arrow",
            "plan.json",
            "run0.csv.arrow",
            "run1.csv.arrow",
            "run2.csv.arrow"
        ]
        .map(Path::new)
    );
}
