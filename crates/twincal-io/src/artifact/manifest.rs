//! `manifest.json`: format version, who wrote the artefact, and the checksum of every file.

use super::pieces::Pieces;
use crate::error::{Error, Place, Result};
use crate::open::open_log_file;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Version of the layout that this program writes and the newest that it reads.
pub const FORMAT: u64 = 1;

/// Oldest version of the program that reads [`FORMAT`].
const NEEDS: &str = "0.1.0";

/// Which command wrote an artefact; `demo` replaces only its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Maker {
    /// `twincal fit`.
    Fit,
    /// `twincal demo`.
    Demo,
    /// `twincal export --draws`.
    Export,
    /// `twincal fleet`.
    Fleet,
    /// `twincal design`.
    Design,
}

/// Size and checksum of one file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Bytes.
    pub bytes: u64,
    /// SHA-256, lower-case hexadecimal.
    pub sha256: String,
}

/// `manifest.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the layout.
    pub format: u64,
    /// Oldest version of the program that reads it.
    pub needs: String,
    /// Version of the program that wrote it.
    pub twincal: String,
    /// Command that wrote it.
    pub made_by: Maker,
    /// Every other file, by name.
    pub files: BTreeMap<String, FileEntry>,
}

/// The part that every version must keep.
#[derive(Deserialize)]
struct Version {
    format: u64,
    needs: String,
}

impl Manifest {
    /// The manifest of these files.
    pub(super) fn of(made_by: Maker, files: &[(&str, Pieces)]) -> Self {
        let entry = |text: &Pieces| FileEntry {
            bytes: text.len() as u64,
            sha256: sha256_of(text.iter()),
        };
        Self {
            format: FORMAT,
            needs: NEEDS.into(),
            twincal: env!("CARGO_PKG_VERSION").into(),
            made_by,
            files: files
                .par_iter()
                .map(|(name, text)| ((*name).to_owned(), entry(text)))
                .collect(),
        }
    }

    /// Parses a manifest; `file` is its name in messages.
    pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Self> {
        let damaged = |e: serde_json::Error| {
            let place = Place {
                file: file.into(),
                line: Some(e.line() as u64),
                column: Some(e.column() as u64),
            };
            Error::content(
                place,
                format!("the manifest is damaged: {e}"),
                "write the artefact anew with `twincal fit`",
            )
        };
        let version: Version = serde_json::from_slice(bytes).map_err(damaged)?;
        let own = env!("CARGO_PKG_VERSION");
        if version.format > FORMAT || numbers(&version.needs) > numbers(own) {
            return Err(Error::content(
                Place::file(file),
                format!(
                    "artefact of format {}, needs twincal >= {}; this is {own}",
                    version.format, version.needs
                ),
                "update twincal",
            ));
        }
        serde_json::from_slice(bytes).map_err(damaged)
    }
}

/// `1.20.3` as numbers that compare.
fn numbers(version: &str) -> Vec<u64> {
    version
        .split(['.', '-', '+'])
        .map(|part| part.parse().unwrap_or(0))
        .collect()
}

/// SHA-256 in lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    sha256_of(std::iter::once(bytes))
}

fn sha256_of<'a>(pieces: impl Iterator<Item = &'a [u8]>) -> String {
    let mut digest = Sha256::new();
    pieces.for_each(|piece| digest.update(piece));
    hexadecimal(&digest.finalize())
}

/// SHA-256 of a file.
///
/// # Errors
/// The file cannot be read.
pub fn sha256_of_file(path: &Path) -> Result<String> {
    sha256_unless(path, &AtomicBool::new(false))
}

/// SHA-256 of a log; what it is does not matter any more once `stop` is set.
///
/// # Errors
/// The file cannot be read.
pub fn sha256_unless(path: &Path, stop: &AtomicBool) -> Result<String> {
    let name = path.to_string_lossy();
    let refused =
        |e: std::io::Error| Error::system(&*name, "read", &e, "give a file that can be read");
    let mut file = open_log_file(path, &name)?;
    let (mut digest, mut buffer) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        if stop.load(Ordering::Relaxed) {
            return Ok(String::new());
        }
        match file.read(&mut buffer).map_err(refused)? {
            0 => return Ok(hexadecimal(&digest.finalize())),
            length => digest.update(&buffer[..length]),
        }
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes
        .iter()
        .fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        })
}
