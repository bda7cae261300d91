//! The key `log` has two forms: a table `[log]` with settings for all logs, or entries `[[log]]`, one per log.

use super::{LogEntry, LogTable};
use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Both forms as they are written.
#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum LogForms {
    /// `[log]`
    Table(LogTable),
    /// `[[log]]`
    Entries(Vec<LogEntry>),
}

/// Either form; not an untagged enum, whose errors would not name the key.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<LogTable, D::Error> {
    struct Forms;
    impl<'de> Visitor<'de> for Forms {
        type Value = LogTable;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a table [log] or entries [[log]]")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<LogTable, A::Error> {
            LogTable::deserialize(MapAccessDeserializer::new(map))
        }

        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<LogTable, A::Error> {
            let entries = Vec::deserialize(SeqAccessDeserializer::new(seq))?;
            Ok(LogTable {
                entries,
                ..LogTable::default()
            })
        }
    }
    deserializer.deserialize_any(Forms)
}

/// Entries where there are any, each with the flags that hold for all logs.
pub(super) fn serialize<S: Serializer>(table: &LogTable, serializer: S) -> Result<S::Ok, S::Error> {
    if table.entries.is_empty() {
        return LogForms::Table(table.clone()).serialize(serializer);
    }
    let over = |entry: &LogEntry| LogEntry {
        rate_hz: table.rate_hz.or(entry.rate_hz),
        lenient: table.lenient.or(entry.lenient),
        ..entry.clone()
    };
    let entries = table.entries.iter().map(over).collect();
    LogForms::Entries(entries).serialize(serializer)
}
