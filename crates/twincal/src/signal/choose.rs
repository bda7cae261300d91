//! Replaces every "auto" of the signal settings by a number that the training logs justify.

use super::align::PreparedLog;
use super::clock::even_interval;
use super::cutoff::{
    JointSpectra, automatic, derived_from, motion_band, noisy_velocity, rms_acceleration, wider,
};
use super::encoder::{Encoder, velocity_resolution};
use super::fir::{column_half_seconds, column_kernel, motion_half_seconds, noise_gain};
use super::prepare::{JointFacts, prepare};
use super::survey::{Candidates, Chapters, Survey};
use super::thin::{coarsest, factor};
use super::{
    Auto, DerivedFrom, Log, LongLog, LongReady, Pipeline, ReadyLog, Recording, SignalSettings,
};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::words::{listed, significant};
use rayon::prelude::*;

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
        ));
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

/// Says that a joint's logged velocity is left out.
fn replaced_velocity(facts: &JointFacts, noise: [f64; 2]) -> Finding {
    let name = &facts.name;
    let [logged, travel] = noise.map(|noise| significant(noise, 2));
    let message = format!(
        "joint `{name}`: the logged velocity has a noise of {logged} per s (after the motion filter), the change of position {travel}: velocity is \
         taken from position; [signal] velocity = \"logged\" takes the log's"
    );
    Finding::new(Severity::Warning, Code::NoisyVelocity, name, message, 0)
}

/// Pipeline on; and a wider cut-off, see [`Chosen::wider_hz`].
fn on(
    joints: &[JointFacts],
    first_log: &str,
    candidates: &Candidates<'_>,
    settings: &SignalSettings,
) -> Result<(Pipeline, Option<f64>, Vec<Finding>)> {
    let coulomb_velocity = settings.coulomb_velocity.unwrap_or(COULOMB_VELOCITY);
    let whole = candidates.whole.iter();
    let surveys: Vec<Survey> = whole
        .map(|(recording, prepared, _)| Survey::of(recording, prepared, true))
        .collect();
    let chapters = candidates.long.iter();
    let seen: Vec<&Survey> = surveys
        .iter()
        .chain(chapters.flat_map(|(_, chapters)| &chapters.surveys))
        .collect();
    // Of a log in chapters its usual one: a chapter that is slower is left out where it must be.
    let of_long = candidates
        .long
        .iter()
        .map(|(_, chapters)| chapters.interval());
    let intervals: Vec<f64> = (surveys.iter().map(|survey| survey.interval))
        .chain(of_long)
        .collect();
    let rates = intervals.iter().map(|interval| 1.0 / interval);
    let lowest_rate = rates.fold(f64::INFINITY, f64::min);
    let longest = seen.iter().map(|survey| survey.longest).fold(0.0, f64::max);
    let all: Vec<&Vec<JointSpectra>> = seen.iter().filter_map(|s| s.spectra.as_ref()).collect();
    if all.is_empty() {
        return Err(Error::Log {
            log: first_log.to_owned(),
            problem: format!(
                "the longest stretch without a cut is {longest:.3} s, too short for a spectrum"
            ),
            remedy: "record at least some seconds without gaps, or set [signal] cutoff_hz = 0"
                .into(),
        });
    }
    let steps: Vec<Option<f64>> = (0..joints.len())
        .into_par_iter()
        .map(|joint| candidates.step(joint))
        .collect();
    let with_steps = |log: &&'_ Vec<JointSpectra>| -> Vec<JointSpectra> {
        let joints = log.iter().zip(&steps);
        joints.map(|(own, step)| own.quantised(*step)).collect()
    };
    let all: Vec<Vec<JointSpectra>> = all.iter().map(with_steps).collect();
    let of_joint =
        |joint: usize| -> Vec<&JointSpectra> { all.iter().map(|log| &log[joint]).collect() };
    // A joint that only trembles must not choose the cut-off.
    let mut moving: Vec<Vec<&JointSpectra>> = (0..joints.len())
        .map(of_joint)
        .filter(|logs| motion_band(logs).1 > COULOMB_VELOCITY)
        .collect();
    if moving.is_empty() {
        moving = (0..joints.len()).map(of_joint).collect();
    }
    let (cutoff, wider_hz) = match settings.cutoff_hz {
        Auto::Value(value) => (value, None),
        Auto::Auto => {
            let cutoff = automatic(&moving, longest, lowest_rate);
            (cutoff, wider(&moving, cutoff, lowest_rate))
        }
    };
    let (rate, mut findings) = limits(first_log, cutoff, longest, lowest_rate, settings)?;
    let motion_cutoff = (4.0 * cutoff).min(MOTION_LIMIT * lowest_rate);
    if motion_cutoff < 4.0 * cutoff {
        findings.push(Finding::new(
            Severity::Note,
            Code::MotionFilterCapped,
            "",
            format!(
                "the motion filter's cut-off is {motion_cutoff:.3} Hz instead of 4 x {cutoff} Hz: the slowest log has only {lowest_rate:.3} Hz"
            ),
            0,
        ));
    }
    let mut derived: Vec<DerivedFrom> = (0..joints.len())
        .map(|joint| derived_from(&of_joint(joint), cutoff))
        .collect();
    let mut velocity_from = vec![DerivedFrom::Velocity; joints.len()];
    let said = settings.corrections.velocity.is_some();
    for (joint, facts) in joints.iter().enumerate().filter(|_| !said) {
        if let Some(noise) = noisy_velocity(&of_joint(joint), motion_cutoff) {
            (velocity_from[joint], derived[joint]) = (DerivedFrom::Position, DerivedFrom::Position);
            findings.push(replaced_velocity(facts, noise));
        }
    }
    if !velocity_from.contains(&DerivedFrom::Position) {
        velocity_from.clear();
    }
    let acceleration = moving.iter().map(|logs| rms_acceleration(logs));
    let acceleration = acceleration.fold(0.0, f64::max);
    let mut pipeline = Pipeline {
        cutoff_hz: cutoff,
        motion_cutoff_hz: motion_cutoff,
        rate_hz: rate,
        motion_interval: if settings.every_sample {
            0.0
        } else {
            coarsest(motion_cutoff, coulomb_velocity, acceleration)
        },
        coulomb_velocity,
        standstill_velocity: Vec::with_capacity(joints.len()),
        derived_from: derived,
        velocity_from,
        corrections: settings.corrections.clone(),
        history: Vec::new(),
    };
    if intervals
        .iter()
        .all(|interval| factor(&pipeline, *interval) == 1)
    {
        pipeline.motion_interval = 0.0;
    }
    let resolved: Vec<(f64, Vec<Finding>)> = (joints.par_iter().enumerate())
        .map(|(joint, facts)| {
            let mut said = Vec::new();
            let logged = [0, 1].map(|channel| seen.iter().all(|s| s.logged[joint][channel]));
            let encoder = Encoder {
                facts,
                logged,
                step: steps[joint],
            };
            let spectra = of_joint(joint);
            let resolved = velocity_resolution(joint, &encoder, &spectra, &pipeline, &mut said);
            (coulomb_velocity.max(resolved), said)
        })
        .collect();
    for (threshold, said) in resolved {
        findings.extend(said);
        pipeline.standstill_velocity.push(threshold);
    }
    let thresholds = &pipeline.standstill_velocity;
    let moving = candidates.move_by(joints, thresholds, cutoff, settings)?;
    let still: Vec<bool> = moving.iter().map(|moves| !moves).collect();
    findings.extend(unexcited(joints, &still, thresholds)?);
    let kept = pipeline.common_rate(
        intervals
            .iter()
            .map(|interval| pipeline.kept_rate(*interval)),
    );
    let taps = column_kernel(cutoff, 1.0 / lowest_rate);
    findings.push(Finding::new(
        Severity::Note,
        Code::Pipeline,
        "",
        format!(
            "columns and torque: symmetric FIR at {cutoff} Hz, {:.3} s to either side, white-noise gain {:.3}; motion: FIR at {motion_cutoff:.3} Hz, {:.3} s; rows at {} Hz",
            column_half_seconds(cutoff),
            noise_gain(&taps),
            motion_half_seconds(motion_cutoff),
            (1e6 * kept).round() / 1e6
        ),
        0,
    ));
    Ok((pipeline, wider_hz, findings))
}

/// Rate of kept rows, after checking that the filters fit the logs.
fn limits(
    first_log: &str,
    cutoff: f64,
    longest: f64,
    lowest_rate: f64,
    settings: &SignalSettings,
) -> Result<(f64, Vec<Finding>)> {
    let mut findings = Vec::new();
    if cutoff > COLUMN_LIMIT * lowest_rate {
        return Err(setting(
            "signal.cutoff_hz",
            format!(
                "{cutoff} Hz is above {COLUMN_LIMIT} of the slowest log's rate of {lowest_rate:.3} Hz"
            ),
            &format!(
                "give at most {:.3}, \"auto\", or 0 for no filter",
                COLUMN_LIMIT * lowest_rate
            ),
        ));
    }
    let mut rate = match settings.rate_hz {
        Auto::Value(value) => value,
        Auto::Auto => 2.5 * cutoff,
    };
    if rate > lowest_rate * 1.001 {
        findings.push(Finding::new(
            Severity::Note,
            Code::RateCapped,
            "",
            format!("rows are kept at the slowest log's rate of {lowest_rate:.3} Hz instead of {rate} Hz"),
            0,
        ));
        rate = lowest_rate;
    }
    if rate < 2.0 * cutoff {
        findings.push(Finding::new(
            Severity::Warning,
            Code::RowsAlias,
            "",
            format!("rows at {rate} Hz are below twice the cut-off of {cutoff} Hz: torque between them folds into the estimates as noise"),
            0,
        ));
    }
    let needed = 2.0
        * (column_half_seconds(cutoff)
            + motion_half_seconds((4.0 * cutoff).min(MOTION_LIMIT * lowest_rate)))
        + FEWEST_ROWS / rate;
    if longest < needed {
        return Err(Error::Log {
            log: first_log.to_owned(),
            problem: format!(
                "the longest stretch without a cut is {longest:.3} s; filters at {cutoff} Hz need {needed:.3} s for {FEWEST_ROWS} rows"
            ),
            remedy: "record longer, fix the gaps, raise [signal] cutoff_hz, or set it to 0".into(),
        });
    }
    Ok((rate, findings))
}
