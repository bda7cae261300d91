//! The one place where files are opened for reading: regular files only, never waiting for a writer, within a limit of bytes, and
//! inside a folder where one is given (`tests/one_open.rs` holds that no other place opens any).

use crate::error::{Error, Place, Result};
use rustix::fs::{CWD, Mode, OFlags, openat};
use std::fmt;
use std::fs::{File, FileType, Metadata};
use std::io::{self, Read as _};
use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
use std::path::{Component, Path};

/// Largest log, bytes: 24 hours of 50 joints at 1 kHz are 0.3 TB as text.
pub const MAX_LOG: u64 = 1 << 40;
/// Most bytes of a file of the system, such as `/proc/meminfo`.
const MAX_SYSTEM: u64 = 1 << 20;

/// A file that is to be read.
#[derive(Debug, Clone, Copy)]
pub struct InputFile<'a> {
    path: &'a Path,
    folder: Option<&'a Path>,
    most: u64,
}

/// What has a path and is no regular file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Special {
    /// A folder.
    Folder,
    /// A pipe, with a name or as the shell makes it for `<(command)`.
    Pipe,
    /// A socket.
    Socket,
    /// A terminal or another device.
    Device,
}

/// Why a file is not opened.
#[derive(Debug)]
pub enum Refusal {
    /// The system says no.
    System(io::Error),
    /// It is no regular file.
    NoFile(Special),
    /// It is, or is reached by, a link that leaves the folder.
    Outside,
    /// It has more bytes than the limit.
    TooLarge {
        /// Bytes of the file, or of what was read of it.
        bytes: u64,
        /// Most bytes.
        most: u64,
    },
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

impl From<rustix::io::Errno> for Refusal {
    fn from(error: rustix::io::Errno) -> Self {
        Self::System(error.into())
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::System(error) => error.fmt(f),
            Self::NoFile(Special::Folder) => f.write_str("is a folder, not a file"),
            Self::NoFile(Special::Pipe) => f.write_str("is a pipe, not a file"),
            Self::NoFile(Special::Socket) => f.write_str("is a socket, not a file"),
            Self::NoFile(Special::Device) => f.write_str("is a device, not a file"),
            Self::Outside => f.write_str("is a link that leads outside the folder"),
            Self::TooLarge { bytes, most } => write!(f, "has {bytes} bytes, the limit is {most}"),
        }
    }
}

impl Refusal {
    /// The error of this crate; `remedy` helps where the system refuses or the file is too large.
    pub fn into_error(self, name: &str, remedy: &str) -> Error {
        let remedy = match &self {
            Self::System(error) => return Error::system(name, "read", error, remedy),
            Self::NoFile(Special::Folder) => "give the file itself",
            Self::NoFile(_) => "write what comes through it into a file, and give that file",
            Self::Outside => "copy the file into the folder",
            Self::TooLarge { .. } => remedy,
        };
        Error::content(Place::file(name), self.to_string(), remedy)
    }
}

impl<'a> InputFile<'a> {
    /// A file of at most `most` bytes.
    pub fn new(path: &'a Path, most: u64) -> Self {
        Self {
            path,
            folder: None,
            most,
        }
    }

    /// The same, which has to lie in `folder` when all links are followed.
    #[must_use]
    pub fn inside(self, folder: &'a Path) -> Self {
        Self {
            folder: Some(folder),
            ..self
        }
    }

    /// Opens the file. A pipe, a device or a socket is refused without waiting for anybody.
    ///
    /// # Errors
    /// See [`Refusal`].
    pub fn open(&self) -> std::result::Result<File, Refusal> {
        // Looked at before it is opened: to open a device may do something. What counts is what the open file is.
        self.check(&std::fs::metadata(self.path)?)?;
        let file = match self.folder {
            None => File::from(openat(CWD, self.path, FLAGS, Mode::empty())?),
            Some(folder) => open_inside(folder, self.path)?,
        };
        self.check(&file.metadata()?)?;
        Ok(file)
    }

    /// All bytes of the file.
    ///
    /// # Errors
    /// See [`Refusal`].
    pub fn read(&self) -> std::result::Result<Vec<u8>, Refusal> {
        let file = self.open()?;
        let mut bytes = Vec::new();
        // The length may have grown since, and files of the system have none.
        file.take(self.most.saturating_add(1))
            .read_to_end(&mut bytes)?;
        self.check_bytes(bytes.len() as u64)?;
        Ok(bytes)
    }

    fn check(&self, metadata: &Metadata) -> std::result::Result<(), Refusal> {
        match special(metadata.file_type()) {
            Some(special) => Err(Refusal::NoFile(special)),
            None => self.check_bytes(metadata.len()),
        }
    }

    fn check_bytes(&self, bytes: u64) -> std::result::Result<(), Refusal> {
        let most = self.most;
        if bytes > most {
            return Err(Refusal::TooLarge { bytes, most });
        }
        Ok(())
    }
}

/// Nobody is waited for, and no terminal becomes that of the program.
const FLAGS: OFlags = OFlags::RDONLY
    .union(OFlags::NONBLOCK)
    .union(OFlags::NOCTTY)
    .union(OFlags::CLOEXEC);

/// What a file is that is no regular file.
fn special(kind: FileType) -> Option<Special> {
    if kind.is_file() {
        None
    } else if kind.is_dir() {
        Some(Special::Folder)
    } else if kind.is_fifo() {
        Some(Special::Pipe)
    } else if kind.is_socket() {
        Some(Special::Socket)
    } else {
        Some(Special::Device)
    }
}

/// Opens what `path` leads to, folder by folder without following a link any more, so that nobody can put one in between.
fn open_inside(folder: &Path, path: &Path) -> std::result::Result<File, Refusal> {
    let (root, real) = (folder.canonicalize()?, path.canonicalize()?);
    let relative = real.strip_prefix(&root).map_err(|_| Refusal::Outside)?;
    let no_link = OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let mut at = openat(CWD, &root, no_link | OFlags::DIRECTORY, Mode::empty())?;
    let mut parts = relative.components().peekable();
    while let Some(part) = parts.next() {
        let Component::Normal(name) = part else {
            return Err(Refusal::Outside);
        };
        let flags = match parts.peek() {
            Some(_) => no_link | OFlags::DIRECTORY,
            None => no_link | FLAGS,
        };
        at = openat(&at, name, flags, Mode::empty())?;
    }
    Ok(File::from(at))
}

/// Opens a log.
///
/// # Errors
/// [`Error::System`] if the system refuses, [`Error::Content`] for what is no regular file or above [`MAX_LOG`].
pub fn open_log_file(path: &Path, name: &str) -> Result<File> {
    let remedy = if name.contains(['*', '?']) {
        "no file is called so: a pattern that matches nothing comes as it was typed"
    } else {
        "check the path and its permissions"
    };
    let refused = |refusal: Refusal| {
        let large = matches!(refusal, Refusal::TooLarge { .. });
        refusal.into_error(name, if large { "give shorter logs" } else { remedy })
    };
    InputFile::new(path, MAX_LOG).open().map_err(refused)
}

/// Whether a path still leads to the file that was opened.
pub(crate) fn still_leads_to(path: &Path, file: &File) -> io::Result<bool> {
    let (there, ours) = (std::fs::metadata(path)?, file.metadata()?);
    Ok((there.ino(), there.dev()) == (ours.ino(), ours.dev()))
}

/// Text of a file of the system, such as `/proc/meminfo`; none where there is no such file.
pub fn system_text(path: &str) -> Option<String> {
    let bytes = InputFile::new(Path::new(path), MAX_SYSTEM).read().ok()?;
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{FileType as Type, mknodat};
    use std::os::unix::fs::symlink;
    use std::os::unix::net::UnixListener;

    fn refusal(path: &Path) -> String {
        let refused = InputFile::new(path, 8).open().unwrap_err();
        refused.into_error("x", "-").to_string()
    }

    #[test]
    fn only_regular_files_are_opened_and_nobody_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        mknodat(CWD, at("pipe"), Type::Fifo, Mode::RUSR, 0).unwrap();
        let _socket = UnixListener::bind(at("socket")).unwrap();
        std::fs::create_dir(at("folder")).unwrap();
        std::fs::write(at("file"), "12345678").unwrap();
        std::fs::write(at("large"), "123456789").unwrap();
        symlink("file", at("link")).unwrap();
        let through_it = "write what comes through it into a file";
        for (name, words) in [
            ("pipe", ["is a pipe, not a file", through_it]),
            ("socket", ["is a socket", through_it]),
            ("folder", ["is a folder", "give the file itself"]),
            ("large", ["has 9 bytes, the limit is 8", "-"]),
            ("none", ["cannot read", "No such file"]),
        ] {
            let said = refusal(&at(name));
            assert!(words.iter().all(|word| said.contains(word)), "{said}");
        }
        let said = refusal(Path::new("/dev/null"));
        assert!(
            said.contains(through_it) && said.contains("device"),
            "{said}"
        );
        for name in ["file", "link"] {
            let path = at(name);
            let bytes = InputFile::new(&path, 8).read().unwrap();
            assert_eq!(bytes, b"12345678");
        }
    }

    #[test]
    fn a_link_that_leaves_the_folder_is_refused_whatever_way_it_takes() {
        let outer = tempfile::tempdir().unwrap();
        let at = |name: &str| outer.path().join(name);
        std::fs::create_dir_all(at("inner/deep")).unwrap();
        std::fs::write(at("secret"), "s").unwrap();
        std::fs::write(at("inner/deep/own"), "o").unwrap();
        symlink("../secret", at("inner/link")).unwrap();
        symlink("..", at("inner/up")).unwrap();
        symlink("deep/own", at("inner/within")).unwrap();
        symlink("inner", at("door")).unwrap();
        for bad in ["link", "up/secret", "../secret", "deep/../../secret"] {
            let path = at("inner").join(bad);
            let folder = at("inner");
            let refused = InputFile::new(&path, 8).inside(&folder).open().unwrap_err();
            assert!(matches!(refused, Refusal::Outside), "{bad}: {refused}");
        }
        // The folder itself may be reached by a link, and links within it are fine.
        for folder in ["inner", "door"] {
            for good in ["within", "deep/own", "up/inner/deep/own"] {
                let (folder, path) = (at(folder), at(folder).join(good));
                let read = InputFile::new(&path, 8).inside(&folder).read();
                assert_eq!(read.unwrap(), b"o", "{good}");
            }
            let folder = at(folder);
            let refused = InputFile::new(&folder, 8).inside(&folder).open();
            assert!(matches!(
                refused.unwrap_err(),
                Refusal::NoFile(Special::Folder)
            ));
        }
    }

    #[test]
    fn files_of_the_system_are_read_to_their_end() {
        let text = system_text("/proc/self/status").expect("Linux tells");
        assert!(text.starts_with("Name:") && text.len() > 100);
        assert_eq!(system_text("/proc/none"), None);
    }
}
