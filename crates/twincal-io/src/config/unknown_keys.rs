//! Keys that the schema does not have, each with its place in the file and the nearest known name.

use crate::error::{Error, Place};
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};
use twincal::robot::nearest_names;

/// The first key of `table` that `schema` does not know, in the order of the file.
pub(super) fn first_unknown(
    table: &DeTable<'_>,
    schema: &Value,
    file: &str,
    text: &str,
) -> Option<Error> {
    let mut found = Vec::new();
    walk(table, schema, schema, "", &mut found);
    let (offset, path, key, known) = found.into_iter().min_by_key(|unknown| unknown.0)?;
    let place = Place::of_offset(file, text.as_bytes(), offset);
    let inside = if path.is_empty() {
        String::new()
    } else {
        format!(" in [{path}]")
    };
    let remedy = match nearest_names(&key, known.iter().map(String::as_str)).first() {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("known keys: {}", known.join(", ")),
    };
    Some(Error::content(
        place,
        format!("unknown key `{key}`{inside}"),
        remedy,
    ))
}

type Unknown = (usize, String, String, Vec<String>);

fn walk(table: &DeTable<'_>, schema: &Value, root: &Value, path: &str, found: &mut Vec<Unknown>) {
    let Some(properties) = properties(schema, root) else {
        return;
    };
    for (key, value) in table.iter() {
        let name: &str = key.get_ref();
        match properties.iter().find(|(known, _)| *known == name) {
            None => {
                let known = properties
                    .iter()
                    .map(|(known, _)| (*known).to_owned())
                    .collect();
                found.push((key.span().start, path.to_owned(), name.to_owned(), known));
            }
            Some((_, inner)) => {
                let inner_path = if path.is_empty() {
                    name.to_owned()
                } else {
                    format!("{path}.{name}")
                };
                descend(value, inner, root, &inner_path, found);
            }
        }
    }
}

fn descend(
    value: &Spanned<DeValue<'_>>,
    schema: &Value,
    root: &Value,
    path: &str,
    found: &mut Vec<Unknown>,
) {
    match value.get_ref() {
        DeValue::Table(table) => walk(table, schema, root, path, found),
        DeValue::Array(values) => {
            if let Some(item) = items(schema, root) {
                for value in values {
                    descend(value, item, root, path, found);
                }
            }
        }
        _ => {}
    }
}

/// Schema of a list's items.
fn items<'a>(schema: &'a Value, root: &'a Value) -> Option<&'a Value> {
    if let Some(target) = referred(schema, root) {
        return items(target, root);
    }
    schema.get("items").or_else(|| {
        let alternatives = schema.get("anyOf").and_then(Value::as_array)?;
        alternatives.iter().find_map(|inner| items(inner, root))
    })
}

/// Known keys of a table: `None` where any key is allowed (a map by joint name).
fn properties<'a>(schema: &'a Value, root: &'a Value) -> Option<Vec<(&'a str, &'a Value)>> {
    let mut all = Vec::new();
    collect(schema, root, &mut all);
    if all.is_empty() { None } else { Some(all) }
}

/// What a `$ref` points to.
fn referred<'a>(schema: &Value, root: &'a Value) -> Option<&'a Value> {
    let pointer = schema.get("$ref")?.as_str()?.strip_prefix('#')?;
    root.pointer(pointer)
}

fn collect<'a>(schema: &'a Value, root: &'a Value, all: &mut Vec<(&'a str, &'a Value)>) {
    if let Some(target) = referred(schema, root) {
        collect(target, root, all);
    }
    for alternative in ["anyOf", "oneOf", "allOf"] {
        for inner in schema
            .get(alternative)
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
        {
            collect(inner, root, all);
        }
    }
    if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
        all.extend(
            properties
                .iter()
                .map(|(name, inner)| (name.as_str(), inner)),
        );
    }
}
