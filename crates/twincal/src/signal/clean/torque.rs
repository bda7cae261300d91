//! What measured torque lacks: samples of it, or any change in it.

use super::held::held_torque;
use crate::error::{Code, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::log::long::{Log, Logs};
use crate::signal::log::recording::{Channels, Recording};

/// A joint that travels less in a log stands still there, rad or m.
const TRAVEL: f64 = 0.01;
/// Names at most in one message.
const NAMED: usize = 4;

impl Recording {
    /// Takes the measured torque out, one entry per joint. What is left is motion alone: torque that is missing or late then
    /// neither cuts nor moves a prediction.
    pub fn take_torque(&mut self) -> Vec<Option<Vec<f64>>> {
        self.joints
            .iter_mut()
            .map(|channels| channels.tau.take())
            .collect()
    }
}

/// Says how much measured torque a log lacks that is only to be predicted; nothing is lost from the prediction.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn missing_torque(robot: &Robot, log: &Log<'_>) -> Result<Option<Finding>> {
    let mut lacking = vec![0_usize; robot.dof()];
    log.until(|recording| {
        for (lacking, channels) in lacking.iter_mut().zip(&recording.joints) {
            let values = channels.tau.iter().flatten();
            *lacking += values.filter(|value| !value.is_finite()).count();
        }
        false
    })?;
    let joints = robot.joint_names().into_iter().zip(&lacking);
    let words: Vec<String> = (joints.filter(|(_, count)| **count > 0).take(NAMED))
        .map(|(name, count)| format!("joint `{name}`: {count}"))
        .collect();
    let most = lacking.iter().copied().max().unwrap_or(0);
    Ok((most > 0).then(|| {
        let samples = log.samples();
        Finding::new(
            Severity::Warning,
            Code::MissingTorque,
            log.name(),
            format!(
                "measured torque is NaN or infinite in some of {samples} rows ({}): they are predicted all the same, with no \
                 measured torque beside",
                words.join(", ")
            ),
            most as u64,
        )
        .with([("rows", samples as f64)])
    }))
}

/// Torque that never changes while its joint moves: drives off, or a column that was not recorded. One joint like that may be
/// a passive one; a log in which every moving joint is like that is degraded, unless the robot swung freely. Torque that is held for a while is
/// said as well (`held.rs`).
///
/// # Errors
/// Of chapters that cannot be read.
pub fn constant_torque<'a>(robot: &Robot, logs: impl Into<Logs<'a>>) -> Result<Vec<Finding>> {
    let names = robot.joint_names();
    let logs = logs.into();
    let mut findings = held_torque(robot, &logs)?;
    for log in logs.0 {
        let mut seen = vec![Seen::default(); names.len()];
        log.until(|recording| {
            for (seen, channels) in seen.iter_mut().zip(&recording.joints) {
                seen.see(channels);
            }
            seen.iter().all(Seen::is_enough)
        })?;
        let moving: Vec<(&str, Range)> = (names.iter().zip(&seen))
            .filter(|(_, seen)| seen.travel.is_wider(TRAVEL))
            .filter_map(|(name, seen)| Some((*name, seen.torque?)))
            .collect();
        let constant: Vec<String> = (moving.iter())
            .filter(|(_, torque)| !torque.is_wider(0.0))
            .map(|(name, torque)| {
                let value = if torque.low.is_finite() {
                    torque.low
                } else {
                    f64::NAN
                };
                format!("`{name}` is {value}")
            })
            .collect();
        if constant.is_empty() {
            continue;
        }
        let shown = constant[..constant.len().min(NAMED)].join(", ");
        let first = moving.iter().find(|(_, torque)| !torque.is_wider(0.0));
        let first = first.map(|(_, torque)| ("torque", torque.low));
        let cause = "the drives were off, or the column was not recorded";
        let severity = if constant.len() == moving.len() {
            Severity::Degraded
        } else {
            Severity::Warning
        };
        findings.push(Finding::new(
            severity,
            Code::ConstantTorque,
            log.name(),
            format!(
                "torque never changes while the joint moves (joint {shown} throughout): {cause}; what is found there is wrong \
                 unless it swung freely; map the measured torque in [columns] tau, or leave this log out"
            ),
            constant.len() as u64,
        )
        .with(first));
    }
    Ok(findings)
}

/// Ranges of a joint's position and torque, as far as the questions here need them.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    travel: Range,
    /// `None` where no torque is logged.
    torque: Option<Range>,
}

impl Seen {
    /// Whether more samples would change nothing.
    fn is_enough(&self) -> bool {
        let varies = self.torque.is_some_and(|torque| torque.is_wider(0.0));
        varies && self.travel.is_wider(TRAVEL)
    }

    fn see(&mut self, channels: &Channels) {
        self.travel.widen(&channels.q, TRAVEL);
        if let Some(tau) = &channels.tau {
            self.torque.get_or_insert_default().widen(tau, 0.0);
        }
    }
}

/// Smallest and largest finite value so far.
#[derive(Debug, Clone, Copy)]
struct Range {
    low: f64,
    high: f64,
}

impl Default for Range {
    /// Of nothing.
    fn default() -> Self {
        Self {
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        }
    }
}

impl Range {
    /// Whether two values are more than `by` apart.
    fn is_wider(self, by: f64) -> bool {
        self.high - self.low > by
    }

    /// Takes more values, no further than to where it is wider than `enough`.
    fn widen(&mut self, values: &[f64], enough: f64) {
        for value in values.iter().filter(|v| v.is_finite()) {
            if self.is_wider(enough) {
                return;
            }
            (self.low, self.high) = (self.low.min(*value), self.high.max(*value));
        }
    }
}
