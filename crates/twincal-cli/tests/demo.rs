//! `twincal demo` as a new user runs it.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::run;
use std::fs;

#[test]
fn demo_ends_with_its_report_and_replaces_only_its_own_output() {
    let folder = tempfile::tempdir().unwrap();
    let done = run(folder.path(), ["demo"]).expect(0);
    // Behind it: how to open the page, and the command to try next.
    let report = done.out.lines().nth_back(2);
    assert_eq!(report, Some("twincal-demo/report.html"), "{}", done.out);
    let read = |name: &str| fs::read(folder.path().join("twincal-demo").join(name)).unwrap();
    let report = read("report.html");
    assert!(report.starts_with(b"<!doctype html>") || report.starts_with(b"<!DOCTYPE html>"));
    // Its model states what a designed motion has to hold.
    let model = [
        "design",
        "--model",
        "twincal-demo/model.urdf",
        "-o",
        "motion",
    ];
    run(folder.path(), model.into_iter().chain(["--duration", "4"])).expect(0);
    // Its own earlier output is replaced, with the same result.
    let result = read("result.json");
    run(folder.path(), ["demo"]).expect(0);
    assert!(read("result.json") == result && read("report.html") == report);
    // What it says can be repeated where it lies; its held-out log passes, and is said to be known.
    let twin = run(
        &folder.path().join("twincal-demo"),
        ["check", "heldout1.parquet", "--twin", "."],
    )
    .expect(0);
    assert!(twin.out.contains("repeats those scores"), "{}", twin.out);
    // A file of the user stays, and so does an output of `fit`.
    fs::write(folder.path().join("twincal-demo/notes.txt"), "mine").unwrap();
    run(folder.path(), ["demo"])
        .expect(2)
        .says(&["twincal-demo", "notes.txt"]);
    assert_eq!(read("notes.txt"), b"mine");
    let other = common::fitted_copy();
    fs::rename(other.path().join("twin"), other.path().join("twincal-demo")).unwrap();
    run(other.path(), ["demo"])
        .expect(2)
        .says(&["twincal-demo"]);
}

/// It has no such flag.
#[test]
fn no_error_of_demo_asks_for_another_output_with_a_flag() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("twincal-demo");
    let refused = || {
        let done = run(folder.path(), ["demo"])
            .expect(2)
            .says(&["in another folder"]);
        assert!(!done.err.contains("-o"), "{}", done.err);
    };
    fs::write(&place, "mine").unwrap();
    refused();
    fs::remove_file(&place).unwrap();
    std::os::unix::fs::symlink("elsewhere", &place).unwrap();
    refused();
    fs::remove_file(&place).unwrap();
    fs::create_dir(&place).unwrap();
    fs::write(place.join("notes.txt"), "mine").unwrap();
    refused();
}
