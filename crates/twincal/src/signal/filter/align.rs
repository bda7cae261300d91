//! One recording through the motion filter: segments of smooth motion, raw torque and standstill flags.

use super::agreement::{self, velocity_agreement};
use super::fir::{column_half_seconds, motion_half_seconds};
use super::pipeline::{COLUMN_LIMIT, MOTION_LIMIT, Pipeline};
use super::prepared_log::{PreparedLog, Raw, prepare};
use super::segment::{Kept, as_logged, smoothed};
use super::trajectory::{Segment, Trajectory};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::clean::prepare::report_short;
use crate::signal::log::joints::JointFacts;
use crate::signal::log::recording::Recording;
use crate::words::significant;

/// Share of standstill from which a joint counts as not moving in a log.
const HARDLY_MOVES: f64 = 0.95;
/// In v_s, from which speed on "standing still" would be no word for what is slower.
const SLOW: f64 = 10.0;

impl PreparedLog<'_> {
    /// Step 2: smooth motion, with what was found on the way; `raw`: what stays of the samples as logged.
    ///
    /// # Errors
    /// As [`align`].
    pub fn align(&self, pipeline: &Pipeline, raw: Raw) -> Result<(Trajectory, Vec<Finding>)> {
        let mut findings = self.findings.clone();
        let trajectory = filtered(self, pipeline, raw, &mut findings)?;
        Ok((trajectory, findings))
    }
}

/// One recording through steps 1 and 2 of method section 1: cut, unfold, resample, smooth, differentiate, mask.
///
/// Rows that are NaN or infinite are dropped and cut the log; so do steps back and gaps of more than five median steps.
/// Uneven clocks are resampled at the median step by a cubic spline. With the pipeline off all rows stay as they are
/// (rows that are not finite excepted).
///
/// # Errors
/// [`crate::Error::Log`] if nothing usable is left or the clock is broken; the message says what to do.
pub fn align(
    robot: &Robot,
    log: &Recording,
    pipeline: &Pipeline,
) -> Result<(Trajectory, Vec<Finding>)> {
    prepare(robot, log, pipeline)?.align(pipeline, Raw::All)
}

/// [`align`] of a part of a log that starts at `start`, s.
///
/// # Errors
/// As [`align`].
pub(crate) fn align_part(
    robot: &Robot,
    part: &Recording,
    start: Option<f64>,
    pipeline: &Pipeline,
) -> Result<(Trajectory, Vec<Finding>)> {
    prepare(robot, part, pipeline)?
        .since(start)
        .align(pipeline, Raw::All)
}

/// See [`PreparedLog::align`].
fn filtered(
    ready: &PreparedLog<'_>,
    pipeline: &Pipeline,
    raw: Raw,
    findings: &mut Vec<Finding>,
) -> Result<Trajectory> {
    let PreparedLog {
        log,
        joints,
        pieces: prepared,
        saturated,
        ..
    } = ready;
    let with_tau = log.joints.iter().all(|c| c.tau.is_some());
    let mut trajectory = Trajectory {
        name: log.name.clone(),
        dof: joints.len(),
        segments: Vec::with_capacity(prepared.pieces.len()),
        payload: log.payload,
        payload_acts: true,
    };
    if pipeline.is_off() {
        let logged = prepared.pieces.iter();
        trajectory.segments = logged.map(|piece| as_logged(piece, with_tau)).collect();
    } else {
        let cutoff = motion_cutoff(ready, pipeline, findings)?;
        let kept = Kept { with_tau, raw };
        trajectory.segments = smooth_segments(ready, pipeline, (cutoff, kept), findings)?;
        report_agreement(ready, (&trajectory, pipeline), findings);
        report_standstill(joints, log, (&trajectory, pipeline), findings);
    }
    pipeline.remember(log, ready.start, &mut trajectory, findings);
    saturated.mask(log, pipeline, &mut trajectory, findings);
    Ok(trajectory)
}

/// Cut-off of the motion filter for this log, Hz.
///
/// # Errors
/// [`Error::Log`] where the log's rate is too low for the column filter.
fn motion_cutoff(
    ready: &PreparedLog<'_>,
    pipeline: &Pipeline,
    findings: &mut Vec<Finding>,
) -> Result<f64> {
    let log = &ready.log;
    let rate = 1.0 / ready.pieces.interval;
    if pipeline.cutoff_hz > COLUMN_LIMIT * rate {
        return Err(Error::Log {
            log: log.name.clone(),
            problem: format!(
                "its rate of {rate:.3} Hz is too low for the cut-off of {} Hz",
                pipeline.cutoff_hz
            ),
            remedy: format!(
                "record at {:.3} Hz or more, or lower [signal] cutoff_hz",
                pipeline.cutoff_hz / COLUMN_LIMIT
            ),
        });
    }
    let cutoff = pipeline.motion_cutoff_hz.min(MOTION_LIMIT * rate);
    if cutoff < pipeline.motion_cutoff_hz {
        findings.push(Finding::new(
            Severity::Warning,
            Code::MotionFilterCapped,
            &log.name,
            format!(
                "the motion filter's cut-off is {cutoff:.3} Hz here instead of {:.3} Hz: the log has only {rate:.3} Hz",
                pipeline.motion_cutoff_hz
            ),
            0,
        )
        .with([("cutoff", cutoff), ("cutoff_wanted", pipeline.motion_cutoff_hz), ("rate", rate)]));
    }
    Ok(cutoff)
}

/// The pieces that are long enough for the filters; says what of the log the filters use up.
///
/// # Errors
/// [`Error::Log`] where no piece is.
fn smooth_segments(
    ready: &PreparedLog<'_>,
    pipeline: &Pipeline,
    filter: (f64, Kept),
    findings: &mut Vec<Finding>,
) -> Result<Vec<Segment>> {
    let (log, (cutoff, kept)) = (&ready.log, filter);
    let mut segments = Vec::with_capacity(ready.pieces.pieces.len());
    let (mut short, mut short_rows, mut used) = (0, 0, 0.0);
    for piece in &ready.pieces.pieces {
        match smoothed(ready, piece, pipeline, cutoff, kept) {
            Some(segment) => {
                let border = 2.0 * column_half_seconds(pipeline.cutoff_hz);
                let length = segment.time.len().saturating_sub(1) as f64 * piece.interval;
                used += (length - border).max(0.0);
                segments.push(segment);
            }
            None => {
                short += 1;
                short_rows += piece.rows.len() as u64;
            }
        }
    }
    report_short(log, short, short_rows, findings);
    if segments.is_empty() {
        return Err(Error::Log {
            log: log.name.clone(),
            problem: format!(
                "no stretch between cuts is longer than the motion filter ({:.3} s)",
                2.0 * motion_half_seconds(cutoff)
            ),
            remedy: "fix the gaps and NaN rows, or raise [signal] cutoff_hz".into(),
        });
    }
    findings.push(Finding::new(
        Severity::Note,
        Code::Borders,
        &log.name,
        format!(
            "the filters need {:.3} s at either end of each segment: {used:.3} of {:.3} s become rows",
            column_half_seconds(pipeline.cutoff_hz) + pipeline.motion_half_length(),
            ready.seconds
        ),
        0,
    )
    .with([
        ("border", column_half_seconds(pipeline.cutoff_hz) + pipeline.motion_half_length()),
        ("seconds_used", used), ("seconds", ready.seconds),
    ]));
    Ok(segments)
}

/// Says where a logged velocity and the change of position disagree.
fn report_agreement(
    ready: &PreparedLog<'_>,
    aligned: (&Trajectory, &Pipeline),
    findings: &mut Vec<Finding>,
) {
    let (log, (trajectory, pipeline)) = (&ready.log, aligned);
    let names: Vec<&str> = (ready.joints.iter())
        .map(|facts| facts.name.as_str())
        .collect();
    let mut agreement = velocity_agreement(trajectory, &pipeline.standstill_velocity);
    for (agreement, channels) in agreement.iter_mut().zip(&log.joints) {
        *agreement = agreement.filter(|_| channels.qd.is_some());
    }
    findings.extend(agreement::findings(&names, &log.name, &agreement));
}

/// Says how much of the log each joint is at rest.
fn report_standstill(
    joints: &[JointFacts],
    log: &Recording,
    (trajectory, pipeline): (&Trajectory, &Pipeline),
    findings: &mut Vec<Finding>,
) {
    for (joint, facts) in joints.iter().enumerate() {
        let (mut still, mut all) = (0_usize, 0_usize);
        for segment in &trajectory.segments {
            let len = segment.time.len();
            let own = &segment.standstill[joint * len..(joint + 1) * len];
            all += len * segment.thinning();
            still += own.iter().filter(|s| **s).count() * segment.thinning();
        }
        if still == 0 {
            continue;
        }
        let share = 100.0 * still as f64 / all as f64;
        let (severity, code, rest) = if still as f64 >= HARDLY_MOVES * all as f64 {
            (Severity::Warning, Code::JointStandsStill, "does not move")
        } else {
            (Severity::Note, Code::Standstill, "is at rest")
        };
        let limit = pipeline.standstill_velocity[joint];
        // A coarse encoder tells slow motion from standing still only where the filter leaves little of its steps.
        let text = if limit > SLOW * pipeline.coulomb_velocity {
            format!(
                "is slower than {} per s in {share:.1} % of this log's filtered samples, which its encoder cannot tell from standstill at a cut-off of {} Hz",
                significant(limit, 2),
                pipeline.cutoff_hz
            )
        } else {
            format!("{rest} in {share:.1} % of this log's filtered samples")
        };
        let message = format!(
            "joint `{}` {text}; its torque there is not used",
            facts.name
        );
        let own = Finding::new(severity, code, &log.name, message, still as u64).with([
            ("share_at_rest", still as f64 / all as f64),
            ("rest_velocity", limit),
            ("cutoff", pipeline.cutoff_hz),
        ]);
        findings.push(own.of_joint(&facts.name));
    }
}
