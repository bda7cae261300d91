//! Advice for logs whose topics have to be mapped: lists of numbers in their definitions, and a line that maps them.

use super::definition::{Definition, Kind, Length, Scalar};
use std::fmt::Write as _;

/// Most lists and points in time that are shown of a topic, and how deep they are looked for.
const SHOWN: usize = 8;
const DEPTH: usize = 4;
/// Most fields that are looked at.
const LOOKED_AT: usize = 10_000;
/// What lists of positions and of torques are usually called.
const POSITIONS: [&str; 8] = [
    "q",
    "position",
    "positions",
    "pos",
    "joint_positions",
    "joint_position",
    "actual_q",
    "angle",
];
const TORQUES: [&str; 8] = [
    "tau",
    "tau_j",
    "effort",
    "efforts",
    "torque",
    "torques",
    "joint_torques",
    "current",
];

/// Lists of numbers in messages of a type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Lists {
    /// Paths with the length where it is fixed.
    found: Vec<(String, Option<usize>)>,
}

/// Walks the fields of a definition, lists of records left out.
fn walk(definition: &Definition, look: &mut impl FnMut(&str, &Kind)) {
    let mut open = vec![(0, String::new(), 0)];
    let mut seen = 0;
    while let Some((record, before, depth)) = open.pop() {
        for field in &definition.records[record].fields {
            seen += 1;
            if seen > LOOKED_AT {
                return;
            }
            let path = format!("{before}{}", field.name);
            look(&path, &field.kind);
            if let Kind::Record(inner) = field.kind
                && depth < DEPTH
            {
                open.push((inner, format!("{path}."), depth + 1));
            }
        }
    }
}

impl Lists {
    /// Lists of floats that may have one entry per joint: of unknown length, or at least `joints`.
    pub(super) fn of(definition: &Definition, joints: usize) -> Self {
        let mut found = Vec::new();
        walk(definition, &mut |path, kind| {
            let Kind::List(entry, length) = kind else {
                return;
            };
            let length = match length {
                Length::Fixed(count) => Some(*count),
                Length::Counted => None,
            };
            let floats = matches!(**entry, Kind::Scalar(Scalar::Float(_)));
            if floats && length.is_none_or(|count| count >= joints) {
                found.push((path.to_owned(), length));
            }
        });
        Self { found }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// `q[7]`, `dq[7]` …
    pub(super) fn words(&self) -> String {
        let mut text = String::new();
        for (number, (path, length)) in self.found.iter().take(SHOWN).enumerate() {
            let comma = if number == 0 { "" } else { ", " };
            let length = length.map_or(String::new(), |count| count.to_string());
            // Writing to a String cannot fail.
            let _ = write!(text, "{comma}{path}[{length}]");
        }
        match self.found.len().saturating_sub(SHOWN) {
            0 => text,
            more => format!("{text} and {more} more"),
        }
    }

    fn called(&self, words: &[&str]) -> Option<&str> {
        let last = |path: &str| path.rsplit('.').next().unwrap_or(path).to_lowercase();
        let paths = || self.found.iter().map(|(path, _)| path.as_str());
        words
            .iter()
            .find_map(|word| paths().find(|path| last(path) == *word))
    }

    /// The key that maps a list which is called torque, or the only list of a topic that is; `joints`: any only list with so many entries.
    pub(super) fn torque(&self, topic: &str, joints: Option<usize>) -> Option<String> {
        let lower = topic.to_lowercase();
        let mut words = lower.split(['/', '_']);
        let called_torque = words.any(|word| TORQUES.contains(&word));
        let only = || match self.found.as_slice() {
            [(path, length)] => {
                let fits = joints.is_some_and(|n| length.is_none_or(|length| length == n));
                (called_torque || fits).then_some(path.as_str())
            }
            _ => None,
        };
        let slash = if topic.starts_with('/') { "" } else { "/" };
        let path = self.called(&TORQUES).or_else(only)?;
        Some(format!("tau = \"{slash}{topic}:{path}[*]\""))
    }

    /// A line for the top of twincal.toml that maps `topic`.
    pub(super) fn line(&self, topic: &str) -> Option<String> {
        let (first, _) = self.found.first()?;
        let q = self.called(&POSITIONS).unwrap_or(first);
        let slash = if topic.starts_with('/') { "" } else { "/" };
        let tau = match self.called(&TORQUES) {
            Some(tau) => format!(", tau = \"{slash}{topic}:{tau}[*]\""),
            None => String::new(),
        };
        Some(format!(
            "columns = {{ q = \"{slash}{topic}:{q}[*]\"{tau} }}"
        ))
    }
}

/// Points in time and 64-bit counters of a definition, for the choice of a time.
pub(super) fn times(definition: &Definition) -> String {
    let mut found = Vec::new();
    walk(definition, &mut |path, kind| {
        let is_time = match kind {
            Kind::Scalar(Scalar::Stamp { .. } | Scalar::Unsigned(8) | Scalar::Signed(8)) => true,
            Kind::Record(number) => definition.records[*number].name == "builtin_interfaces/Time",
            Kind::Scalar(_) => path.to_lowercase().contains("time"),
            _ => false,
        };
        if is_time && found.len() < SHOWN {
            found.push(format!("`{path}`"));
        }
    });
    match found.as_slice() {
        [] => String::new(),
        found => format!(", perhaps {}", found.join(", ")),
    }
}
