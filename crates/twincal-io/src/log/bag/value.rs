//! One message as a tree, only along the paths that are asked, and the places in it that the paths mean.

use super::path::{NAMES, STAMPS, Step, Written};
use twincal::robot::did_you_mean;
use twincal::words::quoted;

/// A number as it stands in a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Number {
    Float(f64),
    Whole(i64),
    /// Time, ns.
    Stamp(i64),
}

impl Number {
    /// As a value of a channel.
    pub(super) fn value(self) -> f64 {
        match self {
            Self::Float(value) => value,
            Self::Whole(value) | Self::Stamp(value) => value as f64,
        }
    }
}

/// A message, or a part of one.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Number(Number),
    Text(String),
    Texts(Vec<String>),
    /// So many numbers, which are not kept.
    Numbers(usize),
    List(Vec<Value>),
    Record(Vec<(String, Value)>),
    /// Not looked at, or nothing that is wanted.
    Other,
}

/// One step to a place: a field's or an entry's number.
pub(super) type At = usize;

/// What has to hold for a place to be the right one in the next message too.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Check {
    /// The text there.
    Text(String),
    /// The number of entries there.
    Length(usize),
}

/// A place in a message, and why it is that one.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Found {
    pub(super) at: Vec<At>,
    pub(super) checks: Vec<(Vec<At>, Check)>,
    /// How `[*]` was understood, if there is one: true by name, false in the model's order.
    pub(super) by_name: Option<bool>,
}

/// Whose value is looked for, for `[*]`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint<'a> {
    pub(super) number: usize,
    /// All moving joints.
    pub(super) names: &'a [&'a str],
}

impl Value {
    fn len(&self) -> Option<usize> {
        match self {
            Self::Texts(texts) => Some(texts.len()),
            Self::Numbers(count) => Some(*count),
            Self::List(entries) => Some(entries.len()),
            _ => None,
        }
    }

    /// In words, for what is no number.
    fn words(&self) -> &'static str {
        match self {
            Self::Number(_) | Self::Other => "no number",
            Self::Text(_) => "a text",
            Self::Texts(_) | Self::Numbers(_) | Self::List(_) => "a list",
            Self::Record(_) => "an object with fields",
        }
    }

    /// The number at a place of a tree that keeps numbers.
    pub(super) fn number(&self, at: &[At]) -> Result<Number, &'static str> {
        let mut value = self;
        for &step in at {
            let inner = match value {
                Self::Record(fields) => fields.get(step).map(|(_, value)| value),
                Self::List(entries) => entries.get(step),
                _ => None,
            };
            value = inner.ok_or("a list that is too short")?;
        }
        match value {
            Self::Number(number) => Ok(*number),
            other => Err(other.words()),
        }
    }

    /// The tree of a JSON text, numbers kept.
    pub(super) fn of_json(json: serde_json::Value) -> Self {
        use serde_json::Value as Json;
        match json {
            Json::Number(number) => Self::Number(match number.as_i64() {
                Some(whole) => Number::Whole(whole),
                None => Number::Float(number.as_f64().unwrap_or(f64::NAN)),
            }),
            Json::String(text) => Self::Text(text),
            Json::Array(entries) if !entries.is_empty() && entries.iter().all(Json::is_string) => {
                let texts = entries.into_iter().map(|entry| match entry {
                    Json::String(text) => text,
                    _ => String::new(),
                });
                Self::Texts(texts.collect())
            }
            Json::Array(entries) => Self::List(entries.into_iter().map(Self::of_json).collect()),
            Json::Object(fields) => {
                let fields = fields.into_iter();
                Self::Record(
                    fields
                        .map(|(key, value)| (key, Self::of_json(value)))
                        .collect(),
                )
            }
            // What JSON has no number for is often written as null.
            Json::Null => Self::Number(Number::Float(f64::NAN)),
            Json::Bool(_) => Self::Other,
        }
    }
}

/// A record on the way to a place.
struct Enclosing<'a> {
    fields: &'a [(String, Value)],
    at: Vec<At>,
}

/// Follows a path through a message.
///
/// # Errors
/// What is not there, with the number of entries or the names that are, in words with a remedy behind a `;`.
pub(super) fn find(root: &Value, steps: &[Step], joint: Joint<'_>) -> Result<Found, String> {
    let (mut found, mut value) = (Found::default(), root);
    let mut enclosing: Vec<Enclosing<'_>> = Vec::new();
    for (number, step) in steps.iter().enumerate() {
        let before = Written(&steps[..number]);
        if let Step::Field(name) = step {
            let (fields, index) = field(value, name, (before, Written(&steps[..=number])))?;
            enclosing.push(Enclosing {
                fields,
                at: found.at.clone(),
            });
            found.at.push(index);
            value = &fields[index].1;
            continue;
        }
        let Some(length) = value.len() else {
            return Err(format!(
                "`{before}` is {}, not a list; leave the brackets out",
                value.words()
            ));
        };
        let list = List {
            before,
            value,
            length,
            enclosing: &enclosing,
        };
        let index = found.entry(&list, step, joint)?;
        if index >= length {
            return Err(format!(
                "`{}` has {length} entries, the names beside it have more; fix the publisher",
                list.before
            ));
        }
        found.at.push(index);
        value = match value {
            Value::List(entries) => &entries[index],
            _ => &Value::Other,
        };
    }
    Ok(found)
}

/// Fields of a record by name.
type Fields = [(String, Value)];

/// The fields of a record, and the place of one of them; the paths up to the record and to the field are for messages.
fn field<'v>(
    value: &'v Value,
    name: &str,
    (before, path): (Written<'_>, Written<'_>),
) -> Result<(&'v Fields, usize), String> {
    let Value::Record(fields) = value else {
        return Err(format!(
            "`{before}` is {}, it has no field `{name}`; correct the path",
            value.words()
        ));
    };
    let Some(index) = fields.iter().position(|(field, _)| field == name) else {
        let names = fields.iter().map(|(field, _)| field.as_str());
        return Err(format!(
            "there is no field `{path}`; {}",
            did_you_mean(name, names)
        ));
    };
    Ok((fields, index))
}

/// A list on the way to a place.
struct List<'a> {
    /// The path to it.
    before: Written<'a>,
    value: &'a Value,
    length: usize,
    /// The records around it, outermost first.
    enclosing: &'a [Enclosing<'a>],
}

impl Found {
    /// Number of the entry of a list that a step means.
    fn entry(&mut self, list: &List<'_>, step: &Step, joint: Joint<'_>) -> Result<usize, String> {
        let List { before, length, .. } = list;
        match step {
            Step::Index(index) if index >= length => Err(format!(
                "`{before}` has {length} entries, none of number {index} (from 0); correct the path"
            )),
            Step::Index(index) => Ok(*index),
            Step::Name(name) => {
                let (index, check) =
                    named(list.value, &self.at, list.enclosing, |known| known == name)?
                        .ok_or_else(|| unnamed(before, name, list.value, list.enclosing))?;
                self.checks.push(check);
                Ok(index)
            }
            _ => self.entry_of_joint(list, joint),
        }
    }

    /// Number of a joint's entry: by name, or in the model's order where nothing says whose the entries are.
    fn entry_of_joint(&mut self, list: &List<'_>, joint: Joint<'_>) -> Result<usize, String> {
        let List {
            before,
            value,
            length,
            enclosing,
        } = list;
        let own = joint.names[joint.number];
        if let Some((index, check)) = named(value, &self.at, enclosing, |known| known == own)? {
            self.by_name = Some(true);
            self.checks.push(check);
            return Ok(index);
        }
        let anyone = |known: &str| joint.names.contains(&known);
        if !named(value, &self.at, enclosing, anyone).is_ok_and(|one| one.is_none()) {
            return Err(unnamed(before, own, value, enclosing));
        }
        if *length != joint.names.len() {
            return Err(format!(
                "`{before}` has {length} entries, the model has {} moving joints, and nothing says which is whose; write a path per joint: {{ {own} = \"…[number]\" }}",
                joint.names.len()
            ));
        }
        if let Some(names) = other_names(enclosing, *length) {
            return Err(format!(
                "`{before}` has the names {}, and none of them is a joint of the model; write a path per joint: {{ {own} = \"…[name]\" }}",
                quoted(&names)
            ));
        }
        self.by_name = Some(false);
        self.checks.push((self.at.clone(), Check::Length(*length)));
        Ok(joint.number)
    }
}

type Named = (usize, (Vec<At>, Check));

/// The entry whose name `is` the wanted one: its own field `name`, else texts in the nearest record around it.
fn named(
    list: &Value,
    at: &[At],
    enclosing: &[Enclosing<'_>],
    is: impl Fn(&str) -> bool,
) -> Result<Option<Named>, String> {
    if let Value::List(entries) = list {
        for (index, entry) in entries.iter().enumerate() {
            let Value::Record(fields) = entry else { break };
            for (number, (field, value)) in fields.iter().enumerate() {
                let Value::Text(text) = value else { continue };
                if NAMES.contains(&field.as_str()) && is(text) {
                    let place = [at, &[index, number]].concat();
                    return Ok(Some((index, (place, Check::Text(text.clone())))));
                }
            }
        }
    }
    for record in enclosing.iter().rev() {
        let mut found: Option<(usize, usize, &String)> = None;
        for (number, (field, value)) in record.fields.iter().enumerate() {
            let Value::Texts(texts) = value else { continue };
            let Some(index) = texts.iter().position(|text| is(text)) else {
                continue;
            };
            if let Some((other, first, text)) = found
                && first != index
            {
                return Err(format!(
                    "`{text}` is entry {first} of `{}` and entry {index} of `{field}`; give the number instead of the name",
                    record.fields[other].0
                ));
            }
            found = found.or(Some((number, index, &texts[index])));
        }
        if let Some((number, index, text)) = found {
            let place = [&record.at[..], &[number, index]].concat();
            return Ok(Some((index, (place, Check::Text(text.clone())))));
        }
    }
    Ok(None)
}

/// Texts beside a list that seem to say whose its entries are.
fn other_names(enclosing: &[Enclosing<'_>], length: usize) -> Option<Vec<String>> {
    let fields = enclosing.iter().rev().flat_map(|record| record.fields);
    let mut lists = fields.filter_map(|(_, value)| match value {
        Value::Texts(texts) if texts.len() == length => Some(texts),
        _ => None,
    });
    let names = lists.next()?.iter().take(16);
    Some(names.map(|name| clean(name)).collect())
}

fn clean(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

fn unnamed(before: &Written<'_>, name: &str, list: &Value, enclosing: &[Enclosing<'_>]) -> String {
    let mut known: Vec<&str> = Vec::new();
    if let Value::List(entries) = list {
        let fields = entries.iter().filter_map(|entry| match entry {
            Value::Record(fields) => Some(fields),
            _ => None,
        });
        known.extend(fields.flatten().filter_map(|(field, value)| match value {
            Value::Text(text) if NAMES.contains(&field.as_str()) => Some(text.as_str()),
            _ => None,
        }));
    }
    for record in enclosing.iter().rev() {
        for (_, value) in record.fields {
            if let Value::Texts(texts) = value {
                known.extend(texts.iter().map(String::as_str));
            }
        }
    }
    let known: Vec<String> = known.into_iter().take(64).map(clean).collect();
    format!(
        "`{before}` has no entry called `{name}`; {}",
        did_you_mean(name, known.iter().map(String::as_str))
    )
}

/// Seconds and nanoseconds of a point in time that is a record; none for a plain number.
pub(super) fn stamp_parts(root: &Value, at: &[At]) -> Option<[Vec<At>; 2]> {
    let mut value = root;
    for &step in at {
        value = match value {
            Value::Record(fields) => &fields.get(step)?.1,
            Value::List(entries) => entries.get(step)?,
            _ => return None,
        };
    }
    let Value::Record(fields) = value else {
        return None;
    };
    STAMPS.iter().find_map(|names| {
        let mut parts = names.iter().filter_map(|name| {
            let number = fields.iter().position(|(field, _)| field == name)?;
            Some([at, &[number]].concat())
        });
        Some([parts.next()?, parts.next()?])
    })
}
