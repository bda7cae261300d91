//! Logs in: tables (CSV, Parquet, Arrow, NPZ) and bags of ROS (MCAP, rosbag2) become a [`Recording`] in the robot's joint order.
//!
//! | step | file |
//! |---|---|
//! | which column is which channel | `columns.rs` |
//! | names of well-known recorders | `preset.rs` |
//! | text tables | `csv/` |
//! | Parquet | `parquet.rs`, checked first by `pages.rs`; `shared_file.rs` for several threads |
//! | Arrow IPC | `arrow/` |
//! | NPZ | `npz.rs` |
//! | MCAP, rosbag2 | `bag/` |
//! | what the logged torque is | `torque.rs` |

mod arrow;
mod bag;
mod columns;
mod csv;
mod header;
mod npz;
mod pages;
mod parquet;
mod preset;
mod shared_file;
mod torque;

pub use columns::{Channel, Selection, joints_without_column, match_columns};
pub use header::read_header;
pub use preset::Preset;
pub use torque::{TorqueOptions, TorqueSource};

use crate::config::ColumnsTable;
use crate::error::{Error, Place, Result};
use crate::memory;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
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
    /// Whose recorder wrote the table (`[log] preset`).
    pub preset: Option<Preset>,
    /// Topics of a bag (`[log] topic`); none: the only one with joint states.
    pub topics: Vec<String>,
    /// What the logged torque is (`[log] torque`).
    pub torque: TorqueOptions,
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

impl Cells {
    /// Room for `rows` numbers in each of `columns` columns, if there is that much memory.
    ///
    /// # Errors
    /// [`Error::Content`] about the file `name` with both sizes.
    pub(crate) fn reserve(name: &str, rows: usize, columns: usize) -> Result<Self> {
        memory::require(
            name,
            (rows as u64).saturating_mul(columns as u64 * 8),
            "read a shorter log, or one with fewer columns",
        )?;
        Ok(Self {
            columns: (0..columns).map(|_| Vec::with_capacity(rows)).collect(),
            ..Self::default()
        })
    }
}

/// Reads one log: CSV with any delimiter, Parquet, Arrow, NPZ, MCAP, a SQLite bag (told by their first bytes, not by their names) or the folder
/// of a rosbag2.
///
/// Values are taken as they are, NaN included, and torque as `[log] torque` says; joints come out in the robot's order.
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
        return finish(bag::read(path, robot, options)?, robot, options);
    }
    let mut head = Vec::new();
    (&mut file)
        .take(Kind::HEAD as u64)
        .read_to_end(&mut head)
        .map_err(|e| system(&e))?;
    // A pipe cannot be rewound: it is text.
    let kind = if metadata.is_file() {
        Kind::of(&head)
    } else {
        Kind::Text
    };
    refuse_false_name(path, &name, &head, kind)?;
    if kind != Kind::Text {
        file.seek(SeekFrom::Start(0)).map_err(|e| system(&e))?;
    }
    let read = match kind {
        Kind::Parquet => {
            let pages = file.try_clone().map_err(|e| system(&e))?;
            let chunks = shared_file::SharedFile::new(file).map_err(|e| system(&e))?;
            parquet::read(chunks, pages, &name, robot, options)?
        }
        Kind::Arrow => arrow::read(file, &name, robot, options)?,
        Kind::Npz => npz::read(BufReader::new(file), &name, robot, options)?,
        Kind::Mcap | Kind::Sqlite | Kind::Zstd => bag::read(path, robot, options)?,
        Kind::FirstFeather => return Err(first_feather(&name)),
        Kind::LfsPointer => return Err(lfs_pointer(&name)),
        // The bytes already taken go first.
        Kind::Text => {
            let head = std::io::Cursor::new(head);
            csv_table(head.chain(file), metadata.len(), &name, robot, options)?
        }
    };
    finish(read, robot, options)
}

/// The files that a log consists of: itself, or what a rosbag2 folder names.
///
/// # Errors
/// [`Error::Content`] for a folder that is no bag.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    bag::files(path).map(|(files, _)| files)
}

/// A file whose name says more than its content holds.
fn refuse_false_name(path: &Path, name: &str, head: &[u8], kind: Kind) -> Result<()> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let (claimed, word) = match ending.as_deref() {
        Some("mcap") => (Kind::Mcap, "an MCAP file"),
        Some("db3") => (Kind::Sqlite, "a SQLite bag"),
        Some("npz") => (Kind::Npz, "an NPZ file"),
        Some("parquet") => (Kind::Parquet, "a Parquet file"),
        Some("arrow" | "arrows" | "feather") => (Kind::Arrow, "an Arrow file"),
        _ => return Ok(()),
    };
    if kind != Kind::Text || kind == claimed || head.is_empty() {
        return Ok(());
    }
    Err(Error::content(
        Place::file(name),
        format!("does not begin as {word} does"),
        "copy it again, or give it the ending of what it is",
    ))
}

/// What Git leaves in the place of a large file that was not fetched.
fn lfs_pointer(name: &str) -> Error {
    Error::content(
        Place::file(name),
        "this is a Git LFS pointer, not the log itself",
        "fetch the log with `git lfs pull`",
    )
}

/// Feather's first version, a format of its own that nothing writes any more.
fn first_feather(name: &str) -> Error {
    Error::content(
        Place::file(name),
        "is a Feather file of version 1",
        "write it again as version 2: pyarrow.feather.write_feather(pyarrow.feather.read_table(FILE), FILE)",
    )
}

/// Reads a log from memory: CSV, Parquet, Arrow, NPZ or MCAP; `name` is what messages call it.
///
/// # Errors
/// Like [`read_log`].
pub fn parse_log(
    name: &str,
    bytes: &'static [u8],
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    let read = match Kind::of(bytes) {
        Kind::Parquet => {
            let pages = std::io::Cursor::new(bytes);
            let bytes = bytes::Bytes::from_static(bytes);
            parquet::read(bytes, pages, name, robot, options)?
        }
        Kind::Mcap => bag::read_mcap(&mut std::io::Cursor::new(bytes), name, robot, options)?,
        Kind::Arrow => arrow::read(std::io::Cursor::new(bytes), name, robot, options)?,
        Kind::Npz => npz::read(std::io::Cursor::new(bytes), name, robot, options)?,
        Kind::FirstFeather => return Err(first_feather(name)),
        Kind::LfsPointer => return Err(lfs_pointer(name)),
        Kind::Text | Kind::Sqlite | Kind::Zstd => {
            csv_table(bytes, bytes.len() as u64, name, robot, options)?
        }
    };
    finish(read, robot, options)
}

/// What a file is by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Text,
    Parquet,
    Arrow,
    FirstFeather,
    Npz,
    Mcap,
    Sqlite,
    Zstd,
    LfsPointer,
}

impl Kind {
    /// Bytes that tell.
    const HEAD: usize = 32;

    fn of(head: &[u8]) -> Self {
        let kinds: [(&[u8], Self); 10] = [
            (b"PAR1", Self::Parquet),
            (arrow::FILE_MAGIC, Self::Arrow),
            (&arrow::MARKER, Self::Arrow),
            (b"FEA1", Self::FirstFeather),
            (b"PK\x03\x04", Self::Npz),
            (b"PK\x05\x06", Self::Npz),
            (b"\x89MCAP", Self::Mcap),
            (b"SQLite format 3\0", Self::Sqlite),
            (b"\x28\xB5\x2F\xFD", Self::Zstd),
            (b"version https://git-lfs", Self::LfsPointer),
        ];
        let found = kinds.iter().find(|(magic, _)| head.starts_with(magic));
        found.map_or(Self::Text, |(_, kind)| *kind)
    }
}

/// What is done to every log, whatever its form.
fn finish(
    (mut recording, mut findings): (Recording, Vec<Finding>),
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    torque::to_joint_torque(&mut recording, robot, options, &mut findings)?;
    Ok((recording, findings))
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
    let read = csv_table(source, bytes, name, robot, options)?;
    finish(read, robot, options)
}

fn csv_table(
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
        None => {
            let mut time = take(positions.time).unwrap_or_default();
            if let Some(unit) = options.columns.time_unit.filter(|unit| unit.ticks() != 1.0) {
                time.iter_mut().for_each(|time| *time /= unit.ticks());
                let message = format!(
                    "time stamps were taken as {} as [columns] time_unit says",
                    unit.word()
                );
                findings.push(Finding::new(Severity::Note, "time_unit", name, message, 0));
            } else if let Some(preset) = options.preset.filter(|p| wants_ticks(*p, options)) {
                time.iter_mut().for_each(|time| *time /= preset.ticks());
                let message = format!(
                    "time stamps were divided by {} as the preset `{}` says",
                    preset.ticks(),
                    preset.name()
                );
                findings.push(Finding::new(Severity::Note, "time_unit", name, message, 0));
            }
            time
        }
    };
    let joints = positions
        .joints
        .iter()
        .enumerate()
        .map(|(number, joint)| Channels {
            q: take(joint[0]).unwrap_or_default(),
            qd: take(joint[1]),
            qdd: take(joint[2]),
            tau: take(joint[3]),
            temperature: take(positions.temperatures.get(number).copied().flatten()),
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

/// Whether a preset's own clock counts: not where the config states the unit.
fn wants_ticks(preset: Preset, options: &LogOptions) -> bool {
    preset.ticks() != 1.0 && options.columns.time_unit.is_none()
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
