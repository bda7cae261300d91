//! Lines of a page: words that are wrapped at the terminal's width, and cut where they would take too many lines.

use crate::commands::summary::wrapped;
use crate::terminal::{Terminal, clean};

/// Where the rest of a text stands that was cut.
const REST: &str = "… (-v)";

/// Columns of the terminal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Width(pub(super) usize);

/// One line, and how it is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Line {
    Plain(String),
    Heading(String),
    Warning(String),
}

pub(super) fn plain(text: impl Into<String>) -> Line {
    Line::Plain(text.into())
}

/// Lines below each other.
#[derive(Debug, Default)]
pub(super) struct Page(Vec<Line>);

impl Page {
    pub(super) fn push(&mut self, line: Line) {
        self.0.push(line);
    }

    pub(super) fn blank(&mut self) {
        self.push(plain(""));
    }

    pub(super) fn heading(&mut self, text: &str) {
        self.push(Line::Heading(text.into()));
    }

    /// A text whose first line and other lines begin like this, of at most `most` lines.
    pub(super) fn paragraph(&mut self, text: &str, begin: [&str; 2], width: Width, most: usize) {
        for line in lines(text, begin, width, most) {
            self.push(plain(line));
        }
    }

    /// The same in the colour of a warning.
    pub(super) fn warning(&mut self, text: &str, begin: [&str; 2], width: Width, most: usize) {
        for line in lines(text, begin, width, most) {
            self.push(Line::Warning(line));
        }
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn print(&self, terminal: &mut Terminal) {
        for line in &self.0 {
            match line {
                Line::Plain(text) => terminal.say(text),
                Line::Heading(text) => terminal.heading(text),
                Line::Warning(text) => terminal.warning(text),
            }
        }
    }

    #[cfg(test)]
    pub(super) fn texts(&self) -> Vec<&str> {
        let text = |line| match line {
            &Line::Plain(ref text) | &Line::Heading(ref text) | &Line::Warning(ref text) => {
                text.as_str()
            }
        };
        self.0.iter().map(text).collect()
    }
}

/// A text in at most `most` lines; what is beyond ends with "…".
pub(super) fn lines(text: &str, begin: [&str; 2], width: Width, most: usize) -> Vec<String> {
    let indent = begin.map(columns).into_iter().max().unwrap_or(0);
    let room = width.0.saturating_sub(indent).max(16);
    let mut lines = wrapped(&clean(text), room);
    if lines.len() > most {
        lines.truncate(most);
        if let Some(last) = lines.last_mut() {
            while columns(last) + 1 + columns(REST) > room
                && let Some((kept, _)) = last.rsplit_once(' ')
            {
                *last = kept.to_owned();
            }
            *last = format!("{last} {REST}");
        }
    }
    let begun = lines.into_iter().enumerate();
    begun
        .map(|(number, line)| format!("{}{line}", begin[usize::from(number > 0)]))
        .collect()
}

/// A name in at most `most` columns: its middle gives way.
pub(super) fn short_name(name: &str, most: usize) -> String {
    let name = clean(name).replace('\n', " ");
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= most {
        return name;
    }
    let head = (most - 1).div_ceil(2);
    let tail = most - 1 - head;
    let text = |letters: &[char]| letters.iter().collect::<String>();
    format!(
        "{}…{}",
        text(&letters[..head]),
        text(&letters[letters.len() - tail..])
    )
}

/// Columns that a text takes; combining marks take none.
pub(super) fn columns(text: &str) -> usize {
    let letters = text.chars();
    letters
        .filter(|letter| !('\u{300}'..='\u{36f}').contains(letter))
        .count()
}

/// The text with blanks behind it up to this many columns.
pub(super) fn padded(text: &str, to: usize) -> String {
    format!("{text}{}", " ".repeat(to.saturating_sub(columns(text))))
}
