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
use std::path::{Path, PathBuf};
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

/// The table in memory: names and values of its columns.
struct Table {
    columns: Vec<String>,
    values: Vec<Vec<f64>>,
}

impl Table {
    /// Time, and position, velocity and torque of seven joints.
    fn new() -> Self {
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
        Self { columns, values }
    }

    /// As CSV, with so many decimals, or all that a double has.
    fn csv(&self, decimals: Option<usize>) -> String {
        let mut text = self.columns.join(",") + "\n";
        for row in 0..ROWS {
            for (c, column) in self.values.iter().enumerate() {
                let (comma, value) = (if c > 0 { "," } else { "" }, column[row]);
                match decimals {
                    Some(decimals) => write!(text, "{comma}{value:.decimals$}").expect("memory"),
                    None => write!(text, "{comma}{value}").expect("memory"),
                }
            }
            text.push('\n');
        }
        text
    }

    /// As Parquet.
    fn parquet(&self) -> Vec<u8> {
        let kinds: Vec<(String, ColumnKind)> = (self.columns.iter())
            .map(|name| (name.clone(), ColumnKind::Number))
            .collect();
        let blocks: Vec<Values<'_>> = self.values.iter().map(|v| Values::Numbers(v)).collect();
        let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &kinds).expect("memory");
        table.push(&blocks).expect("memory");
        table.finish().expect("memory")
    }

    /// Writes two CSV files, as recorders do (nine decimals, and all that a double has), and a Parquet file.
    fn write(&self, folder: &Path) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for (name, decimals) in [("decimals.csv", Some(9)), ("shortest.csv", None)] {
            files.push(folder.join(name));
            std::fs::write(&files[files.len() - 1], self.csv(decimals)).expect("a file");
        }
        files.push(folder.join("zstd.parquet"));
        std::fs::write(&files[2], self.parquet()).expect("a file");
        files
    }
}

/// Where pyarrow is asked for.
struct Peer {
    python: String,
    script: &'static str,
}

impl Peer {
    fn new() -> Self {
        let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../../.venv/bin/python");
        Self {
            python: std::env::var("TWINCAL_CHECK_PYTHON").unwrap_or_else(|_| own.into()),
            script: concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/tables.py"),
        }
    }

    /// Writes a table anew as pyarrow and pandas write it unless told otherwise; whether that went well.
    fn copy(&self, from: &Path, to: &Path) -> bool {
        let mut copy = Command::new(&self.python);
        copy.arg(self.script).arg("--copy").args([from, to]);
        copy.status().is_ok_and(|status| status.success())
    }

    /// Prints what pyarrow takes.
    fn read(&self, files: &[PathBuf]) {
        let output = Command::new(&self.python)
            .arg(self.script)
            .args(files)
            .output();
        match output {
            Ok(output) if output.status.success() => {
                let text = String::from_utf8_lossy(&output.stdout);
                for (line, path) in text.lines().zip(files) {
                    let seconds = line.rsplit(' ').next().and_then(|s| s.parse().ok());
                    let seconds = seconds.expect("a number");
                    say(&word(path), "pyarrow", seconds, size(path));
                }
            }
            Ok(output) => println!(
                "pyarrow failed: {}",
                String::from_utf8_lossy(&output.stderr)
            ),
            Err(_) => println!("pyarrow skipped: no .venv (./check makes it)"),
        }
    }
}

fn size(path: &Path) -> u64 {
    std::fs::metadata(path).expect("a file").len()
}

fn word(path: &Path) -> String {
    path.file_name()
        .map_or(String::new(), |n| n.to_string_lossy().into())
}

/// Prints what one core takes.
fn one_core(files: &[PathBuf], robot: &Robot) {
    for path in files {
        let seconds = shortest(|| {
            let (recording, _) = read_log(path, robot, &LogOptions::default()).expect("readable");
            recording.time.len()
        });
        say(&word(path), "twincal", seconds, size(path));
    }
}

/// Prints what two threads take by the clock.
fn two_threads(files: &[PathBuf], robot: &Robot) {
    let two = rayon::ThreadPoolBuilder::new().num_threads(2);
    let two = two.build().expect("threads");
    for path in files {
        let by_the_clock = (0..5).map(|_| {
            let start = std::time::Instant::now();
            let read = two.install(|| read_log(path, robot, &LogOptions::default()));
            assert_eq!(read.expect("readable").0.time.len(), ROWS);
            start.elapsed().as_secs_f64()
        });
        let seconds = by_the_clock.fold(f64::INFINITY, f64::min);
        say(&word(path), "twincal, two threads", seconds, size(path));
    }
}

/// Prints the peak memory of a process that reads one file and nothing else.
fn peaks(files: &[PathBuf]) {
    for path in files {
        let program = std::env::current_exe().expect("this bench");
        let output = Command::new(program).arg("--peak").arg(path).output();
        let output = output.expect("runs again").stdout;
        let text = String::from_utf8_lossy(&output);
        println!("{:<34} {:<24} peak {}", word(path), "twincal", text.trim());
    }
}

/// Prints what the `csv` crate with the standard library's numbers takes.
fn csv_crate(files: &[PathBuf]) {
    for path in files {
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
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = Table::new().write(folder.path());
    let peer = Peer::new();
    let snappy = folder.path().join("snappy.parquet");
    if peer.copy(&files[2], &snappy) {
        files.push(snappy);
    } else {
        println!("snappy skipped: no pyarrow in .venv (./check makes it)");
    }
    println!("7 joints, t, q, q̇, torque (22 columns), {ROWS} rows");
    one_core(&files, &robot);
    two_threads(&files[2..], &robot);
    peaks(&files);
    csv_crate(&files[..2]);
    peer.read(&files);
}
