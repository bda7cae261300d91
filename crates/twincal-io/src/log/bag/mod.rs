//! Logs of ROS: MCAP files, SQLite bags and rosbag2 folders with `sensor_msgs/JointState` and topics of any other type that are mapped.
//!
//! | step | file |
//! |---|---|
//! | which files a folder has | `folder.rs` |
//! | containers | `mcap.rs`, `sqlite.rs`, unpacked by `unpack.rs` |
//! | one message | `joint_state.rs` |
//! | topics, joints, order in time | `joint_states.rs` |
//! | rows of a topic in memory and on disk | `part.rs` |
//! | messages with some of the joints | `merge.rs` |
//! | what `[columns]` says of topics | `path.rs`, `mapping.rs` |
//! | messages of any type | `definition.rs`, `decode.rs`; `value.rs` finds what a path means |
//! | what could be mapped | `suggest.rs` |

mod decode;
mod definition;
mod folder;
mod joint_state;
mod joint_states;
mod mapping;
mod mcap;
mod merge;
mod part;
mod path;
mod sqlite;
mod suggest;
mod unpack;
mod value;

use super::{Kind, Request};
use crate::error::{Error, Place, Result};
use crate::open::{InputFile, MAX_LOG, open_log_file};
use joint_states::JointStates;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::signal::Log;

/// Bytes read from a file at a time.
const BUFFER: usize = 1 << 18;

/// Reads an MCAP file.
pub(super) fn read_mcap(source: &mut (impl Read + Seek), request: Request<'_>) -> Result<ReadLog> {
    let mut states = JointStates::new(request)?;
    let findings = mcap::read(source, request.name, &mut states)?;
    states.finish(findings)
}

/// A log with what was found in it.
type ReadLog = (Log<'static>, Vec<Finding>);

/// Reads a bag: one file, packed or not, or a folder.
pub(super) fn read(path: &Path, request: Request<'_>) -> Result<ReadLog> {
    let (files, mut findings) = files(path)?;
    let folder = path.is_dir().then_some(path);
    let mut states = JointStates::new(request)?;
    for file in &files {
        findings.extend(read_file(file, folder, &mut states)?);
    }
    states.finish(findings)
}

/// The files that a log consists of: itself, or the files of a folder.
///
/// # Errors
/// [`Error::Content`] for a folder that is no bag.
pub(super) fn files(path: &Path) -> Result<(Vec<PathBuf>, Vec<Finding>)> {
    if path.is_dir() {
        return folder::files(path);
    }
    Ok((vec![path.to_owned()], Vec::new()))
}

/// Reads one file; a file of a bag's folder has to lie in it.
fn read_file(
    path: &Path,
    folder: Option<&Path>,
    states: &mut JointStates<'_>,
) -> Result<Vec<Finding>> {
    let name = path.display().to_string();
    let mut file = match folder {
        None => open_log_file(path, &name)?,
        Some(folder) => (InputFile::new(path, MAX_LOG).inside(folder).open())
            .map_err(|refusal| refusal.into_error(&name, "check its permissions"))?,
    };
    match kind(&mut file, &name)? {
        Kind::Zstd => {
            let unpacked = unpack::unpack(file, &name)?;
            let file = open_log_file(unpacked.path(), &name)?;
            read_unpacked(file, unpacked.path(), &name, states)
        }
        _ => read_unpacked(file, path, &name, states),
    }
}

fn read_unpacked(
    mut file: File,
    path: &Path,
    name: &str,
    states: &mut JointStates<'_>,
) -> Result<Vec<Finding>> {
    match kind(&mut file, name)? {
        Kind::Mcap => {
            let mut file = BufReader::with_capacity(BUFFER, file);
            mcap::read(&mut file, name, states)
        }
        Kind::Sqlite => sqlite::read(&file, path, name, states).map(|()| Vec::new()),
        Kind::LfsPointer => Err(super::lfs_pointer(name)),
        _ => Err(Error::content(
            Place::file(name),
            "is neither an MCAP file nor a SQLite bag",
            "copy it again",
        )),
    }
}

/// What a file is by its first bytes; it stands at its start again.
fn kind(file: &mut File, name: &str) -> Result<Kind> {
    let mut head = Vec::new();
    let read = (file.take(Kind::HEAD as u64).read_to_end(&mut head)).and_then(|_| file.rewind());
    read.map_err(|e| Error::system(name, "read", &e, "check the disk"))?;
    Ok(Kind::of(&head))
}
