//! Settings by name: keywords of Python as keys of `twincal.toml`.

use crate::errors::Problem;
use serde_json::{Map, Value};
use twincal::robot::did_you_mean;
use twincal_cli::Failure;
use twincal_io::config::{Config, schema};

/// What messages call the settings.
const NAME: &str = "settings";
/// Tables whose keys are no keywords: the files are arguments, and there is no terminal.
const LEFT_OUT: [&str; 3] = ["output", "log", "columns"];
/// Tables in the order in which a key that several have is looked up; `rate_hz` is that of [signal], `families` those of [library].
const ORDER: [&str; 7] = [
    "signal",
    "library",
    "noise",
    "inference",
    "prior",
    "model",
    "check",
];

/// The config that these keywords, an object of JSON, make. A keyword is a key of a table, or a table with its keys.
pub(crate) fn config(keywords: &str) -> Result<Config, Problem> {
    let internal = |e: String| Problem::Panicked(format!("settings: {e}"));
    let keywords: Map<String, Value> =
        serde_json::from_str(keywords).map_err(|e| internal(e.to_string()))?;
    let schema: Value = serde_json::from_str(&schema()).map_err(|e| internal(e.to_string()))?;
    let mut tables = Map::new();
    for (key, value) in keywords {
        if value.is_null() {
            continue;
        }
        require_toml(&key, &value)?;
        place(&schema, &mut tables, key, value)?;
    }
    let table =
        toml::Table::try_from(Value::Object(tables)).map_err(|e| internal(e.to_string()))?;
    let parsed = Config::parse(NAME, &table.to_string())?;
    // A keyword stands in no file: a message about its range names the key, not a line of text that nobody wrote.
    let mut config = Config::default();
    config.file = parsed.file;
    Ok(config)
}

/// Refuses a value that no twincal.toml can hold: None in a list, a whole number beyond 64 bits.
fn require_toml(key: &str, value: &Value) -> Result<(), Problem> {
    match toml::Value::try_from(value) {
        Ok(_) => Ok(()),
        Err(e) => Err(Failure::from(twincal::Error::Setting {
            key: key.to_owned(),
            problem: format!("is no value of a setting: {e}"),
            remedy: "give numbers, text, lists and dicts without None".into(),
        })
        .into()),
    }
}

/// Keys of a table of the schema.
fn keys<'a>(schema: &'a Value, table: &str) -> Vec<&'a str> {
    let own = &schema["properties"][table];
    let name = own["$ref"]
        .as_str()
        .and_then(|path| path.rsplit('/').next());
    let own = name.map_or(own, |name| &schema["$defs"][name]);
    let own = own["properties"].as_object();
    own.map_or(Vec::new(), |own| own.keys().map(String::as_str).collect())
}

/// Puts a keyword where it belongs.
fn place(
    schema: &Value,
    tables: &mut Map<String, Value>,
    key: String,
    value: Value,
) -> Result<(), Problem> {
    let is_table = schema["properties"].get(&key).is_some();
    // `noise` is a table and a key of [prior], where an object with a shape belongs.
    if is_table && (value.is_object() || value.is_array()) && key != "output" {
        match (tables.get_mut(&key), value) {
            (Some(Value::Object(known)), Value::Object(more)) => known.extend(more),
            (_, value) => {
                tables.insert(key, value);
            }
        }
        return Ok(());
    }
    let owner = ORDER
        .iter()
        .find(|table| keys(schema, table).contains(&key.as_str()));
    let Some(owner) = owner else {
        return Err(unknown(schema, &key));
    };
    let table = tables
        .entry(*owner)
        .or_insert_with(|| Value::Object(Map::new()));
    if let Value::Object(table) = table {
        table.insert(key, value);
    }
    Ok(())
}

fn unknown(schema: &Value, key: &str) -> Problem {
    let mut known: Vec<&str> = ORDER.iter().flat_map(|table| keys(schema, table)).collect();
    let tables = schema["properties"].as_object();
    known.extend(tables.into_iter().flat_map(Map::keys).map(String::as_str));
    known.retain(|name| !LEFT_OUT.contains(name));
    let near = did_you_mean(key, known);
    let error = twincal::Error::Setting {
        key: key.to_owned(),
        problem: "is no setting".into(),
        remedy: match near.is_empty() {
            true => "`twincal schema` prints every key".into(),
            false => near,
        },
    };
    Failure::from(error).into()
}
