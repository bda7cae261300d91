//! Writing an artefact: claimed before any work, committed in one atomic step after it.

use super::beside::{Beside, Lock};
use super::inputs::Inputs;
use super::manifest::{Maker, Manifest};
use super::pieces::Pieces;
use super::read::MAX_MANIFEST;
use super::{MANIFEST, NAMES, OTHER_OUTPUT};
use crate::error::{Error, Place, Result};
use crate::open::InputFile;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

/// What may be replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Replace {
    /// Nothing: an existing output is refused.
    Never,
    /// Any artefact (`--force`); never a folder that holds other files.
    Artifact,
    /// Only an artefact of this maker.
    MadeBy(Maker),
}

impl Replace {
    /// What to do where the output cannot be written; a maker that replaces only its own output has one name for it.
    fn remedy(self) -> &'static str {
        match self {
            Self::Never | Self::Artifact => OTHER_OUTPUT,
            Self::MadeBy(_) => "run in another folder",
        }
    }
}

/// An output folder that is ours until this value is dropped.
#[derive(Debug)]
pub struct Claim {
    beside: Beside,
    shown: String,
    exists: bool,
    _lock: Lock,
}

impl Claim {
    /// Checks that `target` may be written, locks it and removes what a killed run left behind.
    ///
    /// # Errors
    /// A target that exists (unless `replace` allows it), is or holds one of the `inputs`, is a file, a symbolic link or
    /// read-only, holds files that are not ours, or is being written by another program.
    pub fn new(target: &Path, replace: Replace, inputs: &Inputs) -> Result<Self> {
        let shown = target.to_string_lossy().into_owned();
        let beside = Beside::new(target, replace.remedy())?;
        inputs.refuse(target)?;
        beside.check_parent()?;
        // A wrong target is said before the lock, which may have no place (a read-only disk).
        check(&beside.target, &shown, replace)?;
        let lock = Lock::take(&beside)?;
        recover(&beside).map_err(|e| {
            Error::system(
                &shown,
                "clean up",
                &e,
                "remove the leftovers of a killed run",
            )
        })?;
        let exists = check(&beside.target, &shown, replace)?;
        Ok(Self {
            beside,
            shown,
            exists,
            _lock: lock,
        })
    }

    /// Writes all files and a manifest, and puts them in the target's place in one step.
    ///
    /// # Errors
    /// The system's refusal (disk full, …); then nothing has changed and nothing is left behind.
    pub fn commit(self, made_by: Maker, files: Vec<(&str, impl Into<Pieces>)>) -> Result<()> {
        let files = files.into_iter();
        let mut files: Vec<(&str, Pieces)> =
            files.map(|(name, text)| (name, text.into())).collect();
        let manifest = serde_json::to_vec_pretty(&Manifest::of(made_by, &files)).map_err(|e| {
            Error::content(Place::file(MANIFEST), e.to_string(), "report this as a bug")
        })?;
        files.push((MANIFEST, manifest.into()));
        let done = stage(&self.beside, &files).and_then(|()| {
            if self.exists {
                exchange(&self.beside)
            } else {
                publish(&self.beside)
            }
        });
        // After the exchange the staging folder holds the old artefact, after a failure what was written so far.
        let cleaned = remove(&self.beside.staging);
        let remedy = format!("free space or {}; nothing was changed", self.beside.remedy);
        done.map_err(|e| Error::system(&self.shown, "write", &e, remedy))?;
        let remedy = "the new result is in place; remove the leftovers beside it";
        cleaned.map_err(|e| Error::system(&self.shown, "clean up after writing", &e, remedy))
    }
}

/// True if the target exists and may be replaced, false if there is nothing.
fn check(target: &Path, shown: &str, replace: Replace) -> Result<bool> {
    let refuse =
        |problem: &str, remedy: &str| Err(Error::content(Place::file(shown), problem, remedy));
    let other = replace.remedy();
    let metadata = match fs::symlink_metadata(target) {
        Ok(metadata) => metadata,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(Error::system(shown, "look at", &e, other)),
    };
    if metadata.is_symlink() {
        return refuse("is a symbolic link", other);
    }
    if !metadata.is_dir() {
        return refuse("is a file, not a folder", other);
    }
    if replace == Replace::Never {
        return refuse(
            "exists already",
            &format!("replace it with --force or {other}"),
        );
    }
    if metadata.permissions().readonly() {
        return refuse("the folder is read-only", other);
    }
    let manifest = InputFile::new(&target.join(MANIFEST), MAX_MANIFEST)
        .inside(target)
        .read()
        .ok();
    let manifest = manifest.and_then(|bytes| Manifest::parse(MANIFEST, &bytes).ok());
    let ours = |name: &OsStr| {
        let listed = manifest.iter().flat_map(|manifest| manifest.files.keys());
        NAMES
            .iter()
            .copied()
            .chain(listed.map(String::as_str))
            .any(|known| name == known)
    };
    for entry in fs::read_dir(target).map_err(|e| Error::system(shown, "list", &e, other))? {
        let entry = entry.map_err(|e| Error::system(shown, "list", &e, other))?;
        let (name, is_folder) = (entry.file_name(), entry.path().is_dir());
        if is_folder || !ours(&name) {
            let problem = format!(
                "holds `{}`, which twincal did not write",
                name.to_string_lossy()
            );
            return refuse(&problem, &format!("move it away or {other}"));
        }
    }
    if let Replace::MadeBy(maker) = replace
        && manifest.as_ref().map(|manifest| manifest.made_by) != Some(maker)
    {
        return refuse(
            "exists and was not written by this command",
            &format!("move it away or {other}"),
        );
    }
    Ok(true)
}

/// Removes what a killed run left; brings back the old artefact if it was killed between two renames.
fn recover(beside: &Beside) -> io::Result<()> {
    remove(&beside.staging)?;
    if fs::symlink_metadata(&beside.old).is_ok() {
        if fs::symlink_metadata(&beside.target).is_ok() {
            remove(&beside.old)?;
        } else {
            fs::rename(&beside.old, &beside.target)?;
        }
    }
    Ok(())
}

/// Writes and syncs every file in the staging folder.
pub(super) fn stage(beside: &Beside, files: &[(&str, Pieces)]) -> io::Result<()> {
    fs::create_dir(&beside.staging)?;
    for (name, text) in files {
        let mut file = File::create_new(beside.staging.join(name))?;
        text.iter().try_for_each(|piece| file.write_all(piece))?;
        file.sync_all()?;
    }
    sync_folder(&beside.staging)
}

/// The staging folder becomes the target, which does not exist.
fn publish(beside: &Beside) -> io::Result<()> {
    match renameat_with(
        CWD,
        &beside.staging,
        CWD,
        &beside.target,
        RenameFlags::NOREPLACE,
    ) {
        Ok(()) => {}
        // A plain rename replaces an empty folder at most.
        Err(e) if unsupported(e) => fs::rename(&beside.staging, &beside.target)?,
        Err(e) => return Err(e.into()),
    }
    sync_folder(&beside.parent)
}

/// The staging folder and the target change places.
pub(super) fn exchange(beside: &Beside) -> io::Result<()> {
    match renameat_with(
        CWD,
        &beside.staging,
        CWD,
        &beside.target,
        RenameFlags::EXCHANGE,
    ) {
        Ok(()) => sync_folder(&beside.parent),
        Err(e) if unsupported(e) => exchange_in_two_steps(beside),
        Err(e) => Err(e.into()),
    }
}

/// For file systems without an atomic exchange; [`recover`] repairs after a kill between the two renames.
pub(super) fn exchange_in_two_steps(beside: &Beside) -> io::Result<()> {
    fs::rename(&beside.target, &beside.old)?;
    if let Err(e) = fs::rename(&beside.staging, &beside.target) {
        fs::rename(&beside.old, &beside.target)?;
        return Err(e);
    }
    sync_folder(&beside.parent)?;
    remove(&beside.old)
}

fn unsupported(e: rustix::io::Errno) -> bool {
    use rustix::io::Errno;
    [Errno::INVAL, Errno::NOSYS, Errno::OPNOTSUPP].contains(&e)
}

pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder)?.sync_all() {
        // Some network and FUSE file systems cannot sync a folder; the rename is then as durable as they make it.
        Err(e)
            if e.kind() == io::ErrorKind::InvalidInput
                || e.kind() == io::ErrorKind::Unsupported =>
        {
            Ok(())
        }
        other => other,
    }
}

pub(super) fn remove(path: &Path) -> io::Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(e) => Err(e),
    };
    match removed {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}
