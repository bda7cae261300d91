//! The numbers of a table while it is read: in memory, and on disk where they are many and may come in chapters.

use super::scratch::Scratch;
use crate::error::{Error, Place, Result};
use crate::memory;
use rayon::prelude::*;
use std::io;
use std::ops::Range;

/// Bytes of numbers from which a log is long; tests of this crate have less patience.
const LONG: usize = if cfg!(test) { 1 << 20 } else { 102 << 20 };
/// Bytes of a chapter, and its rows at least: filters take some seconds at either end.
const CHAPTER: usize = if cfg!(test) { 1 << 17 } else { 16 << 20 };
const FEWEST_ROWS: usize = if cfg!(test) { 1 << 10 } else { 1 << 17 };
const BYTES: usize = size_of::<f64>();

/// Numbers of the wanted columns.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    /// Rows in memory: all of them, or the last ones of a long table.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Where the time in the first column counts from, both in ns; none: it is what the file says.
    pub(crate) origin: Option<i64>,
    /// What the numbers of each column are divided by; empty: by 1.
    pub(crate) scales: Vec<f64>,
    /// Rows that could not be read and were dropped when told to be lenient.
    pub(crate) dropped: u64,
    /// The first of them, in words.
    pub(crate) first_dropped: Option<String>,
    /// A long table may be left on disk.
    may_spill: bool,
    spilled: Option<Spilled>,
}

/// Rows on disk.
#[derive(Debug)]
pub(crate) struct Spilled {
    scratch: Scratch,
    /// Rows of each table.
    tables: Vec<usize>,
    /// Whether a column has a finite value.
    finite: Vec<bool>,
}

/// Consecutive rows on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Chapter {
    table: usize,
    rows: Range<usize>,
    /// First of them in the log.
    pub(crate) first: usize,
}

/// A column while it is filled.
pub(crate) enum Sink<'a> {
    /// In memory.
    Memory(&'a mut Vec<f64>),
    /// On disk, from the first row of the only table on.
    Disk {
        scratch: &'a Scratch,
        column: usize,
        row: usize,
        finite: &'a mut bool,
        /// Why numbers could not be written.
        failure: Option<io::Error>,
    },
}

impl Sink<'_> {
    /// Puts numbers at its end.
    pub(crate) fn extend(&mut self, values: impl Iterator<Item = f64>) -> io::Result<()> {
        match self {
            Self::Memory(column) => column.extend(values),
            Self::Disk {
                scratch,
                column,
                row,
                finite,
                failure,
            } => {
                let values: Vec<f64> = values.collect();
                **finite = **finite || values.iter().any(|value| value.is_finite());
                if let Err(error) = scratch.write(0, *column, *row, &values) {
                    let kind = error.kind();
                    failure.get_or_insert(error);
                    return Err(kind.into());
                }
                *row += values.len();
            }
        }
        Ok(())
    }

    /// Numbers so far.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Memory(column) => column.len(),
            Self::Disk { row, .. } => *row,
        }
    }
}

/// What a disk without room did to one of the columns; `None` where the mistake is in the table.
pub(crate) fn disk_failure(name: &str, sinks: &[Sink<'_>]) -> Option<Error> {
    sinks.iter().find_map(|sink| match sink {
        Sink::Disk {
            failure: Some(error),
            ..
        } => Some(no_room(name, error)),
        _ => None,
    })
}

/// Rows of a chapter of a table of so many columns.
pub(crate) fn chapter_rows(columns: usize) -> usize {
    (CHAPTER / BYTES / columns.max(1)).max(FEWEST_ROWS)
}

/// What cannot be kept for want of disk.
fn no_room(name: &str, error: &io::Error) -> Error {
    Error::system(
        name,
        "keep its numbers in a temporary file",
        error,
        "set TMPDIR to a folder with as much room as the log has numbers (8 bytes each)",
    )
}

/// What cannot be read back.
pub(crate) fn unreadable(name: &str, error: &io::Error) -> Error {
    Error::system(
        name,
        "read its numbers back from a temporary file",
        error,
        "look at the disk that holds temporary files (TMPDIR)",
    )
}

impl Cells {
    /// Whether a table is long.
    pub(crate) fn is_long(rows: usize, columns: usize) -> bool {
        Self::are_many(rows.saturating_mul(columns)) && rows >= 2 * chapter_rows(columns)
    }

    /// Whether so many numbers are many.
    pub(crate) fn are_many(numbers: usize) -> bool {
        numbers.saturating_mul(BYTES) >= LONG
    }

    /// No rows yet; `may_spill`: a long table may be left on disk.
    pub(crate) fn new(columns: usize, may_spill: bool) -> Self {
        Self {
            columns: vec![Vec::new(); columns],
            may_spill,
            ..Self::default()
        }
    }

    /// No rows yet of a table that is long.
    ///
    /// # Errors
    /// [`Error::System`] without a temporary file.
    pub(crate) fn on_disk(name: &str, columns: usize) -> Result<Self> {
        Ok(Self {
            spilled: Some(Spilled::new(columns).map_err(|e| no_room(name, &e))?),
            ..Self::new(columns, true)
        })
    }

    /// Room for `rows` of `columns`.
    ///
    /// # Errors
    /// [`Error::Content`] if they do not fit, [`Error::System`] without a temporary file.
    pub(crate) fn reserve(
        name: &str,
        rows: usize,
        columns: usize,
        may_spill: bool,
    ) -> Result<Self> {
        let mut cells = Self::new(columns, may_spill);
        if may_spill && Self::is_long(rows, columns) {
            let mut scratch = Scratch::new(columns).map_err(|e| no_room(name, &e))?;
            // Asked before anything is written: a file may declare more rows than it has bytes.
            let bytes = (rows as u64).saturating_mul((columns * BYTES) as u64);
            let room = scratch.room().map_err(|e| no_room(name, &e))?;
            if bytes > room {
                return Err(Error::content(
                    Place::file(name),
                    format!(
                        "holds {} MB of numbers, the folder of temporary files has room for {} MB",
                        bytes.div_ceil(1_000_000),
                        room / 1_000_000
                    ),
                    "set TMPDIR to a folder with more room, or read a shorter log",
                ));
            }
            scratch.table(rows);
            cells.spilled = Some(Spilled {
                scratch,
                tables: vec![rows],
                finite: vec![false; columns],
            });
            return Ok(cells);
        }
        memory::require(
            name,
            (rows as u64).saturating_mul((columns * BYTES) as u64),
            "read a shorter log, or one with fewer columns",
        )?;
        cells
            .columns
            .iter_mut()
            .for_each(|column| column.reserve(rows));
        Ok(cells)
    }

    /// The columns of [`Cells::reserve`], to be filled.
    pub(crate) fn sinks(&mut self) -> Vec<Sink<'_>> {
        match &mut self.spilled {
            None => self.columns.iter_mut().map(Sink::Memory).collect(),
            Some(Spilled {
                scratch, finite, ..
            }) => {
                let scratch = &*scratch;
                let sink = |(column, finite)| Sink::Disk {
                    scratch,
                    column,
                    row: 0,
                    finite,
                    failure: None,
                };
                finite.iter_mut().enumerate().map(sink).collect()
            }
        }
    }

    /// Adds a row in memory.
    #[inline]
    pub(super) fn push_row(&mut self, row: &[f64]) {
        for (column, value) in self.columns.iter_mut().zip(row) {
            column.push(*value);
        }
    }

    /// Counts a row that cannot be read.
    pub(super) fn drop_row(&mut self, why: &Error) {
        self.dropped += 1;
        self.first_dropped.get_or_insert_with(|| why.to_string());
    }

    /// Bytes that `rows` of these columns take in memory at most.
    pub(crate) fn bytes_in_memory(&self, rows: f64) -> f64 {
        let bytes = rows * (self.columns.len() * BYTES) as f64;
        if self.may_spill {
            bytes.min((LONG + CHAPTER) as f64)
        } else {
            bytes
        }
    }

    /// Moves rows in memory to disk where they are many, but for half a chapter. To be called every few thousand rows.
    ///
    /// # Errors
    /// [`Error::System`] where they cannot be written.
    pub(crate) fn settle(&mut self, name: &str) -> Result<()> {
        if !self.may_spill {
            return Ok(());
        }
        let (columns, rows) = (self.columns.len(), self.rows_in_memory());
        let chapter = chapter_rows(columns);
        if self.spilled.is_none() && !Self::is_long(rows, columns) {
            return Ok(());
        }
        let mut from = 0;
        // No chapter at the end is shorter than half a usual one.
        while from + chapter + chapter / 2 <= rows {
            self.spill(from..from + chapter)
                .map_err(|e| no_room(name, &e))?;
            from += chapter;
        }
        if from > 0 {
            for column in &mut self.columns {
                column.drain(..from);
                column.shrink_to(2 * chapter);
            }
        }
        Ok(())
    }

    fn rows_in_memory(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    fn spill(&mut self, rows: Range<usize>) -> io::Result<()> {
        let columns = self.columns.len();
        let spilled = match &mut self.spilled {
            Some(spilled) => spilled,
            none => none.insert(Spilled::new(columns)?),
        };
        let table = spilled.scratch.table(rows.len());
        spilled.tables.push(rows.len());
        for (column, values) in self.columns.iter().enumerate() {
            let values = &values[rows.clone()];
            spilled.finite[column] |= values.iter().any(|value| value.is_finite());
            spilled.scratch.write(table, column, 0, values)?;
        }
        Ok(())
    }

    /// All rows.
    pub(crate) fn rows(&self) -> usize {
        let spilled = self.spilled.as_ref();
        let on_disk: usize = spilled.map_or(0, |spilled| spilled.tables.iter().sum());
        on_disk + self.rows_in_memory()
    }

    /// Takes the rows on disk, with the last ones too; `None` where all are in memory.
    ///
    /// # Errors
    /// [`Error::System`] where they cannot be written.
    pub(crate) fn take_spilled(&mut self, name: &str) -> Result<Option<Spilled>> {
        let rows = self.rows_in_memory();
        if self.spilled.is_some() && rows > 0 {
            self.spill(0..rows).map_err(|e| no_room(name, &e))?;
            self.columns.fill(Vec::new());
        }
        Ok(self.spilled.take())
    }
}

impl Spilled {
    fn new(columns: usize) -> io::Result<Self> {
        Ok(Self {
            scratch: Scratch::new(columns)?,
            tables: Vec::new(),
            finite: vec![false; columns],
        })
    }

    /// Whether a column has a finite value.
    pub(crate) fn has_values(&self, column: usize) -> bool {
        self.finite[column]
    }

    /// Its rows in chapters that are as long as each other, nearly: each table is cut evenly.
    pub(crate) fn chapters(&self) -> Vec<Chapter> {
        let usual = chapter_rows(self.finite.len());
        let (mut chapters, mut first) = (Vec::new(), 0);
        for (table, &rows) in self.tables.iter().enumerate() {
            let count = (rows as f64 / usual as f64).round().max(1.0) as usize;
            chapters.extend((0..count).map(|i| {
                let rows = i * rows / count..(i + 1) * rows / count;
                Chapter {
                    table,
                    first: first + rows.start,
                    rows,
                }
            }));
            first += rows;
        }
        chapters
    }

    /// The columns of a chapter.
    ///
    /// # Errors
    /// Of the disk.
    pub(crate) fn read(&self, chapter: &Chapter) -> io::Result<Vec<Vec<f64>>> {
        let column = |column| self.read_column(chapter, column);
        (0..self.finite.len()).into_par_iter().map(column).collect()
    }

    /// One of them.
    ///
    /// # Errors
    /// Of the disk.
    pub(crate) fn read_column(&self, chapter: &Chapter, column: usize) -> io::Result<Vec<f64>> {
        self.scratch
            .read(chapter.table, column, chapter.rows.clone())
    }
}

impl Chapter {
    /// Rows.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A long table that came row by row is what came, chapter by chapter, and little of it was in memory.
    #[test]
    fn a_long_table_comes_back_in_chapters() {
        let (columns, rows) = (40, 20_001);
        let value = |column: usize, row: usize| (column * 1_000_000 + row) as f64 + 0.25;
        let mut cells = Cells::new(columns, true);
        let mut most = 0;
        for row in 0..rows {
            for (column, values) in cells.columns.iter_mut().enumerate() {
                values.push(if column == 7 {
                    f64::NAN
                } else {
                    value(column, row)
                });
            }
            if row % 64 == 0 {
                cells.settle("run").unwrap();
                most = most.max(cells.rows_in_memory());
            }
        }
        assert_eq!(cells.rows(), rows);
        assert!(
            most * columns * BYTES <= LONG + 2 * 64 * columns * BYTES,
            "{most} rows in memory"
        );
        let spilled = cells.take_spilled("run").unwrap().expect("a long table");
        assert!(!spilled.has_values(7) && spilled.has_values(8));
        let chapters = spilled.chapters();
        let usual = chapter_rows(columns);
        let mut row = 0;
        for chapter in &chapters {
            assert_eq!(chapter.first, row);
            assert!((usual / 2..2 * usual).contains(&chapter.len()));
            let read = spilled.read(chapter).unwrap();
            for (column, values) in read.iter().enumerate().filter(|(column, _)| *column != 7) {
                let expected = (row..row + chapter.len()).map(|row| value(column, row));
                assert!(values.iter().copied().eq(expected));
            }
            row += chapter.len();
        }
        assert_eq!(row, rows);
    }

    #[test]
    fn a_table_of_known_length_is_filled_column_by_column() {
        let (columns, rows) = (40, 6_000);
        let mut cells = Cells::reserve("run", rows, columns, true).unwrap();
        for (column, sink) in cells.sinks().iter_mut().enumerate() {
            for block in 0..6 {
                let values = (0..1_000).map(|row| (column + block * 1_000 + row) as f64);
                sink.extend(values).unwrap();
            }
            assert_eq!(sink.len(), rows);
        }
        let spilled = cells.take_spilled("run").unwrap().expect("a long table");
        let lengths: Vec<usize> = spilled.chapters().iter().map(Chapter::len).collect();
        assert!(lengths.len() > 1 && lengths.iter().sum::<usize>() == rows);
        let last = spilled.chapters().pop().unwrap();
        assert_eq!(
            spilled.read(&last).unwrap()[3].last(),
            Some(&((rows + 2) as f64))
        );
        // A short one stays in memory, and so does a long one that may not be cut.
        for (rows, may_spill) in [(1_000, true), (rows, false)] {
            let mut cells = Cells::reserve("run", rows, columns, may_spill).unwrap();
            assert!(cells.take_spilled("run").unwrap().is_none());
        }
    }
}
