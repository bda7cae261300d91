//! Numbers that are too many for memory, in a temporary file that has no name: it is gone with the program, however that ends.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;

/// Numbers that pass through memory at a time.
const BLOCK: usize = 1 << 13;
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
        let mut bytes = Vec::with_capacity(BLOCK * BYTES);
        for (block, values) in values.chunks(BLOCK).enumerate() {
            bytes.clear();
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            let place = self.place(table, column, row + block * BLOCK);
            self.file.write_all_at(&bytes, place)?;
        }
        Ok(())
    }

    /// Some rows of a column.
    pub(crate) fn read(
        &self,
        table: usize,
        column: usize,
        rows: Range<usize>,
    ) -> io::Result<Vec<f64>> {
        let mut values = Vec::with_capacity(rows.len());
        let mut bytes = vec![0; BLOCK.min(rows.len()) * BYTES];
        for row in rows.clone().step_by(BLOCK) {
            let bytes = &mut bytes[..BLOCK.min(rows.end - row) * BYTES];
            self.file
                .read_exact_at(bytes, self.place(table, column, row))?;
            let (numbers, _) = bytes.as_chunks::<BYTES>();
            values.extend(numbers.iter().map(|number| f64::from_le_bytes(*number)));
        }
        Ok(values)
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
}
