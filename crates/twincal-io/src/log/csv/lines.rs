//! Lines of a text file with a limit on their length: memory stays flat whatever the file holds.

use crate::error::{Error, Place, Result};
use std::io::{BufRead, BufReader, ErrorKind, Read};

/// Longest line, bytes.
pub(super) const MAX_LINE: usize = 1 << 20;

/// One line without its end.
#[derive(Debug, Clone, Default)]
pub(super) struct Line {
    /// 1-based; of a quoted field over several lines the first.
    pub(super) number: u64,
    /// Content.
    pub(super) text: Vec<u8>,
    /// Whether the file ends within it, without a line feed.
    pub(super) is_open: bool,
}

/// Reads lines; knows the byte-order marks and the impostors.
pub(super) struct Lines<R: Read> {
    reader: BufReader<R>,
    name: String,
    number: u64,
    bytes: u64,
    spare: Vec<u8>,
    comment: Option<Line>,
}

impl<R: Read> Lines<R> {
    pub(super) fn new(source: R, name: &str) -> Self {
        Self {
            reader: BufReader::with_capacity(1 << 18, source),
            name: name.to_owned(),
            number: 0,
            bytes: 0,
            spare: Vec::new(),
            comment: None,
        }
    }

    /// True if not a single byte was read.
    pub(super) fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Lends a line's memory to the next one.
    pub(super) fn give_back(&mut self, line: Line) {
        self.spare = line.text;
    }

    /// The first line that is neither blank nor a comment. If that one holds numbers and a comment stands right above it (as
    /// `numpy.savetxt` writes it), the comment is the header and the numbers come next.
    pub(super) fn header(&mut self) -> Result<Option<Line>> {
        let mut comment: Option<Line> = None;
        while let Some(line) = self.next_line()? {
            if line.number == 1 {
                self.refuse_impostors(&line.text)?;
            }
            if line.text.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            if line.text.starts_with(b"#") {
                comment = Some(line);
                continue;
            }
            let numeric = line
                .text
                .iter()
                .all(|b| b.is_ascii_digit() || b" \t,;|+-.eE\"".contains(b));
            return Ok(match comment.filter(|_| numeric) {
                Some(mut header) => {
                    self.comment = Some(line);
                    header.text[0] = b' ';
                    let blank = header.text.iter().take_while(|b| **b == b' ').count();
                    header.text.drain(..blank);
                    Some(header)
                }
                None => Some(line),
            });
        }
        Ok(None)
    }

    /// The next line that is neither blank nor a comment.
    pub(super) fn data(&mut self) -> Result<Option<Line>> {
        if let Some(line) = self.comment.take() {
            return Ok(Some(line));
        }
        while let Some(line) = self.next_line()? {
            let content = line.text.iter().find(|b| !b.is_ascii_whitespace());
            if content.is_some_and(|b| *b != b'#') {
                return Ok(Some(line));
            }
            self.give_back(line);
        }
        Ok(None)
    }

    /// Hands `read` the bytes that are there already, which begin with a line, before that line is copied: it gives the bytes that the
    /// line takes with its end, or `None` where it cannot read it. Those bytes, or 0 if the line is still to come; blank lines and
    /// comments are not shown.
    pub(super) fn in_place(&mut self, read: impl FnOnce(&[u8]) -> Option<usize>) -> Result<usize> {
        if self.comment.is_some() {
            return Ok(0);
        }
        let bytes = match self.reader.fill_buf() {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == ErrorKind::Interrupted => return Ok(0),
            Err(e) => return Err(unreadable(&self.name, &e)),
        };
        let is_data = (bytes.first()).is_some_and(|b| *b != b'#' && !b.is_ascii_whitespace());
        let taken = if is_data { read(bytes).unwrap_or(0) } else { 0 };
        self.reader.consume(taken);
        self.bytes += taken as u64;
        self.number += u64::from(taken > 0);
        Ok(taken)
    }

    /// The next line; a line with an open quotation mark goes on with the one below.
    fn next_line(&mut self) -> Result<Option<Line>> {
        let mut text = std::mem::take(&mut self.spare);
        text.clear();
        let number = self.number + 1;
        // Parity of quotation marks so far, counted once per byte.
        let mut open = false;
        let mut is_open = true;
        loop {
            let room = (MAX_LINE + 2 - text.len()) as u64;
            let before = text.len();
            let read = (&mut self.reader)
                .take(room)
                .read_until(b'\n', &mut text)
                .map_err(|e| unreadable(&self.name, &e))?;
            if read == 0 {
                break;
            }
            self.bytes += read as u64;
            self.number += 1;
            open ^= odd_quotes(&text[before..]);
            let ended = text.last() == Some(&b'\n');
            if text.len() - usize::from(ended) > MAX_LINE {
                return Err(self.too_long(number, open));
            }
            is_open = !ended;
            if !ended || !open {
                break;
            }
        }
        if text.is_empty() {
            return Ok(None);
        }
        if open {
            return Err(Error::content(
                Place::line(&self.name, number),
                "a quotation mark is never closed",
                "close it or remove it",
            ));
        }
        while matches!(text.last(), Some(b'\n' | b'\r')) {
            text.pop();
        }
        if number == 1 && text.starts_with(b"\xEF\xBB\xBF") {
            text.drain(..3);
        }
        Ok(Some(Line {
            number,
            text,
            is_open,
        }))
    }

    fn too_long(&self, number: u64, open: bool) -> Error {
        let mut problem = format!("the line is longer than {} MiB", MAX_LINE >> 20);
        if open {
            problem.push_str(", inside an open quotation mark");
        }
        Error::content(
            Place::line(&self.name, number),
            problem,
            "this is not a table of joint samples: check the file, or export fewer columns",
        )
    }

    /// Files that are no text table, told by their first bytes.
    fn refuse_impostors(&self, text: &[u8]) -> Result<()> {
        let refuse = |problem: &str, remedy: &str| {
            Err(Error::content(Place::file(&self.name), problem, remedy))
        };
        let utf16 = text.starts_with(b"\xFF\xFE") || text.starts_with(b"\xFE\xFF");
        if utf16
            || text.iter().take(64).filter(|b| **b == 0).count() >= 4 && text.first() != Some(&0x1F)
        {
            return refuse(
                "is UTF-16 (or binary), not UTF-8 text",
                "save it as CSV in UTF-8",
            );
        }
        if text.starts_with(b"version https://git-lfs") {
            return refuse(
                "this is a Git LFS pointer, not the log itself",
                "fetch the log with `git lfs pull`",
            );
        }
        if text.starts_with(b"\x1F\x8B")
            || text.starts_with(b"PK\x03\x04")
            || text.starts_with(b"\x28\xB5\x2F\xFD")
        {
            return refuse("is compressed", "unpack it first");
        }
        if text.starts_with(b"\x89MCAP0")
            || text.starts_with(b"SQLite format 3")
            || text.starts_with(b"\x93NUMPY")
        {
            return refuse(
                "is not a text table",
                "export the joint states to CSV or Parquet",
            );
        }
        Ok(())
    }
}

fn unreadable(name: &str, error: &std::io::Error) -> Error {
    let remedy = "check the disk or the program that writes it";
    Error::system(name, "read", error, remedy)
}

/// Whether the number of quotation marks is odd.
fn odd_quotes(text: &[u8]) -> bool {
    text.contains(&b'"') && text.iter().filter(|b| **b == b'"').count() % 2 == 1
}
