//! How a text table is written: its delimiter and its decimal sign, told from the first two lines.

use super::lines::Line;
use super::number;

/// The way one file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dialect {
    /// Byte between fields; for a space any run of blanks counts once.
    pub(super) delimiter: u8,
    /// `1,5` means 1.5.
    pub(super) decimal_comma: bool,
}

/// Candidates, from the least to the most likely inside a name.
const DELIMITERS: [u8; 5] = [b'\t', b';', b'|', b',', b' '];

impl Dialect {
    /// The first delimiter that splits the header into several fields and the data line into as many; failing that, the first
    /// that splits the header at all.
    pub(super) fn detect(header: &Line, data: Option<&Line>) -> Self {
        let count = |delimiter: u8, line: &Line| {
            let mut fields = 0;
            let dialect = Self {
                delimiter,
                decimal_comma: false,
            };
            let mut last_empty = false;
            dialect.fields(&line.text, |field, _| {
                fields += 1;
                last_empty = field.is_empty();
            });
            fields - usize::from(last_empty && fields > 1)
        };
        let splits = || DELIMITERS.into_iter().filter(|d| count(*d, header) > 1);
        let agrees = |d: &u8| data.is_none_or(|line| count(*d, line) == count(*d, header));
        let delimiter = splits()
            .find(agrees)
            .or_else(|| splits().next())
            .unwrap_or(b',');
        let mut dialect = Self {
            delimiter,
            decimal_comma: false,
        };
        if let Some(data) = data.filter(|_| delimiter != b',') {
            let (mut commas, mut others) = (false, false);
            dialect.fields(&data.text, |field, _| {
                if number::parse(field, false).is_none() {
                    if number::parse(field, true).is_some() {
                        commas = true;
                    }
                } else if field.contains(&b'.') {
                    others = true;
                }
            });
            dialect.decimal_comma = commas && !others;
        }
        dialect
    }

    /// What to call the delimiter.
    pub(super) fn delimiter_word(self) -> &'static str {
        match self.delimiter {
            b'\t' => "tabs",
            b';' => "semicolons",
            b'|' => "vertical bars",
            b' ' => "spaces",
            _ => "commas",
        }
    }

    /// Column names: trimmed, unquoted, control characters out; the empty one after a trailing delimiter is left out.
    pub(super) fn names(self, line: &[u8]) -> Vec<String> {
        let mut names = Vec::new();
        self.fields(line, |field, _| {
            let text = String::from_utf8_lossy(field).replace("\"\"", "\"");
            names.push(
                text.chars()
                    .filter(|c| !c.is_control())
                    .collect::<String>()
                    .trim()
                    .to_owned(),
            );
        });
        if names.len() > 1 && names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        names
    }

    /// Calls `visit(field, offset)` for each field, without blanks and quotation marks around it.
    #[inline]
    pub(super) fn fields<'a>(self, line: &'a [u8], mut visit: impl FnMut(&'a [u8], usize)) {
        let quoted = line.contains(&b'"');
        let mut start = 0;
        if self.delimiter == b' ' {
            while start < line.len() && is_blank(line[start]) {
                start += 1;
            }
        }
        loop {
            let end = if quoted {
                self.end_quoted(line, start)
            } else {
                self.end(line, start)
            };
            let (from, to) = trim(line, start, end);
            visit(&line[from..to], from);
            if end >= line.len() {
                return;
            }
            start = end + 1;
            if self.delimiter == b' ' {
                while start < line.len() && is_blank(line[start]) {
                    start += 1;
                }
                if start == line.len() {
                    return;
                }
            }
        }
    }

    fn end(self, line: &[u8], start: usize) -> usize {
        let rest = &line[start..];
        let found = if self.delimiter == b' ' {
            rest.iter().position(|b| is_blank(*b))
        } else {
            rest.iter().position(|b| *b == self.delimiter)
        };
        found.map_or(line.len(), |n| start + n)
    }

    fn end_quoted(self, line: &[u8], start: usize) -> usize {
        let mut inside = false;
        for (i, byte) in line.iter().enumerate().skip(start) {
            match byte {
                b'"' => inside = !inside,
                b if !inside
                    && (*b == self.delimiter || self.delimiter == b' ' && is_blank(*b)) =>
                {
                    return i;
                }
                _ => {}
            }
        }
        line.len()
    }

    /// The field that begins at `offset`, as text.
    pub(super) fn field_text(self, line: &[u8], offset: usize) -> String {
        let mut text = String::new();
        self.fields(line, |field, at| {
            if at == offset {
                text = String::from_utf8_lossy(field)
                    .chars()
                    .filter(|c| !c.is_control())
                    .collect();
            }
        });
        text
    }
}

fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte == b'\t'
}

/// Range without blanks, then without one pair of quotation marks.
#[inline]
fn trim(line: &[u8], mut from: usize, mut to: usize) -> (usize, usize) {
    while from < to && is_blank(line[from]) {
        from += 1;
    }
    while from < to && (is_blank(line[to - 1]) || line[to - 1] == b'\r') {
        to -= 1;
    }
    if to - from >= 2 && line[from] == b'"' && line[to - 1] == b'"' {
        (from + 1, to - 1)
    } else {
        (from, to)
    }
}
