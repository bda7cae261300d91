//! How the logs of a fit were understood: kept in the twin, for the logs that come after them.

use super::{ColumnsTable, LogSettings};
use crate::log::{TorqueOptions, TorqueSource};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use twincal::{Finding, Severity};

/// How the logs of a fit were understood.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReadAs {
    /// What the torque of all of them was taken as; `None` where they differ.
    torque: Option<TorqueOptions>,
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
                ("[log] preset", options.preset.is_some()),
                ("[log] topic", !options.topics.is_empty()),
                ("[log] rate_hz", options.rate_hz.is_some()),
                ("[columns]", options.columns != ColumnsTable::default()),
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
            keys,
        }
    }

    /// Has torque taken as in the fit where the settings say nothing of it. The answer is loud: torque that is taken for something else
    /// looks like a broken robot.
    pub fn fill_in(&self, settings: &mut LogSettings) -> Option<Finding> {
        let form = &mut settings.form;
        if form.torque != TorqueOptions::default() || form.preset.is_some() {
            return None;
        }
        let message = match &self.torque {
            Some(torque) => {
                let taken = match torque.source {
                    Some(TorqueSource::Motor) => "torque of the motors, with the gear ratios",
                    Some(TorqueSource::Current) => "motor currents, with the drive constants",
                    _ => return None,
                };
                form.torque = torque.clone();
                format!(
                    "the logged torque counts as {taken} that the logs of the fit had; [log] torque of a --config says otherwise (\"joint\": as it is logged)"
                )
            }
            None => "the torque of the fit's logs was not of one kind ([[log]] torque): here it counts as joint torque; [log] torque of a --config says otherwise".into(),
        };
        let code = "torque_as_fitted";
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
