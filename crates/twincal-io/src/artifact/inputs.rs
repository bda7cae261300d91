//! What a command reads, and what belongs to the twin it reads: no output takes its place, whatever `--force` says.

use super::OTHER_OUTPUT;
use super::manifest::sha256_of_file;
use crate::context::FileHash;
use crate::error::{Error, Place, Result};
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// What would lose its content to an output: files, folders with all that lies in them, and what a twin was made from.
///
/// A file is known by its canonical path and by device and number on it, so that symbolic links, hard links and other spellings of
/// its path are the same file; what a twin was made from is known by its checksum.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    read: Vec<Input>,
    originals: Vec<FileHash>,
}

/// A file or folder that is read.
#[derive(Debug, Clone)]
struct Input {
    shown: String,
    real: PathBuf,
    id: (u64, u64),
}

/// Device and number on it.
fn id(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}

/// Metadata of what lies in a folder; nothing for what is no folder.
fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    entries.filter_map(|entry| Some(entry.ok()?.path()))
}

impl Inputs {
    /// Adds a file, or a folder with the files in it. What is not there is said when it is read.
    pub fn add(&mut self, path: &Path) {
        self.add_one(path);
        for entry in entries(path) {
            self.add_one(&entry);
        }
    }

    fn add_one(&mut self, path: &Path) {
        if let (Ok(metadata), Ok(real)) = (fs::metadata(path), path.canonicalize()) {
            self.read.push(Input {
                shown: path.to_string_lossy().into_owned(),
                real,
                id: id(&metadata),
            });
        }
    }

    /// Adds the files that a twin was made from.
    pub fn add_originals(&mut self, files: &[FileHash]) {
        let known = files.iter().filter(|file| !file.sha256.is_empty());
        self.originals.extend(known.cloned());
    }

    /// Refuses a target that is an input, lies in one, or holds one.
    ///
    /// # Errors
    /// [`Error::Content`] with the target and the input.
    pub(super) fn refuse(&self, target: &Path) -> Result<()> {
        // What does not exist loses nothing.
        let (Ok(metadata), Ok(real)) = (fs::metadata(target), target.canonicalize()) else {
            return Ok(());
        };
        let mut ids = vec![id(&metadata)];
        ids.extend(entries(target).filter_map(|entry| Some(id(&fs::metadata(entry).ok()?))));
        let touched = |input: &&Input| {
            ids.contains(&input.id)
                || real.starts_with(&input.real)
                || input.real.starts_with(&real)
        };
        match self.read.iter().find(touched) {
            None => Ok(()),
            Some(input) => {
                let problem = format!(
                    "is read by this command (`{}`) and would be overwritten",
                    input.shown
                );
                Err(refusal(target, problem))
            }
        }
    }

    /// Which of the files that the twin was made from lies at `target`.
    ///
    /// # Errors
    /// [`Error::System`] if the target cannot be read.
    pub(super) fn original(&self, target: &Path) -> Result<Option<FileHash>> {
        if self.originals.is_empty() || !target.is_file() {
            return Ok(None);
        }
        let sha256 = sha256_of_file(target)?;
        let mut originals = self.originals.iter();
        Ok(originals.find(|file| file.sha256 == sha256).cloned())
    }
}

/// The error for a target that would lose what the twin was made from.
pub(super) fn refuse_original(target: &Path, original: &FileHash) -> Error {
    let problem = format!(
        "holds `{}`, from which this twin was made, and would be overwritten",
        original.name
    );
    refusal(target, problem)
}

fn refusal(target: &Path, problem: String) -> Error {
    let place = Place::file(target.to_string_lossy());
    Error::content(place, problem, OTHER_OUTPUT)
}
