//! Names beside a target (lock, staging folder, old version), and the lock that keeps a second writer out.

use super::manifest::sha256;
use crate::error::{Error, Place, Result};
use rustix::fs::OFlags;
use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// Paths that belong to the target `parent/name`. Their names are made from a digest of the target's, so that a
/// name of 255 bytes works too, and are the same for every writer, so that the next one finds what was left behind.
#[derive(Debug, Clone)]
pub(super) struct Beside {
    pub(super) parent: PathBuf,
    pub(super) target: PathBuf,
    pub(super) lock: PathBuf,
    pub(super) staging: PathBuf,
    pub(super) old: PathBuf,
    /// What to do where the target cannot be written.
    pub(super) remedy: &'static str,
}

impl Beside {
    /// # Errors
    /// A target without a name of its own (`.`, `..`, `/`).
    pub(super) fn new(target: &Path, remedy: &'static str) -> Result<Self> {
        let shown = target.to_string_lossy();
        let Some(name) = target.file_name() else {
            return Err(Error::content(
                Place::file(shown),
                "cannot be replaced as a whole",
                "give the name of a new folder or file, such as `twincal-out`",
            ));
        };
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let digest = sha256(name.as_bytes());
        let path = |role: &str| parent.join(format!(".twincal-{}.{role}", &digest[..16]));
        let (lock, staging, old) = (path("lock"), path("staging"), path("old"));
        Ok(Self {
            target: parent.join(name),
            lock,
            staging,
            old,
            parent,
            remedy,
        })
    }

    /// Makes a parent folder that is missing; refuses one that is no folder, or marked read-only (for root too).
    pub(super) fn check_parent(&self) -> Result<()> {
        let shown = self.parent.to_string_lossy();
        let made = match std::fs::metadata(&self.parent) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                std::fs::create_dir_all(&self.parent)
            }
            _ => Ok(()),
        };
        let metadata = made
            .and_then(|()| std::fs::metadata(&self.parent))
            .map_err(|e| {
                Error::system(
                    &*shown,
                    "write into",
                    &e,
                    format!("create it first: mkdir -p '{shown}'"),
                )
            })?;
        if !metadata.is_dir() {
            return Err(Error::content(
                Place::file(shown),
                "is not a folder",
                self.remedy,
            ));
        }
        if metadata.permissions().readonly() {
            return Err(Error::content(
                Place::file(shown),
                "the folder is read-only",
                self.remedy,
            ));
        }
        Ok(())
    }
}

/// An exclusive lock; released, and its file removed, when dropped or when the process ends.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    pub(super) fn take(beside: &Beside) -> Result<Self> {
        let shown = beside.target.to_string_lossy();
        let denied = |e: &std::io::Error| Error::system(&*shown, "write", e, beside.remedy);
        loop {
            let file = OpenOptions::new()
                .create(true)
                .truncate(false)
                .write(true)
                // A link leads nowhere, and nobody waits for a reader of a pipe.
                .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits().cast_signed())
                .open(&beside.lock)
                .map_err(|e| denied(&e))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::content(
                        Place::file(shown),
                        "another twincal is writing to it",
                        format!("wait for it or {}", beside.remedy),
                    ));
                }
                Err(TryLockError::Error(e)) => return Err(denied(&e)),
            }
            // The former owner may have removed the file between our `open` and our lock: then it locks nothing.
            let ours = file.metadata().map_err(|e| denied(&e))?;
            match std::fs::symlink_metadata(&beside.lock) {
                Ok(there) if (there.ino(), there.dev()) == (ours.ino(), ours.dev()) => {
                    return Ok(Self {
                        path: beside.lock.clone(),
                        _file: file,
                    });
                }
                _ => continue,
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Removed before it is released; if that fails the file stays and locks nothing.
        let _ = std::fs::remove_file(&self.path);
    }
}
