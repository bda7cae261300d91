//! The container MCAP: records one by one, a few chunks unpacked at a time, limits before allocations, damaged chunks skipped and counted.
//! Checksums of chunks and of the whole data section are compared where they are given.
//!
//! Format: <https://mcap.dev/spec>. A record is an opcode, a length of 8 bytes and the content.

mod chunk;

use super::definition::MAX_TEXT;
use super::joint_states::{JointStates, TopicId};
use super::mapping::Schema;
use super::unpack::PackedMessages;
use crate::error::{Error, Place, Result};
use chunk::{Chunk, Damage};
use mcap::records::{Record, op};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::rc::Rc;
use twincal::{Code, Finding, Severity};

/// Largest record, and largest chunk when unpacked, bytes.
pub(in super::super) const MAX_RECORD: u64 = 256 << 20;
/// Most bytes of all definitions that are kept.
pub(super) const MAX_DEFINITIONS: usize = 64 << 20;
/// Largest record of a schema or a channel, bytes.
const MAX_DECLARATION: usize = 16 << 20;
/// Most channels of a file.
const MAX_CHANNELS: usize = 10_000;
/// Most chunks that are unpacked side by side, and the unpacked bytes from which on no further one joins them.
const SIDE_BY_SIDE: (usize, u64) = (4, 32 << 20);
/// Bytes of a record before its content.
const RECORD_HEAD: usize = 9;
/// Bytes of a message before its data: channel, sequence, two times.
const MESSAGE_HEAD: usize = 22;

/// Whether a record's content is looked at.
fn is_wanted(opcode: u8) -> bool {
    matches!(
        opcode,
        op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK | op::HEADER | op::DATA_END
    )
}

fn refusal(file: &str, problem: String, remedy: &str) -> Error {
    Error::content(Place::file(file), problem, remedy)
}

struct Reader<'a, 'b> {
    file: &'a str,
    sink: &'a mut JointStates<'b>,
    schemas: BTreeMap<u16, Rc<Schema>>,
    /// Bytes of the definitions in `schemas`.
    definitions: usize,
    channels: BTreeMap<u16, TopicId>,
    /// Channel of the last message and its topic: most messages come from the same.
    last: Option<(u16, TopicId)>,
    /// Chunks that are read and not yet looked at.
    waiting: Vec<Chunk>,
    /// Buffers of earlier ones.
    spare: Vec<Chunk>,
    chunks: u64,
    damaged: u64,
    first_damage: Option<String>,
    packed: PackedMessages,
    /// Of all bytes so far; the end of the data says what it is there, or 0.
    checksum: crc32fast::Hasher,
    is_changed: bool,
    /// Messages without another checksum.
    unchecked: bool,
}

/// Hands all messages of topics that are read in `source` to `sink`.
///
/// # Errors
/// [`Error::System`] if reading fails; [`Error::Content`] for what is no MCAP file, for records and chunks above 256 MiB and unknown
/// compressions. Damaged chunks, a wrong checksum and a missing end are findings.
pub(super) fn read(
    source: &mut (impl Read + Seek),
    file: &str,
    sink: &mut JointStates<'_>,
) -> Result<Vec<Finding>> {
    let mut reader = Reader {
        file,
        sink,
        schemas: BTreeMap::new(),
        definitions: 0,
        channels: BTreeMap::new(),
        last: None,
        waiting: Vec::new(),
        spare: Vec::new(),
        chunks: 0,
        damaged: 0,
        first_damage: None,
        packed: PackedMessages::default(),
        checksum: crc32fast::Hasher::new(),
        is_changed: false,
        unchecked: false,
    };
    let end = reader.records(source)?;
    Ok(reader.damage().into_iter().chain(end.cut(file)).collect())
}

/// How a file ends.
enum End {
    Whole,
    BehindData,
    Cut(u64),
}

impl End {
    /// That the file is not whole.
    fn cut(&self, file: &str) -> Option<Finding> {
        let (severity, message, byte) = match self {
            Self::Whole => return None,
            Self::BehindData => (
                Severity::Warning,
                "the file ends behind its messages, without its index; none was lost".to_owned(),
                None,
            ),
            Self::Cut(byte) => (
                Severity::Degraded,
                format!(
                    "the file is cut off at byte {byte}: what stood whole before was read; `mcap recover` makes a whole file of it"
                ),
                Some(("byte", *byte as f64)),
            ),
        };
        Some(Finding::new(severity, Code::Truncated, file, message, 0).with(byte))
    }
}

impl Reader<'_, '_> {
    fn refuse(&self, problem: String, remedy: &str) -> Error {
        refusal(self.file, problem, remedy)
    }

    /// Chunks that were left out, or bytes that were changed where no chunk shows it.
    fn damage(&self) -> Option<Finding> {
        if self.damaged > 0 {
            let message = format!(
                "{} of {} chunks are damaged and were left out with their messages; the first: {}; record or copy the file again",
                self.damaged,
                self.chunks,
                self.first_damage.as_deref().unwrap_or_default()
            );
            return Some(
                Finding::new(
                    Severity::Degraded,
                    Code::DamagedChunks,
                    self.file,
                    message,
                    self.damaged,
                )
                .with([("chunks", self.chunks as f64)]),
            );
        }
        if !self.is_changed {
            return None;
        }
        let (severity, values) = match self.unchecked {
            true => (Severity::Degraded, "values may be wrong"),
            false => (
                Severity::Warning,
                "those of all chunks are right, and so are the values",
            ),
        };
        let message = format!(
            "some bytes of the file were changed, its checksum over all data is wrong: {values}; copy the file again"
        );
        Some(Finding::new(
            severity,
            Code::DamagedData,
            self.file,
            message,
            1,
        ))
    }

    /// All records of the file, one by one; how it ends.
    fn records(&mut self, source: &mut (impl Read + Seek)) -> Result<End> {
        let mut position = self.magic(source)?;
        let (mut body, mut head) = (Vec::new(), Vec::with_capacity(RECORD_HEAD));
        let mut behind_data = false;
        loop {
            if self.full() {
                self.chunks(source, position)?;
            }
            head.clear();
            (&mut *source)
                .take(RECORD_HEAD as u64)
                .read_to_end(&mut head)
                .map_err(|e| Error::system(self.file, "read", &e, "check the disk"))?;
            let ended = if behind_data {
                End::BehindData
            } else {
                End::Cut(position)
            };
            let Some((opcode, length)) = record_head(&head) else {
                self.chunks(source, position)?;
                return Ok(ended);
            };
            // What stands between chunks otherwise, their indexes, changes nothing.
            if opcode != op::CHUNK && (is_wanted(opcode) || opcode == op::FOOTER) {
                self.chunks(source, position)?;
            }
            if is_wanted(opcode) && length > MAX_RECORD {
                return Err(self.refuse(
                    format!("the record at byte {position} (opcode {opcode:#04x}) claims {length} bytes, the limit is {MAX_RECORD}"),
                    "copy the file again, or write smaller chunks",
                ));
            }
            if opcode != op::DATA_END {
                self.checksum.update(&head);
            }
            if self.body(source, (opcode, length), &mut body)? < length {
                self.chunks(source, position)?;
                return Ok(ended);
            }
            if opcode == op::FOOTER {
                return Ok(End::Whole);
            }
            behind_data |= opcode == op::DATA_END;
            self.whole_record(opcode, &mut body, position)?;
            position += RECORD_HEAD as u64 + length;
        }
    }

    /// The bytes that every MCAP file begins with; how many they are.
    fn magic(&mut self, source: &mut impl Read) -> Result<u64> {
        let mut magic = Vec::new();
        (&mut *source)
            .take(mcap::MAGIC.len() as u64)
            .read_to_end(&mut magic)
            .map_err(|e| {
                let remedy = "check the disk or copy the file again";
                Error::system(self.file, "read", &e, remedy)
            })?;
        if magic != mcap::MAGIC {
            return Err(self.refuse(
                "does not begin as an MCAP file does".into(),
                "give an MCAP file, a rosbag2 folder, CSV, Parquet, Arrow or NPZ",
            ));
        }
        self.checksum.update(&magic);
        Ok(magic.len() as u64)
    }

    /// Reads the content of a record of (opcode, length) into `body`, or passes over it; how many bytes were there.
    fn body(
        &mut self,
        source: &mut impl Read,
        record: (u8, u64),
        body: &mut Vec<u8>,
    ) -> Result<u64> {
        let (opcode, length) = record;
        body.clear();
        let read = if is_wanted(opcode) {
            (&mut *source)
                .take(length)
                .read_to_end(body)
                .map(|n| n as u64)
        } else {
            let mut passed = Passed(&mut self.checksum);
            std::io::copy(&mut (&mut *source).take(length), &mut passed)
        };
        let read = read.map_err(|e| Error::system(self.file, "read", &e, "check the disk"))?;
        if read == length && opcode != op::DATA_END {
            // Of what is not wanted there is nothing left.
            self.checksum.update(body);
        }
        Ok(read)
    }

    /// A record that begins at byte `position`; chunks are put aside.
    fn whole_record(&mut self, opcode: u8, body: &mut Vec<u8>, position: u64) -> Result<()> {
        match opcode {
            op::CHUNK => {
                let mut chunk = self.spare.pop().unwrap_or_default();
                chunk.position = position;
                std::mem::swap(&mut chunk.body, body);
                self.waiting.push(chunk);
            }
            op::DATA_END => {
                let claimed = body.first_chunk().map_or(0, |crc| u32::from_le_bytes(*crc));
                self.is_changed = ![0, self.checksum.clone().finalize()].contains(&claimed);
            }
            _ if is_wanted(opcode) => match self.record_outside(opcode, body) {
                Ok(()) => {}
                Err(Damage::File(error)) => return Err(error),
                Err(Damage::Chunk(problem)) => {
                    return Err(self.refuse(
                        format!("the record at byte {position}: {problem}"),
                        "copy the file again",
                    ));
                }
            },
            _ => {}
        }
        Ok(())
    }

    /// Schemas and channels outside chunks from byte `from` to the end; the position stays.
    fn declared_later(
        &mut self,
        source: &mut (impl Read + Seek),
        from: u64,
    ) -> std::io::Result<()> {
        let start = source.stream_position()?;
        source.seek(SeekFrom::Start(from))?;
        let mut body = Vec::new();
        let mut head = [0; RECORD_HEAD];
        while source.read_exact(&mut head).is_ok() {
            let Some((opcode, length)) = record_head(&head) else {
                break;
            };
            if matches!(opcode, op::SCHEMA | op::CHANNEL) && length <= MAX_RECORD {
                body.clear();
                (&mut *source).take(length).read_to_end(&mut body)?;
                // A broken one is met again on the way, and told there.
                let _ = self.record(opcode, &body);
                continue;
            }
            let Ok(length) = i64::try_from(length) else {
                break;
            };
            // A length beyond all files is damage too.
            if source.seek(SeekFrom::Current(length)).is_err() {
                break;
            }
        }
        source.seek(SeekFrom::Start(start))?;
        Ok(())
    }

    /// Whether no further chunk should wait.
    fn full(&self) -> bool {
        let claims = self.waiting.iter().map(Chunk::claim);
        self.waiting.len() >= SIDE_BY_SIDE.0
            || claims.fold(0, u64::saturating_add) >= SIDE_BY_SIDE.1
    }

    /// The chunks that wait, unpacked on all cores, in their order; damage in them is counted. The next record begins at byte `next`.
    fn chunks(&mut self, source: &mut (impl Read + Seek), next: u64) -> Result<()> {
        let mut waiting = std::mem::take(&mut self.waiting);
        let file = self.file;
        let unpacked: Vec<std::result::Result<(), Damage>> =
            waiting.par_iter_mut().map(|c| c.unpack(file)).collect();
        for (chunk, unpacked) in waiting.iter().zip(unpacked) {
            self.chunks += 1;
            self.unchecked |= !chunk.is_checked;
            match unpacked.and_then(|()| self.records_of_chunk(chunk.records())) {
                Ok(()) => {}
                Err(Damage::File(error)) => return Err(error),
                Err(Damage::Chunk(problem)) => {
                    self.damaged += 1;
                    let at = chunk.position;
                    self.first_damage
                        .get_or_insert_with(|| format!("at byte {at}, {problem}"));
                    if self.damaged == 1 {
                        // What it declared is declared once more behind the data.
                        self.declared_later(source, next)
                            .map_err(|e| Error::system(self.file, "read", &e, "check the disk"))?;
                    }
                }
            }
        }
        self.spare.append(&mut waiting);
        Ok(())
    }

    fn records_of_chunk(&mut self, mut rest: &[u8]) -> std::result::Result<(), Damage> {
        while !rest.is_empty() {
            let cut = || Damage::Chunk("it ends within a record".into());
            let (head, behind) = rest.split_at_checked(RECORD_HEAD).ok_or_else(cut)?;
            let (opcode, length) = record_head(head).ok_or_else(cut)?;
            let length = usize::try_from(length).map_err(|_| cut())?;
            let (body, behind) = behind.split_at_checked(length).ok_or_else(cut)?;
            if matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
                self.record(opcode, body)?;
            }
            rest = behind;
        }
        Ok(())
    }

    /// A record that is in no chunk.
    fn record_outside(&mut self, opcode: u8, body: &[u8]) -> std::result::Result<(), Damage> {
        self.unchecked |= opcode == op::MESSAGE;
        self.record(opcode, body)
    }

    fn record(&mut self, opcode: u8, body: &[u8]) -> std::result::Result<(), Damage> {
        if opcode == op::MESSAGE {
            return self.message(body);
        }
        if matches!(opcode, op::SCHEMA | op::CHANNEL) && body.len() > MAX_DECLARATION {
            return Err(Damage::File(self.refuse(
                format!(
                    "a schema or channel has {} bytes, the limit is {MAX_DECLARATION}",
                    body.len()
                ),
                "record it again with the message's own definition",
            )));
        }
        match parse(opcode, body) {
            Ok(Record::Schema { header, data }) => {
                // A definition beyond all reason is like none.
                let fits =
                    data.len() <= MAX_TEXT && self.definitions + data.len() <= MAX_DEFINITIONS;
                let text = if fits { &data[..] } else { &[] };
                let schema = Schema {
                    kind: header.name,
                    language: header.encoding,
                    text: String::from_utf8_lossy(text).into_owned(),
                };
                self.definitions += text.len();
                let former = self.schemas.insert(header.id, Rc::new(schema));
                self.definitions -=
                    former.map_or(0, |former| former.text.len().min(self.definitions));
            }
            Ok(Record::Channel(channel)) if !self.channels.contains_key(&channel.id) => {
                if self.channels.len() == MAX_CHANNELS {
                    return Err(Damage::File(self.refuse(
                        format!("has more than {MAX_CHANNELS} channels"),
                        "keep the topics that are needed: `mcap filter -y TOPIC`",
                    )));
                }
                let schema = self.schemas.get(&channel.schema_id).cloned();
                let topic = (self.sink).topic(&channel.topic, schema, &channel.message_encoding)?;
                self.channels.insert(channel.id, topic);
            }
            Ok(_) => {}
            Err(problem) => return Err(Damage::Chunk(format!("a record is broken: {problem}"))),
        }
        Ok(())
    }

    #[inline]
    fn message(&mut self, body: &[u8]) -> std::result::Result<(), Damage> {
        let (&[a, b, _, _, _, _, t0, t1, t2, t3, t4, t5, t6, t7, ..], Some(data)) =
            (body, body.get(MESSAGE_HEAD..))
        else {
            return Err(Damage::Chunk("a message is shorter than its head".into()));
        };
        let channel = u16::from_le_bytes([a, b]);
        let log_time = u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
        let topic = match self.last {
            Some((last, topic)) if last == channel => topic,
            _ => {
                let Some(&topic) = self.channels.get(&channel) else {
                    return Err(Damage::Chunk(format!(
                        "a message is of channel {channel}, which is not declared"
                    )));
                };
                self.last = Some((channel, topic));
                topic
            }
        };
        let data = if self.sink.reads(topic) {
            self.packed.unpack(data)
        } else {
            data
        };
        Ok(self.sink.message(topic, log_time, data)?)
    }
}

/// Bytes that nobody reads, but for their checksum.
struct Passed<'a>(&'a mut crc32fast::Hasher);

impl std::io::Write for Passed<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Opcode and length; none at the end and where no record is: 0 is no opcode, and a file with a hole would be walked without end.
fn record_head(head: &[u8]) -> Option<(u8, u64)> {
    let (&opcode, length) = head.split_first()?;
    (opcode != 0).then_some(())?;
    Some((opcode, u64::from_le_bytes(length.try_into().ok()?)))
}

/// A record by the `mcap` crate, once its texts are known to lie within it: that crate allocates what they claim before it reads them.
fn parse(opcode: u8, body: &[u8]) -> std::result::Result<Record<'_>, String> {
    check_texts(opcode, body).ok_or("a text in it is longer than the record")?;
    mcap::parse_record(opcode, body).map_err(|e| e.to_string())
}

/// Walks the texts of a record (4 bytes of length, then content); none if one ends beyond it.
fn check_texts(opcode: u8, body: &[u8]) -> Option<()> {
    let behind = |bytes: &[u8]| -> Option<usize> {
        let length = u32::from_le_bytes(*bytes.first_chunk()?);
        usize::try_from(length).ok()?.checked_add(4)
    };
    let (mut rest, texts) = match opcode {
        op::HEADER => (body, 2),
        op::SCHEMA => (body.get(2..)?, 3),
        op::CHANNEL => (body.get(4..)?, 2),
        op::CHUNK => (body.get(28..)?, 1),
        _ => return Some(()),
    };
    for _ in 0..texts {
        rest = rest.get(behind(rest)?..)?;
    }
    if opcode == op::CHANNEL {
        // Keys and values, one after the other.
        let mut map = rest.get(4..behind(rest)?)?;
        while !map.is_empty() {
            map = map.get(behind(map)?..)?;
        }
    }
    Some(())
}
