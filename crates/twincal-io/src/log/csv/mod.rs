//! Text tables, streamed: one line in memory at a time, only the wanted columns turned into numbers.

mod dialect;
mod lines;
mod number;
mod plain;

use super::Cells;
use crate::error::{Error, Place, Result};
use crate::memory;
use dialect::Dialect;
use lines::Lines;
use std::io::Read;
use twincal::{Finding, Severity};

/// A text table whose header has been read.
pub(super) struct Table<R: Read> {
    name: String,
    lines: Lines<R>,
    dialect: Dialect,
    header: Vec<String>,
    /// First data line, which was needed to tell the dialect.
    first: Option<lines::Line>,
    bytes: u64,
}

impl<R: Read> Table<R> {
    /// Reads up to the first data line. `bytes` is the length of the source if known, else 0.
    pub(super) fn open(source: R, bytes: u64, name: &str) -> Result<Self> {
        let mut lines = Lines::new(source, name);
        let Some(header) = lines.header()? else {
            let what = if lines.is_empty() {
                "is empty (0 bytes)"
            } else {
                "has no header, only blank or comment lines"
            };
            return Err(Error::content(
                Place::file(name),
                what,
                "export a header line and at least one row",
            ));
        };
        let first = lines.data()?;
        let dialect = Dialect::detect(&header, first.as_ref());
        let mut names = dialect.names(&header.text);
        let comment_header = header.text.starts_with(b"#");
        if comment_header && names.first().is_some_and(String::is_empty) {
            names.remove(0);
        }
        if names
            .iter()
            .filter(|n| !n.is_empty())
            .all(|n| number::parse(n.as_bytes(), dialect.decimal_comma).is_some())
        {
            return Err(Error::content(
                Place::line(name, header.number),
                "the first line holds numbers, not column names",
                "add a header line such as `t,q1,qd1,tau1`",
            ));
        }
        Ok(Self {
            name: name.to_owned(),
            lines,
            dialect,
            header: names,
            first,
            bytes,
        })
    }

    /// Column names.
    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// Reads all rows of the columns `wanted` (indices into the header).
    pub(super) fn read(&mut self, wanted: &[usize], lenient: bool) -> Result<Cells> {
        let mut cells = Cells {
            columns: vec![Vec::new(); wanted.len()],
            ..Cells::default()
        };
        // Fields in file order with the column of `cells` they go to.
        let mut order: Vec<(usize, usize)> = wanted
            .iter()
            .enumerate()
            .map(|(to, &from)| (from, to))
            .collect();
        order.sort_unstable();
        let mut row = vec![0.0; wanted.len()];
        let mut next = self.first.take();
        let (mut rows, mut text) = (0_u64, 0_u64);
        while let Some(line) = match next.take() {
            Some(line) => Some(line),
            None => self.lines.data()?,
        } {
            match self.parse(&line, &order, &mut row) {
                Ok(()) => {
                    for (column, value) in cells.columns.iter_mut().zip(&row) {
                        column.push(*value);
                    }
                }
                Err(error) if lenient => {
                    cells.dropped += 1;
                    cells.first_dropped.get_or_insert_with(|| error.to_string());
                }
                Err(error) => return Err(error),
            }
            rows += 1;
            text += line.text.len() as u64 + 1;
            if rows == 1000 {
                let expected = self.bytes as f64 * rows as f64 / text as f64;
                self.check_memory(expected, wanted.len())?;
                // Columns that grow again and again are copied again and again.
                for column in &mut cells.columns {
                    column.reserve((1.01 * expected) as usize);
                }
            }
            self.lines.give_back(line);
        }
        Ok(cells)
    }

    /// What the reader assumed.
    pub(super) fn into_findings(self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let note = |code: &str, message: String| {
            Finding::new(Severity::Note, code, &self.name, message, 0)
        };
        if self.header.len() > 1 {
            findings.push(note(
                "delimiter",
                format!("fields are separated by {}", self.dialect.delimiter_word()),
            ));
        }
        if self.dialect.decimal_comma {
            findings.push(note(
                "decimal_comma",
                "numbers are written with a decimal comma".into(),
            ));
        }
        findings
    }

    /// Refuses what will not fit before it is allocated: rows are estimated from the first 1000.
    fn check_memory(&self, rows: f64, columns: usize) -> Result<()> {
        // Where the estimate falls short, growing vectors hold up to three times their content while they move.
        let needed = rows * columns as f64 * 8.0 * 3.0;
        memory::require(
            &self.name,
            needed as u64,
            "read a shorter log, or one with fewer columns",
        )
    }

    /// One line to numbers, in the order of the wanted columns.
    fn parse(&self, line: &lines::Line, order: &[(usize, usize)], row: &mut [f64]) -> Result<()> {
        if plain::read(&line.text, self.dialect, self.header.len(), order, row) {
            return Ok(());
        }
        self.parse_any(line, order, row)
    }

    /// The same for lines of any form, with what is wrong with them.
    fn parse_any(
        &self,
        line: &lines::Line,
        order: &[(usize, usize)],
        row: &mut [f64],
    ) -> Result<()> {
        let mut wanted = order.iter().peekable();
        let mut count = 0;
        let mut last_empty = false;
        let mut bad: Option<(usize, usize)> = None;
        self.dialect.fields(&line.text, |field, offset| {
            last_empty = field.is_empty();
            while let Some(&&(from, to)) = wanted.peek() {
                if from != count {
                    break;
                }
                wanted.next();
                match number::parse(field, self.dialect.decimal_comma) {
                    Some(value) => row[to] = value,
                    None => bad = bad.or(Some((from, offset))),
                }
            }
            count += 1;
        });
        let expected = self.header.len();
        if count != expected && !(count == expected + 1 && last_empty) {
            let hint = if self.dialect.delimiter == b','
                && count >= 2 * expected - 1
                && expected > 1
            {
                "decimal commas? Export with a decimal point or another delimiter; --lenient drops such rows"
            } else {
                "mend the line, or drop and count such rows with --lenient"
            };
            return Err(Error::content(
                Place::line(&self.name, line.number),
                format!("{count} fields, the header has {expected}"),
                hint,
            ));
        }
        if let Some((column, offset)) = bad {
            let before = String::from_utf8_lossy(&line.text[..offset])
                .chars()
                .count() as u64;
            let place = Place {
                file: self.name.clone(),
                line: Some(line.number),
                column: Some(before + 1),
            };
            let shown: String = self
                .dialect
                .field_text(&line.text, offset)
                .chars()
                .take(40)
                .collect();
            return Err(Error::content(
                place,
                format!(
                    "`{shown}` in column `{}` is not a number",
                    self.header[column]
                ),
                "mend the cell (leave it empty if there is no value), or drop and count such rows with --lenient",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_short_way_reads_what_the_long_way_reads(
            delimiter in prop::sample::select(&b",; \t|"[..]),
            cells in prop::collection::vec("-?[0-9]{0,20}[.,]?[0-9]{0,20}(e-?[0-9]{1,2})?|nan|[ \t\"x]{0,2}1?[ \t\"\r]{0,2}|", 1..6),
            joined in "[,;] ?",
            end in "[,; \t\"]?",
        ) {
            let header: Vec<String> = ["t", "a", "b", "c"].map(str::to_owned).to_vec();
            let joined = if joined.starts_with(char::from(delimiter)) { joined } else { char::from(delimiter).to_string() };
            let text = cells.join(&joined) + &end;
            for decimal_comma in [false, delimiter != b','] {
                let table = Table {
                    name: "x".into(),
                    lines: Lines::new(&b""[..], "x"),
                    dialect: Dialect { delimiter, decimal_comma },
                    header: header.clone(),
                    first: None,
                    bytes: 0,
                };
                let line = lines::Line { number: 2, text: text.clone().into_bytes() };
                for order in [&[(0, 1), (2, 0), (2, 2)][..], &[(0, 0), (1, 1), (2, 2), (3, 3)]] {
                    let (mut short, mut long) = ([7.0; 4], [7.0; 4]);
                    if plain::read(&line.text, table.dialect, 4, order, &mut short) {
                        prop_assert!(table.parse_any(&line, order, &mut long).is_ok(), "{text:?}");
                        prop_assert_eq!(short.map(f64::to_bits), long.map(f64::to_bits), "{:?}", text);
                    }
                }
            }
        }
    }
}
