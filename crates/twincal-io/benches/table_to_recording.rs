//! From a table to a recording, one core: `cargo bench -p twincal-io --bench table_to_recording`. Peers: the `csv` crate with the standard
//! library's numbers, and pyarrow on one thread (`peers/tables.py`; TWINCAL_CHECK_PYTHON or .venv, skipped without pyarrow). Then Parquet on
//! two threads by the clock, and the peak memory of a process that reads one file and nothing else (`… -- --peak FILE`).

#![allow(
    clippy::print_stdout,
    clippy::expect_used,
    reason = "a bench prints its table and stops where it cannot go on"
)]

#[path = "../tests/common/logs.rs"]
#[allow(dead_code, reason = "the tests use the rest of these generators")]
mod logs;

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use twincal::robot::{JointKind, Robot};
use twincal_io::log::{LogOptions, read_log};
use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};

const ROWS: usize = 600_000;

/// Processor time of this thread so far, s: other work on the machine does not count.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let run = text.split(' ').next().expect("a number");
    run.parse::<f64>().expect("nanoseconds") / 1e9
}

/// Shortest of five runs, s of processor time.
fn shortest(mut run: impl FnMut() -> usize) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = processor_time();
        assert_eq!(run(), ROWS);
        best = best.min(processor_time() - start);
    }
    best
}

fn say(what: &str, who: &str, seconds: f64, bytes: u64) {
    println!(
        "{what:<34} {who:<24} {:7.1} ms  {:5.2} M rows/s  {:5.0} MB/s",
        seconds * 1e3,
        ROWS as f64 / seconds / 1e6,
        bytes as f64 / seconds / 1e6
    );
}

/// What reading takes at its highest, MB, of which the file's numbers are so many.
fn peak(path: &Path, robot: &Robot) {
    let (recording, _) = read_log(path, robot, &LogOptions::default()).expect("readable");
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let words = line.expect("a peak").split_ascii_whitespace();
    let kilobytes: f64 = words.rev().nth(1).and_then(|w| w.parse().ok()).expect("kB");
    let numbers = recording.time.len() as f64 * 22.0 * 8.0;
    println!("{:.1} MB of {:.1}", kilobytes / 1e3, numbers / 1e6);
}

fn main() {
    // Columns are decoded here and not on other threads, whose time would not be seen.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1);
    one.use_current_thread()
        .build_global()
        .expect("no pool yet");
    let names: Vec<String> = (1..=7).map(|i| format!("joint{i}")).collect();
    let joints: Vec<(&str, JointKind)> = names
        .iter()
        .map(|name| (name.as_str(), JointKind::Revolute))
        .collect();
    let robot = logs::robot(&joints);
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|word| word == "--peak") {
        peak(Path::new(&arguments[at + 1]), &robot);
        return;
    }
    let mut columns = vec!["t".to_owned()];
    for word in ["q", "qd", "tau"] {
        columns.extend((1..=7).map(|joint| format!("{word}{joint}")));
    }
    let values: Vec<Vec<f64>> = (0..columns.len())
        .map(|c| match c {
            0 => (0..ROWS).map(|row| row as f64 / 1000.0).collect(),
            _ => (0..ROWS)
                .map(|row| {
                    let [q, qd, qdd] = logs::motion((c - 1) % 7, row as f64 / 1000.0);
                    // What a sensor adds: digits that do not repeat.
                    let noise = (row * 22 + c).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
                    [q, qd, 10.0 * qdd][(c - 1) / 7] + noise as f64 * 1e-10
                })
                .collect(),
        })
        .collect();
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = Vec::new();
    // As recorders write them: nine decimals, and all that a double has.
    for (name, decimals) in [("decimals.csv", Some(9)), ("shortest.csv", None)] {
        let mut text = columns.join(",") + "\n";
        for row in 0..ROWS {
            for (c, column) in values.iter().enumerate() {
                let (comma, value) = (if c > 0 { "," } else { "" }, column[row]);
                match decimals {
                    Some(decimals) => write!(text, "{comma}{value:.decimals$}").expect("memory"),
                    None => write!(text, "{comma}{value}").expect("memory"),
                }
            }
            text.push('\n');
        }
        files.push(folder.path().join(name));
        std::fs::write(&files[files.len() - 1], text).expect("a file");
    }
    let kinds: Vec<(String, ColumnKind)> = columns
        .iter()
        .map(|name| (name.clone(), ColumnKind::Number))
        .collect();
    let blocks: Vec<Values<'_>> = values.iter().map(|v| Values::Numbers(v)).collect();
    let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &kinds).expect("memory");
    table.push(&blocks).expect("memory");
    files.push(folder.path().join("zstd.parquet"));
    std::fs::write(&files[2], table.finish().expect("memory")).expect("a file");
    drop(values);
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../../.venv/bin/python");
    let python = std::env::var("TWINCAL_CHECK_PYTHON").unwrap_or_else(|_| own.into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/tables.py");
    // The same table as pyarrow and pandas write it unless told otherwise.
    let snappy = folder.path().join("snappy.parquet");
    let mut copy = Command::new(&python);
    copy.arg(script).arg("--copy").args([&files[2], &snappy]);
    if copy.status().is_ok_and(|status| status.success()) {
        files.push(snappy);
    } else {
        println!("snappy skipped: no pyarrow in .venv (./check makes it)");
    }

    println!("7 joints, t, q, q̇, torque (22 columns), {ROWS} rows");
    let size = |path: &Path| std::fs::metadata(path).expect("a file").len();
    let word = |path: &Path| {
        path.file_name()
            .map_or(String::new(), |n| n.to_string_lossy().into())
    };
    for path in &files {
        let seconds = shortest(|| {
            let (recording, _) = read_log(path, &robot, &LogOptions::default()).expect("readable");
            recording.time.len()
        });
        say(&word(path), "twincal", seconds, size(path));
    }
    let two = rayon::ThreadPoolBuilder::new().num_threads(2);
    let two = two.build().expect("threads");
    for path in &files[2..] {
        let by_the_clock = (0..5).map(|_| {
            let start = std::time::Instant::now();
            let read = two.install(|| read_log(path, &robot, &LogOptions::default()));
            assert_eq!(read.expect("readable").0.time.len(), ROWS);
            start.elapsed().as_secs_f64()
        });
        let seconds = by_the_clock.fold(f64::INFINITY, f64::min);
        say(&word(path), "twincal, two threads", seconds, size(path));
    }
    for path in &files {
        let program = std::env::current_exe().expect("this bench");
        let output = Command::new(program).arg("--peak").arg(path).output();
        let output = output.expect("runs again").stdout;
        let text = String::from_utf8_lossy(&output);
        println!("{:<34} {:<24} peak {}", word(path), "twincal", text.trim());
    }
    for path in &files[..2] {
        let seconds = shortest(|| {
            let mut reader = csv::Reader::from_path(path).expect("a file");
            let mut record = csv::StringRecord::new();
            let mut columns = vec![Vec::<f64>::new(); 22];
            while reader.read_record(&mut record).expect("readable") {
                for (column, field) in columns.iter_mut().zip(&record) {
                    column.push(field.parse().expect("a number"));
                }
            }
            columns[21].len()
        });
        say(&word(path), "csv crate and str::parse", seconds, size(path));
    }
    match Command::new(python).arg(script).args(&files).output() {
        Ok(output) if output.status.success() => {
            let text = String::from_utf8_lossy(&output.stdout);
            for (line, path) in text.lines().zip(&files) {
                let seconds = line.rsplit(' ').next().and_then(|s| s.parse().ok());
                say(
                    &word(path),
                    "pyarrow",
                    seconds.expect("a number"),
                    size(path),
                );
            }
        }
        Ok(output) => println!(
            "pyarrow failed: {}",
            String::from_utf8_lossy(&output.stderr)
        ),
        Err(_) => println!("pyarrow skipped: no .venv (./check makes it)"),
    }
}
