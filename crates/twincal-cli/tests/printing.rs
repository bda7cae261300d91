//! How much `fit` and `demo` print: the answer first, the report's path last, and no more lines than promised.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::{Run, command, finish, fit, folder, run};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs the program on a terminal of so many columns.
fn at_width(folder: &Path, columns: usize, line: &str) -> Run {
    let mut command = command(folder);
    command.env("COLUMNS", columns.to_string());
    finish(command.args(line.split(' ')))
}

const FIT: &str = "fit run.csv --model arm.urdf --config quick.toml --force -o out";

#[track_caller]
fn brief(out: &str, columns: usize) {
    let most = if columns < 80 { 55 } else { 40 };
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines.len() <= most, "{} lines: {out}", lines.len());
    let wide = lines
        .iter()
        .skip(1)
        .find(|line| line.chars().count() > columns);
    assert_eq!(wide, None, "{out}");
    let end = &lines[lines.len().saturating_sub(4)..];
    assert!(end.iter().any(|line| line.contains("report.html")), "{out}");
}

#[test]
fn the_answer_stands_first_and_the_report_last() {
    let folder = folder();
    let quiet = at_width(folder.path(), 80, &format!("{FIT} -q")).expect(0);
    assert_eq!(quiet.out.lines().count(), 1, "{}", quiet.out);
    assert_eq!(quiet.err, "");
    for columns in [60, 80, 120] {
        let done = at_width(folder.path(), columns, FIT).expect(0);
        brief(&done.out, columns);
        assert_eq!(done.out.lines().next(), quiet.out.lines().next());
        assert_eq!(done.out.lines().last(), Some("out/report.html"));
    }
    let all = at_width(folder.path(), 80, &format!("{FIT} --verbose")).expect(0);
    assert_eq!(all.out.lines().next(), quiet.out.lines().next());
    assert!(all.out.contains("What the model misses"), "{}", all.out);
    assert!(!all.out.contains("the report"), "{}", all.out);
    let result = fs::read_to_string(folder.path().join("out/result.json")).unwrap();
    let result: serde_json::Value = serde_json::from_str(&result).unwrap();
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let printed = words(&all.out);
    let findings = result["findings"].as_array().unwrap();
    assert!(findings.iter().any(|own| own["severity"] == "note"));
    for finding in findings {
        let message = words(finding["message"].as_str().unwrap());
        assert!(printed.contains(&message), "{message}: {printed}");
    }
}

#[test]
fn quiet_and_json_do_not_go_together() {
    let folder = folder();
    for pair in ["-q --json", "-q -v"] {
        let done = at_width(folder.path(), 80, &format!("{FIT} {pair}")).expect(2);
        assert!(done.err.contains("cannot be used with"), "{}", done.err);
    }
}

#[test]
fn the_demo_has_the_truth_beside_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    for columns in [60, 80, 120] {
        let done = at_width(folder.path(), columns, "demo").expect(0);
        brief(&done.out, columns);
        assert!(done.out.contains("truth"), "{}", done.out);
    }
    let quiet = run(folder.path(), ["demo", "-q"]).expect(0);
    assert_eq!((quiet.out.lines().count(), quiet.err.as_str()), (1, ""));
}

/// A program of the user's that opens pages, or none.
#[cfg(target_os = "linux")]
#[test]
fn the_report_is_opened_and_that_it_cannot_be_is_a_note() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = folder();
    let bin = folder.path().join("bin");
    fs::create_dir(&bin).unwrap();
    let open = |command: &mut Command| {
        let line = format!("{FIT} --open");
        finish(command.env("PATH", &bin).args(line.split(' '))).expect(0)
    };
    open(&mut command(folder.path())).says(&["note: cannot open", "report.html"]);
    let opener = bin.join("xdg-open");
    fs::write(&opener, "#!/bin/sh\nprintf %s \"$1\" > opened\n").unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let done = open(&mut command(folder.path()));
    assert!(!done.err.contains("cannot open"), "{}", done.err);
    let opened = fs::read_to_string(folder.path().join("opened")).unwrap();
    assert!(
        Path::new(&opened).is_absolute() && opened.ends_with("out/report.html"),
        "{opened}"
    );
    fs::write(&opener, "#!/bin/sh\nexit 3\n").unwrap();
    open(&mut command(folder.path())).says(&["note: cannot open", "exit status: 3"]);
    assert!(
        fit(folder.path(), &["-o", "other"])
            .expect(0)
            .out
            .ends_with("other/report.html\n")
    );
}

#[test]
fn completions_are_scripts_that_know_the_commands() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let done = run(folder.path(), ["completions", shell]).expect(0);
        assert!(done.out.contains("statistics"), "{shell}");
    }
}
