//! What `[columns]` says of a bag: `/topic:field.list[2]`, a number in the messages of a topic.
//!
//! | selector | entry of a list |
//! |---|---|
//! | `[2]` | number 2, counted from 0 |
//! | `[elbow]` | the one called so: its own field `name` says it, or the list of texts beside it, or beside what it lies in |
//! | `[*]` | each joint's: by its name where such names are there, else in the model's order |

use super::definition::{Definition, Field, Fields, Kind, Length, Record, Scalar};
use std::fmt;
use twincal::robot::did_you_mean;

/// Most steps of a path.
const MAX_STEPS: usize = 32;
/// Fields in which an entry of a list may say what it is called.
pub(super) const NAMES: [&str; 2] = ["name", "joint_name"];
/// Seconds and nanoseconds of a point in time, as ROS 2, ROS 1 and JSON call them.
pub(super) const STAMPS: [[&str; 2]; 4] = [
    ["sec", "nanosec"],
    ["secs", "nsecs"],
    ["sec", "nsec"],
    ["seconds", "nanoseconds"],
];

/// One step into a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Step {
    Field(String),
    Index(usize),
    Name(String),
    All,
}

/// A topic and a path into its messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Source {
    pub(super) topic: String,
    pub(super) steps: Vec<Step>,
    /// As written.
    pub(super) text: String,
}

/// Whether a name in `[columns]` is one of these, not a column or the name of a joint.
pub(in super::super) fn is_source(text: &str) -> bool {
    text.starts_with('/') && text.contains(':')
}

impl Source {
    /// Reads `/topic:path`; `[*]` only where `all` joints are meant.
    ///
    /// # Errors
    /// What does not fit, in words.
    pub(super) fn parse(text: &str, all: bool) -> Result<Self, String> {
        let (topic, path) = text.split_once(':').unwrap_or((text, ""));
        let mut steps = Vec::new();
        for part in split(path)? {
            let (field, mut selectors) = part.split_at(part.find('[').unwrap_or(part.len()));
            if field.is_empty() {
                return Err("a field without a name; write /topic:field.field[number]".into());
            }
            steps.push(Step::Field(field.to_owned()));
            while !selectors.is_empty() {
                let inner = (selectors.strip_prefix('[')).and_then(|rest| rest.split_once(']'));
                let (inner, rest) = inner.ok_or("brackets that do not close")?;
                selectors = rest;
                steps.push(match inner.trim() {
                    "" => return Err("empty brackets: write [0], [name] or [*]".into()),
                    "*" => Step::All,
                    digits if digits.bytes().all(|b| b.is_ascii_digit()) => {
                        let index = digits.parse().map_err(|_| "a number that is too large")?;
                        Step::Index(index)
                    }
                    name => Step::Name(name.to_owned()),
                });
            }
        }
        if steps.is_empty() {
            return Err("no field behind the colon; write /topic:field.field[number]".into());
        }
        if steps.len() > MAX_STEPS {
            return Err(format!("{} steps, the limit is {MAX_STEPS}", steps.len()));
        }
        let stars = steps.iter().filter(|step| **step == Step::All).count();
        match (all, stars) {
            (false, 1..) => {
                return Err("[*], which stands for every joint; write [number] or [name], or one path for all joints: q = \"/topic:field[*]\"".into());
            }
            (true, 0) => {
                return Err("no [*] to say where the joint's number or name goes; write one, or a path per joint: q = { joint = \"/topic:field[0]\" }".into());
            }
            (true, 2..) => return Err("[*] more than once".into()),
            _ => {}
        }
        Ok(Self {
            topic: topic.to_owned(),
            steps,
            text: text.to_owned(),
        })
    }

    /// Whether a topic is the one that is meant: other tools than ROS leave the slash out.
    pub(super) fn is_of(&self, topic: &str) -> bool {
        self.topic == topic || self.topic.strip_prefix('/') == Some(topic)
    }
}

/// Parts of a path between dots; dots in brackets belong to names.
fn split(path: &str) -> Result<Vec<&str>, String> {
    let (mut parts, mut start, mut inside) = (Vec::new(), 0, false);
    for (at, byte) in path.bytes().enumerate() {
        match byte {
            b'[' => inside = true,
            b']' => inside = false,
            b'.' if !inside => {
                parts.push(&path[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    if inside {
        return Err("brackets that do not close".into());
    }
    if !path.is_empty() {
        parts.push(&path[start..]);
    }
    Ok(parts)
}

/// Steps as they are written.
pub(super) struct Written<'a>(pub(super) &'a [Step]);

impl fmt::Display for Written<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, step) in self.0.iter().enumerate() {
            match step {
                Step::Field(name) if number == 0 => f.write_str(name)?,
                Step::Field(name) => write!(f, ".{name}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
                Step::Name(name) => write!(f, "[{name}]")?,
                Step::All => f.write_str("[*]")?,
            }
        }
        Ok(())
    }
}

/// What a path has to lead to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    Number,
    /// A point in time, or a number that stands for one.
    Time,
    /// A point in time and nothing else.
    Stamp,
}

fn as_written(definition: &Definition, kind: &Kind) -> String {
    match kind {
        Kind::Scalar(Scalar::Bool) => "bool".into(),
        Kind::Scalar(Scalar::Signed(n)) => format!("int{}", 8 * n),
        Kind::Scalar(Scalar::Unsigned(n)) => format!("uint{}", 8 * n),
        Kind::Scalar(Scalar::Float(n)) => format!("float{}", 8 * n),
        Kind::Scalar(Scalar::Stamp { .. }) => "time".into(),
        Kind::Text => "string".into(),
        Kind::WideText => "wstring".into(),
        Kind::Record(number) => definition.records[*number].name.clone(),
        Kind::List(entry, length) => {
            let entry = as_written(definition, entry);
            match length {
                Length::Fixed(n) => format!("{entry}[{n}]"),
                Length::Counted => format!("{entry}[]"),
            }
        }
    }
}

/// Whether a record is a point in time: two whole numbers called so.
fn is_stamp(record: &Record) -> bool {
    let whole = |name: &str| {
        record.fields.iter().any(|field| {
            field.name == name
                && matches!(
                    field.kind,
                    Kind::Scalar(Scalar::Signed(_) | Scalar::Unsigned(_))
                )
        })
    };
    STAMPS
        .iter()
        .any(|names| names.iter().all(|name| whole(name)))
}

/// Compares a path with the definition of its messages.
///
/// # Errors
/// The field that is not there with those that are, the list without a number, what is no number, in words with a remedy behind a `;`.
pub(super) fn check(definition: &Definition, steps: &[Step], wanted: Wanted) -> Result<(), String> {
    let message = Kind::Record(0);
    let mut walk = Walk {
        definition,
        enclosing: Vec::new(),
        kind: &message,
    };
    for (at, step) in steps.iter().enumerate() {
        walk.step(&steps[..at], step)?;
    }
    check_end(definition, steps, wanted, walk.kind)
}

/// How far a path has been followed into a definition.
struct Walk<'a> {
    definition: &'a Definition,
    /// The records on the way.
    enclosing: Vec<&'a Record>,
    /// What the steps so far lead to.
    kind: &'a Kind,
}

impl Walk<'_> {
    /// One step further; `before`: the steps so far.
    fn step(&mut self, before: &[Step], step: &Step) -> Result<(), String> {
        let path = Written(before);
        let place = match before {
            [] => "the message".to_owned(),
            _ => format!("`{path}`"),
        };
        let kind = || as_written(self.definition, self.kind);
        match (step, self.kind) {
            (Step::Field(name), Kind::Record(number)) => self.field(name, *number),
            (Step::Field(name), Kind::List(..)) => Err(format!(
                "{place} is {}, a list; say whose `{name}`: {path}[0].{name}, or a name or * in the brackets",
                kind()
            )),
            (Step::Field(name), _) => Err(format!(
                "{place} is {} and has no field `{name}`; end the path before it",
                kind()
            )),
            (Step::Index(index), Kind::List(entry, length)) => {
                if let Length::Fixed(count) = length
                    && index >= count
                {
                    return Err(format!(
                        "{place} is {} and has no number {index}; numbers go from 0 to {}",
                        kind(),
                        count.saturating_sub(1)
                    ));
                }
                self.kind = entry;
                Ok(())
            }
            (Step::Name(name), Kind::List(entry, _)) => {
                if !self.has_names(entry) {
                    return Err(format!(
                        "nothing says which entry of {place} is called `{name}`: no list of texts stands beside it; give its number, from 0"
                    ));
                }
                self.kind = entry;
                Ok(())
            }
            (Step::All, Kind::List(entry, _)) => {
                self.kind = entry;
                Ok(())
            }
            (_, _) => Err(format!(
                "{place} is {}, not a list; leave the brackets out",
                kind()
            )),
        }
    }

    /// Into a field of a record.
    fn field(&mut self, name: &str, record: usize) -> Result<(), String> {
        let record = &self.definition.records[record];
        let Some(field) = record.fields.iter().find(|field| field.name == name) else {
            let names = record.fields.iter().map(|field| field.name.as_str());
            return Err(format!(
                "{} has no field `{name}`, it has {}; {}",
                record.name,
                Fields(record),
                did_you_mean(name, names)
            ));
        };
        self.enclosing.push(record);
        self.kind = &field.kind;
        Ok(())
    }

    /// Whether entries of a list have names: in a field of their own, or in a list of texts beside it or what it lies in.
    fn has_names(&self, entry: &Kind) -> bool {
        let names = |f: &Field| matches!(&f.kind, Kind::List(text, _) if **text == Kind::Text);
        let named = |f: &Field| f.kind == Kind::Text && NAMES.contains(&f.name.as_str());
        let own = matches!(*entry, Kind::Record(number) if self.definition.records[number].fields.iter().any(named));
        own || (self.enclosing.iter()).any(|record| record.fields.iter().any(names))
    }
}

/// Whether a path that leads to `kind` leads to what is wanted.
fn check_end(
    definition: &Definition,
    steps: &[Step],
    wanted: Wanted,
    kind: &Kind,
) -> Result<(), String> {
    let path = Written(steps);
    match (wanted, kind) {
        (
            Wanted::Number,
            Kind::Scalar(Scalar::Float(_) | Scalar::Signed(_) | Scalar::Unsigned(_)),
        )
        | (
            Wanted::Time,
            Kind::Scalar(
                Scalar::Float(_) | Scalar::Signed(_) | Scalar::Unsigned(_) | Scalar::Stamp { .. },
            ),
        ) => Ok(()),
        (Wanted::Stamp, Kind::Scalar(Scalar::Stamp { .. })) => Ok(()),
        (Wanted::Time | Wanted::Stamp, Kind::Record(number))
            if is_stamp(&definition.records[*number]) =>
        {
            Ok(())
        }
        (_, Kind::Record(number)) => Err(format!(
            "`{path}` is {}, not a number; its fields are {}",
            as_written(definition, kind),
            Fields(&definition.records[*number])
        )),
        (_, Kind::List(..)) => Err(format!(
            "`{path}` is {}, a list; say which: {path}[0], or {path}[*] for all joints",
            as_written(definition, kind)
        )),
        _ => Err(format!(
            "`{path}` is {}, not a number; choose another field",
            as_written(definition, kind)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::bag::joint_state::Encoding;

    #[test]
    fn paths_are_read_to_their_steps() {
        let source = Source::parse("/a/b:interface_values[left.elbow].values[2]", false).unwrap();
        assert_eq!(source.topic, "/a/b");
        assert_eq!(
            source.steps,
            [
                Step::Field("interface_values".into()),
                Step::Name("left.elbow".into()),
                Step::Field("values".into()),
                Step::Index(2)
            ]
        );
        assert_eq!(
            Written(&source.steps).to_string(),
            "interface_values[left.elbow].values[2]"
        );
        for (text, all, words) in [
            ("/a:", false, "no field behind the colon"),
            ("/a:b..c", false, "a field without a name"),
            ("/a:b[2", false, "do not close"),
            ("/a:b[]", false, "empty brackets"),
            ("/a:b[2]c", false, "do not close"),
            ("/a:b[*]", false, "stands for every joint"),
            ("/a:b", true, "no [*]"),
            ("/a:b[*].c[*]", true, "more than once"),
            ("/a:b[99999999999999999999999]", false, "too large"),
        ] {
            let problem = Source::parse(text, all).unwrap_err();
            assert!(problem.contains(words), "{text}: {problem}");
        }
    }

    #[test]
    fn paths_that_lead_nowhere_are_told_from_the_definition() {
        let text = "string[] names\nJoint[2] joints\nbool on\nstring word\nfloat64[7] q\nTime stamp\nuint64 ticks\nOther other\n\
                    ===\nMSG: p/Joint\nfloat64[] values\n===\nMSG: p/Time\nint32 sec\nuint32 nanosec\n===\nMSG: p/Other\nfloat64[] values";
        let definition = Definition::parse("p/State", text, Encoding::Cdr).unwrap();
        let check = |path: &str, wanted| {
            let source = Source::parse(&format!("/s:{path}"), path.contains('*')).unwrap();
            check(&definition, &source.steps, wanted)
        };
        for good in [
            "q[6]",
            "q[*]",
            "joints[1].values[9]",
            "joints[a].values[0]",
            "q[elbow]",
            "ticks",
        ] {
            check(good, Wanted::Number).unwrap();
        }
        for good in ["stamp", "ticks", "q[0]", "stamp.sec"] {
            check(good, Wanted::Time).unwrap();
        }
        for (bad, words) in [
            (
                "p",
                "p/State has no field `p`, it has `names` (string[]), `joints` (Joint[2])",
            ),
            (
                "q[7]",
                "`q` is float64[7] and has no number 7; numbers go from 0 to 6",
            ),
            ("q", "`q` is float64[7], a list; say which: q[0], or q[*]"),
            (
                "joints.values[0]",
                "`joints` is p/Joint[2], a list; say whose `values`",
            ),
            (
                "joints[0]",
                "is p/Joint, not a number; its fields are `values`",
            ),
            ("on", "`on` is bool, not a number"),
            ("word", "`word` is string, not a number"),
            ("word[0]", "`word` is string, not a list"),
            ("ticks.a", "`ticks` is uint64 and has no field `a`"),
            ("stamp", "is p/Time, not a number"),
        ] {
            let problem = check(bad, Wanted::Number).unwrap_err();
            assert!(problem.contains(words), "{bad}: {problem}");
        }
        assert!(
            check("other", Wanted::Time)
                .unwrap_err()
                .contains("p/Other")
        );
    }

    #[test]
    fn a_name_leads_nowhere_where_messages_hold_no_names() {
        let bare = Definition::parse("p/S", "float64[] q", Encoding::Cdr).unwrap();
        let source = Source::parse("/s:q[elbow]", false).unwrap();
        let problem = check(&bare, &source.steps, Wanted::Number).unwrap_err();
        assert!(
            problem.contains("is called `elbow`: no list of texts"),
            "{problem}"
        );
    }
}
