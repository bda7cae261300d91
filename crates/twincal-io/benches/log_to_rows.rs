//! From a file to rows, stage by stage, one core: `cargo bench -p twincal-io --bench log_to_rows`.

#![allow(
    clippy::print_stdout,
    clippy::expect_used,
    reason = "a bench prints its table and stops where it cannot go on"
)]

#[path = "../tests/common/logs.rs"]
#[allow(dead_code, reason = "the tests use the rest of these generators")]
mod logs;

use std::time::Instant;
use twincal::robot::Robot;
use twincal::rows::{RowSignal, visit_rows};
use twincal::signal::{Auto, Pipeline, SignalSettings, Trajectory, align, choose_pipeline};
use twincal::term::{Family, Library, LibrarySettings};
use twincal_io::log::{LogOptions, read_csv, read_log};
use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};

const ROWS: f64 = 300_000.0;

/// Shortest of five runs, s.
fn shortest<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..5 {
        let start = Instant::now();
        result = Some(run());
        best = best.min(start.elapsed().as_secs_f64());
    }
    (best, result.expect("five runs"))
}

fn say(stage: &str, seconds: f64, bytes: Option<usize>) {
    let speed = bytes.map_or(String::new(), |b| {
        format!("  {:7.0} MB/s", b as f64 / seconds / 1e6)
    });
    println!(
        "{stage:<28} {:8.1} ms  {:7.2} M samples/s{speed}",
        seconds * 1e3,
        ROWS / seconds / 1e6
    );
}

fn main() {
    let robot = logs::arm();
    let log = logs::LogText::moving(2, 1000.0, ROWS / 1000.0);
    let text = log.csv();
    let options = LogOptions::default();
    println!("2 joints, 9 columns, {ROWS} samples at 1 kHz");
    let (seconds, recording) = shortest(|| {
        let bytes = text.len() as u64;
        read_csv(text.as_bytes(), bytes, "run", &robot, &options)
            .expect("readable")
            .0
    });
    say("read/csv/9_columns", seconds, Some(text.len()));
    tables(&log, &robot, &options);
    let settings = SignalSettings {
        cutoff_hz: Auto::Auto,
        rate_hz: Auto::Auto,
        coulomb_velocity: None,
        corrections: twincal::signal::Corrections::default(),
        every_sample: false,
    };
    let logs = [recording];
    let (seconds, pipeline) =
        shortest(|| choose_pipeline(&robot, &logs, &settings).expect("moves").0);
    say("choose_pipeline/2_joints", seconds, None);
    let (seconds, trajectory) = shortest(|| align(&robot, &logs[0], &pipeline).expect("moves").0);
    say("align/2_joints", seconds, None);
    rows(&robot, &pipeline, &trajectory);
}

/// Tables written, and the Parquet one read again.
fn tables(log: &logs::LogText, robot: &Robot, options: &LogOptions) {
    let columns: Vec<(String, ColumnKind)> = log
        .header
        .iter()
        .map(|h| (h.clone(), ColumnKind::Number))
        .collect();
    let values: Vec<Vec<f64>> = (0..columns.len())
        .map(|c| {
            log.rows
                .iter()
                .map(|row| row[c].parse().expect("number"))
                .collect()
        })
        .collect();
    let blocks: Vec<Values<'_>> = values.iter().map(|v| Values::Numbers(v)).collect();
    for (stage, format) in [
        ("write/csv/9_columns", TableFormat::Csv),
        ("write/parquet/9_columns", TableFormat::Parquet),
    ] {
        let (seconds, written) = shortest(|| {
            let mut table = TableWriter::new(Vec::new(), format, &columns).expect("memory");
            table.push(&blocks).expect("memory");
            table.finish().expect("memory")
        });
        say(stage, seconds, Some(written.len()));
        if format == TableFormat::Parquet {
            let file = tempfile::NamedTempFile::new().expect("a file");
            std::fs::write(file.path(), &written).expect("a file");
            let (seconds, _) =
                shortest(|| read_log(file.path(), robot, options).expect("readable"));
            say("read/parquet/9_columns", seconds, Some(written.len()));
        }
    }
}

/// Rows of friction, filtered and raw.
fn rows(robot: &Robot, pipeline: &Pipeline, trajectory: &Trajectory) {
    let library = LibrarySettings {
        generic: Some(true),
        families: Family::JOINT.to_vec(),
        coulomb_velocity: 0.02,
        ..LibrarySettings::default()
    };
    let library = Library::propose(robot, &library).expect("terms").0;
    for (stage, signal) in [
        ("rows/filtered", RowSignal::Filtered),
        ("rows/raw", RowSignal::Raw),
    ] {
        let (seconds, rows) = shortest(|| {
            let mut rows = 0;
            visit_rows(
                robot,
                &library,
                pipeline,
                trajectory,
                signal,
                &mut |block| {
                    rows += block.len;
                    Ok(())
                },
            )
            .expect("rows");
            rows
        });
        say(
            &format!("{stage}/2_joints/{}_columns", library.columns().len()),
            seconds,
            None,
        );
        println!("    {rows} rows");
    }
}
