//! One output file (predictions): written beside its place and renamed into it, complete or absent.

use super::OTHER_OUTPUT;
use super::beside::{Beside, Lock};
use super::inputs::{Inputs, refuse_original};
use super::manifest::sha256_of_file;
use super::write::{remove, sync_folder};
use crate::context::FileHash;
use crate::error::{Error, Place, Result};
use std::fs::{self, File};
use std::io;
use std::path::Path;

/// A file that appears under its name only when it is complete.
#[derive(Debug)]
pub struct OutputFile {
    beside: Beside,
    shown: String,
    file: Option<File>,
    /// What the target holds now, if a twin was made from it.
    original: Option<FileHash>,
    _lock: Lock,
}

impl OutputFile {
    /// Checks and locks `target`, and opens the file to write.
    ///
    /// # Errors
    /// A target that exists (unless `force`), is one of the `inputs`, a folder or a symbolic link, or cannot be written.
    pub fn create(target: &Path, force: bool, inputs: &Inputs) -> Result<Self> {
        let shown = target.to_string_lossy().into_owned();
        let refuse =
            |problem: &str, remedy: &str| Err(Error::content(Place::file(&shown), problem, remedy));
        let beside = Beside::new(target, OTHER_OUTPUT)?;
        inputs.refuse(target)?;
        beside.check_parent()?;
        match fs::symlink_metadata(&beside.target) {
            Ok(metadata) if metadata.is_symlink() => {
                return refuse("is a symbolic link", "give the file itself");
            }
            Ok(metadata) if !metadata.is_file() => {
                return refuse("is not a file", OTHER_OUTPUT);
            }
            Ok(_) if !force => {
                return refuse(
                    "exists already",
                    &format!("replace it with --force or {OTHER_OUTPUT}"),
                );
            }
            _ => {}
        }
        let original = inputs.original(&beside.target)?;
        let lock = Lock::take(&beside)?;
        // A new file: a link that lies there leads nowhere.
        let file = remove(&beside.staging)
            .and_then(|()| File::create_new(&beside.staging))
            .map_err(|e| Error::system(&shown, "write", &e, OTHER_OUTPUT))?;
        Ok(Self {
            original,
            beside,
            shown,
            file: Some(file),
            _lock: lock,
        })
    }

    /// The open file.
    pub fn file(&mut self) -> Option<&mut File> {
        self.file.as_mut()
    }

    /// Syncs the file and gives it its name; `written` is what became of the writing.
    ///
    /// # Errors
    /// A target from which a twin was made, unless the same bytes were written; the system's refusal. Then nothing is left behind.
    pub fn commit(mut self, written: io::Result<()>) -> Result<()> {
        if let (Some(original), true) = (&self.original, written.is_ok())
            && sha256_of_file(&self.beside.staging)? != original.sha256
        {
            return Err(refuse_original(&self.beside.target, original));
        }
        let done = written.and_then(|()| {
            if let Some(file) = self.file.take() {
                file.sync_all()?;
            }
            fs::rename(&self.beside.staging, &self.beside.target)?;
            sync_folder(&self.beside.parent)
        });
        let remedy = format!("free space or {OTHER_OUTPUT}; nothing was written");
        done.map_err(|e| Error::system(&self.shown, "write", &e, remedy))
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        // After a commit there is nothing under this name any more.
        let _ = fs::remove_file(&self.beside.staging);
    }
}
