//! `[prior] drive_gain`: how well the constants of drives are known.

use super::{Config, LogSettings};
use crate::error::Result;
use crate::log::{LogOptions, TorqueSource};

/// Drive constants from catalogues are off by 5 to 10 %.
const DRIVE_GAIN_SD: f64 = 0.07;

impl Config {
    /// Prior sd of the factor that all drives share: as given, or that of constants of drives where a log's torque is made by them.
    pub(super) fn drive_gain_sd(&self, log: &LogSettings) -> Result<f64> {
        if let Some(sd) = self.file.prior.drive_gain {
            let range = "a number from 0 to below 1, such as 0.07";
            return self.number("prior.drive_gain", sd, |sd| (0.0..1.0).contains(&sd), range);
        }
        let fitted = log.entries.iter().filter(|entry| !entry.heldout);
        let mut forms = fitted.map(|entry| &entry.form).chain([&log.form]);
        let of_drives = forms.any(|form| {
            let options = LogOptions {
                preset: form.preset,
                torque: form.torque.clone(),
                ..LogOptions::default()
            };
            matches!(
                options.torque_source(),
                TorqueSource::Motor | TorqueSource::Current
            )
        });
        Ok(if of_drives { DRIVE_GAIN_SD } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_of_motors_has_uncertain_constants() {
        let sd = |text: &str| {
            let config = Config::parse("twincal.toml", text).unwrap();
            config.settings().map(|s| s.calibration.drive_gain_sd)
        };
        assert_eq!(sd("").unwrap(), 0.0);
        assert_eq!(sd("[log]\ntorque = \"joint\"").unwrap(), 0.0);
        assert_eq!(sd("[log]\ntorque = \"current\"").unwrap(), 0.07);
        assert_eq!(sd("[log]\ntorque = \"motor\"").unwrap(), 0.07);
        assert_eq!(sd("[log]\npreset = \"ur-rtde\"").unwrap(), 0.07);
        let stated = "[log]\ntorque = \"motor\"\n[prior]\ndrive_gain = 0.02";
        assert_eq!(sd(stated).unwrap(), 0.02);
        assert_eq!(sd("[prior]\ndrive_gain = 0.1").unwrap(), 0.1);
        assert!(sd("[prior]\ndrive_gain = 1.5").is_err());
    }
}
