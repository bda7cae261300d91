//! How the logs of a fit were understood: kept in the twin, for the logs that come after them.

use super::{ColumnsTable, FactorTable, LogSettings};
use crate::log::{Preset, TorqueOptions, TorqueSource};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use twincal::Code;
use twincal::{Finding, Severity};

/// How the logs of a fit were understood.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReadAs {
    /// What the torque of all of them was taken as; `None` where they differ.
    torque: Option<TorqueOptions>,
    /// What logged numbers were multiplied with.
    #[serde(default, skip_serializing_if = "FactorTable::is_empty")]
    pub(super) factor: FactorTable,
    /// The other keys of `[columns]`; nothing in twins of earlier versions.
    #[serde(default)]
    pub(super) columns: ColumnsTable,
    /// Other keys that said how to read any of them.
    keys: Vec<String>,
}

impl ReadAs {
    /// Of the logs that are fitted with these settings.
    pub fn of(settings: &LogSettings, logs: &[PathBuf]) -> Self {
        let options = logs.iter().map(|log| settings.options(log));
        let (mut torques, mut keys) = (Vec::new(), Vec::new());
        for mut options in options {
            options.torque.source = Some(options.torque_source());
            let said = [
                ("[[log]] preset", options.preset.is_some()),
                ("[[log]] topic", !options.topics.is_empty()),
                ("[[log]] rate_hz", options.rate_hz.is_some()),
            ];
            for (key, _) in said.into_iter().filter(|(_, said)| *said) {
                if !keys.iter().any(|known| known == key) {
                    keys.push(key.to_owned());
                }
            }
            torques.push(options.torque);
        }
        let alike = torques.windows(2).all(|pair| pair[0] == pair[1]);
        Self {
            torque: torques.into_iter().next().filter(|_| alike),
            factor: settings.columns.factor.clone(),
            columns: ColumnsTable {
                factor: FactorTable::default(),
                ..settings.columns.clone()
            },
            keys,
        }
    }

    /// Has the torque of new logs taken as in the fit where the settings say nothing of it, for all or in a log's own entry. The answer is
    /// loud: torque that is taken for something else looks like a broken robot.
    pub fn fill_in(&self, settings: &mut LogSettings, logs: &[PathBuf]) -> Option<Finding> {
        let is_silent = |torque: &TorqueOptions, preset: Option<Preset>| {
            *torque == TorqueOptions::default() && preset.is_none()
        };
        let mut options = logs.iter().map(|log| settings.options(log));
        if !options.any(|options| is_silent(&options.torque, options.preset)) {
            return None;
        }
        let message = match &self.torque {
            Some(torque) => {
                let taken = match torque.source {
                    Some(TorqueSource::Motor) => "torque of the motors, with the gear ratios",
                    Some(TorqueSource::Current) => "motor currents, with the drive constants",
                    _ => return None,
                };
                let own = settings.entries.iter_mut().map(|entry| &mut entry.form);
                std::iter::once(&mut settings.form)
                    .chain(own)
                    .filter(|form| is_silent(&form.torque, form.preset))
                    .for_each(|form| form.torque = torque.clone());
                format!(
                    "the logged torque counts as {taken} that the logs of the fit had; [[log]] torque of a --config says otherwise (\"joint\": as it is logged)"
                )
            }
            None => "the torque of the fit's logs was not of one kind ([[log]] torque): here it counts as joint torque; [[log]] torque of a --config says otherwise".into(),
        };
        let code = Code::TorqueAsFitted;
        Some(Finding::new(Severity::Warning, code, "", message, 0))
    }

    /// What else helped to read the logs of the fit, for a log that cannot be read without it.
    pub fn hint(&self) -> Option<String> {
        (!self.keys.is_empty()).then(|| {
            format!(
                "the logs of the fit were read with {}: give its config with --config",
                self.keys.join(", ")
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    fn settings(text: &str) -> LogSettings {
        let config = Config::parse("twincal.toml", text).expect("a config");
        config.settings().expect("good settings").log
    }

    const MOTOR: &str = "torque = \"motor\"\ngear_ratio = { a = 50.0 }\n";

    /// What becomes of the torque of `new.csv` under a config, by a twin whose logs were read by another.
    fn filled(fit: &str, config: &str) -> (Option<TorqueSource>, Option<String>) {
        let fitted = [PathBuf::from("one.csv"), PathBuf::from("two.csv")];
        let (mut new, log) = (settings(config), PathBuf::from("new.csv"));
        let read_as = ReadAs::of(&settings(fit), &fitted);
        let said = read_as.fill_in(&mut new, std::slice::from_ref(&log));
        let source = new.options(&log).torque.source;
        (source, said.map(|finding| finding.message))
    }

    #[test]
    fn torque_is_taken_as_in_the_fit_where_nothing_is_said() {
        let fit = format!("[log]\n{MOTOR}");
        for config in [
            "",
            "[check]\nrmse_ratio = 2.0\n",
            "[[log]]\nfile = \"new.csv\"\npayload = \"unknown\"\n",
            "[[log]]\nfile = \"other.csv\"\ntorque = \"joint\"\n",
        ] {
            let (source, said) = filled(&fit, config);
            assert_eq!(source, Some(TorqueSource::Motor), "{config}");
            assert!(said.expect("a warning").contains("gear ratios"), "{config}");
        }
    }

    #[test]
    fn what_is_said_of_torque_stays() {
        let fit = format!("[log]\n{MOTOR}");
        for config in [
            "[log]\ntorque = \"joint\"\n",
            "[[log]]\nfile = \"new.csv\"\ntorque = \"joint\"\n",
        ] {
            let joint = Some(TorqueSource::Joint);
            assert_eq!(filled(&fit, config), (joint, None), "{config}");
        }
        assert_eq!(filled("", ""), (None, None));
    }

    #[test]
    fn a_fit_of_logs_that_differ_asks() {
        let fit = format!("[[log]]\nfile = \"one.csv\"\n{MOTOR}[[log]]\nfile = \"two.csv\"\n");
        let (source, said) = filled(&fit, "");
        assert_eq!(source, None);
        assert!(said.expect("a warning").contains("not of one kind"));
    }
}
