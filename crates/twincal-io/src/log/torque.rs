//! What the logged torque is: joint torque, motor torque before the gear, or a motor current; turned into joint torque only by numbers
//! that the user gave.
//!
//! | `[[log]] torque` | joint torque |
//! |---|---|
//! | `joint` (default) | as logged |
//! | `motor` | `gear_ratio` · logged |
//! | `current` | `gear_ratio` · `drive_constant` · logged; without any `gear_ratio` the constant is of the joint's side |
//! | `none` | left out: the log is only to be predicted |

use super::{LogOptions, Preset};
use crate::error::Result;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use twincal::robot::{Robot, did_you_mean};
use twincal::signal::Recording;
use twincal::words::listed;
use twincal::{Code, Finding, Severity};

/// What the logged torque is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TorqueSource {
    /// Torque on the joint's side of the gear, N·m or N.
    #[default]
    Joint,
    /// Torque on the motor's side of the gear, N·m.
    Motor,
    /// Motor current, A.
    Current,
    /// Not used.
    None,
}

/// `[[log]] torque`, `gear_ratio`, `drive_constant`, `accept_model_torque`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TorqueOptions {
    /// As stated; `None`: `Current` with the preset `ur-rtde`, else `Joint`.
    pub source: Option<TorqueSource>,
    /// Turns of the motor per turn of the joint, by joint.
    pub gear_ratio: BTreeMap<String, f64>,
    /// N·m/A, by joint.
    pub drive_constant: BTreeMap<String, f64>,
    /// Columns that hold the controller's own model of the torque may be fitted.
    pub accept_model_torque: bool,
}

impl LogOptions {
    /// What the logged torque is, the preset considered.
    pub fn torque_source(&self) -> TorqueSource {
        self.torque.source.unwrap_or(match self.preset {
            Some(Preset::UrRtde) => TorqueSource::Current,
            _ => TorqueSource::Joint,
        })
    }
}

fn setting(key: &str, problem: String, remedy: String) -> crate::Error {
    twincal::Error::Setting {
        key: format!("log.{key}"),
        problem,
        remedy,
    }
    .into()
}

/// The number of a joint.
fn of_joint(key: &str, table: &BTreeMap<String, f64>, joint: &str, example: &str) -> Result<f64> {
    table.get(joint).copied().ok_or_else(|| {
        setting(
            key,
            format!("has no number for joint `{joint}`"),
            format!("state it: [[log]] {key} = {{ \"{joint}\" = {example} }}"),
        )
    })
}

/// Turns the logged torque into joint torque.
///
/// # Errors
/// [`twincal::Error::Setting`] for a joint without a number that is needed, or a number of a joint that does not move in the model.
pub(super) fn to_joint_torque(
    recording: &mut Recording,
    robot: &Robot,
    options: &LogOptions,
    findings: &mut Vec<Finding>,
) -> Result<()> {
    let names = robot.joint_names();
    refuse_unknown_joints(&names, options)?;
    let source = options.torque_source();
    let mut factors = Vec::new();
    for (joint, channels) in names.iter().zip(&mut recording.joints) {
        if source == TorqueSource::None {
            channels.tau = None;
        }
        let Some(tau) = &mut channels.tau else {
            continue;
        };
        let Some(factor) = factor(joint, options)? else {
            continue;
        };
        tau.iter_mut().for_each(|value| *value *= factor);
        factors.push(format!("{joint} {factor}"));
    }
    let (what, unit) = match source {
        TorqueSource::Motor => ("motor torque times gear ratio", ""),
        TorqueSource::Current if options.torque.gear_ratio.is_empty() => {
            ("current times drive constant of the joint's side", " N·m/A")
        }
        TorqueSource::Current => ("current times drive constant times gear ratio", " N·m/A"),
        TorqueSource::Joint | TorqueSource::None => return Ok(()),
    };
    if !factors.is_empty() {
        let message = format!(
            "joint torque is {what}, as told: {}{unit}",
            listed(&factors, ", ")
        );
        findings.push(Finding::new(
            Severity::Note,
            Code::TorqueSource,
            &recording.name,
            message,
            0,
        ));
    }
    Ok(())
}

/// Every number is of a joint that moves in the model.
fn refuse_unknown_joints(names: &[&str], options: &LogOptions) -> Result<()> {
    for (key, table) in [
        ("gear_ratio", &options.torque.gear_ratio),
        ("drive_constant", &options.torque.drive_constant),
    ] {
        if let Some(joint) = table.keys().find(|joint| !names.contains(&joint.as_str())) {
            return Err(setting(
                key,
                format!("names joint `{joint}`, which does not move in the model"),
                did_you_mean(joint, names.iter().copied()),
            ));
        }
    }
    Ok(())
}

/// Joint torque over what is logged; `None` where joint torque is logged.
fn factor(joint: &str, options: &LogOptions) -> Result<Option<f64>> {
    let gear = &options.torque.gear_ratio;
    let constant = &options.torque.drive_constant;
    let factor = match options.torque_source() {
        TorqueSource::Joint | TorqueSource::None => return Ok(None),
        TorqueSource::Motor => of_joint("gear_ratio", gear, joint, "100.0")?,
        TorqueSource::Current => {
            let constant = of_joint("drive_constant", constant, joint, "0.12")?;
            if gear.is_empty() {
                constant
            } else {
                constant * of_joint("gear_ratio", gear, joint, "100.0")?
            }
        }
    };
    Ok(Some(factor))
}
