//! What the program leaves on disk: complete or absent, locked, verified, the same bytes for any number of threads.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{command, files, fit, fitted, fitted_copy, folder, run, shell};
use std::fs;
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

fn leftovers(folder: &Path) -> usize {
    files(folder)
        .iter()
        .filter(|path| path.to_string_lossy().starts_with(".twincal"))
        .count()
}

#[test]
fn case_97_kill_nine_at_every_write_step() {
    let folder = fitted_copy();
    let read = |name: &str| fs::read(folder.path().join("twin").join(name)).unwrap();
    let before = (read("result.json"), read("twin.json"), read("report.html"));
    // `report` writes the whole artefact anew; its duration decides where the kills fall. It is learned on the way, as a run
    // beside other tests may take many times as long as the next one.
    let began = std::time::Instant::now();
    run(folder.path(), ["report", "--twin", "twin"]).expect(0);
    let mut whole = began.elapsed().as_secs_f64();
    let mut killed = 0;
    for round in 0..200_u32 {
        let mut command = command(folder.path());
        command
            .args(["report", "--twin", "twin"])
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        // Most kills in the last half, where the writing is; golden-ratio steps cover it evenly.
        let share = 0.4 + 0.7 * ((f64::from(round) * 0.618_033_988_75) % 1.0);
        std::thread::sleep(Duration::from_secs_f64(whole * share));
        child.kill().unwrap();
        let in_time = child.wait().unwrap().code().is_none();
        killed += u32::from(in_time);
        whole *= if in_time { 1.02 } else { 0.9 };
        assert_eq!(
            (read("result.json"), read("twin.json"), read("report.html")),
            before,
            "round {round}"
        );
    }
    assert!(
        killed > 20,
        "only {killed} runs were killed before their end: the test tested nothing"
    );
    run(folder.path(), ["report", "--twin", "twin"]).expect(0);
    common::write_later(folder.path());
    run(folder.path(), ["check", "later.csv", "--twin", "twin"]).expect(0);
    assert_eq!(leftovers(folder.path()), 0, "{:?}", files(folder.path()));
}

#[test]
fn case_98_disk_full_leaves_nothing_behind() {
    let folder = folder();
    // 8 blocks of 1024 bytes: the result fits, the report does not.
    let line = "ulimit -f 8; \"$TWINCAL\" fit run.csv --model arm.urdf --config quick.toml -o out";
    shell(folder.path(), line).expect(2).says(&[
        "out: cannot write",
        "File too large",
        "free space",
    ]);
    assert!(!folder.path().join("out").exists());
    assert_eq!(leftovers(folder.path()), 0);
    let line = format!(
        "ulimit -f 8; \"$TWINCAL\" predict run.csv --twin {}/twin -o p.csv",
        fitted().display()
    );
    shell(folder.path(), &line)
        .expect(2)
        .says(&["p.csv: cannot write", "File too large"]);
    assert!(!folder.path().join("p.csv").exists());
    assert_eq!(leftovers(folder.path()), 0);
}

#[test]
fn case_98_full_standard_output_is_said() {
    let line = format!(
        "\"$TWINCAL\" predict run.csv --twin {}/twin > /dev/full",
        fitted().display()
    );
    shell(folder().path(), &line)
        .expect(2)
        .says(&["cannot write to standard output"]);
}

#[test]
fn case_99_unusable_output_is_refused_before_any_work() {
    let folder = folder();
    fs::write(folder.path().join("file"), "x").unwrap();
    std::os::unix::fs::symlink("elsewhere", folder.path().join("link")).unwrap();
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, std::os::unix::fs::PermissionsExt::from_mode(0o555)).unwrap();
    for (output, words) in [
        ("file", "file: is a file"),
        ("link", "link: is a symbolic link"),
        ("closed/out", "closed: the folder is read-only"),
        ("/proc/out", "/proc"),
    ] {
        let base = [
            "fit",
            "run.csv",
            "--model",
            "arm.urdf",
            "--config",
            "quick.toml",
            "--force",
            "-o",
        ];
        let done = run(folder.path(), base.iter().chain([&output]))
            .expect(2)
            .says(&[words]);
        assert!(
            !done.err.contains("reading"),
            "work was done first:\n{}",
            done.err
        );
    }
}

#[test]
fn case_100_existing_output_needs_force_and_foreign_files_are_kept() {
    let folder = fitted_copy();
    let done = fit(folder.path(), &["-o", "twin"])
        .expect(2)
        .says(&["twin: exists already", "--force"]);
    assert!(
        !done.err.contains("reading"),
        "work was done first:\n{}",
        done.err
    );
    fit(folder.path(), &["-o", "twin", "--force"]).expect(0);
    fs::write(folder.path().join("twin/notes.txt"), "mine").unwrap();
    fit(folder.path(), &["-o", "twin", "--force"])
        .expect(2)
        .says(&["holds `notes.txt`, which twincal did not write"]);
    assert_eq!(
        fs::read(folder.path().join("twin/notes.txt")).unwrap(),
        b"mine"
    );
    run(
        folder.path(),
        ["predict", "run.csv", "--twin", "twin", "-o", "run.csv"],
    )
    .expect(2)
    .says(&["run.csv: is read by this command"]);
    fs::write(folder.path().join("p.csv"), "mine").unwrap();
    run(
        folder.path(),
        ["predict", "run.csv", "--twin", "twin", "-o", "p.csv"],
    )
    .expect(2)
    .says(&["exists already"]);
}

/// Starts a fit of a long log as `$first`, and goes on once it has locked its output.
const FIRST: &str = "\"$TWINCAL\" fit long.csv --model arm.urdf --config quick.toml -o out & first=$!; \
                     until compgen -G '.twincal-*.lock' >/dev/null; do :; done; ";

fn with_long_log() -> tempfile::TempDir {
    let folder = folder();
    let long = common::csv(100_000, &|_, row| row);
    fs::write(folder.path().join("long.csv"), long).unwrap();
    folder
}

#[test]
fn case_101_second_run_on_the_same_output_is_refused() {
    let folder = with_long_log();
    let line = format!(
        "{FIRST} kill -STOP $first; \
         \"$TWINCAL\" fit run.csv --model arm.urdf --config quick.toml -o out; code=$?; \
         kill -9 $first; exit $code"
    );
    shell(folder.path(), &line)
        .expect(2)
        .says(&["out: another twincal is writing to it"]);
    // The lock of a killed run locks nothing.
    fit(folder.path(), &["-o", "out"]).expect(0);
    assert_eq!(leftovers(folder.path()), 0);
}

#[test]
fn case_102_interrupt_ends_at_once_with_130() {
    // A shell starts background jobs with SIGINT ignored; `set -m` gives them their own reaction.
    let line = format!("set -m; {FIRST} kill -INT $first; wait $first");
    shell(with_long_log().path(), &line).expect(130);
}

#[test]
fn case_103_a_reader_that_goes_away_is_no_error() {
    let line = format!(
        "\"$TWINCAL\" predict run.csv --twin {}/twin | head -1; exit ${{PIPESTATUS[0]}}",
        fitted().display()
    );
    let done = shell(folder().path(), &line).expect(0);
    assert!(done.out.starts_with("t,shoulder.tau_meas"), "{}", done.out);
    assert!(
        !done.err.contains("panick") && !done.err.contains("Broken pipe"),
        "{}",
        done.err
    );
    shell(
        folder().path(),
        "\"$TWINCAL\" schema | head -1; exit ${PIPESTATUS[0]}",
    )
    .expect(0);
}

#[test]
fn case_104_works_without_home_terminal_and_locale() {
    let folder = folder();
    let done = finish_in_c_locale(folder.path());
    assert!(done.out.ends_with("out/report.html\n"), "{}", done.out);
    assert!(
        !done.out.contains('\u{1b}') && !done.err.contains('\u{1b}'),
        "escape codes without a terminal"
    );
}

fn finish_in_c_locale(folder: &Path) -> common::Run {
    let line = "env -i LANG=C TMPDIR=/nonexistent \"$TWINCAL\" fit run.csv --model arm.urdf --config quick.toml -o out";
    shell(folder, line).expect(0)
}

#[test]
fn case_105_memory_is_estimated_before_it_is_taken() {
    let folder = folder();
    let log = common::csv(2000, &|_, row| row);
    let (header, body) = log.split_once('\n').unwrap();
    fs::write(
        folder.path().join("long.csv"),
        format!("{header}\n{}", body.repeat(60)),
    )
    .unwrap();
    fs::write(folder.path().join("rows.toml"), "[signal]\ncutoff_hz = 0\n").unwrap();
    // What reading takes, and what the rows of all candidates take besides.
    for (kb, config, words) in [
        (60_000, "quick.toml", ["long.csv: needs about", "ulimit -v"]),
        (
            110_000,
            "rows.toml",
            ["fitting all logs needs about", "cutoff_hz"],
        ),
    ] {
        let line = format!(
            "ulimit -v {kb}; \"$TWINCAL\" fit long.csv --model arm.urdf --config {config} -o out --threads 1"
        );
        let done = shell(folder.path(), &line).expect(2);
        done.says(&["long.csv", "MB of memory"]).says(&words);
    }
    assert!(!folder.path().join("out").exists());
}

#[test]
fn case_106_same_bytes_on_any_number_of_threads() {
    let folder = folder();
    let outputs = ["1", "2", "7"].map(|threads| {
        let out = format!("out{threads}");
        fit(folder.path(), &["-o", &out, "--threads", threads]).expect(0);
        let csv = format!("p{threads}.csv");
        run(
            folder.path(),
            [
                "predict",
                "run.csv",
                "--twin",
                &out,
                "-o",
                &csv,
                "--threads",
                threads,
            ],
        )
        .expect(0);
        let read = |path: String| fs::read_to_string(folder.path().join(path)).unwrap();
        [
            read(format!("{out}/result.json")),
            read(format!("{out}/report.html")),
            read(csv),
        ]
    });
    assert!(
        outputs[0] == outputs[1] && outputs[0] == outputs[2],
        "bytes differ"
    );
    let absolute = folder.path().to_string_lossy().into_owned();
    assert!(
        outputs[0].iter().all(|text| !text.contains(&absolute)),
        "a result names a folder of this machine"
    );
    // The same from another folder, with absolute paths.
    let elsewhere = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).into_os_string();
    let arguments = [
        "fit".into(),
        at("run.csv"),
        "--model".into(),
        at("arm.urdf"),
        "--config".into(),
        at("quick.toml"),
    ];
    run(elsewhere.path(), arguments).expect(0);
    for (name, text) in [
        ("result.json", &outputs[0][0]),
        ("report.html", &outputs[0][1]),
    ] {
        let here = fs::read_to_string(elsewhere.path().join("twincal-out").join(name)).unwrap();
        assert!(here == *text, "{name} depends on the folder");
    }
}

#[test]
fn case_108_any_path_works() {
    let long = "x".repeat(251);
    for name in [
        b"a b".as_slice(),
        "Größe π".as_bytes(),
        b"bad\xff\xfe",
        b"-rf",
        long.as_bytes(),
    ] {
        let folder = folder();
        let name = std::ffi::OsStr::from_bytes(name);
        let with = |ending: &str| [name.as_bytes(), ending.as_bytes()].concat();
        let (log, twin, table) = (with(".csv"), with(""), with(".csv"));
        fs::rename(
            folder.path().join("run.csv"),
            folder.path().join(std::ffi::OsStr::from_bytes(&log)),
        )
        .unwrap();
        let os = |bytes: &[u8]| std::ffi::OsStr::from_bytes(bytes).to_owned();
        let output = os(&[b"-o=".as_slice(), &twin].concat());
        let model =
            ["fit", "--model", "arm.urdf", "--config", "quick.toml"].map(std::ffi::OsString::from);
        run(
            folder.path(),
            model.into_iter().chain([output, "--".into(), os(&log)]),
        )
        .expect(0);
        let twin = os(&[b"--twin=".as_slice(), &twin].concat());
        run(
            folder.path(),
            ["check".into(), twin.clone(), "--".into(), os(&log)],
        )
        .expect(0);
        fs::create_dir(folder.path().join("p")).unwrap();
        let output = os(&[b"-o=p/".as_slice(), &table].concat());
        run(
            folder.path(),
            ["predict".into(), twin, output, "--".into(), os(&log)],
        )
        .expect(0);
        assert!(folder.path().join("p").join(os(&table)).exists());
    }
}

#[test]
fn case_109_and_110_hostile_joint_names_stay_text() {
    let folder = folder();
    let name = "&lt;script&gt;alert(1)&lt;/script&gt;\u{9b}31m";
    let arm = common::ARM
        .replace("\"shoulder\"", &format!("\"{name}\""))
        .replace("\"elbow\"", "\"=cmd()\"");
    fs::write(folder.path().join("arm.urdf"), arm).unwrap();
    let done = fit(folder.path(), &["-o", "out"]).expect(0);
    assert!(
        !done.out.contains('\u{9b}') && !done.err.contains('\u{9b}'),
        "a terminal escape came through"
    );
    let report = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(!report.contains("<script>alert") && report.contains("&lt;script&gt;alert"));
    run(
        folder.path(),
        ["predict", "run.csv", "--twin", "out", "-o", "p.csv"],
    )
    .expect(0);
    let table = fs::read_to_string(folder.path().join("p.csv")).unwrap();
    let cells = table.lines().next().unwrap().split(',');
    assert!(
        cells.clone().count() == 12
            && cells
                .clone()
                .all(|cell| !cell.trim_matches('"').starts_with('=')),
        "{table:.300}"
    );
}

#[test]
fn case_114_newer_artefacts_say_what_they_need() {
    let folder = fitted_copy();
    let path = folder.path().join("twin/manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let newer = text
        .replace("\"format\": 1", "\"format\": 7")
        .replace("\"needs\": \"0.1.0\"", "\"needs\": \"3.2.0\"");
    assert_ne!(newer, text);
    fs::write(&path, newer).unwrap();
    for arguments in uses() {
        run(folder.path(), arguments)
            .expect(2)
            .says(&["needs twincal >= 3.2.0"]);
    }
}

#[test]
fn case_115_a_flipped_bit_is_found_by_every_command() {
    for name in [
        "result.json",
        "twin.json",
        "report.html",
        "run.log",
        "manifest.json",
    ] {
        let folder = fitted_copy();
        let path = folder.path().join("twin").join(name);
        let mut bytes = fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&path, bytes).unwrap();
        for arguments in uses() {
            let done = run(folder.path(), arguments).expect(2);
            assert!(
                done.err.contains("checksum") || name == "manifest.json",
                "{name}: {}",
                done.err
            );
        }
    }
}

fn uses() -> [Vec<&'static str>; 3] {
    [
        vec!["check", "run.csv", "--twin", "twin"],
        vec!["predict", "run.csv", "--twin", "twin"],
        vec!["report", "--twin", "twin"],
    ]
}

#[test]
fn report_is_written_anew_and_the_same() {
    let folder = fitted_copy();
    let path = folder.path().join("twin/report.html");
    let report = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    let done = run(folder.path(), ["report", "--twin", "twin"]).expect(0);
    assert_eq!(done.out, "twin/report.html\n");
    assert!(fs::read(&path).unwrap() == report);
    fs::write(&path, "by hand").unwrap();
    run(folder.path(), ["report", "--twin", "twin"])
        .expect(2)
        .says(&["checksum"]);
    run(folder.path(), ["report", "--twin", "twin", "--force"]).expect(0);
    assert!(fs::read(&path).unwrap() == report);
}

#[test]
fn nothing_is_left_after_a_refusal() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), common::csv(8, &|_, row| row)).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(4);
    assert!(!folder.path().join("out").exists());
    assert_eq!(leftovers(folder.path()), 0);
}
