//! Two streams: results on standard output, everything else on standard error; names from files cannot steer the
//! terminal.

use crate::failure::{Failure, Outcome};
use anstream::AutoStream;
use std::io::{self, IsTerminal as _, Write};
use std::path::Path;

const BOLD: &str = "\x1b[1m";
const RED: &str = "\x1b[1;31m";
const YELLOW: &str = "\x1b[33m";
const PLAIN: &str = "\x1b[0m";

/// Where a command speaks to.
pub(crate) struct Terminal {
    out: Out,
    err: Option<AutoStream<io::Stderr>>,
    broken: Option<io::Error>,
    /// Where a result lies that is complete whatever becomes of standard output.
    complete: Option<String>,
    width: usize,
}

/// Where results go.
enum Out {
    Stream(AutoStream<io::Stdout>),
    /// Kept for a program that called the command.
    Kept(Vec<u8>),
}

/// Columns that text is laid out for: no fewer and no more, and those of a file.
const WIDTHS: (usize, usize) = (60, 120);
const WIDTH_OF_FILES: usize = 80;

impl Terminal {
    pub(crate) fn new() -> Self {
        Self {
            out: Out::Stream(anstream::stdout()),
            err: Some(anstream::stderr()),
            broken: None,
            complete: None,
            width: width(std::env::var("COLUMNS").ok().as_deref()),
        }
    }

    /// Keeps results and says nothing.
    pub(crate) fn kept() -> Self {
        Self {
            out: Out::Kept(Vec::new()),
            err: None,
            broken: None,
            complete: None,
            width: WIDTH_OF_FILES,
        }
    }

    /// The results that were kept.
    pub(crate) fn into_kept(self) -> String {
        match self.out {
            Out::Stream(_) => String::new(),
            Out::Kept(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        }
    }

    /// True if a person watches standard error.
    pub(crate) fn is_watched() -> bool {
        io::stderr().is_terminal()
    }

    /// Columns of the terminal, 60 to 120.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// The answer, in one line for programs and in whole words for a person who watches.
    pub(crate) fn answer(&mut self, line: &str) {
        if !io::stdout().is_terminal() {
            return self.heading(&line.replace('\n', " "));
        }
        for line in crate::commands::wrapped(line, self.width) {
            self.heading(&line);
        }
    }

    /// A line of the result.
    pub(crate) fn say(&mut self, line: &str) {
        self.write(&format!("{}\n", clean(line)));
    }

    /// A heading of the result.
    pub(crate) fn heading(&mut self, line: &str) {
        self.write(&format!("{BOLD}{}{PLAIN}\n", clean(line)));
    }

    /// A warning inside the result.
    pub(crate) fn warning(&mut self, line: &str) {
        self.write(&format!("{YELLOW}{}{PLAIN}\n", clean(line)));
    }

    /// A result for programs, as it is.
    pub(crate) fn data(&mut self, text: &str) {
        self.write(text);
    }

    /// Standard output for a command that writes rows itself; what became of that goes to [`Terminal::wrote`].
    pub(crate) fn rows(&mut self) -> io::BufWriter<io::Stdout> {
        io::BufWriter::new(io::stdout())
    }

    /// Takes what became of rows.
    pub(crate) fn wrote(&mut self, outcome: io::Result<()>) {
        self.broken = self.broken.take().or(outcome.err());
    }

    /// The result is in its place: what is said from here on only repeats it.
    pub(crate) fn complete(&mut self, place: &Path) {
        self.complete = Some(place.to_string_lossy().into_owned());
    }

    /// A line that is not part of the result.
    pub(crate) fn note(&mut self, line: &str) {
        let Some(err) = &mut self.err else { return };
        // Nobody is left to be told when standard error is closed.
        let _ = writeln!(err, "{}", clean(line));
    }

    /// Why the command failed.
    pub(crate) fn failure(&mut self, failure: &Failure) {
        let Some(err) = &mut self.err else { return };
        let (problem, remedy) = failure.words();
        let _ = writeln!(err, "{RED}error{PLAIN}: {}", clean(&problem));
        if let Some(remedy) = remedy {
            let _ = writeln!(err, "  {BOLD}help{PLAIN}: {}", clean(&remedy));
        }
    }

    /// Says whether everything could be written; a reader that went away (`| head`) wanted no more.
    pub(crate) fn finish(&mut self) -> Outcome<()> {
        let flushed = match &mut self.out {
            Out::Stream(out) => out.flush(),
            Out::Kept(_) => Ok(()),
        };
        match self.broken.take().map_or(flushed, Err) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(match self.complete.take() {
                Some(place) => Failure::Unprinted {
                    problem: format!("cannot write the summary to standard output: {e}"),
                    remedy: format!(
                        "the result in {place} is complete: nothing has to be run again"
                    ),
                },
                None => Failure::usage(
                    format!("cannot write to standard output: {e}"),
                    "free space or write elsewhere",
                ),
            }),
            _ => Ok(()),
        }
    }

    fn write(&mut self, text: &str) {
        match &mut self.out {
            Out::Stream(out) if self.broken.is_none() => {
                self.broken = out.write_all(text.as_bytes()).err();
            }
            Out::Stream(_) => {}
            Out::Kept(kept) => kept.extend_from_slice(text.as_bytes()),
        }
    }
}

/// Columns by COLUMNS where it is a number, else of the terminal, else those of a file.
fn width(given: Option<&str>) -> usize {
    let given = given.and_then(|columns| columns.trim().parse().ok());
    let of_terminal = || terminal_size::terminal_size().map(|(width, _)| width.0.into());
    let columns: usize = given.or_else(of_terminal).unwrap_or(WIDTH_OF_FILES);
    columns.clamp(WIDTHS.0, WIDTHS.1)
}

/// The text without what could steer a terminal or turn the reading direction.
pub(crate) fn clean(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '\n' => c,
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{200e}' | '\u{200f}' => {
                '\u{fffd}'
            }
            c if c.is_control() => '\u{fffd}',
            c => c,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{clean, width};

    #[test]
    fn text_is_laid_out_for_60_to_120_columns() {
        let of = |given: &str| width(Some(given));
        assert_eq!(
            [of("20"), of("60"), of("101"), of("999")],
            [60, 60, 101, 120]
        );
    }

    #[test]
    fn case_109_names_cannot_steer_the_terminal() {
        assert_eq!(
            clean("a\x1b[31mred\x07\u{9b}2J\u{202e}x"),
            "a\u{fffd}[31mred\u{fffd}\u{fffd}2J\u{fffd}x"
        );
        assert_eq!(clean("Größe q̇ ± 3 N·m\nnext"), "Größe q̇ ± 3 N·m\nnext");
    }
}
