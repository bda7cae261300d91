//! Message definitions as text (`ros2msg`, `ros1msg`): what a message of a type consists of.
//!
//! The text of a type comes first; the types it uses follow, each behind a line of `=` and a line `MSG: package/Name`. Constants, default
//! values and comments say nothing of the bytes and are skipped. Types that never change and that recorders leave out are known here too:
//! `Time`, `Duration`, `Header`, and a few that carry joints in bags without definitions.

use super::joint_state::Encoding;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Longest text of a definition, bytes.
pub(super) const MAX_TEXT: usize = 1 << 20;
/// Deepest nesting of types.
const MAX_DEPTH: usize = 32;

/// A number of one size, and what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    Bool,
    Signed(usize),
    Unsigned(usize),
    Float(usize),
    /// Two 32-bit numbers, seconds and nanoseconds, of ROS 1: `time`, or `duration`, which is signed.
    Stamp {
        signed: bool,
    },
}

impl Scalar {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Bool => 1,
            Self::Signed(n) | Self::Unsigned(n) | Self::Float(n) => n,
            Self::Stamp { .. } => 8,
        }
    }

    fn of(name: &str, encoding: Encoding) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "int8" => Self::Signed(1),
            "int16" => Self::Signed(2),
            "int32" => Self::Signed(4),
            "int64" => Self::Signed(8),
            "uint8" | "char" => Self::Unsigned(1),
            "byte" if encoding == Encoding::Cdr => Self::Unsigned(1),
            "byte" => Self::Signed(1),
            "uint16" => Self::Unsigned(2),
            "uint32" => Self::Unsigned(4),
            "uint64" => Self::Unsigned(8),
            "float32" => Self::Float(4),
            "float64" => Self::Float(8),
            "time" if encoding == Encoding::Ros1 => Self::Stamp { signed: false },
            "duration" if encoding == Encoding::Ros1 => Self::Stamp { signed: true },
            _ => return None,
        })
    }
}

/// How many entries a list has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Length {
    Fixed(usize),
    /// The message says it.
    Counted,
}

/// What a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    Text,
    WideText,
    /// Number of a [`Record`].
    Record(usize),
    List(Box<Kind>, Length),
}

/// A field of a type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// The type as it is written.
    pub(super) written: String,
}

/// A type that consists of fields.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Record {
    pub(super) name: String,
    pub(super) fields: Vec<Field>,
    /// Fewest bytes that a message of it takes, padding left out; 0: it never takes any.
    pub(super) least: usize,
}

/// All types of a message; the first record is its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Definition {
    pub(super) records: Vec<Record>,
    pub(super) encoding: Encoding,
}

/// Texts of types that are known without a definition.
fn well_known(name: &str, encoding: Encoding) -> Option<&'static str> {
    Some(match (name, encoding) {
        ("builtin_interfaces/Time" | "builtin_interfaces/Duration", Encoding::Cdr) => {
            "int32 sec\nuint32 nanosec"
        }
        ("std_msgs/Header", Encoding::Cdr) => "builtin_interfaces/Time stamp\nstring frame_id",
        ("std_msgs/Header", Encoding::Ros1) => "uint32 seq\ntime stamp\nstring frame_id",
        ("std_msgs/Float64MultiArray", _) => "MultiArrayLayout layout\nfloat64[] data",
        ("std_msgs/Float32MultiArray", _) => "MultiArrayLayout layout\nfloat32[] data",
        ("std_msgs/MultiArrayLayout", _) => "MultiArrayDimension[] dim\nuint32 data_offset",
        ("std_msgs/MultiArrayDimension", _) => "string label\nuint32 size\nuint32 stride",
        ("sensor_msgs/JointState", _) => {
            "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
        }
        ("control_msgs/DynamicJointState", Encoding::Cdr) => {
            "Header header\nstring[] joint_names\nInterfaceValue[] interface_values"
        }
        ("control_msgs/InterfaceValue", Encoding::Cdr) => {
            "string[] interface_names\nfloat64[] values"
        }
        _ => return None,
    })
}

/// `package/Name` of `package/msg/Name`.
fn short(name: &str) -> String {
    match name.split_once("/msg/") {
        Some((package, name)) => format!("{package}/{name}"),
        None => name.to_owned(),
    }
}

impl Definition {
    /// Reads the text of the type `name`; an empty text will do where the type is known.
    ///
    /// # Errors
    /// What does not fit, in words: the line, the type that is missing, what contains itself.
    pub(super) fn parse(name: &str, text: &str, encoding: Encoding) -> Result<Self, String> {
        if text.len() > MAX_TEXT {
            return Err(format!(
                "its text has {} bytes, the limit is {MAX_TEXT}",
                text.len()
            ));
        }
        let mut texts: BTreeMap<String, String> = BTreeMap::new();
        let (mut current, mut at_head) = (Some(short(name)), false);
        for line in text.lines() {
            let trimmed = line.trim();
            if trimmed.len() >= 3 && trimmed.bytes().all(|b| b == b'=') {
                at_head = true;
                continue;
            }
            if let (true, Some(name)) = (at_head, trimmed.strip_prefix("MSG:")) {
                // Some writers repeat a type for every use.
                current = Some(short(name.trim())).filter(|name| !texts.contains_key(name));
                at_head = false;
                if let Some(current) = &current {
                    texts.insert(current.clone(), String::new());
                }
                continue;
            }
            if let Some(current) = current.as_ref().filter(|_| !trimmed.is_empty()) {
                let text = texts.entry(current.clone()).or_default();
                text.push_str(trimmed);
                text.push('\n');
            }
        }
        let mut parser = Parser {
            texts,
            encoding,
            records: Vec::new(),
            numbers: BTreeMap::new(),
            open: Vec::new(),
        };
        parser.record(&short(name))?;
        Ok(Self {
            records: parser.records,
            encoding,
        })
    }

    /// Fewest bytes of one value.
    pub(super) fn least(&self, kind: &Kind) -> usize {
        least(&self.records, kind)
    }
}

fn least(records: &[Record], kind: &Kind) -> usize {
    match kind {
        Kind::Scalar(scalar) => scalar.bytes(),
        Kind::Text | Kind::WideText | Kind::List(_, Length::Counted) => 4,
        Kind::Record(number) => records[*number].least,
        Kind::List(entry, Length::Fixed(count)) => least(records, entry).saturating_mul(*count),
    }
}

struct Parser {
    texts: BTreeMap<String, String>,
    encoding: Encoding,
    records: Vec<Record>,
    numbers: BTreeMap<String, usize>,
    /// Types that are being read, outermost first.
    open: Vec<String>,
}

impl Parser {
    /// The number of a type, read with all types that it uses.
    fn record(&mut self, name: &str) -> Result<usize, String> {
        if self.open.iter().any(|open| open == name) {
            return Err(format!("type `{name}` contains itself"));
        }
        if let Some(&number) = self.numbers.get(name) {
            return Ok(number);
        }
        if self.open.len() == MAX_DEPTH {
            return Err(format!("types are nested deeper than {MAX_DEPTH}"));
        }
        let text = match self.texts.get(name) {
            Some(text) => text.clone(),
            None => match well_known(name, self.encoding) {
                Some(text) => text.to_owned(),
                None => return Err(format!("it lacks the definition of type `{name}`")),
            },
        };
        let number = self.records.len();
        self.records.push(Record::default());
        self.open.push(name.to_owned());
        let mut fields: Vec<Field> = Vec::new();
        let mut names = BTreeSet::new();
        for line in text.lines() {
            if let Some(field) = self.field(name, line)? {
                if !names.insert(field.name.clone()) {
                    return Err(format!("type `{name}` has two fields `{}`", field.name));
                }
                fields.push(field);
            }
        }
        if fields.is_empty() && self.encoding == Encoding::Cdr {
            // ROS 2 writes one byte for a type without fields.
            fields.push(Field {
                name: "structure_needs_at_least_one_member".into(),
                kind: Kind::Scalar(Scalar::Unsigned(1)),
                written: "uint8".into(),
            });
        }
        self.open.pop();
        let least = (fields.iter()).fold(0_usize, |sum, field| {
            sum.saturating_add(least(&self.records, &field.kind))
        });
        self.records[number] = Record {
            name: name.to_owned(),
            fields,
            least,
        };
        self.numbers.insert(name.to_owned(), number);
        Ok(number)
    }

    /// One line: a field, or nothing (a constant, a comment).
    fn field(&mut self, record: &str, line: &str) -> Result<Option<Field>, String> {
        if line.is_empty() || line.starts_with('#') {
            return Ok(None);
        }
        let broken = || format!("type `{record}` has the line `{}`", shown(line));
        let (written, rest) = line.split_once(char::is_whitespace).ok_or_else(broken)?;
        let rest = rest.trim_start();
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        let (name, rest) = rest.split_at(end.unwrap_or(rest.len()));
        if rest.trim_start().starts_with('=') {
            return Ok(None);
        }
        if name.is_empty()
            || !rest.starts_with(|c: char| c.is_whitespace() || c == '#') && !rest.is_empty()
        {
            return Err(broken());
        }
        let (entry, length) = match written.split_once('[') {
            None => (written, None),
            Some((entry, length)) => {
                let length = length.strip_suffix(']').ok_or_else(broken)?;
                let length = match length {
                    "" => Length::Counted,
                    bounded if bounded.starts_with("<=") => Length::Counted,
                    number => Length::Fixed(number.parse().map_err(|_| broken())?),
                };
                (entry, Some(length))
            }
        };
        let kind = self.kind(record, entry)?;
        let kind = match length {
            None => kind,
            Some(length) => Kind::List(Box::new(kind), length),
        };
        Ok(Some(Field {
            name: name.to_owned(),
            kind,
            written: written.to_owned(),
        }))
    }

    fn kind(&mut self, record: &str, entry: &str) -> Result<Kind, String> {
        if let Some(scalar) = Scalar::of(entry, self.encoding) {
            return Ok(Kind::Scalar(scalar));
        }
        match entry.split_once("<=").map_or(entry, |(text, _)| text) {
            "string" => return Ok(Kind::Text),
            "wstring" => return Ok(Kind::WideText),
            _ => {}
        }
        let name = match entry.contains('/') {
            true => short(entry),
            false if entry == "Header" => "std_msgs/Header".to_owned(),
            false => match record.split_once('/') {
                Some((package, _)) => format!("{package}/{entry}"),
                None => entry.to_owned(),
            },
        };
        Ok(Kind::Record(self.record(&name)?))
    }
}

/// Text of a file as it may stand in a message.
fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(60).collect()
}

/// The fields of a record in words: `q` (float64[7]), …
pub(super) struct Fields<'a>(pub(super) &'a Record);

impl fmt::Display for Fields<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 40;
        for (number, field) in self.0.fields.iter().take(SHOWN).enumerate() {
            let comma = if number == 0 { "" } else { ", " };
            write!(
                f,
                "{comma}`{}` ({})",
                shown(&field.name),
                shown(&field.written)
            )?;
        }
        match self.0.fields.len().saturating_sub(SHOWN) {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Definition, String> {
        Definition::parse("my_msgs/msg/Arm", text, Encoding::Cdr)
    }

    #[test]
    fn fields_are_told_from_constants_defaults_and_comments() {
        let definition = parse(
            "# an arm\nuint8 IDLE=0\nstring WORD = \"a # b\"\n\nbool on true\nint32[] counts [1, 2] # two\nstring<=10 mode \"a=b\"\n\
             float64[<=3] bounded\nJoint[2] joints\nbuiltin_interfaces/Time stamp\n\
             ================================================================================\nMSG: my_msgs/msg/Joint\nfloat32 q 0.5\n",
        )
        .unwrap();
        let fields: Vec<&str> = (definition.records[0].fields.iter())
            .map(|field| field.name.as_str())
            .collect();
        assert_eq!(
            fields,
            ["on", "counts", "mode", "bounded", "joints", "stamp"]
        );
        assert_eq!(definition.records[0].least, 1 + 4 + 4 + 4 + 8 + 8);
        let Kind::List(joint, Length::Fixed(2)) = &definition.records[0].fields[4].kind else {
            panic!("{definition:?}");
        };
        let Kind::Record(joint) = **joint else {
            panic!("{definition:?}");
        };
        assert_eq!(definition.records[joint].name, "my_msgs/Joint");
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (text, words) in [
            ("Arm again", "`my_msgs/Arm` contains itself"),
            (
                "Joint[2] joints",
                "lacks the definition of type `my_msgs/Joint`",
            ),
            ("float64[x] q", "has the line `float64[x] q`"),
            ("float64[2", "has the line"),
            ("float64 q\nint8 q", "two fields `q`"),
            ("float64 q*", "has the line"),
            (
                "B b\n===\nMSG: my_msgs/B\nC c\n===\nMSG: my_msgs/C\nB b",
                "`my_msgs/B` contains itself",
            ),
        ] {
            let problem = parse(text).unwrap_err();
            assert!(problem.contains(words), "{text}: {problem}");
        }
        let mut deep = "T1 a\n".to_owned();
        for i in 1..40 {
            deep += &format!("===\nMSG: my_msgs/T{i}\nT{} a\n", i + 1);
        }
        assert!(parse(&deep).unwrap_err().contains("deeper than 32"));
    }

    #[test]
    fn sizes_that_overflow_saturate() {
        let huge = format!("A[{0}] a\n===\nMSG: my_msgs/A\nfloat64[{0}] b", usize::MAX);
        assert_eq!(parse(&huge).unwrap().records[0].least, usize::MAX);
    }
}
