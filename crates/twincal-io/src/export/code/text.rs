//! Names from outside as text in source code: data in every language, whatever they hold.
//!
//! | where | rule |
//! |---|---|
//! | comment (C `/* */`, Python `"""`, Rust `//!`) | [`comment_text`]: printable characters on one line, nothing that ends or continues a comment |
//! | string (Python, JSON) | [`python_string`], [`json_text`]: printable ASCII, all else as escapes, so that it reads back to the same text |

use serde_json::ser::{CharEscape, Formatter};
use std::fmt::Write as _;
use std::io;

/// Text for one line of a comment in C, Python or Rust.
///
/// White space becomes a space. What is not printable by Unicode (control characters, bidirectional marks, U+2028, a byte-order mark)
/// becomes its number, `<U+202E>`. A backslash would continue a C comment or begin an escape in Python: `|`. Double quotes end Python's
/// text: `'`. Signs whose pairs mean something to a C compiler (`*/`, `/*`, `??`) stand apart.
pub(in crate::export) fn comment_text(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => line.push('|'),
            '"' => line.push('\''),
            '*' | '/' | '?' if line.ends_with(['*', '/', '?']) => line.extend([' ', c]),
            c if c.is_whitespace() => line.push(' '),
            c if is_printable(c) => line.push(c),
            c => push_number(&mut line, c),
        }
    }
    line.truncate(line.trim_end().len());
    line
}

/// A string literal of Python.
pub(super) fn python_string(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in text.chars() {
        // Writing to a string cannot fail.
        let _ = match c {
            '"' | '\\' => write!(literal, "\\{c}"),
            ' '..='~' => write!(literal, "{c}"),
            c => write!(literal, "\\U{:08x}", u32::from(c)),
        };
    }
    literal.push('"');
    literal
}

/// A JSON value in printable ASCII: the writer of every string in exported JSON.
pub(super) fn json_text(value: &serde_json::Value) -> serde_json::Result<String> {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Ascii);
    serde::Serialize::serialize(value, &mut serializer)?;
    // ASCII is UTF-8.
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Letters, digits, signs: what `char::escape_debug` leaves as it is, and combining marks, which it leaves behind a letter only.
fn is_printable(c: char) -> bool {
    matches!(c, '\'' | '"' | '\\') || c.escape_debug().len() == 1
}

/// The number of a character that is not shown.
fn push_number(line: &mut String, c: char) {
    let _ = write!(line, "<U+{:04X}>", u32::from(c));
}

/// JSON that escapes all but printable ASCII.
struct Ascii;

impl Formatter for Ascii {
    fn write_string_fragment<W: io::Write + ?Sized>(
        &mut self,
        writer: &mut W,
        fragment: &str,
    ) -> io::Result<()> {
        for c in fragment.chars() {
            match c {
                ' '..='~' => writer.write_all(&[c as u8])?,
                c => {
                    for unit in c.encode_utf16(&mut [0; 2]) {
                        write!(writer, "\\u{unit:04x}")?;
                    }
                }
            }
        }
        Ok(())
    }

    fn write_char_escape<W: io::Write + ?Sized>(
        &mut self,
        writer: &mut W,
        escape: CharEscape,
    ) -> io::Result<()> {
        serde_json::ser::CompactFormatter.write_char_escape(writer, escape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_comment_stays_one_line_of_a_comment() {
        for (name, line) in [
            ("a*/ b", "a* / b"),
            ("*\\/", "*|/"),
            ("*??/x", "* ? ? /x"),
            ("\"\"\"", "'''"),
            ("a\nb\r\u{2028}c", "a b  c"),
            (
                "\u{202e}x\u{feff}\0\u{1b}[0m",
                "<U+202E>x<U+FEFF><U+0000><U+001B>[0m",
            ),
            ("Gelenk Süd 関節", "Gelenk Süd 関節"),
            ("ends in \\", "ends in |"),
        ] {
            assert_eq!(comment_text(name), line);
        }
    }

    proptest! {
        #[test]
        fn no_text_leaves_its_comment(name in "(?s).{0,40}|[*/?\\\\\"\n\r\u{0}\u{202e} a]{0,40}") {
            let line = comment_text(&name);
            prop_assert!(!line.contains(['\\', '"']), "{line}");
            prop_assert!(["*/", "/*", "??"].iter().all(|pair| !line.contains(pair)), "{line}");
            prop_assert!(line.chars().all(|c| c == ' ' || is_printable(c)), "{line:?}");
        }

        #[test]
        fn strings_read_back(name in "(?s).{0,40}") {
            let json = json_text(&name.as_str().into()).unwrap();
            prop_assert!(json.bytes().all(|byte| (b' '..=b'~').contains(&byte)), "{json}");
            prop_assert_eq!(serde_json::from_str::<String>(&json).unwrap(), name.as_str());
            let python = python_string(&name);
            prop_assert!(python.bytes().all(|byte| (b' '..=b'~').contains(&byte)), "{python}");
        }
    }
}
