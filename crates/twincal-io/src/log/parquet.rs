//! Parquet logs: columns side by side into doubles, after the file's claims about itself have been checked.

use super::cells::{Sink, disk_failure};
use super::memory_table::typed_stamps;
use super::pages::check_chunk;
use super::{Cells, Request, assemble};
use crate::error::{Error, Place, Result};
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{AsBytes, ByteArray, DataType, FixedLenByteArray};
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;
use rayon::prelude::*;
use std::io::{Read, Seek};
use twincal::Finding;
use twincal::signal::Log;

/// Values read at a time.
const BATCH: usize = 8192;
/// Largest page, packed and unpacked, bytes, of files whose columns are decoded side by side: writers make pages of 1 MiB.
const SIDE_BY_SIDE: u64 = 1 << 24;

/// Largest footer, bytes: 24 hours of 4000 channels in row groups of a million rows have 20 MB.
const MAX_FOOTER: u32 = 32 << 20;

/// Refuses a footer that would take more memory than any log's: it is taken apart as a whole.
///
/// # Errors
/// [`Error::Content`] with its bytes.
pub(super) fn check_footer(chunks: &impl ChunkReader, name: &str) -> Result<()> {
    let Some(at) = chunks.len().checked_sub(8) else {
        return Ok(());
    };
    let tail = chunks.get_bytes(at, 8).map_err(|e| broken(name, &e))?;
    let claimed = tail
        .first_chunk()
        .map_or(0, |four| u32::from_le_bytes(*four));
    if tail.ends_with(b"PAR1") && claimed > MAX_FOOTER {
        return Err(Error::content(
            Place::file(name),
            format!("its footer has {claimed} bytes, the limit is {MAX_FOOTER}"),
            "write it with larger row groups, or export only the columns that are needed",
        ));
    }
    Ok(())
}

fn broken(name: &str, error: &ParquetError) -> Error {
    Error::content(
        Place::file(name),
        format!("is not a whole Parquet file: {error}"),
        "copy or export it again",
    )
}

/// Reads a Parquet log; `pages` is a second handle to the same bytes.
pub(super) fn read(
    chunks: impl ChunkReader + 'static,
    mut pages: impl Read + Seek,
    request: Request<'_>,
) -> Result<(Log<'static>, Vec<Finding>)> {
    let name = request.name;
    check_footer(&chunks, name)?;
    let reader = SerializedFileReader::new(chunks).map_err(|e| broken(name, &e))?;
    let metadata = reader.metadata();
    let columns: Vec<_> = metadata.file_metadata().schema_descr().columns().to_vec();
    let header: Vec<String> = columns.iter().map(|c| c.path().string()).collect();
    let selection = request.select(&header)?;
    let wanted = selection.file_columns();
    let mut findings = Vec::new();
    let mut scales = Vec::with_capacity(wanted.len());
    let kinds: Vec<ByteNumber> = wanted
        .iter()
        .map(|&i| ByteNumber::of(&columns[i]))
        .collect();
    for &index in &wanted {
        scales.push(scale(name, &columns[index], &mut findings)?);
    }
    let (rows, largest) = check(&mut pages, name, metadata, &wanted)?;
    let side_by_side = if largest <= SIDE_BY_SIDE {
        1
    } else {
        wanted.len()
    };
    let mut cells = Cells::reserve(name, rows, wanted.len(), request.chapters)?;
    let mut sinks = cells.sinks();
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(|e| broken(name, &e))?;
        // A thread holds the page that it is at, packed and unpacked.
        let read: Vec<_> = (sinks.par_iter_mut().zip(wanted.par_iter().zip(&kinds)))
            .with_min_len(side_by_side)
            .map(|(values, (&index, kind))| append(group.get_column_reader(index)?, *kind, values))
            .collect();
        // The first column with a mistake, whichever thread was first.
        for read in read {
            read.map_err(|e| disk_failure(name, &sinks).unwrap_or_else(|| broken(name, &e)))?;
        }
    }
    if let Some(short) = sinks.iter().position(|column| column.len() != rows) {
        return Err(Error::content(
            Place::file(name),
            format!(
                "column `{}` has {} values, the file declares {rows} rows",
                header[wanted[short]],
                sinks[short].len()
            ),
            "copy or export it again",
        ));
    }
    cells.scales = scales;
    let log = assemble(request, cells, selection, &mut findings)?;
    Ok((log, findings))
}

/// Numbers that stand as bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ByteNumber {
    /// None: bytes are text.
    None,
    /// IEEE 754 binary16, little-endian.
    Half,
    /// The digits of a decimal, big-endian in two's complement.
    Decimal,
}

impl ByteNumber {
    fn of(column: &ColumnDescriptor) -> Self {
        match column.logical_type_ref() {
            Some(LogicalType::Float16) => Self::Half,
            Some(LogicalType::Decimal(_)) => Self::Decimal,
            None if column.converted_type() == ConvertedType::DECIMAL => Self::Decimal,
            _ => Self::None,
        }
    }

    fn value(self, bytes: &[u8]) -> f64 {
        match (self, bytes) {
            (Self::Half, &[low, high]) => half(u16::from_le_bytes([low, high])),
            (Self::Decimal, bytes) => digits(bytes),
            _ => f64::NAN,
        }
    }
}

/// (−1)^s 2^(e−15) (1 + f/1024); below 2⁻¹⁴ s f 2⁻²⁴.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// A whole number, exact up to 2⁵³.
fn digits(bytes: &[u8]) -> f64 {
    let negative = bytes.first().is_some_and(|byte| byte >> 7 == 1);
    // −n is the complement of n − 1, whose bytes are all added.
    let byte = |byte: &u8| f64::from(if negative { !byte } else { *byte });
    let size = bytes.iter().fold(0.0, |sum, next| 256.0 * sum + byte(next));
    if negative { -size - 1.0 } else { size }
}

/// Refuses types that are no numbers; what the numbers are divided by: ticks per second of stamps whose type states their unit, the
/// power of ten of decimals, else 1.
fn scale(name: &str, column: &ColumnDescriptor, findings: &mut Vec<Finding>) -> Result<f64> {
    let path = column.path().string();
    let refuse = |what: String| {
        Err(Error::content(
            Place::file(name),
            format!("column `{path}` {what}"),
            "store it as DOUBLE, or map another column in [columns]",
        ))
    };
    if column.max_rep_level() > 0
        || column.self_type().get_basic_info().repetition() == Repetition::REPEATED
    {
        return refuse("is a list, not one number per row".into());
    }
    match ByteNumber::of(column) {
        ByteNumber::Half => return Ok(1.0),
        ByteNumber::Decimal => return Ok(10_f64.powi(column.type_scale())),
        ByteNumber::None => {}
    }
    match column.physical_type() {
        Type::DOUBLE | Type::FLOAT | Type::INT32 => return Ok(1.0),
        Type::INT64 => {}
        Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY => {
            return refuse("is text or bytes, not a number".into());
        }
        other => return refuse(format!("is {other}, not a number")),
    }
    let Some(LogicalType::Timestamp(stamp)) = column.logical_type_ref() else {
        return Ok(1.0);
    };
    let (ticks, word) = match stamp.unit {
        TimeUnit::MILLIS => (1e3, "milliseconds"),
        TimeUnit::MICROS => (1e6, "microseconds"),
        TimeUnit::NANOS => (1e9, "nanoseconds"),
    };
    findings.push(typed_stamps(name, &path, word));
    Ok(ticks)
}

/// Compares the footer's claims with each other and with the pages'; the number of rows, and the bytes of the largest page.
fn check(
    pages: &mut (impl Read + Seek),
    name: &str,
    metadata: &ParquetMetaData,
    wanted: &[usize],
) -> Result<(usize, u64)> {
    let refuse =
        |problem: String| Error::content(Place::file(name), problem, "copy or export it again");
    let (mut rows, mut largest) = (0_usize, 0);
    for (number, group) in metadata.row_groups().iter().enumerate() {
        let claimed = group.num_rows();
        rows = usize::try_from(claimed)
            .ok()
            .and_then(|n| rows.checked_add(n))
            .ok_or_else(|| refuse(format!("row group {number} declares {claimed} rows")))?;
        for &index in wanted {
            let Some(chunk) = group.columns().get(index) else {
                return Err(refuse(format!(
                    "row group {number} lacks column {}",
                    index + 1
                )));
            };
            readable(name, &chunk.column_path().string(), chunk.compression())?;
            let values = chunk.num_values();
            if values != claimed {
                return Err(refuse(format!(
                    "column `{}` declares {values} values in row group {number} of {claimed} rows",
                    chunk.column_path().string()
                )));
            }
            let start = chunk
                .dictionary_page_offset()
                .unwrap_or(chunk.data_page_offset());
            let start = start.min(chunk.data_page_offset());
            let (Ok(start), Ok(length)) =
                (u64::try_from(start), u64::try_from(chunk.compressed_size()))
            else {
                return Err(refuse(format!(
                    "column `{}` begins before the file",
                    chunk.column_path().string()
                )));
            };
            let page = check_chunk(pages, start, length, values).map_err(|problem| {
                refuse(format!(
                    "column `{}`: {problem}",
                    chunk.column_path().string()
                ))
            })?;
            largest = largest.max(page);
        }
    }
    Ok((rows, largest))
}

/// Refuses the codecs that this program does not carry.
fn readable(name: &str, column: &str, codec: Compression) -> Result<()> {
    let codec = match codec {
        Compression::BROTLI(_) => "Brotli",
        Compression::LZO => "LZO",
        _ => return Ok(()),
    };
    Err(Error::content(
        Place::file(name),
        format!("column `{column}` is compressed with {codec}, which is not read"),
        "write the file with zstd, snappy, gzip, lz4 or no compression",
    ))
}

/// Appends one column chunk, nulls as NaN.
fn append(
    column: ColumnReader,
    kind: ByteNumber,
    values: &mut Sink<'_>,
) -> std::result::Result<(), ParquetError> {
    match column {
        ColumnReader::FixedLenByteArrayColumnReader(reader) => {
            append_typed(reader, values, |v: FixedLenByteArray| kind.value(v.data()))
        }
        ColumnReader::ByteArrayColumnReader(reader) => {
            append_typed(reader, values, |v: ByteArray| kind.value(v.data()))
        }
        ColumnReader::DoubleColumnReader(reader) => append_typed(reader, values, |v| v),
        ColumnReader::FloatColumnReader(reader) => append_typed(reader, values, f64::from),
        ColumnReader::Int32ColumnReader(reader) => append_typed(reader, values, f64::from),
        ColumnReader::Int64ColumnReader(reader) => append_typed(reader, values, |v| v as f64),
        _ => Err(ParquetError::General(
            "the column's type changed between footer and pages".into(),
        )),
    }
}

fn append_typed<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    values: &mut Sink<'_>,
    convert: impl Fn(T::T) -> f64,
) -> std::result::Result<(), ParquetError>
where
    T::T: AsBytes + Clone,
{
    let (mut batch, mut levels) = (Vec::with_capacity(BATCH), Vec::with_capacity(BATCH));
    loop {
        batch.clear();
        levels.clear();
        let (records, read, _) = reader.read_records(BATCH, Some(&mut levels), None, &mut batch)?;
        if records == 0 {
            return Ok(());
        }
        if levels.is_empty() {
            values.extend(batch.drain(..).map(&convert))?;
            continue;
        }
        // A level below the deepest is a null.
        let deepest = levels.iter().copied().max().filter(|_| read > 0);
        let mut present = batch.drain(..);
        values.extend(levels.iter().map(|level| {
            let value = if Some(*level) == deepest {
                present.next()
            } else {
                None
            };
            value.map_or(f64::NAN, &convert)
        }))?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::basic::BrotliLevel;

    /// Values of IEEE 754-2019, table 3.5, and of Python's `int.to_bytes`.
    #[test]
    fn numbers_that_stand_as_bytes() {
        for (bits, value) in [
            (0x3C00, 1.0),
            (0xC000, -2.0),
            (0x7BFF, 65504.0),
            (0x0001, 5.960464477539063e-8),
            (0x3555, 0.333251953125),
            (0xFC00, f64::NEG_INFINITY),
            (0x8000, 0.0),
        ] {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7E00).is_nan());
        for (bytes, value) in [
            (&[0x30, 0x39][..], 12345.0),
            (&[0xCF, 0xC7], -12345.0),
            (&[0xFF; 16], -1.0),
            (&[0x80, 0], -32768.0),
            (&[], 0.0),
            (
                &[0, 0x1F, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF],
                9007199254740991.0,
            ),
        ] {
            assert_eq!(digits(bytes), value);
        }
    }

    #[test]
    fn a_codec_that_is_not_read_is_named_with_those_that_are() {
        let brotli = Compression::BROTLI(BrotliLevel::default());
        let error = readable("run.parquet", "q1", brotli)
            .unwrap_err()
            .to_string();
        assert_eq!(
            error,
            "run.parquet: column `q1` is compressed with Brotli, which is not read; write the file with zstd, snappy, gzip, lz4 \
             or no compression"
        );
        assert!(readable("run.parquet", "q1", Compression::SNAPPY).is_ok());
    }
}
