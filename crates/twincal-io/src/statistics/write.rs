//! Statistics to a file.

use super::{COLUMNS, Entry, FORMAT, KEY, Layout, Metadata, RowText, StatisticsFile, json};
use crate::artifact::sha256;
use crate::error::{Error, Result};
use crate::log::{Row, fits};
use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::{ArrayRef, RecordBatch, StringArray};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{ArrowError, DataType, Field, Schema};
use std::collections::HashMap;
use std::io::{self, Write};
use std::sync::Arc;
use twincal::calibrate::LogTable;

impl StatisticsFile {
    /// Writes the same bytes for the same statistics.
    ///
    /// # Errors
    /// [`crate::Error::Internal`] for what has no JSON. The inner error is the system's refusal.
    pub fn write_to(&self, to: impl Write) -> Result<io::Result<()>> {
        let rows: Vec<(Entry, Row)> = (self.statistics.tables()).map(row).collect::<Result<_>>()?;
        let metadata = Metadata {
            format: FORMAT,
            checksum: String::new(),
            model: self.model.clone(),
            header: self.statistics.header(),
            logs: rows.iter().map(|(entry, _)| entry.clone()).collect(),
        };
        let rows = rows.into_iter().map(|(_, row)| Ok(row));
        written(metadata, rows, to)
    }
}

/// A log as a row.
fn row(table: LogTable) -> Result<(Entry, Row)> {
    let mut numbers = Vec::new();
    let records = table.records.into_iter().map(|own| {
        numbers.extend(own.values.iter().flat_map(|value| value.to_le_bytes()));
        let count = own.values.len() as u64;
        Layout(
            own.joint,
            own.quantity,
            own.block,
            own.rows,
            own.runs,
            count,
        )
    });
    let text = RowText {
        records: records.collect(),
        header: table.header,
    };
    let bytes = json(&text)?.into_bytes();
    let checksums = [&bytes, &numbers].map(|bytes| sha256(bytes));
    let entry = Entry::new(&text.header, checksums);
    let text = bytes;
    Ok((entry, Row { text, numbers }))
}

/// Rows as they come, behind their metadata.
///
/// # Errors
/// [`Error::Core`] for more logs than can be read again; those of the rows.
pub(super) fn written(
    mut metadata: Metadata,
    rows: impl Iterator<Item = Result<Row>>,
    to: impl Write,
) -> Result<io::Result<()>> {
    metadata.checksum = metadata.own_checksum()?;
    let (text, logs) = (json(&metadata)?, metadata.logs.len());
    drop(metadata);
    if !fits(text.len(), logs) {
        let megabytes = text.len() >> 20;
        return Err(Error::Core(twincal::Error::Statistics {
            problem: format!(
                "names and checksums of {logs} logs take {megabytes} MB, more than one file may have"
            ),
            remedy: "merge fewer files at a time, and give `fit` several".into(),
        }));
    }
    let mut writer = match Writer::new(text, to) {
        Ok(writer) => writer,
        Err(error) => return Ok(Err(error)),
    };
    for row in rows {
        if let Err(error) = writer.add(row?) {
            return Ok(Err(error));
        }
    }
    Ok(writer.finish())
}

struct Writer<W: Write> {
    file: FileWriter<W>,
    schema: Arc<Schema>,
    item: Arc<Field>,
}

impl<W: Write> Writer<W> {
    fn new(metadata: String, to: W) -> io::Result<Self> {
        let item = Arc::new(Field::new("item", DataType::Float64, false));
        let fields = vec![
            Field::new(COLUMNS[0], DataType::Utf8, false),
            Field::new(COLUMNS[1], DataType::List(Arc::clone(&item)), false),
        ];
        // One key: a map of several would come in any order.
        let metadata = HashMap::from([(KEY.to_owned(), metadata)]);
        let schema = Arc::new(Schema::new_with_metadata(fields, metadata));
        let file = FileWriter::try_new(to, &schema).map_err(system)?;
        Ok(Self { file, schema, item })
    }

    fn add(&mut self, row: Row) -> io::Result<()> {
        let text = String::from_utf8(row.text).map_err(io::Error::other)?;
        let numbers = row.numbers.as_chunks().0.iter().copied();
        let mut list = ListBuilder::new(Float64Builder::new()).with_field(Arc::clone(&self.item));
        list.append_value(numbers.map(|number| Some(f64::from_le_bytes(number))));
        let columns: Vec<ArrayRef> = vec![
            Arc::new(StringArray::from(vec![text])),
            Arc::new(list.finish()),
        ];
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), columns).map_err(system)?;
        self.file.write(&batch).map_err(system)
    }

    fn finish(mut self) -> io::Result<()> {
        self.file.finish().map_err(system)
    }
}

fn system(error: ArrowError) -> io::Error {
    match error {
        ArrowError::IoError(_, error) => error,
        other => io::Error::other(other.to_string()),
    }
}
