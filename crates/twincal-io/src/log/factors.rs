//! Logged numbers in the model's units and signs: `[columns] factor`.

use super::LogOptions;
use crate::config::PerJoint;
use crate::error::Result;
use twincal::robot::{Robot, did_you_mean};
use twincal::signal::Recording;
use twincal::words::listed;
use twincal::{Code, Finding, Severity};

/// Refuses factors that turn no number into another one, and joints that do not move in the model.
///
/// # Errors
/// [`twincal::Error::Setting`].
pub(super) fn check(robot: &Robot, options: &LogOptions) -> Result<()> {
    let names = robot.joint_names();
    for (channel, factor) in options.columns.factor.channels() {
        let setting = |problem: String, remedy: String| twincal::Error::Setting {
            key: format!("columns.factor.{channel}"),
            problem,
            remedy,
        };
        let numbers: Vec<f64> = match factor {
            PerJoint::All(number) => vec![*number],
            PerJoint::ByJoint(factors) => {
                if let Some(joint) = factors
                    .keys()
                    .find(|joint| !names.contains(&joint.as_str()))
                {
                    return Err(setting(
                        format!("names joint `{joint}`, which does not move in the model"),
                        did_you_mean(joint, names.iter().copied()),
                    )
                    .into());
                }
                factors.values().copied().collect()
            }
        };
        if let Some(number) = numbers.iter().find(|x| !x.is_finite() || **x == 0.0) {
            let remedy = "give what a logged number is multiplied with, such as -1.0";
            return Err(setting(format!("is {number}"), remedy.into()).into());
        }
    }
    Ok(())
}

/// Multiplies what was logged, and says so.
pub(super) fn apply(
    recording: &mut Recording,
    robot: &Robot,
    options: &LogOptions,
    findings: &mut Vec<Finding>,
) {
    let factors = &options.columns.factor;
    if factors.is_empty() {
        return;
    }
    let mut told: Vec<String> = Vec::new();
    for (joint, own) in robot.joint_names().into_iter().zip(&mut recording.joints) {
        let values = [
            Some(&mut own.q),
            own.qd.as_mut(),
            own.qdd.as_mut(),
            own.tau.as_mut(),
        ];
        for ((channel, factor), values) in factors.channels().into_iter().zip(values) {
            if let (Some(factor), Some(values)) = (factor.of_joint(joint), values) {
                values.iter_mut().for_each(|value| *value *= factor);
                told.push(format!("{channel} of {joint} {factor}"));
            }
        }
    }
    findings.push(Finding::new(
        Severity::Note,
        Code::ColumnFactor,
        &recording.name,
        format!(
            "logged numbers are multiplied, as told: {}",
            listed(&told, ", ")
        ),
        0,
    ));
}

/// Multiplies positions of one joint.
pub(super) fn apply_to_positions(q: &mut [f64], joint: &str, options: &LogOptions) {
    if let Some(factor) = options.columns.factor.q.of_joint(joint) {
        q.iter_mut().for_each(|value| *value *= factor);
    }
}
