//! Bags that are packed as a whole (`.db3.zstd`, `.mcap.zstd`): unpacked into a file that nobody else sees and that goes by itself.
//! Bags whose messages are packed one by one (rosbag2's `compression_mode: MESSAGE`): unpacked as they come.

use crate::error::{Error, Place, Result};
use std::fs::File;
use std::io::{Read, Write};
use tempfile::NamedTempFile;

/// Most bytes out per byte in, beyond [`FREE`].
const RATIO: u64 = 200;
/// Bytes that may come out of any file.
const FREE: u64 = 64 << 20;

/// Unpacks a Zstandard file.
///
/// # Errors
/// [`Error::Content`] if it is damaged or grows more than 200 times; [`Error::System`] if there is no room for it.
pub(super) fn unpack(packed: File, file: &str) -> Result<NamedTempFile> {
    let broken = |e: &std::io::Error| {
        Error::content(
            Place::file(file),
            format!("cannot be unpacked: {e}"),
            "copy it again",
        )
    };
    let room = |e: &std::io::Error| {
        Error::system(
            file,
            "unpack",
            e,
            "make room in the folder for temporary files (TMPDIR), or unpack it with `zstd -d`",
        )
    };
    let size = packed.metadata().map_err(|e| broken(&e))?.len();
    let limit = size.saturating_mul(RATIO).max(FREE);
    let mut source = zstd::stream::read::Decoder::new(packed).map_err(|e| broken(&e))?;
    let mut target = NamedTempFile::new().map_err(|e| room(&e))?;
    let mut block = vec![0; 1 << 18];
    let mut written = 0;
    loop {
        let read = source.read(&mut block).map_err(|e| broken(&e))?;
        if read == 0 {
            break;
        }
        written += read as u64;
        if written > limit {
            return Err(Error::content(
                Place::file(file),
                format!("{size} bytes unpack to more than {limit}: refusing to expand"),
                "if it is an honest log, unpack it with `zstd -d`",
            ));
        }
        target.write_all(&block[..read]).map_err(|e| room(&e))?;
    }
    target.flush().map_err(|e| room(&e))?;
    Ok(target)
}

/// First bytes of a Zstandard frame; CDR and ROS 1 messages begin otherwise.
const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];
/// Largest message when unpacked, bytes.
const MAX_MESSAGE: usize = 1 << 20;

/// Unpacks messages that are packed one by one; what is not packed stays as it is.
#[derive(Default)]
pub(super) struct PackedMessages {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
    unpacked: Vec<u8>,
}

impl PackedMessages {
    /// The message; an empty one where it cannot be unpacked, which is dropped and counted like any that cannot be read.
    pub(super) fn unpack<'a>(&'a mut self, data: &'a [u8]) -> &'a [u8] {
        if !data.starts_with(&ZSTD) {
            return data;
        }
        self.unpacked.clear();
        if self.zstd.is_none() {
            self.zstd = zstd::bulk::Decompressor::new().ok();
            self.unpacked.reserve_exact(MAX_MESSAGE);
        }
        let unpacked = self.zstd.as_mut();
        let unpacked =
            unpacked.and_then(|zstd| zstd.decompress_to_buffer(data, &mut self.unpacked).ok());
        if unpacked.is_none() {
            self.unpacked.clear();
        }
        &self.unpacked
    }
}
