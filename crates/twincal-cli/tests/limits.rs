//! Logs that are made to take all memory, a clock that goes backwards, and settings that look like variables of the shell.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{Run, finish, fit, folder, run, shell};
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

/// Address space in which every refusal here has to find room (KiB): a seventh of the largest file.
const ROOM: &str = "ulimit -v 150000; ";
const FIT: &str =
    "\"$TWINCAL\" fit big.csv --model arm.urdf --config quick.toml -o out --threads 1";

/// Fits `big.csv` in little memory; it has to be refused and nothing may be written.
#[track_caller]
fn refused(folder: &Path, more: &str, words: &[&str]) {
    shell(folder, &format!("{ROOM}{FIT}{more}"))
        .expect(2)
        .says(words);
    assert!(!folder.join("out").exists());
}

#[test]
fn case_43_a_million_columns_are_refused_by_their_number() {
    let folder = folder();
    let path = folder.path().join("big.csv");
    let few = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2";
    // Columns without a name: the header is just within the limit of a line.
    fs::write(
        &path,
        format!("{few}{}\n0{}\n", ",".repeat(999_991), ",0".repeat(8)),
    )
    .unwrap();
    refused(
        folder.path(),
        "",
        &[
            "big.csv:1",
            "columns, the limit is 100000",
            "export only the columns",
        ],
    );
    // With names the header is longer than a line may be.
    let names: String = (0..1_000_000).map(|i| format!(",c{i}")).collect();
    fs::write(&path, format!("{few}{names}\n")).unwrap();
    refused(
        folder.path(),
        "",
        &[
            "big.csv:1",
            "the line is longer than 1 MiB",
            "fewer columns",
        ],
    );
}

#[test]
fn case_44_a_line_of_a_gigabyte_is_refused_at_the_limit_in_flat_memory() {
    let folder = folder();
    let path = folder.path().join("big.csv");
    let header = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2\n";
    // A file with a hole: a gigabyte long and a page on the disk.
    for (begin, line) in [("t,q1", "big.csv:1"), (header, "big.csv:2")] {
        let mut file = File::create(&path).unwrap();
        file.write_all(begin.as_bytes()).unwrap();
        file.set_len(1 << 30).unwrap();
        for more in ["", " --lenient"] {
            refused(
                folder.path(),
                more,
                &[line, "the line is longer than 1 MiB", "check the file"],
            );
        }
    }
    // A pipe that never ends is not waited for.
    let line = format!(
        "{ROOM}(printf 't,q1\\n'; tr '\\0' 7 </dev/zero) | {}",
        FIT.replace("big.csv", "/dev/stdin")
    );
    shell(folder.path(), &line)
        .expect(2)
        .says(&["/dev/stdin: is a pipe, not a file"]);
}

#[test]
fn case_45_a_quoted_field_of_a_million_lines_is_refused_in_flat_memory() {
    let folder = folder();
    let path = folder.path().join("big.csv");
    let newlines = "\n".repeat(8 << 20);
    let header = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2\n";
    for (begin, line) in [
        ("t,\"q1", "big.csv:1"),
        (&*format!("{header}0,\"1"), "big.csv:2"),
    ] {
        for end in ["", "\"\n"] {
            fs::write(&path, format!("{begin}{newlines}{end}")).unwrap();
            for more in ["", " --lenient"] {
                refused(
                    folder.path(),
                    more,
                    &[line, "longer than 1 MiB", "inside an open quotation mark"],
                );
            }
        }
    }
    // Short of the limit: never closed.
    fs::write(&path, format!("{header}0,\"1\n\n\n")).unwrap();
    refused(
        folder.path(),
        "",
        &["big.csv:2", "a quotation mark is never closed"],
    );
}

/// The system's clock goes back by an hour at every look; all other clocks are as they were.
const SHIM: &str = "#define _GNU_SOURCE
#include <time.h>
#include <unistd.h>
#include <sys/syscall.h>
int clock_gettime(clockid_t clock, struct timespec *now) {
    static long looks = 0;
    int code = (int)syscall(SYS_clock_gettime, clock, now);
    if (clock == CLOCK_REALTIME)
        now->tv_sec -= 3600 * __atomic_add_fetch(&looks, 1, __ATOMIC_SEQ_CST);
    return code;
}
";

#[cfg(target_os = "linux")]
#[test]
fn case_107_durations_do_not_follow_a_clock_that_is_set_back() {
    let folder = folder();
    let library = folder.path().join("clock.so");
    fs::write(folder.path().join("clock.c"), SHIM).unwrap();
    // A C compiler was needed to build this program.
    let built = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o", "clock.so", "clock.c"])
        .current_dir(folder.path())
        .status()
        .unwrap();
    assert!(built.success());
    fit(folder.path(), &["-o", "plain"]).expect(0);
    let before = std::time::Instant::now();
    let mut command = common::command(folder.path());
    command
        .args([
            "fit",
            "run.csv",
            "--model",
            "arm.urdf",
            "--config",
            "quick.toml",
            "-o",
            "out",
        ])
        .env("LD_PRELOAD", &library);
    finish(&mut command).expect(0);
    let passed = before.elapsed().as_secs_f64();
    let read = |path: &str| fs::read_to_string(folder.path().join(path)).unwrap();
    let line = |path: &str, key: &str| -> String {
        let log = read(path);
        let line = log.lines().find_map(|line| line.strip_prefix(key));
        line.unwrap().trim().to_owned()
    };
    // The shim was in the way: the end is at least an hour before it was.
    let stamp = |path: &str| line(path, "finished ")[..13].to_owned();
    assert!(stamp("out/run.log") < stamp("plain/run.log"));
    let seconds: f64 = line("out/run.log", "seconds ").parse().unwrap();
    assert!((0.0..=passed).contains(&seconds), "{seconds} s of {passed}");
    // The answer knows no clock.
    assert_eq!(read("out/result.json"), read("plain/result.json"));
}

/// 10 million draws of 1000 chains: no machine holds them, and a failed allocation would end the process in the middle.
#[test]
fn more_draws_than_the_memory_holds_are_refused() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("run.csv"), common::csv(2000, &|_, row| row)).unwrap();
    let many = "[library]\nfamilies = [\"viscous\", \"coulomb\"]\n[inference]\nmethod = \"gibbs\"\nchains = 1000\ndraws = 10000000\n";
    fs::write(at.join("many.toml"), many).unwrap();
    let line = "fit run.csv --model arm.urdf --config many.toml -o out";
    run(at, line.split(' ')).expect(2).says(&[
        "inference.draws",
        "MB are free",
        "use fewer draws or chains",
    ]);
    assert!(!at.join("out").exists());
}

#[test]
fn case_113_a_config_does_not_read_variables_of_the_environment() {
    let folder = folder();
    let quick = fs::read_to_string(folder.path().join("quick.toml")).unwrap();
    let with = |more: &str| -> Run {
        fs::write(folder.path().join("own.toml"), format!("{quick}{more}")).unwrap();
        let mut command = common::command(folder.path());
        command
            .args(["fit", "--model", "arm.urdf", "--config", "own.toml"])
            .env("HOME", folder.path())
            .env("LOG", "run.csv")
            .env("JOINT", "elbow")
            // What a program that takes settings from its environment might be called by.
            .env("TWINCAL_OUTPUT", "elsewhere")
            .env("TWINCAL_CONFIG", "quick.toml");
        finish(&mut command)
    };
    for form in [
        "$LOG",
        "${LOG}",
        "%LOG%",
        "{{ env.LOG }}",
        "${env:LOG}",
        "~/run.csv",
        "$HOME/run.csv",
    ] {
        with(&format!("[[log]]\nfile = \"{form}\"\n"))
            .expect(2)
            .says(&[&format!("{form}: cannot read")]);
    }
    with("[[log]]\nfile = \"run.csv\"\n[columns]\nq = { elbow = \"$JOINT\" }\n")
        .expect(2)
        .says(&["no column `$JOINT`"]);
    // As a name it is as good as any other.
    with("[[log]]\nfile = \"run.csv\"\n[output]\ndirectory = \"${LOG}\"\n").expect(0);
    assert!(folder.path().join("${LOG}/result.json").exists());
    assert!(!folder.path().join("elsewhere").exists());
    run(folder.path(), ["report", "--twin", "${LOG}"]).expect(0);
}
