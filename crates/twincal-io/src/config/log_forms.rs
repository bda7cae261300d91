//! The logs as they are written: entries `[[log]]`, one per log, or a table `[log]`, which is read as the first entry. An entry without
//! `file` holds for all logs that have no entry of their own.

use super::{LogEntry, LogTable, PayloadKey, PresetWord, Topics, TorqueWord};
use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// `[[log]]`: one log and what is known of it. Without LOG on the command line these are the logs; with LOG an entry
/// speaks of the log that is the same file. An entry without `file` holds for all logs without an entry of their own.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub(super) struct LogKeys {
    /// The log, relative to this config; without it the entry holds for all logs without an entry of their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
    /// What the robot carried beyond its model: { mass = kg, com = [x, y, z] } in the payload frame, m; "unknown": to be
    /// found. Default: nothing.
    payload: Option<PayloadKey>,
    /// Score on this log instead of fitting it; default false. In an entry that holds for all logs: the logs to score on
    /// instead of a split of the fitted ones, relative to this config (flag `--heldout`).
    heldout: Option<HeldOutKey>,
    /// Sampling rate, Hz: replaces time stamps that are missing or wrong (flag `--rate`).
    #[schemars(extend("exclusiveMinimum" = 0))]
    rate_hz: Option<f64>,
    /// Drop and count rows that cannot be read instead of refusing the file (flag `--lenient`).
    lenient: Option<bool>,
    /// Refuse all logs (exit code 2) where data was lost or degraded beyond the stated limit (flag `--strict`).
    strict: Option<bool>,
    /// Topics of a bag that are read: one, or a list from which each joint's channel is taken from the first that has it.
    /// Default: the only one with joint states.
    topic: Option<Topics>,
    /// Whose recorder wrote the table: its column names are then known. `[columns]` goes first.
    preset: Option<PresetWord>,
    /// What the logged torque is; default "joint", with the preset ur-rtde "current".
    torque: Option<TorqueWord>,
    /// Turns of the motor per turn of the joint, by joint name; for torque = "motor" and "current".
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    gear_ratio: BTreeMap<String, f64>,
    /// Motor torque per current, N·m/A, by joint name, for torque = "current"; without gear_ratio joint torque per current.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    drive_constant: BTreeMap<String, f64>,
    /// Take a column that holds the controller's own model of the torque, such as target_moment, for a measurement;
    /// default false.
    accept_model_torque: Option<bool>,
}

/// Whether a log is held out, or which ones are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected true, false or a list of logs")]
pub(super) enum HeldOutKey {
    /// This one.
    This(bool),
    /// These.
    These(Vec<PathBuf>),
}

/// Both forms as they are written.
#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code, reason = "only its schema is used")]
pub(super) enum LogForms {
    /// `[[log]]`
    Entries(Vec<LogKeys>),
    /// `[log]`
    Table(LogKeys),
}

impl LogTable {
    /// Takes the entries in the order of the file.
    ///
    /// # Errors
    /// What an entry says that only another kind of entry can say.
    fn take(entries: Vec<LogKeys>) -> Result<Self, &'static str> {
        let mut table = Self::default();
        let mut for_all = false;
        for keys in entries {
            match (&keys.file, for_all) {
                (None, true) => {
                    return Err("two entries [[log]] have no `file`: keep one of them");
                }
                (None, false) => for_all = true,
                (Some(_), _) => {}
            }
            table.add(keys)?;
        }
        Ok(table)
    }

    fn add(&mut self, keys: LogKeys) -> Result<(), &'static str> {
        self.strict = self.strict.or(keys.strict);
        let heldout = match keys.heldout {
            Some(HeldOutKey::These(logs)) if self.heldout.is_none() => {
                self.heldout = Some(logs);
                None
            }
            Some(HeldOutKey::These(_)) => {
                return Err("two entries [[log]] list held-out logs: keep one of them");
            }
            Some(HeldOutKey::This(this)) => Some(this),
            None => None,
        };
        let Some(file) = keys.file else {
            if keys.payload.is_some() || heldout == Some(true) {
                return Err(
                    "an entry [[log]] with `payload` or `heldout = true` is of one log: name it with `file`",
                );
            }
            self.rate_hz = keys.rate_hz;
            self.lenient = keys.lenient;
            self.topic = keys.topic;
            self.preset = keys.preset;
            self.torque = keys.torque;
            self.gear_ratio = keys.gear_ratio;
            self.drive_constant = keys.drive_constant;
            self.accept_model_torque = keys.accept_model_torque;
            return Ok(());
        };
        self.entries.push(LogEntry {
            file,
            payload: keys.payload,
            heldout,
            rate_hz: keys.rate_hz,
            lenient: keys.lenient,
            topic: keys.topic,
            preset: keys.preset,
            torque: keys.torque,
            gear_ratio: keys.gear_ratio,
            drive_constant: keys.drive_constant,
            accept_model_torque: keys.accept_model_torque,
        });
        Ok(())
    }

    /// What holds for all logs.
    fn for_all(&self) -> LogKeys {
        LogKeys {
            heldout: self.heldout.clone().map(HeldOutKey::These),
            rate_hz: self.rate_hz,
            lenient: self.lenient,
            strict: self.strict,
            topic: self.topic.clone(),
            preset: self.preset,
            torque: self.torque,
            gear_ratio: self.gear_ratio.clone(),
            drive_constant: self.drive_constant.clone(),
            accept_model_torque: self.accept_model_torque,
            ..LogKeys::default()
        }
    }
}

impl From<LogEntry> for LogKeys {
    fn from(entry: LogEntry) -> Self {
        Self {
            file: Some(entry.file),
            payload: entry.payload,
            heldout: entry.heldout.map(HeldOutKey::This),
            rate_hz: entry.rate_hz,
            lenient: entry.lenient,
            strict: None,
            topic: entry.topic,
            preset: entry.preset,
            torque: entry.torque,
            gear_ratio: entry.gear_ratio,
            drive_constant: entry.drive_constant,
            accept_model_torque: entry.accept_model_torque,
        }
    }
}

/// Either form; not an untagged enum, whose errors would not name the key.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<LogTable, D::Error> {
    struct Forms;
    impl<'de> Visitor<'de> for Forms {
        type Value = LogTable;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("entries [[log]]")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<LogTable, A::Error> {
            let only = LogKeys::deserialize(MapAccessDeserializer::new(map))?;
            LogTable::take(vec![only]).map_err(A::Error::custom)
        }

        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<LogTable, A::Error> {
            let entries = Vec::deserialize(SeqAccessDeserializer::new(seq))?;
            LogTable::take(entries).map_err(A::Error::custom)
        }
    }
    deserializer.deserialize_any(Forms)
}

/// What holds for all logs, where anything does, then one entry per log.
pub(super) fn serialize<S: Serializer>(table: &LogTable, serializer: S) -> Result<S::Ok, S::Error> {
    let all = table.for_all();
    let mut written = Vec::new();
    if all != LogKeys::default() {
        written.push(all);
    }
    written.extend(table.entries.iter().cloned().map(LogKeys::from));
    written.serialize(serializer)
}

/// Entries of single logs alone, for a config that is proposed.
pub(super) fn serialize_entries<S: Serializer>(
    entries: &[LogEntry],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let keys: Vec<LogKeys> = entries.iter().cloned().map(LogKeys::from).collect();
    keys.serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::super::Config;
    use crate::log::TorqueSource;
    use std::path::{Path, PathBuf};

    const MOTOR: &str = "torque = \"motor\"\ngear_ratio = { elbow = 50.0 }\n";

    #[test]
    fn a_table_is_read_as_the_first_entry() {
        for header in ["[log]", "[[log]]"] {
            let text = format!("{header}\nfile = \"a.csv\"\nheldout = [\"b.csv\"]\n{MOTOR}");
            let config = Config::parse("x", &text).unwrap();
            let log = config.settings().unwrap().log;
            assert_eq!(log.named(), [PathBuf::from("a.csv")]);
            assert_eq!(log.heldout, [PathBuf::from("b.csv")]);
            let source = |name: &str| log.options(Path::new(name)).torque.source;
            assert_eq!(source("a.csv"), Some(TorqueSource::Motor));
            assert_eq!(source("b.csv"), None);
            let wrong = text.replace("50.0", "0.0");
            let error = Config::parse("x", &wrong).unwrap().settings().unwrap_err();
            assert!(
                error
                    .to_string()
                    .starts_with("x:5:24: key `log.0.gear_ratio.elbow`"),
                "{error}"
            );
        }
    }

    #[test]
    fn an_entry_without_a_file_holds_for_logs_without_an_entry() {
        for (header, line) in [("[log]", 3), ("[[log]]\nfile = \"own.csv\"\n[[log]]", 5)] {
            let text = format!("{header}\nrate_hz = 100\n{MOTOR}");
            let config = Config::parse("x", &text).unwrap();
            let log = config.settings().unwrap().log;
            let any = log.options(Path::new("any.csv"));
            assert_eq!(any.rate_hz, Some(100.0));
            assert_eq!(any.torque.source, Some(TorqueSource::Motor));
            if header.contains("own") {
                assert_eq!(log.options(Path::new("own.csv")).rate_hz, None);
            }
            // The report's settings say the same.
            let again = Config::parse("x", &config.in_force()).unwrap();
            assert_eq!(again.file, config.file);
            assert!(
                !config.in_force().contains("\n[log]"),
                "{}",
                config.in_force()
            );
            let error = (Config::parse("x", &text.replace("50.0", "0.0")).unwrap())
                .settings()
                .unwrap_err()
                .to_string();
            let place = format!("x:{}:", line + 1);
            assert!(error.starts_with(&place), "{error}");
        }
    }

    #[test]
    fn what_only_another_entry_can_say_is_refused() {
        for (text, words) in [
            (
                "[[log]]\ntorque = \"none\"\n[[log]]\nrate_hz = 5\n",
                "two entries [[log]] have no `file`",
            ),
            ("[[log]]\npayload = \"unknown\"\n", "name it with `file`"),
            ("[log]\nheldout = true\n", "name it with `file`"),
            (
                "[log]\nheldout = \"a.csv\"\n",
                "expected true, false or a list of logs",
            ),
        ] {
            let error = Config::parse("x", text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn both_forms_are_one_error_with_both_lines() {
        for (text, place, lines) in [
            (
                "[log]\nrate_hz = 5\n\n[[log]] # a\nfile = \"a\"\n",
                "x:4:",
                ["line 1", "line 4"],
            ),
            (
                "[[log]]\nfile = \"a\"\n[ log ]\nrate_hz = 5\n",
                "x:3:",
                ["line 3", "line 1"],
            ),
        ] {
            let error = Config::parse("x", text).unwrap_err().to_string();
            assert!(error.starts_with(place), "{error}");
            let words = ["write [[log]] in both lines", lines[0], lines[1]];
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
    }

    #[test]
    fn more_entries_than_any_fit_has_are_refused_by_their_number() {
        let entries: String = (0..10_001)
            .map(|i| format!("[[log]]\nfile = \"{i}\"\n"))
            .collect();
        let error = Config::parse("x", &entries)
            .unwrap()
            .settings()
            .unwrap_err();
        assert!(
            error
                .to_string()
                .contains("10001 entries, the limit is 10000"),
            "{error}"
        );
    }
}
