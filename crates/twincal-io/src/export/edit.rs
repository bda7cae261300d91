//! Changes of a text by byte position: every byte that is not named stays.

use crate::model::xml::{Document, Element};
use std::ops::Range;

/// Changes of one file, collected and then made at once.
#[derive(Debug)]
pub(super) struct Edits<'a> {
    document: &'a Document,
    text: &'a str,
    edits: Vec<(Range<usize>, String)>,
}

impl<'a> Edits<'a> {
    /// No change yet, of the document's first file.
    pub(super) fn new(document: &'a Document) -> Self {
        Self {
            document,
            text: document.files.first().map_or("", |file| file.text.as_str()),
            edits: Vec::new(),
        }
    }

    /// The text with all changes.
    pub(super) fn apply(mut self) -> String {
        self.edits
            .sort_by_key(|(range, _)| (range.start, range.end));
        let mut out = String::with_capacity(self.text.len() + 256);
        let mut at = 0;
        for (range, new) in &self.edits {
            out.push_str(&self.text[at..range.start.max(at)]);
            out.push_str(new);
            at = range.end.max(at);
        }
        out.push_str(&self.text[at..]);
        out
    }

    /// Gives an attribute these numbers: only words change that are further than `tolerance` from them. A missing
    /// attribute counts as `default` and is added where that is not near.
    pub(super) fn numbers(
        &mut self,
        element: &Element,
        name: &str,
        new: &[f64],
        default: &[f64],
        tolerance: f64,
    ) {
        let far = |old: f64, new: f64| (old - new).abs() > tolerance;
        let Some(attribute) = element.get(name) else {
            if new.iter().zip(default).any(|(new, old)| far(*old, *new)) {
                self.add_attribute(element, name, &list(new));
            }
            return;
        };
        let raw = &self.text[attribute.span.clone()];
        let words: Vec<&str> = raw.split_ascii_whitespace().collect();
        let values: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
        match values.filter(|values| values.len() == new.len()) {
            Some(values) => {
                for ((word, old), new) in words.iter().zip(values).zip(new) {
                    if far(old, *new) {
                        let start = word.as_ptr() as usize - self.text.as_ptr() as usize;
                        self.edits.push((start..start + word.len(), digits(*new)));
                    }
                }
            }
            // Numbers behind entities: as a whole.
            None => self.edits.push((attribute.span.clone(), list(new))),
        }
    }

    /// Gives an attribute another name and value.
    pub(super) fn replace_attribute(
        &mut self,
        element: &Element,
        old: &str,
        name: &str,
        value: &str,
    ) {
        if let Some(attribute) = element.get(old) {
            let before = &self.text[element.offset..attribute.span.start];
            if let Some(at) = before.rfind(old) {
                let start = element.offset + at;
                self.edits.push((start..start + old.len(), name.into()));
            }
            self.edits.push((attribute.span.clone(), value.into()));
        }
    }

    /// Adds an attribute behind the last one, with its quotes.
    pub(super) fn add_attribute(&mut self, element: &Element, name: &str, value: &str) {
        let (at, quote) = match element.attributes.iter().max_by_key(|a| a.span.end) {
            Some(last) => {
                let quote = self.text[last.span.end..].chars().next();
                (last.span.end + 1, quote.unwrap_or('"'))
            }
            None => (element.offset + 1 + element.name.len(), '"'),
        };
        self.edits
            .push((at..at, format!(" {name}={quote}{value}{quote}")));
    }

    /// Adds a child as the first, on a line of its own. `lines` are its lines, each with its depth below the child.
    pub(super) fn first_child(&mut self, element: &Element, lines: &[(usize, String)]) {
        self.child(element, element.inside, lines);
    }

    /// `comment` as a first line of a child block, unless it stands there before the element's first child.
    pub(super) fn once(&self, element: &Element, comment: &str) -> Option<(usize, String)> {
        let first = element.children.first();
        let end = first.map_or(element.close, |&c| self.document.elements[c].offset);
        let said = self.text[element.inside..end].contains(comment);
        (!said).then(|| (0, comment.to_owned()))
    }

    /// Adds a child as the last.
    pub(super) fn last_child(&mut self, element: &Element, lines: &[(usize, String)]) {
        let last = element.children.last();
        let at = last.map_or(element.inside, |&last| self.document.elements[last].end);
        self.child(element, at, lines);
    }

    fn child(&mut self, element: &Element, at: usize, lines: &[(usize, String)]) {
        let newline = if self.text.contains("\r\n") {
            "\r\n"
        } else {
            "\n"
        };
        let own = self.indentation(element).to_owned();
        let unit = self.unit(element);
        let first = element.children.first();
        let below = match first.map(|&c| self.indentation(&self.document.elements[c])) {
            Some(below) if below.len() > own.len() => below.to_owned(),
            _ => format!("{own}{unit}"),
        };
        let mut block = String::new();
        for (depth, line) in lines {
            block.push_str(newline);
            block.push_str(&below);
            block.push_str(&unit.repeat(*depth));
            block.push_str(line);
        }
        if element.close == element.inside && element.end == element.inside {
            // <link name="x"/> opens up: spaces before the slash go.
            let tag = &self.text[element.offset..element.inside];
            let kept = tag.trim_end_matches('>').trim_end_matches('/').trim_end();
            let start = element.offset + kept.len();
            let text = format!(">{block}{newline}{own}</{}>", element.name);
            self.edits.push((start..element.inside, text));
        } else {
            if self.text[at..element.close].trim().is_empty()
                && !self.text[at..element.close].contains('\n')
            {
                block.push_str(newline);
                block.push_str(&own);
            }
            self.edits.push((at..at, block));
        }
    }

    /// White space before an element on its line; none where something else stands there.
    fn indentation(&self, element: &Element) -> &'a str {
        let before = &self.text[..element.offset];
        let line = &before[before.rfind('\n').map_or(0, |at| at + 1)..];
        if line.chars().all(|c| c == ' ' || c == '\t') {
            line
        } else {
            ""
        }
    }

    /// What one level is indented by: as the element's first child, or as the root's.
    fn unit(&self, element: &Element) -> String {
        for parent in [element, &self.document.elements[0]] {
            let own = self.indentation(parent);
            for &child in &parent.children {
                if let Some(unit) = self
                    .indentation(&self.document.elements[child])
                    .strip_prefix(own)
                    && !unit.is_empty()
                {
                    return unit.to_owned();
                }
            }
        }
        "  ".into()
    }
}

/// A number in at most twelve significant digits, as short as it can be.
pub(super) fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(value);
    if rounded == 0.0 {
        "0".into()
    } else if (1e-5..1e15).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// Several numbers.
pub(super) fn list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|value| digits(*value)).collect();
    words.join(" ")
}
