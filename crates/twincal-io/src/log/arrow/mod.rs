//! Arrow IPC logs, files (Feather version 2) and streams: the wanted columns into doubles, block by block.
//!
//! The `arrow-ipc` crate reads the metadata. The values are taken here: its decoder holds a whole record batch, which may be the
//! whole log, and panics where a buffer ends beyond its batch.

mod layout;
mod rows;

use super::cells::{Sink, disk_failure};
use super::{ARROW_FILE, ARROW_MESSAGE, Cells, MAX_COLUMNS, Request, assemble};
use crate::error::{Error, Place, Result};
use arrow_ipc::{
    CompressionType, Endianness, MessageHeader, MetadataVersion, RecordBatch, Schema,
    root_as_footer, root_as_message,
};
use layout::{Form, Numbers, Position};
pub(crate) use rows::{ANEW, Row, Rows, fits};
use std::io::{self, Read, Seek, SeekFrom};
use twincal::signal::Log as GivenLog;
use twincal::{Code, Finding, Severity};

/// Longest footer or message without its values, bytes.
const MAX_METADATA: u64 = 1 << 26;
/// Most record batches.
const MAX_BATCHES: usize = 1 << 20;
/// Bytes of numbers at a time: a whole count of any form.
const BLOCK: usize = 1 << 16;

/// Reads an Arrow IPC file or stream.
pub(super) fn read(
    source: impl Read + Seek,
    request: Request<'_>,
) -> Result<(GivenLog<'static>, Vec<Finding>)> {
    let name = request.name;
    let mut log = Log::open(source, name, EXPORT)?;
    let selection = request.select(&log.header()?)?;
    let wanted = selection.file_columns();
    let mut findings = Vec::new();
    let columns = log.columns(&wanted, &mut findings)?;
    let mut rows = 0_usize;
    for at in log.batches.clone() {
        let batch = log.batch(at, &columns)?;
        rows = rows
            .checked_add(batch.rows)
            .ok_or_else(|| log.refuse("declares more rows than can be counted".into()))?;
    }
    let mut cells = Cells::reserve(name, rows, wanted.len(), request.chapters)?;
    let mut sinks = cells.sinks();
    for at in log.batches.clone() {
        let batch = log.batch(at, &columns)?;
        for ((values, column), chunk) in sinks.iter_mut().zip(&columns).zip(&batch.chunks) {
            let appended = log.append(&batch, *chunk, column.numbers.form, values);
            if let Err(error) = appended {
                return Err(disk_failure(name, &sinks).unwrap_or_else(|| {
                    log.refuse(format!(
                        "column `{}`, record batch at byte {at}: {}",
                        column.name,
                        reason(&error)
                    ))
                }));
            }
        }
    }
    let ticks = |column: &Column| column.numbers.ticks.map_or(1.0, |(ticks, _)| ticks);
    cells.scales = columns.iter().map(ticks).collect();
    let log = assemble(request, cells, selection, &mut findings)?;
    Ok((log, findings))
}

/// Column names of an Arrow IPC file or stream.
pub(super) fn header(source: impl Read + Seek, name: &str) -> Result<Vec<String>> {
    Log::open(source, name, EXPORT)?.header()
}

/// An input error in words.
fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => "holds fewer values than it declares".into(),
        _ => error.to_string(),
    }
}

/// What helps where a log is damaged.
const EXPORT: &str = "copy or export it again";

/// A file or stream whose schema has been read.
#[derive(Debug)]
struct Log<R> {
    source: R,
    name: String,
    /// What helps where the file is damaged.
    remedy: &'static str,
    length: u64,
    /// Footer of a file, first message of a stream.
    metadata: Vec<u8>,
    is_file: bool,
    /// Where the messages of the record batches begin.
    batches: Vec<u64>,
}

/// A wanted column.
struct Column {
    name: String,
    index: usize,
    numbers: Numbers,
}

/// Where one record batch has the wanted columns.
struct Batch {
    rows: usize,
    compression: Option<CompressionType>,
    chunks: Vec<Chunk>,
}

/// Values of one column in one batch: bytes of the file.
#[derive(Clone, Copy)]
struct Chunk {
    /// Which values are there, one bit each; none if all are.
    valid: Option<Span>,
    values: Span,
}

#[derive(Clone, Copy)]
struct Span {
    start: u64,
    length: u64,
}

/// A message without its body.
struct Message {
    metadata: Vec<u8>,
    /// First byte of the body.
    body: u64,
}

impl<R: Read + Seek> Log<R> {
    fn open(mut source: R, name: &str, remedy: &'static str) -> Result<Self> {
        let system = |e: &io::Error| Error::system(name, "read", e, "check the disk");
        let length = source.seek(SeekFrom::End(0)).map_err(|e| system(&e))?;
        let mut log = Self {
            source,
            name: name.to_owned(),
            remedy,
            length,
            metadata: Vec::new(),
            is_file: false,
            batches: Vec::new(),
        };
        let mut head = [0; 8];
        log.is_file = log.fill(0, &mut head).is_ok() && head.starts_with(ARROW_FILE);
        if log.is_file {
            log.read_footer()?;
        } else {
            log.walk()?;
        }
        if log.schema()?.endianness() == Endianness::Big {
            return Err(Error::content(
                Place::file(name),
                "is written in big-endian byte order",
                "write it again on the machine that reads it",
            ));
        }
        Ok(log)
    }

    fn refuse(&self, problem: String) -> Error {
        Error::content(Place::file(&self.name), problem, self.remedy)
    }

    fn broken(&self, at: u64) -> Error {
        self.refuse(format!("the message at byte {at} is broken"))
    }

    fn cut_off(&self) -> Error {
        self.refuse("is not a whole Arrow file: it does not end as one".into())
    }

    /// Fills `bytes` from byte `at` on.
    fn fill(&mut self, at: u64, bytes: &mut [u8]) -> io::Result<()> {
        self.source.seek(SeekFrom::Start(at))?;
        self.source.read_exact(bytes)
    }

    /// `length` bytes of metadata, within the file and the limit.
    fn take(&mut self, at: u64, length: u64) -> Result<Vec<u8>> {
        if length > MAX_METADATA {
            return Err(self.refuse(format!(
                "the metadata at byte {at} claim {length} bytes, the limit is {MAX_METADATA}"
            )));
        }
        if at.checked_add(length).is_none_or(|end| end > self.length) {
            return Err(self.refuse(format!(
                "the metadata at byte {at} claim {length} bytes, the file has {}",
                self.length
            )));
        }
        let mut bytes = vec![0; length as usize];
        self.fill(at, &mut bytes).map_err(|_| self.broken(at))?;
        Ok(bytes)
    }

    /// A file's footer: schema and places of the record batches. It ends with its length and the magic.
    fn read_footer(&mut self) -> Result<()> {
        let mut tail = [0; 10];
        let at = self
            .length
            .checked_sub(18)
            .ok_or_else(|| self.cut_off())?
            .saturating_add(8);
        self.fill(at, &mut tail).map_err(|_| self.cut_off())?;
        let [a, b, c, d, magic @ ..] = tail;
        let length = u64::try_from(i32::from_le_bytes([a, b, c, d])).ok();
        let (Some(length), true) = (length, magic == ARROW_FILE) else {
            return Err(self.cut_off());
        };
        let start = at.checked_sub(length).ok_or_else(|| self.cut_off())?;
        self.metadata = self.take(start, length)?;
        let footer = root_as_footer(&self.metadata).map_err(|_| self.broken(start))?;
        let blocks = footer.recordBatches().unwrap_or_default();
        let places = blocks.iter().map(|block| u64::try_from(block.offset()));
        self.batches = places
            .collect::<std::result::Result<_, _>>()
            .map_err(|_| self.broken(start))?;
        self.check_count()
    }

    /// A stream's messages from the first to the last: schema and places of the record batches.
    fn walk(&mut self) -> Result<()> {
        let mut at = 0;
        while let Some(message) = self.message(at)? {
            let parsed = root_as_message(&message.metadata).map_err(|_| self.broken(at))?;
            let is_schema = parsed.header_type() == MessageHeader::Schema;
            if is_schema != (at == 0) {
                return Err(self.broken(at));
            }
            if parsed.header_type() == MessageHeader::RecordBatch {
                self.batches.push(at);
                self.check_count()?;
            }
            let next = u64::try_from(parsed.bodyLength())
                .ok()
                .and_then(|length| message.body.checked_add(length))
                .filter(|next| *next <= self.length)
                .ok_or_else(|| {
                    self.refuse(format!(
                        "the record batch at byte {at} ends beyond the file: it is cut off"
                    ))
                })?;
            if is_schema {
                self.metadata = message.metadata;
            }
            at = next;
        }
        Ok(())
    }

    fn check_count(&self) -> Result<()> {
        if self.batches.len() > MAX_BATCHES {
            return Err(Error::content(
                Place::file(&self.name),
                format!("more than {MAX_BATCHES} record batches"),
                "write more rows per batch",
            ));
        }
        Ok(())
    }

    /// The message at byte `at`; none at the end of a stream.
    fn message(&mut self, at: u64) -> Result<Option<Message>> {
        let mut head = [0; 8];
        let given = self.length.saturating_sub(at).min(8) as usize;
        self.fill(at, &mut head[..given])
            .map_err(|_| self.broken(at))?;
        let (length, start) = match head {
            _ if given == 0 => return Ok(None),
            _ if given < 4 => return Err(self.broken(at)),
            // Before Arrow 0.15 the length stood alone.
            [a, b, c, d, ..] if [a, b, c, d] != ARROW_MESSAGE => ([a, b, c, d], at + 4),
            [.., a, b, c, d] if given == 8 => ([a, b, c, d], at + 8),
            _ => return Err(self.broken(at)),
        };
        let length = u64::try_from(i32::from_le_bytes(length)).map_err(|_| self.broken(at))?;
        if length == 0 {
            return Ok(None);
        }
        let metadata = self.take(start, length)?;
        let body = start + length;
        Ok(Some(Message { metadata, body }))
    }

    fn schema(&self) -> Result<Schema<'_>> {
        let schema = if self.is_file {
            root_as_footer(&self.metadata).ok().and_then(|f| f.schema())
        } else {
            let message = root_as_message(&self.metadata).ok();
            message.and_then(|message| message.header_as_schema())
        };
        schema.ok_or_else(|| self.refuse("holds no schema".into()))
    }

    fn header(&self) -> Result<Vec<String>> {
        let fields = self.schema()?.fields().unwrap_or_default();
        if fields.len() > MAX_COLUMNS {
            return Err(Error::content(
                Place::file(&self.name),
                format!("{} columns, the limit is {MAX_COLUMNS}", fields.len()),
                "export only the columns that are needed",
            ));
        }
        let names = fields.iter().map(|f| f.name().unwrap_or_default().into());
        Ok(names.collect())
    }

    /// What the wanted columns hold; those that hold no numbers are refused by name.
    fn columns(&self, wanted: &[usize], findings: &mut Vec<Finding>) -> Result<Vec<Column>> {
        let fields = self.schema()?.fields().unwrap_or_default();
        let mut columns = Vec::with_capacity(wanted.len());
        for &index in wanted {
            let field = fields.get(index);
            let name = field.name().unwrap_or_default().to_owned();
            let numbers = layout::numbers(field).map_err(|what| {
                Error::content(
                    Place::file(&self.name),
                    format!("column `{name}` {what}"),
                    "store it as float64, or map another column in [columns]",
                )
            })?;
            if let Some((_, unit)) = numbers.ticks {
                let message = format!(
                    "column `{name}` is a time in {unit} by its type and was turned into seconds"
                );
                findings.push(Finding::new(
                    Severity::Note,
                    Code::TimestampType,
                    &self.name,
                    message,
                    0,
                ));
            }
            columns.push(Column {
                name,
                index,
                numbers,
            });
        }
        Ok(columns)
    }

    /// Finds the wanted columns in the record batch at byte `at` and checks its claims.
    fn batch(&mut self, at: u64, columns: &[Column]) -> Result<Batch> {
        let message = self.message(at)?.ok_or_else(|| self.broken(at))?;
        let parsed = root_as_message(&message.metadata).map_err(|_| self.broken(at))?;
        let batch = parsed
            .header_as_record_batch()
            .ok_or_else(|| self.broken(at))?;
        let end = u64::try_from(parsed.bodyLength())
            .ok()
            .and_then(|length| message.body.checked_add(length))
            .filter(|end| *end <= self.length)
            .ok_or_else(|| {
                self.refuse(format!(
                    "the record batch at byte {at} ends beyond the file: it is cut off"
                ))
            })?;
        let rows = usize::try_from(batch.length()).map_err(|_| {
            self.refuse(format!(
                "the record batch at byte {at} declares {} rows",
                batch.length()
            ))
        })?;
        let compression = batch.compression().map(|compression| compression.codec());
        if let Some(other) = compression
            .filter(|c| !matches!(*c, CompressionType::LZ4_FRAME | CompressionType::ZSTD))
        {
            return Err(Error::content(
                Place::file(&self.name),
                format!("is compressed by method {}, which is not known", other.0),
                "write it with lz4, zstd or no compression",
            ));
        }
        let positions = self
            .positions(&batch, parsed.version(), columns)?
            .ok_or_else(|| self.broken(at))?;
        let body = Span {
            start: message.body,
            length: end - message.body,
        };
        let mut chunks = Vec::with_capacity(columns.len());
        for (column, position) in columns.iter().zip(positions) {
            let width = column.numbers.form.width();
            let chunk = chunk(&batch, position, rows, width, body).map_err(|problem| {
                self.refuse(format!(
                    "column `{}`, record batch at byte {at}: {problem}",
                    column.name
                ))
            })?;
            chunks.push(chunk);
        }
        Ok(Batch {
            rows,
            compression,
            chunks,
        })
    }

    /// Node and buffer of every wanted column; none if the batch does not fit the schema.
    fn positions(
        &self,
        batch: &RecordBatch<'_>,
        version: MetadataVersion,
        columns: &[Column],
    ) -> Result<Option<Vec<Position>>> {
        let fields = self.schema()?.fields().unwrap_or_default();
        let variadic: Vec<i64> = batch.variadicBufferCounts().into_iter().flatten().collect();
        let last = columns.iter().map(|c| c.index).max().unwrap_or(0);
        let mut positions = Vec::with_capacity(last + 1);
        let mut position = Position::default();
        for field in fields.iter().take(last + 1) {
            positions.push(position);
            if position.pass(field, version, &variadic).is_none() {
                return Ok(None);
            }
        }
        let wanted = columns.iter().map(|c| positions.get(c.index).copied());
        Ok(wanted.collect())
    }

    /// Appends a batch's values of one column, nulls as NaN.
    fn append(
        &mut self,
        batch: &Batch,
        chunk: Chunk,
        form: Form,
        sink: &mut Sink<'_>,
    ) -> io::Result<()> {
        let mut present = Vec::new();
        if let Some(valid) = chunk.valid {
            let bits = self.unpacked(valid, batch.compression)?;
            let bytes = batch.rows.div_ceil(8) as u64;
            bits.take(bytes).read_to_end(&mut present)?;
            if (present.len() as u64) < bytes {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
        let mut block = vec![0; BLOCK];
        let mut values = Vec::with_capacity(BLOCK);
        let (mut row, mut left) = (0, batch.rows * form.width() as usize);
        let mut numbers = self.unpacked(chunk.values, batch.compression)?;
        while left > 0 {
            let part = &mut block[..left.min(BLOCK)];
            numbers.read_exact(part)?;
            form.append(part, &mut values);
            for value in &mut values {
                let known = present
                    .get(row / 8)
                    .is_none_or(|byte| byte >> (row % 8) & 1 == 1);
                if !known {
                    *value = f64::NAN;
                }
                row += 1;
            }
            sink.extend(values.drain(..))?;
            left -= part.len();
        }
        Ok(())
    }

    /// The bytes of a buffer as they were before compression.
    fn unpacked<'s>(
        &'s mut self,
        span: Span,
        compression: Option<CompressionType>,
    ) -> io::Result<Box<dyn Read + 's>> {
        self.source.seek(SeekFrom::Start(span.start))?;
        let mut packed = io::BufReader::new((&mut self.source).take(span.length));
        let Some(method) = compression.filter(|_| span.length > 0) else {
            return Ok(Box::new(packed));
        };
        let mut length = [0; 8];
        packed.read_exact(&mut length)?;
        // A buffer that would have grown is stored as it is.
        if i64::from_le_bytes(length) == -1 {
            return Ok(Box::new(packed));
        }
        Ok(if method == CompressionType::LZ4_FRAME {
            Box::new(lz4_flex::frame::FrameDecoder::new(packed))
        } else {
            Box::new(io::BufReader::new(
                zstd::stream::read::Decoder::with_buffer(packed)?,
            ))
        })
    }
}

/// The buffers of one column, within the batch and as long as its rows need.
fn chunk(
    batch: &RecordBatch<'_>,
    position: Position,
    rows: usize,
    width: u64,
    body: Span,
) -> std::result::Result<Chunk, String> {
    let nodes = batch.nodes().unwrap_or_default();
    let buffers = batch.buffers().unwrap_or_default();
    if position.node >= nodes.len() || position.buffer.saturating_add(1) >= buffers.len() {
        return Err("it is not in the batch".into());
    }
    let node = nodes.get(position.node);
    if node.length() != batch.length() {
        return Err(format!(
            "{} values, the batch has {rows} rows",
            node.length()
        ));
    }
    let span = |number: usize, needed: u64| {
        let buffer = buffers.get(number);
        let (start, length) = (
            u64::try_from(buffer.offset()),
            u64::try_from(buffer.length()),
        );
        let (Ok(start), Ok(length)) = (start, length) else {
            return Err("its values begin before the batch".to_owned());
        };
        if start
            .checked_add(length)
            .is_none_or(|end| end > body.length)
        {
            return Err("its values end beyond the batch".to_owned());
        }
        if batch.compression().is_none() && length < needed {
            return Err(format!(
                "{rows} values need {needed} bytes, it has {length}"
            ));
        }
        Ok(Span {
            start: body.start + start,
            length,
        })
    };
    let bytes = (rows as u64)
        .checked_mul(width)
        .ok_or_else(|| format!("{rows} values"))?;
    let values = span(position.buffer + 1, bytes)?;
    let valid = (node.null_count() != 0)
        .then(|| span(position.buffer, (rows as u64).div_ceil(8)))
        .transpose()?;
    Ok(Chunk { valid, values })
}
