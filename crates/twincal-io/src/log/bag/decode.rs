//! Messages by their definition: CDR as ROS 2 writes it (XCDR1, both byte orders) and the form of ROS 1.
//!
//! Two ways through a message. The slow one makes a tree along the paths that are asked, finds the places that they mean, and gives a
//! [`Plan`]. The quick one walks by the plan, keeps the wanted numbers and skips the rest; where a name or a length on which the plan
//! rests has changed it says so, and the slow way is gone again.
//!
//! Nothing is allocated for what a message claims: a list has to fit into the bytes that are left first.

use super::definition::{Definition, Kind, Length, Scalar};
use super::joint_state::{Cursor, begin};
use super::path::{NAMES, Step};
use super::value::{At, Check, Number, Value};

/// Longest list of names or records on the way to a number.
const MAX_LIST: usize = 4096;
/// Largest message of a mapped topic, bytes.
pub(super) const MAX_MESSAGE: usize = 16 << 20;

/// What is wanted of a part of a message.
#[derive(Debug, Clone, PartialEq)]
enum Want {
    /// A number, for these places of the result.
    Number(Vec<usize>),
    Text(String),
    /// Fields in their order.
    Record(Vec<(usize, Want)>),
    /// Entries in their order, and how many there have to be.
    List(Vec<(usize, Want)>, Option<usize>),
}

/// What is read of every message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    root: Want,
    numbers: usize,
}

/// How a quick walk ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Walked {
    Whole,
    /// Names or lengths are not those of the plan.
    Changed,
}

impl Plan {
    /// A plan for these places; what cannot go together (a number that is a record elsewhere) does not come from one tree.
    pub(super) fn new<'a>(
        definition: &Definition,
        places: &[Vec<At>],
        checks: impl Iterator<Item = &'a (Vec<At>, Check)>,
    ) -> Self {
        let mut root = Want::Record(Vec::new());
        let start = Kind::Record(0);
        for (slot, at) in places.iter().enumerate() {
            let leaf = want_at(definition, &start, &mut root, at);
            match leaf {
                Some(Want::Number(slots)) => slots.push(slot),
                Some(leaf) => *leaf = Want::Number(vec![slot]),
                None => {}
            }
        }
        for (at, check) in checks {
            let leaf = want_at(definition, &start, &mut root, at);
            match (leaf, check) {
                (Some(leaf), Check::Text(text)) => *leaf = Want::Text(text.clone()),
                (Some(Want::List(_, length)), Check::Length(wanted)) => *length = Some(*wanted),
                _ => {}
            }
        }
        Self {
            root,
            numbers: places.len(),
        }
    }
}

/// The want at a place, made with all on the way where it is not there yet.
fn want_at<'w>(
    definition: &Definition,
    kind: &Kind,
    want: &'w mut Want,
    at: &[At],
) -> Option<&'w mut Want> {
    let Some((&step, rest)) = at.split_first() else {
        return Some(want);
    };
    let inner = match kind {
        Kind::Record(number) => &definition.records[*number].fields.get(step)?.kind,
        Kind::List(entry, _) => entry,
        _ => return None,
    };
    let (Want::Record(parts) | Want::List(parts, _)) = want else {
        return None;
    };
    let place = match parts.binary_search_by_key(&step, |(number, _)| *number) {
        Ok(place) => place,
        Err(place) => {
            let empty = match inner {
                Kind::Record(_) => Want::Record(Vec::new()),
                Kind::List(..) => Want::List(Vec::new(), None),
                _ => Want::Number(Vec::new()),
            };
            parts.insert(place, (step, empty));
            place
        }
    };
    want_at(definition, inner, &mut parts[place].1, rest)
}

/// Fields of a record or entries of a list.
struct Entries<F> {
    /// Kind of each.
    kind: F,
    count: usize,
}

/// Reads one message.
struct Reader<'a, 'd> {
    cursor: Cursor<'a>,
    definition: &'d Definition,
}

type Outcome<T> = Result<T, String>;

impl<'a, 'd> Reader<'a, 'd> {
    fn new(definition: &'d Definition, message: &'a [u8]) -> Outcome<Self> {
        if message.len() > MAX_MESSAGE {
            return Err(format!(
                "it has {} bytes, the limit for mapped topics is {MAX_MESSAGE}",
                message.len()
            ));
        }
        if definition.encoding == super::joint_state::Encoding::Cdr
            && let &[0, id @ 2..=11, ..] = message
        {
            return Err(format!(
                "it is written in XCDR2 or with parameter lists (encapsulation 00 {id:02x}); messages of mapped topics are read in plain CDR (00 00, 00 01): record with the default encoding of ROS 2"
            ));
        }
        Ok(Self {
            cursor: begin(definition.encoding, message)?,
            definition,
        })
    }

    fn end(&self) -> String {
        format!(
            "it reaches past its end ({} bytes)",
            self.cursor.bytes.len()
        )
    }

    fn left(&self) -> usize {
        self.cursor.bytes.len().saturating_sub(self.cursor.at)
    }

    /// Number of entries of a list that fits into what is left.
    fn count(&mut self, entry: &Kind, length: Length) -> Outcome<usize> {
        let count = match length {
            Length::Fixed(count) => count,
            Length::Counted => self.cursor.u32().ok_or_else(|| self.end())? as usize,
        };
        let least = self.definition.least(entry).saturating_mul(count);
        if least > self.left() {
            return Err(format!(
                "it claims a list of {count} entries in the {} bytes that are left of it",
                self.left()
            ));
        }
        Ok(count)
    }

    fn skip(&mut self, kind: &Kind) -> Outcome<()> {
        match kind {
            Kind::Scalar(scalar) => {
                self.cursor.align(scalar.bytes());
                self.cursor.take(scalar.bytes()).ok_or_else(|| self.end())?;
            }
            Kind::Text => {
                self.cursor.string().ok_or_else(|| self.end())?;
            }
            Kind::WideText => {
                return Err("a wstring stands before the wanted fields, and its size is not the same with all writers; use string".into());
            }
            Kind::Record(number) => {
                let definition = self.definition;
                let record = &definition.records[*number];
                if record.least > 0 {
                    for field in &record.fields {
                        self.skip(&field.kind)?;
                    }
                }
            }
            Kind::List(entry, length) => {
                let count = self.count(entry, *length)?;
                match &**entry {
                    Kind::Scalar(scalar) => self.skip_numbers(*scalar, count)?,
                    // Entries that take no bytes could be any number.
                    entry if self.definition.least(entry) == 0 => {}
                    entry => {
                        for _ in 0..count {
                            self.skip(entry)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn skip_numbers(&mut self, scalar: Scalar, count: usize) -> Outcome<()> {
        if count > 0 {
            self.cursor.align(scalar.bytes());
        }
        let bytes = count.checked_mul(scalar.bytes());
        let taken = bytes.and_then(|bytes| self.cursor.take(bytes));
        taken.map(|_| ()).ok_or_else(|| self.end())
    }

    #[inline]
    fn number(&mut self, scalar: Scalar) -> Outcome<Number> {
        self.cursor.align(scalar.bytes());
        let big_endian = self.cursor.layout.big_endian;
        let bytes = self.cursor.take(scalar.bytes());
        let bytes = bytes.ok_or_else(|| self.end())?;
        Ok(number(scalar, big_endian, bytes))
    }

    /// A tree along these paths, each the steps that are still to go from here.
    fn value(&mut self, kind: &Kind, paths: &[&[Step]]) -> Outcome<Value> {
        match kind {
            Kind::Text => {
                let text = self.cursor.string().ok_or_else(|| self.end())?;
                Ok(Value::Text(String::from_utf8_lossy(text).into_owned()))
            }
            Kind::Record(number) => self.record(*number, paths),
            Kind::List(entry, length) => {
                let count = self.count(entry, *length)?;
                if let Kind::Scalar(scalar) = **entry {
                    self.skip_numbers(scalar, count)?;
                    return Ok(Value::Numbers(count));
                }
                self.list(entry, count, paths)
            }
            other => {
                self.skip(other)?;
                Ok(Value::Other)
            }
        }
    }

    /// The fields of a record that the paths go through or that hold names.
    fn record(&mut self, number: usize, paths: &[&[Step]]) -> Outcome<Value> {
        let definition = self.definition;
        let record = &definition.records[number];
        let mut fields = Vec::with_capacity(record.fields.len());
        for field in &record.fields {
            let further: Vec<&[Step]> = (paths.iter())
                .filter_map(|path| match path.split_first() {
                    Some((Step::Field(name), rest)) if *name == field.name => Some(rest),
                    _ => None,
                })
                .collect();
            let says_names = match &field.kind {
                Kind::Text => NAMES.contains(&field.name.as_str()),
                Kind::List(entry, _) => **entry == Kind::Text,
                _ => false,
            };
            let value = if says_names || !further.is_empty() {
                self.value(&field.kind, &further)?
            } else {
                self.skip(&field.kind)?;
                Value::Other
            };
            fields.push((field.name.clone(), value));
        }
        Ok(Value::Record(fields))
    }

    /// A list of `count` entries that are no numbers.
    fn list(&mut self, entry: &Kind, count: usize, paths: &[&[Step]]) -> Outcome<Value> {
        if count > MAX_LIST {
            return Err(format!(
                "it has a list of {count} entries on the way to a mapped number, the limit is {MAX_LIST}"
            ));
        }
        let further: Vec<&[Step]> = (paths.iter())
            .filter_map(|path| match path.split_first() {
                Some((Step::Field(_), _)) | None => None,
                Some((_, rest)) => Some(rest),
            })
            .collect();
        let mut entries = Vec::with_capacity(count);
        for _ in 0..count {
            entries.push(self.value(entry, &further)?);
        }
        if *entry != Kind::Text {
            return Ok(Value::List(entries));
        }
        let texts = entries.into_iter().map(|entry| match entry {
            Value::Text(text) => text,
            _ => String::new(),
        });
        Ok(Value::Texts(texts.collect()))
    }

    /// Follows the plan; `last` where nothing is wanted behind this part.
    fn walk(
        &mut self,
        kind: &Kind,
        want: &Want,
        last: bool,
        out: &mut [Number],
    ) -> Outcome<Walked> {
        match (kind, want) {
            (Kind::Scalar(scalar), Want::Number(slots)) => {
                let number = self.number(*scalar)?;
                for &slot in slots {
                    out[slot] = number;
                }
            }
            (Kind::Text, Want::Text(expected)) => {
                let text = self.cursor.string().ok_or_else(|| self.end())?;
                if text != expected.as_bytes() {
                    return Ok(Walked::Changed);
                }
            }
            (Kind::Record(number), Want::Record(parts)) => {
                let definition = self.definition;
                let fields = &definition.records[*number].fields;
                let entries = Entries {
                    kind: |at: usize| &fields[at].kind,
                    count: fields.len(),
                };
                return self.walk_parts(&entries, parts, last, out);
            }
            (Kind::List(entry, length), Want::List(parts, expected)) => {
                let count = self.count(entry, *length)?;
                let reach = parts.last().map_or(0, |(number, _)| number + 1);
                if reach > count || expected.is_some_and(|expected| expected != count) {
                    return Ok(Walked::Changed);
                }
                if let Kind::Scalar(scalar) = **entry {
                    return self.pick(scalar, count, parts, out);
                }
                // Entries that take no bytes could be any number: none is passed over behind the parts.
                let takes_bytes = self.definition.least(entry) > 0;
                let entries = Entries {
                    kind: |_: usize| &**entry,
                    count: if takes_bytes { count } else { 0 },
                };
                return self.walk_parts(&entries, parts, last, out);
            }
            (kind, _) => self.skip(kind)?,
        }
        Ok(Walked::Whole)
    }

    /// Follows the parts of a record or a list in their order, and passes over what stands between and behind them.
    fn walk_parts<'k>(
        &mut self,
        entries: &Entries<impl Fn(usize) -> &'k Kind>,
        parts: &[(usize, Want)],
        last: bool,
        out: &mut [Number],
    ) -> Outcome<Walked> {
        let mut next = 0;
        for (part, (wanted, want)) in parts.iter().enumerate() {
            for at in next..*wanted {
                self.skip((entries.kind)(at))?;
            }
            next = wanted + 1;
            let last = last && part + 1 == parts.len();
            if self.walk((entries.kind)(*wanted), want, last, out)? == Walked::Changed {
                return Ok(Walked::Changed);
            }
        }
        if !last {
            for at in next..entries.count {
                self.skip((entries.kind)(at))?;
            }
        }
        Ok(Walked::Whole)
    }

    /// Numbers of a list of numbers.
    fn pick(
        &mut self,
        scalar: Scalar,
        count: usize,
        parts: &[(usize, Want)],
        out: &mut [Number],
    ) -> Outcome<Walked> {
        if count > 0 {
            self.cursor.align(scalar.bytes());
        }
        let (size, big_endian) = (scalar.bytes(), self.cursor.layout.big_endian);
        let bytes = count.checked_mul(size);
        let bytes = bytes.and_then(|bytes| self.cursor.take(bytes));
        let bytes = bytes.ok_or_else(|| self.end())?;
        for (wanted, want) in parts {
            let Want::Number(slots) = want else { continue };
            let value = number(
                scalar,
                big_endian,
                &bytes[wanted * size..(wanted + 1) * size],
            );
            for &slot in slots {
                out[slot] = value;
            }
        }
        Ok(Walked::Whole)
    }
}

/// A number from its bytes.
#[inline]
fn number(scalar: Scalar, big_endian: bool, bytes: &[u8]) -> Number {
    let mut eight = [0; 8];
    let n = bytes.len().min(8);
    eight[..n].copy_from_slice(&bytes[..n]);
    if big_endian {
        eight[..n].reverse();
    }
    let bits = u64::from_le_bytes(eight);
    match scalar {
        Scalar::Float(4) => Number::Float(f64::from(f32::from_bits(bits as u32))),
        Scalar::Float(_) => Number::Float(f64::from_bits(bits)),
        Scalar::Bool => Number::Whole(i64::from(bits != 0)),
        Scalar::Unsigned(_) => match i64::try_from(bits) {
            Ok(whole) => Number::Whole(whole),
            Err(_) => Number::Float(bits as f64),
        },
        // Shifted up and back down, the sign comes along.
        Scalar::Signed(n) => {
            let unused = 64 - 8 * n as u32;
            Number::Whole((bits << unused).cast_signed() >> unused)
        }
        Scalar::Stamp { signed } => {
            let (seconds, nanoseconds) = (bits as u32, (bits >> 32) as u32);
            let part = |bits: u32| match signed {
                true => i64::from(bits.cast_signed()),
                false => i64::from(bits),
            };
            Number::Stamp(part(seconds) * 1_000_000_000 + part(nanoseconds))
        }
    }
}

/// The tree of a message along these paths.
///
/// # Errors
/// What does not fit, in words.
pub(super) fn tree(
    definition: &Definition,
    message: &[u8],
    paths: &[&[Step]],
) -> Result<Value, String> {
    Reader::new(definition, message)?.value(&Kind::Record(0), paths)
}

/// Reads the numbers of a plan into `out`.
///
/// # Errors
/// What does not fit, in words.
pub(super) fn read(
    definition: &Definition,
    message: &[u8],
    plan: &Plan,
    out: &mut Vec<Number>,
) -> Result<Walked, String> {
    out.clear();
    out.resize(plan.numbers, Number::Float(f64::NAN));
    Reader::new(definition, message)?.walk(&Kind::Record(0), &plan.root, true, out)
}
