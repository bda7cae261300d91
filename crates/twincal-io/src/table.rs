//! Tables out: predictions as CSV, Parquet or MCAP, written block by block.

#[cfg(feature = "bags")]
mod mcap;
#[cfg(feature = "tables")]
mod parquet;

#[cfg(feature = "bags")]
use self::mcap::McapTable;
#[cfg(feature = "tables")]
use self::parquet::ParquetTable;
use crate::error::{Error, Result};
use crate::log::stamps;
use std::io::{self, Write};
use std::ops::RangeInclusive;
use std::path::Path;

/// How a table is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated text, UTF-8, numbers in the shortest form that reads back to the same double.
    Csv,
    /// Parquet, doubles and booleans, Zstandard.
    Parquet,
    /// MCAP, `JointState` messages on one topic per quantity, Zstandard.
    Mcap,
}

impl TableFormat {
    /// From a file name's ending.
    ///
    /// # Errors
    /// [`Error::Content`] if it is none of `.csv`, `.parquet` and `.mcap`.
    pub fn of_path(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            Some("mcap") => Ok(Self::Mcap),
            _ => Err(Error::content(
                crate::error::Place::file(path.display().to_string()),
                "does not say its format",
                "let the name end in .csv, .parquet or .mcap",
            )),
        }
    }
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Doubles; NaN is an empty cell in CSV and NaN in Parquet.
    Number,
    /// `true` and `false`.
    Flag,
}

/// A block of one column.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// For [`ColumnKind::Number`].
    Numbers(&'a [f64]),
    /// For [`ColumnKind::Number`]: times in s from a stamp in ns on. CSV and MCAP hold every nanosecond, Parquet the nearest double.
    Stamps(i64, &'a [f64]),
    /// For [`ColumnKind::Flag`].
    Flags(&'a [bool]),
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(v) | Self::Stamps(_, v) => v.len(),
            Self::Flags(v) => v.len(),
        }
    }
}

/// Writes a table whose columns are known and whose rows come in blocks; memory is one row group.
///
/// # Example
/// ```
/// use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};
///
/// let columns = [("elbow.tau".to_owned(), ColumnKind::Number), ("elbow.outside".to_owned(), ColumnKind::Flag)];
/// let mut table = TableWriter::new(Vec::new(), TableFormat::Csv, &columns)?;
/// table.push(&[Values::Numbers(&[1.25, f64::NAN]), Values::Flags(&[false, true])])?;
/// let text = String::from_utf8(table.finish()?)?;
/// assert_eq!(text, "elbow.tau,elbow.outside\n1.25,false\n,true\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TableWriter<W: Write + Send> {
    columns: Vec<(String, ColumnKind)>,
    sink: Sink<W>,
}

enum Sink<W: Write + Send> {
    Csv {
        writer: W,
        line: String,
    },
    #[cfg(feature = "tables")]
    Parquet(Box<ParquetTable<W>>),
    #[cfg(feature = "bags")]
    Mcap(Box<McapTable<W>>),
}

impl<W: Write + Send> TableWriter<W> {
    /// Begins a table.
    ///
    /// # Errors
    /// What `writer` returns.
    pub fn new(
        mut writer: W,
        format: TableFormat,
        columns: &[(String, ColumnKind)],
    ) -> io::Result<Self> {
        let sink = match format {
            TableFormat::Csv => {
                let names: Vec<String> = columns.iter().map(|(name, _)| csv_cell(name)).collect();
                writeln!(writer, "{}", names.join(","))?;
                Sink::Csv {
                    writer,
                    line: String::new(),
                }
            }
            #[cfg(feature = "tables")]
            TableFormat::Parquet => Sink::Parquet(Box::new(ParquetTable::new(writer, columns)?)),
            #[cfg(feature = "bags")]
            TableFormat::Mcap => Sink::Mcap(Box::new(McapTable::new(writer, columns)?)),
            #[cfg(not(all(feature = "tables", feature = "bags")))]
            other => {
                let problem = format!("{other:?} is not written by this build of twincal-io");
                return Err(io::Error::new(io::ErrorKind::Unsupported, problem));
            }
        };
        Ok(Self {
            columns: columns.to_vec(),
            sink,
        })
    }

    /// Times that the format can hold, s.
    pub fn times(&self) -> RangeInclusive<f64> {
        match &self.sink {
            Sink::Csv { .. } => f64::NEG_INFINITY..=f64::INFINITY,
            #[cfg(feature = "tables")]
            Sink::Parquet(_) => f64::NEG_INFINITY..=f64::INFINITY,
            #[cfg(feature = "bags")]
            // Log time has no sign, `header.stamp` has 31 bits of seconds.
            Sink::Mcap(_) => 0.0..=f64::from(i32::MAX),
        }
    }

    /// Keeps a text beside the table under `key`: in the metadata of Parquet; CSV and MCAP have no place for it.
    #[cfg(feature = "tables")]
    pub fn keep(&mut self, key: &str, text: &str) {
        match &mut self.sink {
            Sink::Csv { .. } => {}
            Sink::Parquet(table) => table.keep(key, text),
            #[cfg(feature = "bags")]
            Sink::Mcap(_) => {}
        }
    }

    /// Adds rows: one block per column, all of one length, in the order of the columns.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidInput`] if the blocks do not fit the columns; what the writer returns.
    pub fn push(&mut self, blocks: &[Values<'_>]) -> io::Result<()> {
        let rows = blocks.first().map_or(0, Values::len);
        let fits = blocks.len() == self.columns.len()
            && blocks.iter().zip(&self.columns).all(|(values, (_, kind))| {
                values.len() == rows
                    && matches!(values, Values::Flags(_)) == (*kind == ColumnKind::Flag)
            });
        if !fits {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "blocks do not fit the table's columns",
            ));
        }
        match &mut self.sink {
            Sink::Csv { writer, line } => {
                for row in 0..rows {
                    csv_line(line, blocks, row);
                    writer.write_all(line.as_bytes())?;
                }
                Ok(())
            }
            #[cfg(feature = "tables")]
            Sink::Parquet(table) => table.push(blocks),
            #[cfg(feature = "bags")]
            Sink::Mcap(table) => table.push(blocks, rows),
        }
    }

    /// Ends the table and gives the writer back.
    ///
    /// # Errors
    /// What the writer returns.
    pub fn finish(self) -> io::Result<W> {
        match self.sink {
            Sink::Csv { mut writer, .. } => {
                writer.flush()?;
                Ok(writer)
            }
            #[cfg(feature = "tables")]
            Sink::Parquet(table) => table.finish(),
            #[cfg(feature = "bags")]
            Sink::Mcap(table) => table.finish(),
        }
    }
}

/// One row of a CSV table, line end included.
fn csv_line(line: &mut String, blocks: &[Values<'_>], row: usize) {
    use std::fmt::Write as _;
    line.clear();
    for (column, values) in blocks.iter().enumerate() {
        if column > 0 {
            line.push(',');
        }
        // Writing to a String cannot fail.
        let _ = match values {
            Values::Numbers(v) if v[row].is_nan() => Ok(()),
            Values::Numbers(v) => {
                let size = v[row].abs();
                if size != 0.0 && !(1e-5..1e16).contains(&size) {
                    write!(line, "{:e}", v[row])
                } else {
                    write!(line, "{}", v[row])
                }
            }
            Values::Stamps(start, v) => {
                let stamp = stamps::of_seconds(*start, v[row]);
                write!(line, "{}", stamps::digits(stamp))
            }
            Values::Flags(v) => write!(line, "{}", v[row]),
        };
    }
    line.push('\n');
}

/// A text cell: control characters out, no formula in a spreadsheet (a leading `= + - @` gets an apostrophe), quoted where needed.
pub fn csv_cell(text: &str) -> String {
    let mut cell: String = text.chars().filter(|c| !c.is_control()).collect();
    if cell.starts_with(['=', '+', '-', '@']) {
        cell.insert(0, '\'');
    }
    if cell.contains([',', '"', ';']) || cell.starts_with(' ') || cell.ends_with(' ') {
        cell = format!("\"{}\"", cell.replace('"', "\"\""));
    }
    cell
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns() -> Vec<(String, ColumnKind)> {
        vec![
            ("t".into(), ColumnKind::Number),
            ("=cmd()|' /C calc'!A0.tau".into(), ColumnKind::Number),
            ("extrapolating".into(), ColumnKind::Flag),
        ]
    }

    const NUMBERS: [f64; 6] = [0.1, -1.0 / 3.0, 1e-300, f64::MAX, f64::NAN, 1e22];
    const FLAGS: [bool; 6] = [true, false, false, true, false, true];

    fn written(format: TableFormat) -> Vec<u8> {
        let mut table = TableWriter::new(Vec::new(), format, &columns()).unwrap();
        for part in [0..2, 2..6] {
            table
                .push(&[
                    Values::Numbers(&NUMBERS[part.clone()]),
                    Values::Numbers(&NUMBERS[part.clone()]),
                    Values::Flags(&FLAGS[part]),
                ])
                .unwrap();
        }
        table.finish().unwrap()
    }

    #[test]
    fn csv_reads_back_to_the_same_doubles_and_holds_no_formula() {
        let text = String::from_utf8(written(TableFormat::Csv)).unwrap();
        let mut lines = text.lines();
        assert_eq!(
            lines.next().unwrap(),
            "t,'=cmd()|' /C calc'!A0.tau,extrapolating"
        );
        for (i, line) in lines.enumerate() {
            let cells: Vec<&str> = line.split(',').collect();
            if NUMBERS[i].is_nan() {
                assert_eq!(cells[0], "");
            } else {
                assert_eq!(
                    cells[0].parse::<f64>().unwrap().to_bits(),
                    NUMBERS[i].to_bits()
                );
            }
            assert_eq!(cells[2], if FLAGS[i] { "true" } else { "false" });
        }
        for (text, cell) in [
            ("a,b", "\"a,b\""),
            ("@x", "'@x"),
            ("-rf", "'-rf"),
            ("q\u{1b}[31m\"", "\"q[31m\"\"\""),
        ] {
            assert_eq!(csv_cell(text), cell);
        }
    }

    #[cfg(feature = "tables")]
    #[test]
    fn parquet_reads_back_to_the_same_doubles() {
        use ::parquet::file::reader::{FileReader, SerializedFileReader};
        use ::parquet::record::RowAccessor;
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&written(TableFormat::Parquet)).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let rows: Vec<_> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap())
            .collect();
        assert_eq!(rows.len(), 6);
        for (i, row) in rows.iter().enumerate() {
            assert_eq!(row.get_double(0).unwrap().to_bits(), NUMBERS[i].to_bits());
            assert_eq!(row.get_bool(2).unwrap(), FLAGS[i]);
        }
    }

    #[test]
    fn blocks_that_do_not_fit_are_refused() {
        let mut table = TableWriter::new(Vec::new(), TableFormat::Csv, &columns()).unwrap();
        assert!(table.push(&[Values::Numbers(&[1.0])]).is_err());
        assert!(
            table
                .push(&[
                    Values::Numbers(&[1.0]),
                    Values::Numbers(&[1.0, 2.0]),
                    Values::Flags(&[true])
                ])
                .is_err()
        );
        assert!(
            table
                .push(&[
                    Values::Numbers(&[1.0]),
                    Values::Numbers(&[1.0]),
                    Values::Numbers(&[1.0])
                ])
                .is_err()
        );
    }
}
