//! One chunk of an MCAP file: its limits before it is unpacked, and what is wrong with it.

use super::{MAX_RECORD, parse, refusal};
use crate::error::Error;
use mcap::records::{Record, op};
use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;

/// Where a chunk says how large it is when unpacked.
const CLAIM: usize = 16;
/// Where the records of a chunk begin that is not packed: behind two times, size, checksum, an empty text and a length.
const PLAIN: usize = 40;

/// What goes wrong inside a chunk: the chunk alone is lost, or the file is refused.
pub(super) enum Damage {
    Chunk(String),
    File(Error),
}

impl From<Error> for Damage {
    fn from(error: Error) -> Self {
        Self::File(error)
    }
}

/// A chunk as it lies in the file, and unpacked.
#[derive(Default)]
pub(super) struct Chunk {
    /// Of its record, bytes from the start of the file.
    pub(super) position: u64,
    pub(super) body: Vec<u8>,
    unpacked: Vec<u8>,
    /// Where its records are in `body`; `None`: in `unpacked`.
    plain: Option<Range<usize>>,
    /// Whether it has a checksum of its own.
    pub(super) is_checked: bool,
}

impl Chunk {
    /// Bytes that it claims to unpack to; they are compared with the limit before anything is unpacked.
    pub(super) fn claim(&self) -> u64 {
        let claim = self.body.get(CLAIM..).and_then(<[u8]>::first_chunk);
        claim.map_or(0, |bytes| u64::from_le_bytes(*bytes))
    }

    /// Its records, once it is unpacked.
    pub(super) fn records(&self) -> &[u8] {
        match &self.plain {
            Some(range) => &self.body[range.clone()],
            None => &self.unpacked,
        }
    }

    /// Unpacks what is packed and compares size and checksum.
    pub(super) fn unpack(&mut self, file: &str) -> std::result::Result<(), Damage> {
        self.unpacked.clear();
        let Ok(Record::Chunk {
            header,
            data: Cow::Borrowed(data),
        }) = parse(op::CHUNK, &self.body)
        else {
            return Err(Damage::Chunk("its header is broken".into()));
        };
        let size = header.uncompressed_size;
        let refuse = |problem, remedy| Damage::File(refusal(file, problem, remedy));
        if size > MAX_RECORD {
            return Err(refuse(
                format!("a chunk claims {size} bytes when unpacked, the limit is {MAX_RECORD}"),
                "record it again with smaller chunks",
            ));
        }
        let damaged = |e: std::io::Error| Damage::Chunk(format!("cannot be unpacked: {e}"));
        let plain = PLAIN..PLAIN + data.len();
        self.plain = header.compression.is_empty().then_some(plain);
        match header.compression.as_str() {
            "" => {}
            "zstd" => {
                self.unpacked.reserve_exact(size as usize);
                zstd::bulk::Decompressor::new()
                    .and_then(|mut zstd| zstd.decompress_to_buffer(data, &mut self.unpacked))
                    .map_err(damaged)?;
            }
            "lz4" => {
                self.unpacked.reserve_exact(size as usize);
                lz4_flex::frame::FrameDecoder::new(data)
                    .take(size + 1)
                    .read_to_end(&mut self.unpacked)
                    .map_err(damaged)?;
            }
            other => {
                return Err(refuse(
                    format!("a chunk is compressed with `{other}`, known are zstd and lz4"),
                    "`mcap compress` writes it anew",
                ));
            }
        }
        let records = self.records();
        if records.len() as u64 != size {
            return Err(Damage::Chunk(format!(
                "it unpacks to {} bytes and claims {size}",
                records.len()
            )));
        }
        let claimed = header.uncompressed_crc;
        let is_right = claimed == 0 || crc32fast::hash(records) == claimed;
        self.is_checked = claimed != 0;
        if !is_right {
            return Err(Damage::Chunk("its checksum is wrong".into()));
        }
        Ok(())
    }
}
