//! Reading an artefact: nothing is used before its checksum is verified.

use super::manifest::{Manifest, sha256};
use super::{MANIFEST, Maker, REPORT};
use crate::error::{Error, Place, Result};
use crate::memory;
use crate::open::{InputFile, Refusal};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Largest manifest, bytes: 100 000 files.
pub(super) const MAX_MANIFEST: u64 = 16 << 20;
/// Largest file of an artefact, bytes: the twin of an arm of 6 joints has 18 MB, one of 44 joints some 50 times as much.
const MAX_FILE: u64 = 4 << 30;

/// An artefact whose manifest has been read; each file is verified when it is read.
///
/// # Example
/// ```
/// # #[path = "../../../twincal/examples/two_link.rs"] mod two_link;
/// use twincal_io::artifact::{Artifact, Maker};
///
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path().join("twin");
/// # twincal_io::save(&two_link::study()?, &folder)?;
/// let artifact = Artifact::open(&folder)?;
/// assert_eq!(artifact.made_by(), Maker::Fit);
/// assert!(artifact.names().any(|name| name == "twin.json"));
/// assert!(artifact.read("result.json")?.starts_with(b"{"));
/// std::fs::write(folder.join("result.json"), "{}")?;
/// assert!(artifact.read("result.json").is_err()); // the checksum is another one
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
        let manifest = InputFile::new(&path, MAX_MANIFEST).inside(folder);
        let bytes = manifest.read().map_err(|refusal| {
            let remedy = "give the folder that `twincal fit` wrote";
            match refusal {
                Refusal::System(e) if e.kind() == ErrorKind::NotFound && folder.is_dir() => {
                    let problem = format!("is no twin: there is no {MANIFEST} in it");
                    Error::content(Place::file(folder.to_string_lossy()), problem, remedy)
                }
                Refusal::System(e) => {
                    Error::system(folder.to_string_lossy(), "open as a twin", &e, remedy)
                }
                other => other.into_error(&path.to_string_lossy(), remedy),
            }
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
        let damaged = |problem: String| Error::content(Place::file(&*shown), problem, anew);
        let changed = |bytes: u64| {
            damaged(format!(
                "was changed after it was written (checksum): {bytes} bytes instead of {}",
                entry.bytes
            ))
        };
        if entry.bytes > MAX_FILE {
            return Err(damaged(format!(
                "has {} bytes by the manifest, the limit is {MAX_FILE}",
                entry.bytes
            )));
        }
        memory::require(&shown, entry.bytes, "read it on a machine with more memory")?;
        let file = InputFile::new(&path, entry.bytes).inside(&self.folder);
        let bytes = file.read().map_err(|refusal| match refusal {
            Refusal::TooLarge { bytes, .. } => changed(bytes),
            other => other.into_error(&shown, anew),
        })?;
        if bytes.len() as u64 != entry.bytes {
            return Err(changed(bytes.len() as u64));
        }
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
