//! Replaces every "auto" of the signal settings by a number that the training logs justify.

mod filtered;

use super::align::PreparedLog;
use super::clock::even_interval;
use super::prepare::{JointFacts, prepare};
use super::survey::{Candidates, Chapters};
use super::{
    Auto, DerivedFrom, Log, LongLog, LongReady, Pipeline, ReadyLog, Recording, SignalSettings,
};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::words::listed;
use filtered::on;

/// v_s where the pipeline is on and nothing is said, rad/s or m/s.
const COULOMB_VELOCITY: f64 = 0.02;
/// Motion filter's highest cut-off as a share of the log's rate.
pub(crate) const MOTION_LIMIT: f64 = 0.45;
/// Column filter's highest cut-off as a share of the log's rate: 2.5 f_c is then the rate itself.
pub(crate) const COLUMN_LIMIT: f64 = 0.4;
/// Kept rows that the longest segment must give at least.
const FEWEST_ROWS: f64 = 10.0;

fn setting(key: &str, problem: String, remedy: &str) -> Error {
    Error::Setting {
        key: key.into(),
        problem,
        remedy: remedy.into(),
    }
}

/// What [`super::choose_and_prepare`] gives.
#[derive(Debug)]
pub struct Chosen<'a> {
    /// For every log.
    pub pipeline: Pipeline,
    /// Four times the cut-off where nobody stated one, accelerations are known as well there and the logs are fast enough, Hz.
    pub wider_hz: Option<f64>,
    /// What was found on the way.
    pub findings: Vec<Finding>,
    /// The logs, ready for the pipeline.
    pub logs: Vec<ReadyLog<'a>>,
}

/// See [`super::choose_and_prepare`].
pub(crate) fn choose<'a>(
    joints: &[JointFacts],
    logs: &'a [Log<'_>],
    settings: &SignalSettings,
) -> Result<Chosen<'a>> {
    check_settings(settings)?;
    if logs.is_empty() {
        return Err(Error::Refused {
            problem: "no training log".into(),
            remedy: "give at least one log".into(),
        });
    }
    let (corrections, is_off) = (
        &settings.corrections,
        settings.cutoff_hz == Auto::Value(0.0),
    );
    corrections.check(joints, is_off)?;
    let mut candidates = Candidates {
        whole: Vec::new(),
        long: Vec::new(),
    };
    for log in logs {
        match log {
            Log::Whole(recording) => {
                // What is wrong with single logs is said when they are aligned.
                let mut unsaid = Vec::new();
                let pieces = prepare(joints, recording, is_off, corrections, &mut unsaid)?;
                candidates.whole.push((recording, pieces, unsaid));
            }
            Log::Long(long) if is_off => return Err(needs_a_filter(long)),
            Log::Long(long) => {
                let chapters = Chapters::read(joints, long, settings)?;
                candidates.long.push((long, chapters));
            }
        }
    }
    let (pipeline, wider_hz, findings) = if is_off {
        let recordings: Vec<&Recording> = candidates.whole.iter().map(|whole| whole.0).collect();
        let (pipeline, findings) = off(joints, &recordings, settings)?;
        (pipeline, None, findings)
    } else {
        on(joints, logs[0].name(), &candidates, settings)?
    };
    let Candidates { whole, long } = candidates;
    let (mut whole, mut long) = (whole.into_iter(), long.into_iter());
    let ready = |log: &Log<'_>| match log {
        Log::Whole(_) => whole.next().map(|(recording, pieces, findings)| {
            let joints = joints.to_vec();
            ReadyLog::Whole(PreparedLog::of(
                joints, recording, pieces, findings, &pipeline,
            ))
        }),
        Log::Long(_) => long.next().map(|(log, chapters)| {
            ReadyLog::Long(LongReady {
                log: log.clone(),
                joints: joints.to_vec(),
                interval: chapters.interval(),
            })
        }),
    };
    let logs = logs.iter().filter_map(ready).collect();
    Ok(Chosen {
        pipeline,
        wider_hz,
        findings,
        logs,
    })
}

fn needs_a_filter(long: &LongLog) -> Error {
    Error::Log {
        log: long.name.clone(),
        problem: "is in chapters, which are made for a filter".into(),
        remedy: "set [signal] cutoff_hz to \"auto\" or a number above 0, or hold the log in memory"
            .into(),
    }
}

fn check_settings(settings: &SignalSettings) -> Result<()> {
    let positive = |key: &str, value: f64, zero: bool| {
        if value.is_finite() && (value > 0.0 || zero && value == 0.0) {
            return Ok(());
        }
        Err(setting(
            key,
            format!("{value} is out of range"),
            "give a number above 0",
        ))
    };
    if let Auto::Value(value) = settings.cutoff_hz {
        positive("signal.cutoff_hz", value, true)?;
    }
    if let Auto::Value(value) = settings.rate_hz {
        positive("signal.rate_hz", value, false)?;
    }
    settings.coulomb_velocity.map_or(Ok(()), |value| {
        positive("library.coulomb_velocity", value, true)
    })
}

/// `limits`: how fast a joint must be to count as moving, rad/s or m/s; empty with the filter off.
fn unexcited(joints: &[JointFacts], still: &[bool], limits: &[f64]) -> Result<Vec<Finding>> {
    let names = |wanted: bool| -> Vec<String> {
        joints
            .iter()
            .enumerate()
            .filter(|(joint, _)| still[*joint] == wanted)
            .map(|(joint, facts)| match limits.get(joint) {
                Some(limit) => format!("`{}` below {limit:.3} rad/s (m/s)", facts.name),
                None => format!("`{}`", facts.name),
            })
            .collect()
    };
    if names(false).is_empty() {
        return Err(Error::Refused {
            problem: format!(
                "no excitation: every joint is at rest in all training logs ({})",
                listed(names(true), ", ")
            ),
            remedy: if limits.iter().any(|limit| *limit > COULOMB_VELOCITY) {
                "a coarse encoder cannot distinguish slower motion from rest: record faster motion, log the velocity, or \
                 lower [signal] cutoff_hz"
                    .into()
            } else {
                "record logs in which the joints move".into()
            },
        });
    }
    Ok(joints
        .iter()
        .zip(still)
        .filter(|(_, still)| **still)
        .map(|(joint, _)| {
            Finding::new(
                Severity::Warning,
                Code::JointNotExcited,
                &joint.name,
                format!(
                    "joint `{}` is at rest in all training logs: its own effects cannot be seen",
                    joint.name
                ),
                0,
            )
        })
        .collect())
}

/// Pipeline off: rows are the input rows, so motion has to be complete.
fn off(
    joints: &[JointFacts],
    logs: &[&Recording],
    settings: &SignalSettings,
) -> Result<(Pipeline, Vec<Finding>)> {
    let mut still = vec![true; joints.len()];
    for log in logs {
        require_derivatives(joints, log)?;
        for (joint, still) in still.iter_mut().enumerate() {
            let moves = |values: &[f64]| values.iter().any(|v| v.is_finite() && *v != 0.0);
            *still &= !log.joints[joint].qd.as_deref().is_some_and(moves);
        }
    }
    // Poses without motion still tell gravity: only a log without any change is without excitation.
    for log in logs {
        for (joint, still) in still.iter_mut().enumerate() {
            let q = &log.joints[joint].q;
            *still &= q.iter().all(|v| !v.is_finite() || *v == q[0]);
        }
    }
    let mut findings = unexcited(joints, &still, &[])?;
    if let Auto::Value(rate) = settings.rate_hz {
        findings.push(Finding::new(
            Severity::Warning,
            Code::RateIgnored,
            "",
            format!(
                "signal.rate_hz = {rate} has no effect: with signal.cutoff_hz = 0 every input row is one row; leave one of them out"
            ),
            0,
        )
        .with([("rate", rate)]));
    }
    let intervals: Vec<f64> = logs
        .iter()
        .filter_map(|log| even_interval(&log.time))
        .collect();
    let rate = intervals.iter().copied().fold(f64::NAN, f64::min);
    let pipeline = Pipeline {
        cutoff_hz: 0.0,
        motion_cutoff_hz: 0.0,
        rate_hz: if rate.is_finite() { 1.0 / rate } else { 0.0 },
        motion_interval: 0.0,
        coulomb_velocity: settings.coulomb_velocity.unwrap_or(0.0),
        standstill_velocity: vec![0.0; joints.len()],
        derived_from: vec![DerivedFrom::Position; joints.len()],
        velocity_from: Vec::new(),
        corrections: settings.corrections.clone(),
        history: Vec::new(),
    };
    Ok((pipeline, findings))
}

/// With the filter off nothing is differentiated.
pub(crate) fn require_derivatives(joints: &[JointFacts], log: &Recording) -> Result<()> {
    for (channels, joint) in log.joints.iter().zip(joints) {
        for (missing, what) in [
            (channels.qd.is_none(), "velocity"),
            (channels.qdd.is_none(), "acceleration"),
        ] {
            if missing {
                return Err(Error::Log {
                    log: log.name.clone(),
                    problem: format!(
                        "joint `{}` has no {what} and cutoff_hz = 0 differentiates nothing",
                        joint.name
                    ),
                    remedy: "log it, or set [signal] cutoff_hz to \"auto\" or a number".into(),
                });
            }
        }
    }
    Ok(())
}
