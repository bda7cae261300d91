//! Arrow IPC files with one row to a record batch: a text, and a list of numbers. Statistics are kept so.

use super::{ARROW_FILE, Log, MAX_BATCHES, MAX_METADATA, Span, reason};
use crate::error::{Error, Place, Result};
use crate::memory;
use arrow_ipc::{Buffer, Precision, RecordBatch, Type, root_as_message};
use std::io::{self, Read, Seek, SeekFrom};

/// Nodes and buffers of a row: text (validity, offsets, bytes), list (validity, offsets), numbers (validity, values).
const NODES: usize = 3;
const BUFFERS: usize = 7;
/// Where these buffers stand: offsets and bytes of the text, offsets and values of the list.
const TEXT: [usize; 2] = [1, 2];
const LIST: [usize; 2] = [4, 6];
/// Bytes of a footer for each record batch, and for what is not metadata.
const PER_BATCH: u64 = 24;
const FRAME: u64 = 4096;
/// What helps where a file is not as it was written.
pub(crate) const ANEW: &str = "make it anew with `twincal statistics --force`";
/// Numbers of a row that are read without asking for memory, bytes.
const SMALL: u64 = 16 << 20;

/// A file whose schema has been read.
#[derive(Debug)]
pub(crate) struct Rows<R> {
    log: Log<R>,
}

/// A row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Row {
    /// UTF-8, if nothing is damaged.
    pub(crate) text: Vec<u8>,
    /// Doubles, little-endian.
    pub(crate) numbers: Vec<u8>,
}

/// Whether a file of so many rows with so many bytes of metadata can be read again.
pub(crate) fn fits(metadata: usize, rows: usize) -> bool {
    let (metadata, rows) = (metadata as u64, rows as u64);
    rows <= MAX_BATCHES as u64 && metadata + PER_BATCH * rows + FRAME <= MAX_METADATA
}

impl<R: Read + Seek> Rows<R> {
    /// # Errors
    /// [`Error::Content`] for what is no Arrow file.
    pub(crate) fn open(mut source: R, name: &str) -> Result<Self> {
        let mut magic = [0; ARROW_FILE.len()];
        let read = source.read_exact(&mut magic);
        if read.is_err() || magic != *ARROW_FILE {
            return Err(Error::content(
                Place::file(name),
                "is no Arrow file",
                "give a file that `twincal statistics` wrote",
            ));
        }
        let log = Log::open(source, name, ANEW)?;
        if !log.batches.is_sorted_by(|one, next| one < next) {
            return Err(log.refuse("names a record batch twice, or not in their order".into()));
        }
        Ok(Self { log })
    }

    /// A file that was looked at before, whose rows begin at these bytes.
    pub(crate) fn again(mut source: R, name: &str, batches: Vec<u64>) -> Result<Self> {
        let length = source.seek(SeekFrom::End(0));
        let length = length.map_err(|e| Error::system(name, "read", &e, "check the disk"))?;
        let log = Log {
            source,
            name: name.to_owned(),
            remedy: ANEW,
            length,
            metadata: Vec::new(),
            is_file: true,
            batches,
        };
        Ok(Self { log })
    }

    /// Where the rows begin, for [`Self::again`].
    pub(crate) fn into_batches(self) -> Vec<u64> {
        self.log.batches
    }

    /// A text of the schema's metadata.
    pub(crate) fn metadata(&self, key: &str) -> Result<Option<String>> {
        let metadata = self.log.schema()?.custom_metadata().unwrap_or_default();
        let own = metadata.iter().find(|pair| pair.key() == Some(key));
        Ok(own.and_then(|pair| pair.value()).map(str::to_owned))
    }

    pub(crate) fn len(&self) -> usize {
        self.log.batches.len()
    }

    /// # Errors
    /// [`Error::Content`] for other columns than a text and a list of doubles.
    pub(crate) fn require_columns(&self) -> Result<()> {
        let fields = self.log.schema()?.fields().unwrap_or_default();
        let kinds: Vec<Type> = fields.iter().map(|field| field.type_type()).collect();
        let lists = fields.iter().skip(1);
        let mut items = lists.flat_map(|list| list.children().unwrap_or_default());
        let item = items.next().and_then(|own| own.type_as_floating_point());
        let double = item.is_some_and(|own| own.precision() == Precision::DOUBLE);
        if kinds == [Type::Utf8, Type::List] && double {
            return Ok(());
        }
        let problem = "has other columns than a text and a list of doubles";
        Err(self.log.refuse(problem.into()))
    }

    /// # Errors
    /// [`Error::Content`] for a record batch that is none of one such row, and for more bytes than there is memory.
    pub(crate) fn row(&mut self, number: usize) -> Result<Row> {
        let log = &mut self.log;
        let at = log.batches.get(number).copied();
        let at = at.ok_or_else(|| log.refuse(format!("has no row {number}")))?;
        let message = log.message(at)?.ok_or_else(|| log.broken(at))?;
        let parsed = root_as_message(&message.metadata).map_err(|_| log.broken(at))?;
        let left = log.length.saturating_sub(message.body);
        let length = u64::try_from(parsed.bodyLength()).ok();
        let length = length.filter(|length| *length <= left);
        let body = Span {
            start: message.body,
            length: length.ok_or_else(|| log.broken(at))?,
        };
        let batch = parsed.header_as_record_batch();
        let batch = batch.ok_or_else(|| log.broken(at))?;
        let buffers = buffers(&batch);
        let buffers = buffers.map_err(|what| log.refuse(format!("row {number} {what}")))?;
        let text = log.list((&buffers, TEXT), 1, body, (at, number))?;
        if text.length > MAX_METADATA {
            let most = MAX_METADATA;
            return Err(log.refuse(format!(
                "the text of row {number} has {} bytes, the limit is {most}",
                text.length
            )));
        }
        let numbers = log.list((&buffers, LIST), 8, body, (at, number))?;
        if numbers.length > SMALL {
            memory::require(&log.name, numbers.length, "give it more memory")?;
        }
        Ok(Row {
            text: log.bytes(text, number)?,
            numbers: log.bytes(numbers, number)?,
        })
    }
}

impl<R: Read + Seek> Log<R> {
    /// Where the only list of a column stands, each of its items so many bytes.
    fn list(
        &mut self,
        (buffers, [offsets, items]): (&[Buffer], [usize; 2]),
        width: u64,
        body: Span,
        (at, number): (u64, usize),
    ) -> Result<Span> {
        let span = |buffer: &Buffer, from: u64, length: u64| {
            let start = u64::try_from(buffer.offset()).ok()?.checked_add(from)?;
            let inside = from.checked_add(length)? <= u64::try_from(buffer.length()).ok()?
                && start.checked_add(length)? <= body.length;
            inside.then_some(Span {
                start: body.start + start,
                length,
            })
        };
        let ends = span(&buffers[offsets], 0, 8).ok_or_else(|| self.broken(at))?;
        let ends = self.bytes(ends, number)?;
        let mut ends = ends.as_chunks().0.iter().copied().map(i32::from_le_bytes);
        let mut end = || ends.next().and_then(|end| u64::try_from(end).ok());
        let list = end().zip(end()).and_then(|(first, last)| {
            let (from, length) = (first * width, last.checked_sub(first)? * width);
            span(&buffers[items], from, length)
        });
        list.ok_or_else(|| self.broken(at))
    }

    /// Bytes within the file.
    fn bytes(&mut self, span: Span, number: usize) -> Result<Vec<u8>> {
        let mut bytes = vec![0; span.length as usize];
        let read: io::Result<()> = (self.source.seek(SeekFrom::Start(span.start)))
            .and_then(|_| self.source.read_exact(&mut bytes));
        read.map_err(|e| self.refuse(format!("row {number}: {}", reason(&e))))?;
        Ok(bytes)
    }
}

/// The buffers of a batch of one row.
///
/// # Errors
/// What it is instead, in words.
fn buffers(batch: &RecordBatch<'_>) -> std::result::Result<Vec<Buffer>, &'static str> {
    if batch.compression().is_some() {
        return Err("is compressed, which statistics are not");
    }
    if batch.length() != 1 {
        return Err("is not one row of a log, as each record batch is");
    }
    let (nodes, buffers) = (
        batch.nodes().unwrap_or_default(),
        batch.buffers().unwrap_or_default(),
    );
    let whole = (nodes.len(), buffers.len()) == (NODES, BUFFERS);
    if !whole || nodes.iter().any(|node| node.null_count() != 0) {
        return Err("has missing values, or other columns than its schema");
    }
    Ok(buffers.iter().copied().collect())
}
