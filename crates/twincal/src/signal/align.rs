//! One recording through the motion filter: segments of smooth motion, raw torque and standstill flags.

mod segment;

use super::agreement::{self, velocity_agreement};
use super::choose::{COLUMN_LIMIT, MOTION_LIMIT, require_derivatives};
use super::fir::{column_half_seconds, motion_half_seconds};
use super::mask::Saturated;
use super::prepare::{JointFacts, Piece, Prepared, prepare, report_short};
use super::thin::thin;
use super::{Channels, Pipeline, Recording, Segment, Trajectory};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::words::significant;
use segment::{Kept, as_logged, smoothed};
use std::borrow::Cow;
use std::ops::Range;

/// Standstill has to last for this many periods of the cut-off.
pub(super) const STANDSTILL_PERIODS: f64 = 3.0;

/// Share of standstill from which a joint counts as not moving in a log.
const HARDLY_MOVES: f64 = 0.95;
/// In v_s, from which speed on "standing still" would be no word for what is slower.
const SLOW: f64 = 10.0;

/// What a segment keeps of samples as logged where its motion has a coarser clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Raw {
    /// None: for filtered rows alone.
    None,
    /// Evenly spread stretches, about 65 536 samples of a log: enough for a standard deviation or a coverage.
    Spread,
    /// All.
    All,
}

/// A log cut, unfolded and on even clocks, ready for any cut-off up to 1.4 times that of the pipeline it was made for.
#[derive(Debug)]
pub struct PreparedLog<'a> {
    log: Cow<'a, Recording>,
    joints: Vec<JointFacts>,
    pieces: Prepared<'a>,
    saturated: Saturated,
    /// What each joint's position spans at most at rest, rad or m.
    at_rest: Vec<f64>,
    /// Time between cuts, before anything is thinned, s.
    seconds: f64,
    /// First stamp of the log that this is, or is a part of, s.
    start: f64,
    findings: Vec<Finding>,
}

impl<'a> PreparedLog<'a> {
    /// Step 1 of method section 1.
    pub(crate) fn new(
        joints: Vec<JointFacts>,
        log: &'a Recording,
        pipeline: &Pipeline,
    ) -> Result<Self> {
        let mut findings = Vec::new();
        let every_row = pipeline.is_off();
        if every_row {
            require_derivatives(&joints, log)?;
        }
        let pieces = prepare(
            &joints,
            log,
            every_row,
            &pipeline.corrections,
            &mut findings,
        )?;
        Ok(Self::of(joints, log, pieces, findings, pipeline))
    }

    /// The same from pieces that are there already, with what was found in them.
    pub(crate) fn of(
        joints: Vec<JointFacts>,
        log: &'a Recording,
        mut pieces: Prepared<'a>,
        mut findings: Vec<Finding>,
        pipeline: &Pipeline,
    ) -> Self {
        let (at_rest, seconds) = (pieces.at_rest(log), pieces.seconds());
        if !pipeline.is_off() {
            let (short, rows) = thin(&mut pieces, pipeline);
            report_short(log, short, rows, &mut findings);
        }
        Self {
            saturated: Saturated::find(&joints, log, pipeline),
            at_rest,
            seconds,
            start: first_stamp(log).unwrap_or(0.0),
            log: Cow::Borrowed(log),
            joints,
            pieces,
            findings,
        }
    }

    /// The same as a part of a log that starts at another time, s.
    #[must_use]
    pub(crate) fn since(self, start: Option<f64>) -> Self {
        Self {
            start: start.unwrap_or(self.start),
            ..self
        }
    }

    /// The log itself.
    pub fn recording(&self) -> &Recording {
        &self.log
    }

    /// Interval of the clock at which motion is held, s.
    pub(super) fn interval(&self) -> f64 {
        let pieces = self.pieces.pieces.first();
        pieces.map_or(self.pieces.interval, |piece| piece.interval)
    }

    /// Samples of each piece.
    pub(super) fn lengths(&self) -> Vec<usize> {
        let pieces = self.pieces.pieces.iter();
        pieces.map(|piece| piece.time.len()).collect()
    }

    /// Some stretches of it, each a piece of its own: (piece, samples).
    pub(super) fn cut(&self, stretches: &[(usize, Range<usize>)]) -> PreparedLog<'_> {
        let piece =
            |(piece, range): &(usize, Range<usize>)| self.pieces.pieces[*piece].lent(range.clone());
        PreparedLog {
            log: Cow::Borrowed(&self.log),
            joints: self.joints.clone(),
            pieces: Prepared {
                time: None,
                interval: self.pieces.interval,
                pieces: stretches.iter().map(piece).collect(),
            },
            saturated: self.saturated.clone(),
            at_rest: self.at_rest.clone(),
            seconds: self.seconds,
            start: self.start,
            findings: Vec::new(),
        }
    }

    /// Samples of all pieces, on the clock at which motion is held.
    pub fn samples(&self) -> usize {
        self.lengths().iter().sum()
    }

    /// Rows that a fit with this pipeline keeps at most: filters trim the ends of pieces.
    pub fn rows_at_most(&self, pipeline: &Pipeline) -> usize {
        let pieces = self.pieces.pieces.iter();
        pieces
            .map(|piece| piece.time.len().div_ceil(pipeline.step(piece.interval)))
            .sum()
    }

    /// What [`Raw::None`] needs, without the recording: of that only its name and its load are left, and which channels it had.
    #[must_use]
    pub fn detached(self) -> PreparedLog<'static> {
        let channels = self.log.joints.iter().map(|joint| Channels {
            q: Vec::new(),
            qd: joint.qd.as_ref().map(|_| Vec::new()),
            qdd: joint.qdd.as_ref().map(|_| Vec::new()),
            tau: joint.tau.as_ref().map(|_| Vec::new()),
            temperature: None,
        });
        PreparedLog {
            log: Cow::Owned(Recording {
                unfolded: self.log.unfolded,
                start_ns: self.log.start_ns,
                name: self.log.name.clone(),
                time: Vec::new(),
                joints: channels.collect(),
                payload: self.log.payload,
            }),
            joints: self.joints,
            pieces: Prepared {
                time: None,
                interval: self.pieces.interval,
                pieces: (self.pieces.pieces.into_iter())
                    .map(Piece::into_owned)
                    .collect(),
            },
            saturated: self.saturated,
            at_rest: self.at_rest,
            seconds: self.seconds,
            start: self.start,
            findings: self.findings,
        }
    }

    /// Step 2: smooth motion, with what was found on the way; `raw`: what stays of the samples as logged.
    ///
    /// # Errors
    /// As [`super::align`].
    pub fn align(&self, pipeline: &Pipeline, raw: Raw) -> Result<(Trajectory, Vec<Finding>)> {
        let mut findings = self.findings.clone();
        let trajectory = align(self, pipeline, raw, &mut findings)?;
        Ok((trajectory, findings))
    }
}

/// See [`PreparedLog::align`].
fn align(
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

/// First stamp of a log, s.
pub(super) fn first_stamp(log: &Recording) -> Option<f64> {
    log.time.iter().copied().find(|time| time.is_finite())
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
