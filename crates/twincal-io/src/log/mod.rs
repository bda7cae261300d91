//! Logs in: tables (CSV, Parquet, Arrow, NPZ) and bags of ROS (MCAP, rosbag2) become a [`Recording`] in the robot's joint order.
//!
//! | step | file |
//! |---|---|
//! | which column is which channel | `columns.rs` |
//! | names of well-known recorders | `preset.rs` |
//! | numbers to a recording, or to chapters of a long one | `assemble.rs`, `cells.rs`, `scratch.rs` |
//! | text tables | `csv/` |
//! | Parquet | `parquet.rs`, checked first by `pages.rs`; `shared_file.rs` for several threads |
//! | Arrow IPC | `arrow/` |
//! | NPZ | `npz.rs` |
//! | tables in memory | `memory_table.rs` |
//! | MCAP, rosbag2 | `bag/`, `stamps.rs` |
//! | other units and signs | `factors.rs` |
//! | what the logged torque is | `torque.rs` |

#[cfg(feature = "tables")]
mod arrow;
mod assemble;
#[cfg(feature = "bags")]
mod bag;
mod cells;
mod columns;
mod csv;
mod factors;
mod header;
mod memory_table;
#[cfg(feature = "tables")]
mod npz;
#[cfg(feature = "tables")]
mod pages;
#[cfg(feature = "tables")]
mod parquet;
mod preset;
mod scratch;
#[cfg(not(all(feature = "tables", feature = "bags")))]
mod unsupported;
#[cfg(feature = "tables")]
mod shared_file;
pub(crate) mod stamps;
mod torque;

#[cfg(feature = "tables")]
pub(crate) use arrow::{ANEW, Row, Rows, fits};
pub(crate) use assemble::assemble;
pub(crate) use cells::Cells;
pub(crate) use columns::has_columns;
pub use columns::{Channel, Selection, joints_without_column, match_columns};
pub use header::read_header;
pub use memory_table::{Column, read_columns};
pub use preset::Preset;
pub use torque::{TorqueOptions, TorqueSource};

#[cfg(feature = "bags")]
use self::bag::read as read_bag;
use crate::artifact::sha256;
use crate::config::ColumnsTable;
use crate::error::{Error, Place, Result};
use crate::open::open_log_file;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::robot::Robot;
use twincal::signal::{Log, Payload, Recording};

/// Most columns of a table.
pub const MAX_COLUMNS: usize = 100_000;
/// Longest name of a column, a topic or a joint, bytes.
pub const MAX_NAME: usize = 4096;

/// What an Arrow file begins and ends with.
const ARROW_FILE: &[u8] = b"ARROW1";
/// What an Arrow message begins with, and so a stream.
const ARROW_MESSAGE: [u8; 4] = [0xFF; 4];

/// How logs are read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogOptions {
    /// Sampling rate, Hz: replaces the time stamps (`--rate`).
    pub rate_hz: Option<f64>,
    /// Drop and count rows that cannot be read instead of refusing the file (`--lenient`).
    pub lenient: bool,
    /// Which column is which channel where the names do not say it (`[columns]`).
    pub columns: ColumnsTable,
    /// Whose recorder wrote the table (`[[log]] preset`).
    pub preset: Option<Preset>,
    /// Topics of a bag (`[[log]] topic`); none: the only one with joint states.
    pub topics: Vec<String>,
    /// What the logged torque is (`[[log]] torque`).
    pub torque: TorqueOptions,
    /// What the robot carried (`[[log]] payload`); handed on as it is.
    pub payload: Payload,
}

impl LogOptions {
    /// SHA-256 of all of them: a log that is read otherwise is another log.
    #[must_use]
    pub fn checksum(&self) -> String {
        sha256(format!("{self:?}").as_bytes())
    }
}

/// Reads one log: CSV with any delimiter, Parquet, Arrow, NPZ, MCAP, a SQLite bag (told by their first bytes, not by their names) or the folder
/// of a rosbag2.
///
/// Values are taken as they are, NaN included, and torque as `[[log]] torque` says; joints come out in the robot's order.
///
/// # Errors
/// [`Error::System`] if the file cannot be read; [`Error::Content`] with `file:line[:column]` for everything in it that cannot
/// be understood: empty, UTF-16, ragged rows, text in numbers, columns that are duplicate, missing or without any number.
///
/// # Example
/// A table without time stamps that was logged at 100 Hz.
/// ```
/// use twincal_io::log::{LogOptions, read_log};
///
/// # use twincal_io::model::parse_model;
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
/// # <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// # <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// # let (robot, _) = parse_model("pendulum.urdf", text.as_bytes(), &Default::default())?.robot(&Default::default())?;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("run1.csv");
/// std::fs::write(&path, "pivot.q,pivot.tau\n0.1,0.5\n0.2,1\n0.3,1.5\n")?;
/// let options = LogOptions { rate_hz: Some(100.0), ..LogOptions::default() };
/// let (log, findings) = read_log(&path, &robot, &options)?;
/// assert!((log.time[2] - log.time[0] - 0.02).abs() < 1e-12);
/// for finding in &findings {
///     println!("{}", finding.message);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_log(
    path: &Path,
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    in_memory(read(path, robot, options, false)?)
}

/// The same, but a log that is long (102 MiB of numbers) is left in a temporary file and comes in chapters: memory does not grow with
/// it.
///
/// # Errors
/// Those of [`read_log`], and [`Error::System`] without room for the temporary file.
pub fn open_log(
    path: &Path,
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Log<'static>, Vec<Finding>)> {
    read(path, robot, options, true)
}

/// What was read without chapters.
fn in_memory((log, findings): (Log<'static>, Vec<Finding>)) -> Result<(Recording, Vec<Finding>)> {
    let recording = match log {
        Log::Whole(recording) => recording.into_owned(),
        Log::Long(long) => long.whole()?,
    };
    Ok((recording, findings))
}

/// What every reader has to know.
#[derive(Clone, Copy)]
pub(crate) struct Request<'a> {
    /// The file as given.
    pub(crate) name: &'a str,
    pub(crate) robot: &'a Robot,
    pub(crate) options: &'a LogOptions,
    /// Whether a long log may come in chapters.
    pub(crate) chapters: bool,
}

impl Request<'_> {
    /// Which of the columns of a table are wanted.
    fn select(&self, header: &[String]) -> Result<Selection> {
        match_columns(self.name, header, self.robot, self.options)
    }
}

fn read(
    path: &Path,
    robot: &Robot,
    options: &LogOptions,
    chapters: bool,
) -> Result<(Log<'static>, Vec<Finding>)> {
    let name = path.display().to_string();
    let system = |e: &std::io::Error| Error::system(&name, "read", e, "check the disk");
    let request = Request {
        name: &name,
        robot,
        options,
        chapters,
    };
    if path.is_dir() {
        return read_bag(path, request);
    }
    let mut file = open_log_file(path, &name)?;
    let bytes = file.metadata().map_err(|e| system(&e))?.len();
    let mut head = Vec::new();
    (&mut file)
        .take(Kind::HEAD as u64)
        .read_to_end(&mut head)
        .map_err(|e| system(&e))?;
    let kind = Kind::of(&head);
    refuse_false_name(path, &name, &head, kind)?;
    file.seek(SeekFrom::Start(0)).map_err(|e| system(&e))?;
    match kind {
        #[cfg(feature = "tables")]
        Kind::Parquet => {
            let pages = file.try_clone().map_err(|e| system(&e))?;
            let chunks = shared_file::SharedFile::new(file).map_err(|e| system(&e))?;
            parquet::read(chunks, pages, request)
        }
        #[cfg(feature = "tables")]
        Kind::Arrow => arrow::read(file, request),
        #[cfg(feature = "tables")]
        Kind::Npz => npz::read(std::io::BufReader::new(file), request),
        #[cfg(not(feature = "tables"))]
        Kind::Parquet | Kind::Arrow | Kind::Npz => Err(unsupported::table(&name)),
        Kind::Mcap | Kind::Sqlite | Kind::Zstd => read_bag(path, request),
        Kind::FirstFeather => Err(first_feather(&name)),
        Kind::LfsPointer => Err(lfs_pointer(&name)),
        Kind::Text => csv_table(file, bytes, request),
    }
}

#[cfg(not(feature = "bags"))]
fn read_bag(_: &Path, request: Request<'_>) -> Result<(Log<'static>, Vec<Finding>)> {
    Err(unsupported::bag(request.name))
}

/// The files that a log consists of: itself, or what a rosbag2 folder names.
///
/// # Errors
/// [`Error::Content`] for a folder that is no bag.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    #[cfg(feature = "bags")]
    return bag::files(path).map(|(files, _)| files);
    #[cfg(not(feature = "bags"))]
    Ok(vec![path.to_owned()])
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
    let request = Request {
        name,
        robot,
        options,
        chapters: false,
    };
    let read = match Kind::of(bytes) {
        #[cfg(feature = "tables")]
        Kind::Parquet => {
            let pages = std::io::Cursor::new(bytes);
            let bytes = bytes::Bytes::from_static(bytes);
            parquet::read(bytes, pages, request)?
        }
        #[cfg(feature = "tables")]
        Kind::Arrow => arrow::read(std::io::Cursor::new(bytes), request)?,
        #[cfg(feature = "tables")]
        Kind::Npz => npz::read(std::io::Cursor::new(bytes), request)?,
        #[cfg(not(feature = "tables"))]
        Kind::Parquet | Kind::Arrow | Kind::Npz => return Err(unsupported::table(name)),
        #[cfg(feature = "bags")]
        Kind::Mcap => bag::read_mcap(&mut std::io::Cursor::new(bytes), request)?,
        #[cfg(not(feature = "bags"))]
        Kind::Mcap => return Err(unsupported::bag(name)),
        Kind::FirstFeather => return Err(first_feather(name)),
        Kind::LfsPointer => return Err(lfs_pointer(name)),
        Kind::Text | Kind::Sqlite | Kind::Zstd => csv_table(bytes, bytes.len() as u64, request)?,
    };
    in_memory(read)
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
            (ARROW_FILE, Self::Arrow),
            (&ARROW_MESSAGE, Self::Arrow),
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
    let request = Request {
        name,
        robot,
        options,
        chapters: false,
    };
    in_memory(csv_table(source, bytes, request)?)
}

fn csv_table(
    source: impl Read,
    bytes: u64,
    request: Request<'_>,
) -> Result<(Log<'static>, Vec<Finding>)> {
    let mut table = csv::Table::open(source, bytes, request.name)?;
    let selection = request.select(table.header())?;
    let wanted = selection.file_columns();
    let cells = table.read(&wanted, request.options.lenient, request.chapters)?;
    let mut findings = table.into_findings();
    let log = assemble(request, cells, selection, &mut findings)?;
    Ok((log, findings))
}

#[cfg(test)]
mod tests;
