//! Reading an artefact: nothing is used before its checksum is verified.

use super::manifest::{Manifest, sha256};
use super::{MANIFEST, Maker, REPORT};
use crate::error::{Error, Place, Result};
use std::path::{Path, PathBuf};

/// An artefact whose manifest has been read; each file is verified when it is read.
#[derive(Debug, Clone)]
pub struct Artifact {
    folder: PathBuf,
    manifest: Manifest,
}

impl Artifact {
    /// Opens the artefact in `folder`.
    ///
    /// # Errors
    /// No artefact there, a damaged manifest, or one that needs a newer program.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(MANIFEST);
        let bytes = std::fs::read(&path).map_err(|e| {
            let remedy = "give the folder that `twincal fit` wrote";
            if e.kind() == std::io::ErrorKind::NotFound && folder.is_dir() {
                let problem = format!("is no twin: there is no {MANIFEST} in it");
                return Error::content(Place::file(folder.to_string_lossy()), problem, remedy);
            }
            Error::system(folder.to_string_lossy(), "open as a twin", &e, remedy)
        })?;
        let manifest = Manifest::parse(&path.to_string_lossy(), &bytes)?;
        Ok(Self {
            folder: folder.to_owned(),
            manifest,
        })
    }

    /// Which command wrote it.
    pub fn made_by(&self) -> Maker {
        self.manifest.made_by
    }

    /// Names of its files, in order, without the manifest.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.manifest.files.keys().map(String::as_str)
    }

    /// The verified bytes of one file.
    ///
    /// # Errors
    /// The file is missing or not what the manifest says.
    pub fn read(&self, name: &str) -> Result<Vec<u8>> {
        let path = self.folder.join(name);
        let shown = path.to_string_lossy();
        let anew = if name == REPORT {
            "write the report anew with `twincal report --force`"
        } else {
            "write the artefact anew with `twincal fit --force`"
        };
        let Some(entry) = self.manifest.files.get(name) else {
            return Err(Error::content(
                Place::file(shown),
                "is not part of this artefact",
                anew,
            ));
        };
        // An entry is a plain name: a manifest cannot lead out of its folder.
        if Path::new(name).components().count() != 1 || Path::new(name).file_name().is_none() {
            return Err(Error::content(
                Place::file(shown),
                "is not a plain file name",
                anew,
            ));
        }
        let size = std::fs::metadata(&path)
            .map_err(|e| Error::system(&*shown, "read", &e, anew))?
            .len();
        let damaged = |problem: String| Error::content(Place::file(&*shown), problem, anew);
        if size != entry.bytes {
            return Err(damaged(format!(
                "was changed after it was written (checksum): {size} bytes instead of {}",
                entry.bytes
            )));
        }
        let bytes = std::fs::read(&path).map_err(|e| Error::system(&*shown, "read", &e, anew))?;
        if sha256(&bytes) != entry.sha256 {
            return Err(damaged(
                "was changed after it was written (checksum)".into(),
            ));
        }
        Ok(bytes)
    }

    /// Verifies every file except those named.
    ///
    /// # Errors
    /// As [`Artifact::read`].
    pub fn verify_except(&self, except: &[&str]) -> Result<()> {
        self.names()
            .filter(|name| !except.contains(name))
            .try_for_each(|name| self.read(name).map(drop))
    }
}
