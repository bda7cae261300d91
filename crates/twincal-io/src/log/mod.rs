//! Logs in: CSV and Parquet tables become a [`Recording`] in the robot's joint order.
//!
//! | step | file |
//! |---|---|
//! | which column is which channel | `columns.rs` |
//! | text tables | `csv/` |
//! | Parquet | `parquet.rs`, checked first by `pages.rs` |

mod columns;
mod csv;
mod pages;
mod parquet;

pub use columns::{Channel, Selection, match_columns};

use crate::config::ColumnsTable;
use crate::error::{Error, Place, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use twincal::robot::Robot;
use twincal::signal::{Channels, Payload, Recording};
use twincal::{Finding, Severity};

/// Most columns of a table.
pub const MAX_COLUMNS: usize = 100_000;
/// Share of rows dropped as unreadable beyond which the log counts as degraded.
const DROPPED_LIMIT: f64 = 0.01;

/// How logs are read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogOptions {
    /// Sampling rate, Hz: replaces the time stamps (`--rate`).
    pub rate_hz: Option<f64>,
    /// Drop and count rows that cannot be read instead of refusing the file (`--lenient`).
    pub lenient: bool,
    /// Which column is which channel where the names do not say it (`[columns]`).
    pub columns: ColumnsTable,
    /// What the robot carried (`[[log]] payload`); handed on as it is.
    pub payload: Payload,
}

/// A table's selected columns as they stand in the file; missing cells are NaN.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Cells {
    /// One per selected column, all of one length.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Rows that could not be read and were dropped.
    pub(crate) dropped: u64,
    /// First of them, in words.
    pub(crate) first_dropped: Option<String>,
}

/// Reads one log file: CSV with any delimiter, or Parquet (told by its first four bytes, not by its name).
///
/// Values are taken as they are, NaN included; joints come out in the robot's order.
///
/// # Errors
/// [`Error::System`] if the file cannot be read; [`Error::Content`] with `file:line[:column]` for everything in it that cannot
/// be understood: empty, UTF-16, ragged rows, text in numbers, columns that are duplicate, missing or without any number.
pub fn read_log(
    path: &Path,
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    let name = path.display().to_string();
    let system =
        |e: &std::io::Error| Error::system(&name, "read", e, "check the path and its permissions");
    let mut file = File::open(path).map_err(|e| system(&e))?;
    let metadata = file.metadata().map_err(|e| system(&e))?;
    if metadata.is_dir() {
        return Err(Error::content(
            Place::file(&name),
            "is a folder",
            "give a CSV or Parquet file",
        ));
    }
    let mut magic = [0; 4];
    let mut known = 0;
    while known < 4 {
        match file.read(&mut magic[known..]).map_err(|e| system(&e))? {
            0 => break,
            n => known += n,
        }
    }
    if metadata.is_file() && magic == *b"PAR1" {
        file.seek(SeekFrom::Start(0)).map_err(|e| system(&e))?;
        let pages = file.try_clone().map_err(|e| system(&e))?;
        return parquet::read(file, pages, &name, robot, options);
    }
    // The bytes already taken go first: a pipe cannot be rewound.
    let head = std::io::Cursor::new(magic[..known].to_vec());
    read_csv(head.chain(file), metadata.len(), &name, robot, options)
}

/// Reads a log from memory: CSV or Parquet; `name` is what messages call it.
///
/// # Errors
/// Like [`read_log`].
pub fn parse_log(
    name: &str,
    bytes: &'static [u8],
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    if bytes.starts_with(b"PAR1") {
        let pages = std::io::Cursor::new(bytes);
        return parquet::read(
            bytes::Bytes::from_static(bytes),
            pages,
            name,
            robot,
            options,
        );
    }
    read_csv(bytes, bytes.len() as u64, name, robot, options)
}

/// Reads a CSV log from any source; `name` is what messages call it, `bytes` its length if known (else 0).
///
/// # Errors
/// Like [`read_log`].
pub fn read_csv(
    source: impl Read,
    bytes: u64,
    name: &str,
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    let mut table = csv::Table::open(source, bytes, name)?;
    let selection = match_columns(name, table.header(), robot, options)?;
    let wanted = selection.file_columns();
    let cells = table.read(&wanted, options.lenient)?;
    let mut findings = table.into_findings();
    let recording = assemble(
        name,
        table_rows(&cells),
        cells,
        &selection,
        options,
        &mut findings,
    )?;
    Ok((recording, findings))
}

fn table_rows(cells: &Cells) -> usize {
    cells.columns.first().map_or(0, Vec::len)
}

/// Cells to a recording: time from the file or the rate, channels per joint.
pub(crate) fn assemble(
    name: &str,
    rows: usize,
    mut cells: Cells,
    selection: &Selection,
    options: &LogOptions,
    findings: &mut Vec<Finding>,
) -> Result<Recording> {
    findings.extend(selection.findings.iter().cloned());
    if rows == 0 {
        return Err(Error::content(
            Place::file(name),
            "has a header but no rows",
            "record a motion and export it again",
        ));
    }
    if cells.dropped > 0 {
        let share = cells.dropped as f64 / (rows as f64 + cells.dropped as f64);
        let severity = if share > DROPPED_LIMIT {
            Severity::Degraded
        } else {
            Severity::Warning
        };
        let first = cells.first_dropped.take().unwrap_or_default();
        let message = format!(
            "{} rows ({:.2} %) could not be read and were dropped; the first: {first}",
            cells.dropped,
            100.0 * share
        );
        findings.push(Finding::new(
            severity,
            "unreadable_rows",
            name,
            message,
            cells.dropped,
        ));
    }
    let mut take = |index: Option<usize>| index.map(|i| std::mem::take(&mut cells.columns[i]));
    let positions = selection.positions();
    let time = match options.rate_hz {
        Some(rate) => {
            if !(rate.is_finite() && rate > 0.0) {
                let key = "--rate";
                return Err(twincal::Error::Setting {
                    key: key.into(),
                    problem: format!("{rate} Hz is out of range"),
                    remedy: "give the sampling rate in Hz, above 0".into(),
                }
                .into());
            }
            if selection.time.is_some() {
                let message = format!("time stamps were replaced by row / {rate} Hz as told");
                findings.push(Finding::new(
                    Severity::Note,
                    "time_replaced",
                    name,
                    message,
                    rows as u64,
                ));
            }
            (0..rows).map(|row| row as f64 / rate).collect()
        }
        None => take(positions.time).unwrap_or_default(),
    };
    let joints = positions
        .joints
        .iter()
        .map(|joint| Channels {
            q: take(joint[0]).unwrap_or_default(),
            qd: take(joint[1]),
            qdd: take(joint[2]),
            tau: take(joint[3]),
        })
        .collect();
    let recording = Recording {
        name: name.to_owned(),
        time,
        joints,
        payload: options.payload,
    };
    refuse_empty_columns(name, &recording, selection)?;
    Ok(recording)
}

/// A column without a single number is a mistake in the export, not a gap.
fn refuse_empty_columns(name: &str, recording: &Recording, selection: &Selection) -> Result<()> {
    let check = |values: &[f64], column: &Option<String>| match column {
        Some(column) if values.iter().all(|v| !v.is_finite()) => Err(Error::content(
            Place::file(name),
            format!(
                "column `{column}` is NaN or empty in all {} rows",
                values.len()
            ),
            "export it again, or map another column in [columns]",
        )),
        _ => Ok(()),
    };
    if let Some(time) = selection
        .time
        .as_ref()
        .filter(|_| !recording.time.is_empty())
    {
        check(&recording.time, &Some(time.name.clone()))?;
    }
    for (channels, joint) in recording.joints.iter().zip(&selection.joints) {
        let names = joint.each_ref().map(|c| c.as_ref().map(|c| c.name.clone()));
        check(&channels.q, &names[0])?;
        for (values, column) in [&channels.qd, &channels.qdd, &channels.tau]
            .into_iter()
            .zip(&names[1..])
        {
            if let Some(values) = values {
                check(values, column)?;
            }
        }
    }
    Ok(())
}
