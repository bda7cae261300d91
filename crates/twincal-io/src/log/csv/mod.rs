//! Text tables, streamed: one line in memory at a time, only the wanted columns turned into numbers.

mod cut;
mod dialect;
mod lines;
mod number;
mod plain;

use super::Cells;
use crate::error::{Error, Place, Result};
use crate::memory;
use cut::LastFields;
use dialect::Dialect;
use lines::Lines;
use std::io::Read;
use twincal::Code;
use twincal::{Finding, Severity};

/// Rows between two looks at whether the table is long.
const SETTLE: u64 = 1 << 14;

/// A text table whose header has been read.
pub(super) struct Table<R: Read> {
    name: String,
    lines: Lines<R>,
    dialect: Dialect,
    header: Vec<String>,
    /// First data line, which was needed to tell the dialect.
    first: Option<lines::Line>,
    bytes: u64,
    /// That the file ends within its last row.
    cut: Option<Finding>,
}

impl<R: Read> Table<R> {
    /// Reads up to the first data line. `bytes` is the length of the source if known, else 0.
    pub(super) fn open(source: R, bytes: u64, name: &str) -> Result<Self> {
        let mut lines = Lines::new(source, name);
        let Some(header) = lines.header()? else {
            let (what, remedy) = if lines.is_empty() {
                (
                    "is empty (0 bytes)",
                    "record, export or copy it again: nothing was written to it",
                )
            } else {
                (
                    "has no header, only blank or comment lines",
                    "export a header line and at least one row",
                )
            };
            return Err(Error::content(Place::file(name), what, remedy));
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
            cut: None,
        })
    }

    /// Column names.
    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// Reads all rows of the columns `wanted` (indices into the header); `chapters`: a long table may be left on disk.
    pub(super) fn read(
        &mut self,
        wanted: &[usize],
        lenient: bool,
        chapters: bool,
    ) -> Result<Cells> {
        let mut cells = Cells::new(wanted.len(), chapters);
        let order = in_file_order(wanted);
        let mut row = vec![0.0; wanted.len()];
        let mut next = self.first.take();
        let (mut rows, mut text) = (0_u64, 0_u64);
        let (dialect, fields) = (self.dialect, self.header.len());
        let mut last_fields = LastFields::new(dialect.delimiter);
        loop {
            let mut taken = 0;
            if next.is_none() {
                taken = self.lines.in_place(|text| {
                    let taken = plain::read(text, false, dialect, fields, &order, &mut row)?;
                    last_fields.see(&text[..taken]);
                    Some(taken)
                })?;
            }
            let mut read = Ok(());
            if taken == 0 {
                let Some(line) = (match next.take() {
                    Some(line) => Some(line),
                    None => self.lines.data()?,
                }) else {
                    break;
                };
                read = self.parse(&line, &order, &mut row);
                taken = line.text.len() + 1;
                if line.is_open && rows > 0 {
                    self.cut = last_fields.cut(&self.name, &line, read.is_ok());
                    if self.cut.is_some() {
                        break;
                    }
                }
                last_fields.see(&line.text);
                self.lines.give_back(line);
            }
            match read {
                Ok(()) => cells.push_row(&row),
                Err(error) if lenient => cells.drop_row(&error),
                Err(error) => return Err(error),
            }
            rows += 1;
            text += taken as u64;
            if rows == 1000 {
                self.reserve(&mut cells, self.bytes as f64 * rows as f64 / text as f64)?;
            }
            if rows.is_multiple_of(SETTLE) {
                cells.settle(&self.name)?;
            }
        }
        Ok(cells)
    }

    /// What the reader assumed.
    pub(super) fn into_findings(self) -> Vec<Finding> {
        let mut findings: Vec<Finding> = self.cut.into_iter().collect();
        let note = |code: Code, message: String| {
            Finding::new(Severity::Note, code, &self.name, message, 0)
        };
        if self.header.len() > 1 {
            findings.push(note(
                Code::Delimiter,
                format!("fields are separated by {}", self.dialect.delimiter_word()),
            ));
        }
        if self.dialect.decimal_comma {
            findings.push(note(
                Code::DecimalComma,
                "numbers are written with a decimal comma".into(),
            ));
        }
        findings
    }

    /// Makes room for as many rows as are `expected` after a look at the first 1000; what will not fit is refused before it is allocated.
    fn reserve(&self, cells: &mut Cells, expected: f64) -> Result<()> {
        // Columns that grow again and again are copied again and again.
        let bytes = cells.bytes_in_memory(1.01 * expected);
        // Where the estimate falls short, growing vectors hold up to three times their content while they move.
        let needed = 3.0 * bytes;
        memory::require(
            &self.name,
            needed as u64,
            "read a shorter log, or one with fewer columns",
        )?;
        let columns = cells.columns.len().max(1);
        for column in &mut cells.columns {
            column.reserve(bytes as usize / 8 / columns);
        }
        Ok(())
    }

    /// One line to numbers, in the order of the wanted columns.
    fn parse(&self, line: &lines::Line, order: &[(usize, usize)], row: &mut [f64]) -> Result<()> {
        let fields = self.header.len();
        if plain::read(&line.text, true, self.dialect, fields, order, row).is_some() {
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
                "fix the line, or drop and count such rows with --lenient"
            };
            return Err(Error::content(
                Place::line(&self.name, line.number),
                format!("{count} fields, the header has {expected}"),
                hint,
            ));
        }
        match bad {
            Some((column, offset)) => Err(self.not_a_number(line, column, offset)),
            None => Ok(()),
        }
    }

    /// The error for a field of a wanted column that begins at byte `offset` of its line.
    fn not_a_number(&self, line: &lines::Line, column: usize, offset: usize) -> Error {
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
        let column = &self.header[column];
        let (problem, remedy) = match self.has_number(line) {
            true => (
                format!("`{shown}` in column `{column}` is not a number"),
                "fix the cell (leave it empty if there is no value), or drop and count such rows with --lenient",
            ),
            false => (
                format!("this line holds no number: `{shown}` in column `{column}`"),
                "delete it if it holds units or names, or drop and count such rows with --lenient",
            ),
        };
        Error::content(place, problem, remedy)
    }

    fn has_number(&self, line: &lines::Line) -> bool {
        let mut found = false;
        self.dialect.fields(&line.text, |field, _| {
            let number = number::parse(field, self.dialect.decimal_comma);
            found |= number.is_some_and(f64::is_finite);
        });
        found
    }
}

/// Wanted fields in the order of the file, each with the column of the cells that it goes to.
fn in_file_order(wanted: &[usize]) -> Vec<(usize, usize)> {
    let mut order: Vec<(usize, usize)> = wanted
        .iter()
        .enumerate()
        .map(|(to, &from)| (from, to))
        .collect();
    order.sort_unstable();
    order
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
                    cut: None,
                };
                let line = lines::Line { number: 2, text: text.clone().into_bytes(), is_open: false };
                for order in [&[(0, 1), (2, 0), (2, 2)][..], &[(0, 0), (1, 1), (2, 2), (3, 3)]] {
                    let (mut short, mut long) = ([7.0; 4], [7.0; 4]);
                    if plain::read(&line.text, true, table.dialect, 4, order, &mut short).is_some() {
                        prop_assert!(table.parse_any(&line, order, &mut long).is_ok(), "{text:?}");
                        prop_assert_eq!(short.map(f64::to_bits), long.map(f64::to_bits), "{:?}", text);
                    }
                    // The same where more follows, or the rest of the line is still to come.
                    for (after, read) in [("\n", true), ("\r\n7,8", true), ("\n\n", true), ("", false), ("\r", false), ("\r7", false)] {
                        let mut line = text.clone().into_bytes();
                        while matches!(line.last(), Some(b'\r' | b'\n')) {
                            line.pop();
                        }
                        let mut there = [7.0; 4];
                        let alone = plain::read(&line, true, table.dialect, 4, order, &mut short);
                        let length = line.len() + after.trim_end_matches(|c: char| c.is_ascii_digit() || c == ',').len().min(if after.starts_with('\r') { 2 } else { 1 });
                        line.extend(after.bytes());
                        let taken = plain::read(&line, false, table.dialect, 4, order, &mut there);
                        prop_assert_eq!(taken, alone.filter(|_| read).map(|_| length), "{:?}{:?}", text, after);
                        prop_assert!(taken.is_none() || short.map(f64::to_bits) == there.map(f64::to_bits), "{:?}", text);
                    }
                }
            }
        }
    }

    /// Lines that are read in place, lines that are not and lines that end in another buffer (256 KiB): numbers are the standard
    /// library's, and a mistake is told with its line.
    #[test]
    fn rows_of_every_kind_are_those_of_a_naive_reader() {
        let mut text = String::from("t,a,b,c\n");
        let (mut expected, mut line) = (vec![Vec::new(); 2], 1_u64);
        for row in 0..60_000_u64 {
            let noise = row.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let [a, c] = [noise as i64 as f64 * 1e-17, (noise >> 20) as f64 * 1e-9];
            let c = match row % 19 {
                0 => String::new(),
                1 => format!("{c:e}"),
                2 => format!("{c:.0}"),
                _ => format!("{c:.9}"),
            };
            let b = match row % 7 {
                0 => "\"quoted, with\na line\"",
                1 => "word",
                2 => "",
                _ => "12.5",
            };
            if row % 11 == 0 {
                text.push_str(["\n", "  \n", "# a comment\n", "\t# too\n"][(row % 4) as usize]);
                line += 1;
            }
            text.push_str(&format!("{row}.5,{a},{b},{c}"));
            text.push_str(["\n", "\r\n", ",\n", "\n"][(row % 4) as usize]);
            line += 1 + u64::from(row % 7 == 0);
            let number = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN).to_bits();
            expected[0].push(number(&c));
            expected[1].push(number(&a.to_string()));
        }
        let read = |text: &str| {
            let mut table = Table::open(text.as_bytes(), text.len() as u64, "run.csv").unwrap();
            table.read(&[3, 1], false, false)
        };
        let cells = read(&text).unwrap();
        for (found, expected) in cells.columns.iter().zip(&expected) {
            let found: Vec<u64> = found.iter().map(|value| value.to_bits()).collect();
            assert!(found == *expected);
        }
        // Without the end of its last line, and with a mistake in one more.
        assert_eq!(read(text.trim_end()).unwrap().columns[1].len(), 60_000);
        let error = read(&(text + "1,2,3,x\n")).unwrap_err().to_string();
        let place = format!("run.csv:{}:7: ", line + 1);
        assert!(error.starts_with(&place), "{error}, not {place}");
    }
}
