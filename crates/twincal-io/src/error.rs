//! Why a file could not be read or written: one structured error for the whole crate.

use std::fmt;

/// `Result` with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// A place in a file as the user named it: `file`, `file:line` or `file:line:column`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Place {
    /// The file as given by the user.
    pub file: String,
    /// 1-based line.
    pub line: Option<u64>,
    /// 1-based column in characters; only with a line.
    pub column: Option<u64>,
}

impl Place {
    /// The whole file.
    pub fn file(file: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            line: None,
            column: None,
        }
    }

    /// A line of a file (the first is 1).
    pub fn line(file: impl Into<String>, line: u64) -> Self {
        Self {
            file: file.into(),
            line: Some(line),
            column: None,
        }
    }

    /// Line and column (in characters) of byte `offset` in the file's text; both start at 1.
    pub fn of_offset(file: impl Into<String>, text: &[u8], offset: usize) -> Self {
        let before = &text[..offset.min(text.len())];
        let line_start = before
            .iter()
            .rposition(|&b| b == b'\n')
            .map_or(0, |i| i + 1);
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count() as u64;
        // UTF-8 continuation bytes are 10xxxxxx: every other byte begins a character.
        let column = 1 + before[line_start..]
            .iter()
            .filter(|&&b| b & 0xC0 != 0x80)
            .count() as u64;
        Self {
            file: file.into(),
            line: Some(line),
            column: Some(column),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
            if let Some(column) = self.column {
                write!(f, ":{column}")?;
            }
        }
        Ok(())
    }
}

/// Why a file could not be read or written. Every message names the culprit, the number and the remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// What a file says is wrong (exit code 2).
    #[error("{place}: {problem}; {remedy}")]
    Content {
        /// Where.
        place: Place,
        /// What is wrong, with the number.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// The operating system refused (exit code 2).
    #[error("{path}: cannot {action}: {problem}; {remedy}")]
    System {
        /// File or folder as given.
        path: String,
        /// What was tried: "read", "write", "create".
        action: &'static str,
        /// The system's own words.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// A mistake in this program, not in its input.
    #[error("{what}: {problem}; this is a mistake in twincal, please report it")]
    Internal {
        /// Which part of the program.
        what: String,
        /// What went wrong there.
        problem: String,
    },
    /// The mathematics refused what the files say; the exit code follows from `source`.
    #[error(transparent)]
    Core(#[from] twincal::Error),
}

impl Error {
    /// [`Error::Content`] at a place.
    pub fn content(place: Place, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Content {
            place,
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    /// [`Error::System`] from the operating system's answer.
    pub fn system(
        path: impl Into<String>,
        action: &'static str,
        problem: &std::io::Error,
        remedy: impl Into<String>,
    ) -> Self {
        Self::System {
            path: path.into(),
            action,
            problem: problem.to_string(),
            remedy: remedy.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn place_counts_lines_and_characters() {
        let text = "ab\nä b\n".as_bytes();
        for (offset, line, column) in [
            (0, 1, 1),
            (2, 1, 3),
            (3, 2, 1),
            (5, 2, 2),
            (6, 2, 3),
            (99, 3, 1),
        ] {
            let place = Place::of_offset("f", text, offset);
            assert_eq!(
                (place.line, place.column),
                (Some(line), Some(column)),
                "offset {offset}"
            );
        }
        assert_eq!(Place::line("x.csv", 7).to_string(), "x.csv:7");
    }
}
