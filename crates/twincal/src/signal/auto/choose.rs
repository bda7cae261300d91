//! Replaces every "auto" of the signal settings by a number that the training logs justify.

use super::filtered::on;
use super::ready::{LongReady, ReadyLog};
use super::settings::{Auto, SignalSettings};
use super::survey::{Candidates, Chapters};
use super::unexcited::unexcited;
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::clean::correct::DerivedFrom;
use crate::signal::clean::prepare::prepare;
use crate::signal::filter::pipeline::Pipeline;
use crate::signal::filter::prepared_log::{PreparedLog, require_derivatives};
use crate::signal::log::joints::{JointFacts, joint_facts};
use crate::signal::log::long::{Log, Logs, LongLog};
use crate::signal::log::recording::Recording;
use crate::signal::log::stamps::even_interval;

/// What [`choose_and_prepare`] gives.
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

/// Chooses cut-off, rates and thresholds from the training recordings; the same pipeline then serves every log.
///
/// | value | rule for "auto" |
/// |---|---|
/// | `cutoff_hz` | max(5 Hz, 2 f_m), f_m the frequency below which 99 % of the velocity's power lies; lower where encoder noise in q̈ asks for it (`signal/auto/cutoff.rs` states the whole rule) |
/// | `motion_cutoff_hz` | 4 f_c, at most 0.45 of the slowest log's rate |
/// | `rate_hz` | 2.5 f_c |
/// | `standstill_velocity` | the largest of v_s, three standard deviations of the noise in the derivative of position after the motion filter, and 4 f_q encoder steps (two steps at once look that fast) |
///
/// # Errors
/// [`crate::Error::Setting`] for numbers out of range or a cut-off above 0.4 of a log's rate; [`crate::Error::Log`] for logs that
/// are too short or have a broken clock, and with cut-off 0 for logs without q̇ or q̈; [`crate::Error::Refused`] if every joint stands still.
pub fn choose_pipeline(
    robot: &Robot,
    logs: &[Recording],
    settings: &SignalSettings,
) -> Result<(Pipeline, Vec<Finding>)> {
    let logs = Logs::from(logs);
    let chosen = choose_and_prepare(robot, &logs.0, settings)?;
    Ok((chosen.pipeline, chosen.findings))
}

/// [`choose_pipeline`] and [`crate::signal::ready`] in one: logs in memory are cut and unfolded once.
///
/// # Errors
/// Those of both.
pub fn choose_and_prepare<'a>(
    robot: &Robot,
    logs: &'a [Log<'_>],
    settings: &SignalSettings,
) -> Result<Chosen<'a>> {
    choose(&joint_facts(robot), logs, settings)
}

/// See [`choose_and_prepare`].
pub(crate) fn choose<'a>(
    joints: &[JointFacts],
    logs: &'a [Log<'_>],
    settings: &SignalSettings,
) -> Result<Chosen<'a>> {
    settings.check()?;
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
    let logs = ready(joints, logs, candidates, &pipeline);
    Ok(Chosen {
        pipeline,
        wider_hz,
        findings,
        logs,
    })
}

/// The logs that the pipeline was chosen from, ready for it, in their order.
fn ready<'a>(
    joints: &[JointFacts],
    logs: &[Log<'_>],
    candidates: Candidates<'a>,
    pipeline: &Pipeline,
) -> Vec<ReadyLog<'a>> {
    let Candidates { whole, long } = candidates;
    let (mut whole, mut long) = (whole.into_iter(), long.into_iter());
    let ready = |log: &Log<'_>| match log {
        Log::Whole(_) => whole.next().map(|(recording, pieces, findings)| {
            let joints = joints.to_vec();
            ReadyLog::Whole(PreparedLog::of(
                joints, recording, pieces, findings, pipeline,
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
    logs.iter().filter_map(ready).collect()
}

fn needs_a_filter(long: &LongLog) -> Error {
    Error::Log {
        log: long.name.clone(),
        problem: "is in chapters, which are made for a filter".into(),
        remedy: "set [signal] cutoff_hz to \"auto\" or a number above 0, or hold the log in memory"
            .into(),
    }
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
