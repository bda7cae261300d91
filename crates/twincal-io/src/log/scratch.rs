//! Numbers that are too many for memory, in a temporary file that has no name: it is gone with the program, however that ends.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use twincal::signal::Shelf;

const BYTES: usize = size_of::<f64>();

/// Tables one behind the other, each column by column.
#[derive(Debug)]
pub(crate) struct Scratch {
    file: File,
    columns: usize,
    tables: Vec<Table>,
}

/// Where a table begins, and its rows.
#[derive(Debug, Clone, Copy)]
struct Table {
    start: u64,
    rows: usize,
}

impl Scratch {
    /// For tables of so many columns.
    pub(crate) fn new(columns: usize) -> io::Result<Self> {
        Ok(Self {
            file: tempfile::tempfile()?,
            columns,
            tables: Vec::new(),
        })
    }

    /// Bytes that there is room for on its disk.
    pub(crate) fn room(&self) -> io::Result<u64> {
        let disk = rustix::fs::fstatvfs(&self.file)?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Room for one more table; its number.
    pub(crate) fn table(&mut self, rows: usize) -> usize {
        let end = |table: &Table| table.start + (table.rows * self.columns * BYTES) as u64;
        let start = self.tables.last().map_or(0, end);
        self.tables.push(Table { start, rows });
        self.tables.len() - 1
    }

    fn place(&self, table: usize, column: usize, row: usize) -> u64 {
        let Table { start, rows } = self.tables[table];
        start + ((column * rows + row) * BYTES) as u64
    }

    /// Puts numbers into a column from a row on.
    pub(crate) fn write(
        &self,
        table: usize,
        column: usize,
        row: usize,
        values: &[f64],
    ) -> io::Result<()> {
        let place = self.place(table, column, row);
        self.file.write_all_at(bytemuck::cast_slice(values), place)
    }

    /// Some rows of a column.
    pub(crate) fn read(
        &self,
        table: usize,
        column: usize,
        rows: Range<usize>,
    ) -> io::Result<Vec<f64>> {
        let mut values = vec![0.0; rows.len()];
        let place = self.place(table, column, rows.start);
        let bytes = bytemuck::cast_slice_mut(&mut values);
        self.file.read_exact_at(bytes, place)?;
        Ok(values)
    }
}

/// Numbers that the calibration of long logs puts away, in a temporary file of their own.
#[derive(Debug)]
pub(crate) struct TemporaryShelf {
    log: String,
    file: File,
    /// Bytes so far.
    end: AtomicU64,
    failure: OnceLock<twincal::Error>,
}

impl TemporaryShelf {
    /// For what is made of a log of this name.
    pub(crate) fn new(log: &str) -> io::Result<Self> {
        Ok(Self {
            log: log.to_owned(),
            file: tempfile::tempfile()?,
            end: AtomicU64::new(0),
            failure: OnceLock::new(),
        })
    }

    fn error(&self, what: &str, error: &io::Error) -> twincal::Error {
        twincal::Error::Log {
            log: self.log.clone(),
            problem: format!("its rows cannot be {what} disk: {error}"),
            remedy: "look at the folder of temporary files, or set TMPDIR to one with more room"
                .into(),
        }
    }
}

impl Shelf for TemporaryShelf {
    fn put(&self, numbers: &[f64]) -> twincal::Result<u64> {
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        let place = self.end.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.file.write_all_at(bytes, place).map_err(|e| {
            let error = self.error("put on", &e);
            // Only the first is told.
            let _ = self.failure.set(error.clone());
            error
        })?;
        Ok(place)
    }

    fn get(&self, place: u64, skip: usize, numbers: &mut [f64]) {
        let place = place + (skip * BYTES) as u64;
        let read = self
            .file
            .read_exact_at(bytemuck::cast_slice_mut(numbers), place);
        if let Err(error) = read {
            numbers.fill(f64::NAN);
            // Only the first is told.
            let _ = self.failure.set(self.error("read back from", &error));
        }
    }

    fn failure(&self) -> Option<twincal::Error> {
        self.failure.get().cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_from_any_row_on() {
        let mut scratch = Scratch::new(2).unwrap();
        let value = |table: usize, column: usize, row: usize| {
            (1e6 * table as f64) + 1e5 * column as f64 + row as f64 + 0.1
        };
        let sizes = [20_000, 3];
        for rows in sizes {
            scratch.table(rows);
        }
        for (table, rows) in sizes.into_iter().enumerate().rev() {
            for column in [1, 0] {
                let all: Vec<f64> = (0..rows).map(|row| value(table, column, row)).collect();
                let (first, rest) = all.split_at(rows / 3);
                scratch.write(table, column, first.len(), rest).unwrap();
                scratch.write(table, column, 0, first).unwrap();
            }
        }
        for (table, column, rows) in [
            (0, 0, 0..20_000),
            (0, 1, 8190..16_500),
            (1, 1, 1..3),
            (1, 0, 2..2),
        ] {
            let read = scratch.read(table, column, rows.clone()).unwrap();
            let expected: Vec<f64> = rows.map(|row| value(table, column, row)).collect();
            assert_eq!(read, expected);
        }
        assert!(scratch.read(1, 1, 1..4).is_err(), "nothing is there");
    }

    #[test]
    fn what_is_put_away_comes_back_or_says_why() {
        let shelf = TemporaryShelf::new("run").unwrap();
        let numbers = [[1.5, f64::MIN_POSITIVE, -0.0], [4.0, 5.0, 1e300]];
        let places: Vec<u64> = numbers
            .iter()
            .map(|three| shelf.put(three).unwrap())
            .collect();
        let mut back = [0.0; 3];
        for (place, expected) in places.iter().zip(&numbers).rev() {
            shelf.get(*place, 0, &mut back);
            assert_eq!(back.map(f64::to_bits), expected.map(f64::to_bits));
        }
        shelf.get(places[1], 1, &mut back[..2]);
        assert_eq!(back[..2], [5.0, 1e300]);
        assert_eq!(shelf.failure(), None);
        shelf.get(places[1], 1, &mut back);
        assert!(back.iter().all(|number| number.is_nan()));
        let words = shelf.failure().expect("a failure").to_string();
        assert!(
            words.starts_with("log `run`: its rows cannot be read back from disk"),
            "{words}"
        );
    }
}
