//! Keys of `[log]` and `[[log]]` that say how a log is to be understood: recorder, topics, what the torque is.

use super::{Config, LogEntry, LogTable, PresetWord, Topics, TorqueWord};
use crate::error::Result;
use crate::log::{LogOptions, Preset, TorqueOptions, TorqueSource};
use std::collections::BTreeMap;

/// Keys of `[log]` and `[[log]]` that say how a log is to be understood.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogForm {
    /// Whose recorder wrote it.
    pub preset: Option<Preset>,
    /// Topics of a bag.
    pub topics: Vec<String>,
    /// What the logged torque is.
    pub torque: TorqueOptions,
}

impl LogForm {
    fn new(
        topic: Option<&Topics>,
        preset: Option<PresetWord>,
        source: Option<TorqueWord>,
        [gear_ratio, drive_constant]: [&BTreeMap<String, f64>; 2],
        accept_model_torque: Option<bool>,
    ) -> Self {
        let source = source.map(|word| match word {
            TorqueWord::Joint => TorqueSource::Joint,
            TorqueWord::Motor => TorqueSource::Motor,
            TorqueWord::Current => TorqueSource::Current,
            TorqueWord::None => TorqueSource::None,
        });
        Self {
            preset: preset.map(|word| match word {
                PresetWord::UrRtde => Preset::UrRtde,
                PresetWord::Franka => Preset::Franka,
            }),
            topics: match topic {
                None => Vec::new(),
                Some(Topics::One(topic)) => vec![topic.clone()],
                Some(Topics::Several(topics)) => topics.clone(),
            },
            torque: TorqueOptions {
                source,
                gear_ratio: gear_ratio.clone(),
                drive_constant: drive_constant.clone(),
                accept_model_torque: accept_model_torque.unwrap_or(false),
            },
        }
    }

    pub(super) fn of_table(table: &LogTable) -> Self {
        let numbers = [&table.gear_ratio, &table.drive_constant];
        let topic = table.topic.as_ref();
        let accept = table.accept_model_torque;
        Self::new(topic, table.preset, table.torque, numbers, accept)
    }

    pub(super) fn of_entry(entry: &LogEntry) -> Self {
        let numbers = [&entry.gear_ratio, &entry.drive_constant];
        let topic = entry.topic.as_ref();
        let accept = entry.accept_model_torque;
        Self::new(topic, entry.preset, entry.torque, numbers, accept)
    }
}

impl Config {
    /// Numbers that are none, or that what is stated of the torque has no use for.
    pub(super) fn form(&self, table: &str, form: LogForm) -> Result<LogForm> {
        let options = LogOptions {
            preset: form.preset,
            torque: form.torque.clone(),
            ..LogOptions::default()
        };
        let source = options.torque_source();
        let used = [
            matches!(source, TorqueSource::Motor | TorqueSource::Current),
            source == TorqueSource::Current,
        ];
        let tables = [
            ("gear_ratio", &form.torque.gear_ratio),
            ("drive_constant", &form.torque.drive_constant),
        ];
        for ((name, numbers), used) in tables.into_iter().zip(used) {
            let key = format!("{table}.{name}");
            if !used && !numbers.is_empty() {
                let problem = "has no use: torque is not said to be of the motor".to_owned();
                let remedy = "say torque = \"motor\" or \"current\", or leave it out";
                return Err(self.out_of_range(&key, problem, remedy));
            }
            for (joint, &number) in numbers {
                let range = "a finite number other than 0";
                self.number(
                    &format!("{key}.{joint}"),
                    number,
                    |number| number != 0.0,
                    range,
                )?;
            }
        }
        Ok(form)
    }
}
