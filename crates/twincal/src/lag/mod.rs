//! How much later than the motion torque was logged (case 17).
//!
//! ```text
//! τ_j(t + L_j) = Y_j(q, q̇, q̈) π + f_j(q̇_j)        only where joint j slides
//! ```
//! All inertial parameters π and the friction f of sliding joints are free, so that neither a wrong model nor a payload is a lag. At a
//! velocity reversal friction remembers the motion before it (presliding), which looks like tens of milliseconds: rows within a tenth of a
//! second of one are not used. What is left is the shift of torque that acceleration, gravity and speed ask for, joint by joint,
//! by Gauss–Newton; its error comes from pieces of the logs. A lag is the recorder's, so that it is the same for all joints: what most joints
//! agree on is applied where it is beyond three standard deviations and where left-out rows get better.
//!
//! The torque that a twin predicts belongs to the motion of the same instant. A log's measured torque is moved back before it is fitted, scored or
//! compared, by the lag of the training logs.

mod estimate;
mod pool;
mod rows;

use crate::error::{Code, Finding, Severity};
use crate::robot::Robot;
use crate::signal::{Lag, Pipeline, Trajectory};
use crate::words::significant;
use estimate::{Estimate, estimate};
use pool::agreed;
use rows::REACH;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A lag is there beyond this many standard deviations, and where this share of what is left of left-out rows goes with it.
const CLEARLY: f64 = 3.0;
const IMPROVES: f64 = 0.02;
/// Share of the longest lag that is looked for from which on an estimate is at its end, and none: torque of the wrong sign has one there.
const END: f64 = 0.9;
/// A lag with a larger standard deviation says nothing, s; nor that of one joint that differs.
const VAGUE: f64 = 0.02;
const SHARP: f64 = 0.005;
/// Share of what is left of its rows that goes with the lag of one joint or log that is called a mistake.
const MISTAKE: f64 = 0.1;

/// Lag of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointLag {
    /// Name of the joint.
    pub joint: String,
    /// How much later torque is logged than the motion, s; negative where it is first.
    pub lag: f64,
    /// Its standard deviation, s.
    pub sd: f64,
    /// Whether it clearly differs from that of the other joints, and left-out rows of this joint get better with it.
    pub differs: bool,
}

/// Lag of one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogLag {
    /// Name of the log.
    pub log: String,
    /// Sampling interval, s.
    pub interval: f64,
    /// Lag and standard deviation over all joints, s; `None` where the log does not say it. What joints disagree by, alike in all logs, is not
    /// in the standard deviation: it compares logs.
    pub common: Option<[f64; 2]>,
    /// Whether it clearly differs from that of the other logs.
    pub differs: bool,
}

/// Lags of logs of one robot that are looked at together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lags {
    /// What more than half of the joints agree on: mean and standard deviation, s.
    pub common: Option<[f64; 2]>,
    /// Share of the root mean square of left-out training rows that goes with the lags that are clear; 0 where none is.
    pub gain: f64,
    /// Whether the common lag is clear.
    pub clear: bool,
    /// Joints that slide enough, in order.
    pub joints: Vec<JointLag>,
    /// All logs, in order.
    pub logs: Vec<LogLag>,
}

/// What joints and logs say of their lags.
struct Votes {
    /// Joints that say it, with their lag and its standard deviation, s.
    joints: Vec<(usize, [f64; 2])>,
    /// Which of them differ from the others.
    apart: Vec<bool>,
    /// Which of the logs that say it differ from the others.
    logs_apart: Vec<bool>,
    /// What most joints agree on, without the logs that differ.
    common: Option<[f64; 2]>,
}

/// The lag of a joint or log that says it.
fn said_lag(lag: &Option<[f64; 2]>) -> Option<[f64; 2]> {
    lag.filter(|[_, sd]| *sd < VAGUE)
}

impl Votes {
    fn new(found: &Estimate<'_>) -> Self {
        let own = found.joints.iter().enumerate();
        let joints: Vec<(usize, [f64; 2])> = own
            .filter_map(|(joint, lag)| Some((joint, said_lag(lag)?)))
            .collect();
        let values: Vec<[f64; 2]> = joints.iter().map(|(_, lag)| *lag).collect();
        let of_logs: Vec<[f64; 2]> = found.logs.iter().filter_map(said_lag).collect();
        let (agree, mut several) = (agreed(&values), agreed(&of_logs));
        // Joints that do not agree say nothing of a log either.
        if agree.common.is_none() {
            several.differs.fill(false);
        }
        // Logs that differ must not pull what is applied to all.
        let common = match of_logs.len() {
            0 | 1 => agree.common,
            _ => agree.common.and(several.common),
        };
        // Of two joints nobody knows which is right, and a log that differs pulls joints apart.
        let alike = joints.len() > 2 && !several.differs.contains(&true);
        let sharp = joints.iter().map(|(_, [_, sd])| alike && *sd < SHARP);
        let apart = (agree.differs.iter().zip(sharp)).map(|(apart, sharp)| *apart && sharp);
        Self {
            apart: apart.collect(),
            logs_apart: several.differs,
            joints,
            common,
        }
    }
}

/// Estimates the lags of logs together; `None` without torque or with too little motion.
pub fn lags(robot: &Robot, pipeline: &Pipeline, logs: &[&Trajectory]) -> Option<Lags> {
    let mut found = estimate(robot, pipeline, logs)?;
    let names = robot.joint_names();
    let votes = Votes::new(&found);
    let is_clear = |[lag, sd]: &[f64; 2]| lag.abs() > CLEARLY * sd && lag.abs() < END * REACH;
    let clear = votes.common.filter(is_clear);
    let mut moved = vec![clear.map_or(0.0, |[lag, _]| lag); names.len()];
    let apart = || votes.joints.iter().zip(&votes.apart);
    for ((joint, [lag, _]), _) in apart().filter(|(_, apart)| **apart) {
        moved[*joint] = *lag;
    }
    let (gain, gains) = match moved.iter().any(|lag| *lag != 0.0) {
        true => found.gain(&moved)?,
        false => (0.0, vec![0.0; names.len()]),
    };
    let joint = |((joint, [lag, sd]), apart): (&(usize, [f64; 2]), &bool)| JointLag {
        joint: names[*joint].to_owned(),
        lag: *lag,
        sd: *sd,
        differs: *apart && gains[*joint] > MISTAKE,
    };
    let of_logs = found.gain_of_logs(votes.common.map_or(0.0, |[lag, _]| lag));
    let mut logs_apart = votes.logs_apart.iter();
    let log = |((trajectory, lag), gain): ((&&Trajectory, &Option<[f64; 2]>), &f64)| {
        let apart = said_lag(lag).and_then(|_| logs_apart.next());
        LogLag {
            log: trajectory.name.clone(),
            interval: (trajectory.segments.first()).map_or(0.0, |s| s.logged_interval),
            common: *lag,
            differs: apart.is_some_and(|apart| *apart) && *gain > MISTAKE,
        }
    };
    let own = logs.iter().zip(&found.logs).zip(&of_logs);
    Some(Lags {
        common: votes.common,
        gain,
        clear: clear.is_some() && gain > IMPROVES,
        joints: apart().map(joint).collect(),
        logs: own.map(log).collect(),
    })
}

/// Lag of each third of a log, with its standard deviation, s: a lag that grows is a torque clock that drifts. `None` where a third does not say it.
pub fn lag_by_thirds(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
) -> Option<[[f64; 2]; 3]> {
    let first = trajectory.segments.first()?.time.first()?;
    let last = trajectory.segments.last()?.time.last()?;
    let third = |k: usize| {
        let [from, to] = [k, k + 1].map(|k| first + (last - first) * k as f64 / 3.0);
        trajectory.between(from, to)
    };
    let thirds = [0, 1, 2].map(third);
    let found = estimate(robot, pipeline, &thirds.each_ref())?;
    match found.logs[..] {
        [Some(a), Some(b), Some(c)] => Some([a, b, c]),
        _ => None,
    }
}

impl Lags {
    /// What moves torque back: the common lag where it is clear, that of each joint that differs. `None` where nothing is clear.
    pub fn correction(&self, robot: &Robot) -> Option<Lag> {
        let common = self
            .common
            .filter(|_| self.clear)
            .map_or(0.0, |[lag, _]| lag);
        let differ: Vec<&JointLag> = self.joints.iter().filter(|joint| joint.differs).collect();
        if differ.is_empty() {
            return (common != 0.0).then_some(Lag::All(common));
        }
        let names = robot.joint_names().into_iter();
        let mut joints: BTreeMap<String, f64> =
            names.map(|name| (name.to_owned(), common)).collect();
        for joint in differ {
            joints.insert(joint.joint.clone(), joint.lag);
        }
        Some(Lag::Joints(joints))
    }
}

/// Findings on the lags of logs, beside those that are `known`. `said`: what the user said of lags, which was applied before these were estimated.
///
/// | what is clear | finding |
/// |---|---|
/// | a lag of all joints and logs | a note that it is applied; a warning where the user said another |
/// | that of one joint | degraded data, its subject is the joint; it is applied |
/// | that of one log | a warning, `log_torque_lag`; it is not applied |
pub fn lag_findings(said: &Lag, lags: &Lags, known: &[Finding]) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some([lag, sd]) = lags.common.filter(|_| lags.clear) {
        findings.push(common_finding(said, lags, [lag, sd]));
    }
    let common = lags.common.map_or(0.0, |[lag, _]| lag);
    for joint in lags.joints.iter().filter(|joint| joint.differs) {
        let message = format!(
            "joint `{}`: torque is logged {}, other joints {:.1} ms. It is moved back before the fit. Look at how this joint's torque is recorded; [signal] \
             lag = {{ {} = {:.4} }} says that it is right",
            joint.joint,
            behind([joint.lag, joint.sd]),
            1e3 * common,
            joint.joint,
            joint.lag
        );
        let severity = match said {
            Lag::Unsaid => Severity::Degraded,
            _ => Severity::Warning,
        };
        findings.push(
            Finding::new(severity, Code::TorqueLag, &joint.joint, message, 0).with([
                ("lag", joint.lag),
                ("lag_sd", joint.sd),
                ("lag_of_others", common),
            ]),
        );
    }
    findings.extend(late_logs(lags, known));
    findings
}

/// Findings on logs whose lag differs from that of the others, where none is `known` that says so: nothing moves a single log's torque.
pub fn late_logs(lags: &Lags, known: &[Finding]) -> Vec<Finding> {
    let is_known = |log: &LogLag| {
        let mut known = known.iter();
        known.any(|own| own.code == Code::LogTorqueLag && own.subject == log.log)
    };
    let late = (lags.logs.iter()).filter(|log| log.differs && !is_known(log));
    let finding = |log: &LogLag| {
        let own = log.common?;
        let message = format!(
            "log `{}`: torque is logged {}, unlike the other logs. Leave this log out, or move its torque to the time of its motion",
            log.log,
            behind(own)
        );
        Some(
            Finding::new(Severity::Warning, Code::LogTorqueLag, &log.log, message, 0)
                .with([("lag", own[0]), ("lag_sd", own[1])]),
        )
    };
    late.filter_map(finding).collect()
}

fn common_finding(said: &Lag, lags: &Lags, common: [f64; 2]) -> Finding {
    let gain = significant(100.0 * lags.gain, 2);
    let late = behind(common);
    let (severity, message) = match said {
        Lag::Unsaid => (
            Severity::Note,
            format!(
                "torque is logged {late}, as most joints agree. It is moved back before the fit: left-out rows of the training logs have {gain} % less error. \
                 [signal] lag = 0 leaves it as logged"
            ),
        ),
        _ => (
            Severity::Warning,
            format!(
                "with the [signal] lag that was given torque is still logged {late}; without this left-out rows of the training logs have {gain} % less \
                 error. Give a lag that is {:.4} s longer, or \"auto\"",
                common[0]
            ),
        ),
    };
    Finding::new(severity, Code::TorqueLag, "", message, 0).with([
        ("lag", common[0]),
        ("lag_sd", common[1]),
        ("error_reduction", lags.gain),
    ])
}

/// A lag in words.
fn behind([lag, sd]: [f64; 2]) -> String {
    let order = if lag < 0.0 { "before" } else { "after" };
    format!(
        "{:.1} ± {:.1} ms {order} the motion",
        1e3 * lag.abs(),
        1e3 * sd
    )
}

#[cfg(test)]
mod tests;
