//! A table as a Parquet file, row group by row group.

use super::{ColumnKind, Values};
use crate::log::stamps;
use parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{BoolType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// Rows of one row group.
const GROUP: usize = 65_536;

/// Writes rows in groups; memory is one group.
pub(super) struct ParquetTable<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    waiting: Vec<Column>,
}

impl<W: Write + Send> ParquetTable<W> {
    /// Begins a file.
    pub(super) fn new(writer: W, columns: &[(String, ColumnKind)]) -> io::Result<Self> {
        let waiting = columns.iter().map(|(_, kind)| match kind {
            ColumnKind::Number => Column::Numbers(Vec::new()),
            ColumnKind::Flag => Column::Flags(Vec::new()),
        });
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_dictionary_enabled(false)
            .set_created_by(format!("twincal version {}", env!("CARGO_PKG_VERSION")))
            .build();
        let schema = schema(columns).map_err(io_error)?;
        let writer = SerializedFileWriter::new(writer, schema, Arc::new(properties));
        Ok(Self {
            writer: writer.map_err(io_error)?,
            waiting: waiting.collect(),
        })
    }

    /// Keeps a text under `key` in the file's metadata.
    pub(super) fn keep(&mut self, key: &str, text: &str) {
        self.writer
            .append_key_value_metadata(KeyValue::new(key.to_owned(), text.to_owned()));
    }

    /// Adds rows; blocks are those of the columns.
    pub(super) fn push(&mut self, blocks: &[Values<'_>]) -> io::Result<()> {
        for (column, values) in self.waiting.iter_mut().zip(blocks) {
            match (column, values) {
                (Column::Numbers(all), Values::Numbers(new)) => all.extend_from_slice(new),
                (Column::Numbers(all), Values::Stamps(start, new)) => {
                    let seconds = |s: &f64| stamps::seconds(stamps::of_seconds(*start, *s));
                    all.extend(new.iter().map(seconds));
                }
                (Column::Flags(all), Values::Flags(new)) => all.extend_from_slice(new),
                _ => {}
            }
        }
        let gathered = self.waiting.first().map_or(0, Column::len);
        if gathered >= GROUP {
            write_group(&mut self.writer, &mut self.waiting).map_err(io_error)?;
        }
        Ok(())
    }

    /// Ends the file and gives the writer back.
    pub(super) fn finish(mut self) -> io::Result<W> {
        if self.waiting.first().is_some_and(|c| c.len() > 0) {
            write_group(&mut self.writer, &mut self.waiting).map_err(io_error)?;
        }
        self.writer.into_inner().map_err(io_error)
    }
}

/// One column's share of the row group that is being gathered.
enum Column {
    Numbers(Vec<f64>),
    Flags(Vec<bool>),
}

fn io_error(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}

impl Column {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(v) => v.len(),
            Self::Flags(v) => v.len(),
        }
    }
}

fn schema(columns: &[(String, ColumnKind)]) -> std::result::Result<Arc<Type>, ParquetError> {
    let fields = columns
        .iter()
        .map(|(name, kind)| {
            let physical = match kind {
                ColumnKind::Number => Physical::DOUBLE,
                ColumnKind::Flag => Physical::BOOLEAN,
            };
            Type::primitive_type_builder(name, physical)
                .with_repetition(Repetition::REQUIRED)
                .build()
                .map(Arc::new)
        })
        .collect::<std::result::Result<Vec<_>, _>>()?;
    Type::group_type_builder("table")
        .with_fields(fields)
        .build()
        .map(Arc::new)
}

fn write_group<W: Write + Send>(
    writer: &mut SerializedFileWriter<W>,
    waiting: &mut [Column],
) -> std::result::Result<(), ParquetError> {
    let mut group = writer.next_row_group()?;
    for column in waiting {
        let Some(mut out) = group.next_column()? else {
            break;
        };
        match column {
            Column::Numbers(values) => {
                out.typed::<DoubleType>().write_batch(values, None, None)?;
                values.clear();
            }
            Column::Flags(values) => {
                out.typed::<BoolType>().write_batch(values, None, None)?;
                values.clear();
            }
        }
        out.close()?;
    }
    group.close()?;
    Ok(())
}
