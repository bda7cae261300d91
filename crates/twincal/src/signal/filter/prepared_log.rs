//! A log that was cut, unfolded and put on even clocks, with what filtering it takes.

use super::mask::Saturated;
use super::pipeline::Pipeline;
use super::thin::thin;
use crate::error::{Error, Finding, Result};
use crate::robot::Robot;
use crate::signal::clean::pieces::{Piece, Prepared};
use crate::signal::clean::prepare::{self, report_short};
use crate::signal::log::joints::{JointFacts, joint_facts};
use crate::signal::log::recording::{Channels, Recording};
use crate::signal::log::stamps::first_stamp;
use std::borrow::Cow;
use std::ops::Range;

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
    pub(super) log: Cow<'a, Recording>,
    pub(super) joints: Vec<JointFacts>,
    pub(super) pieces: Prepared<'a>,
    pub(super) saturated: Saturated,
    /// What each joint's position spans at most at rest, rad or m.
    pub(super) at_rest: Vec<f64>,
    /// Time between cuts, before anything is thinned, s.
    pub(super) seconds: f64,
    /// First stamp of the log that this is, or is a part of, s.
    pub(super) start: f64,
    pub(super) findings: Vec<Finding>,
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
        let pieces = prepare::prepare(
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
    pub(in crate::signal) fn interval(&self) -> f64 {
        let pieces = self.pieces.pieces.first();
        pieces.map_or(self.pieces.interval, |piece| piece.interval)
    }

    /// Samples of each piece.
    pub(in crate::signal) fn lengths(&self) -> Vec<usize> {
        let pieces = self.pieces.pieces.iter();
        pieces.map(|piece| piece.time.len()).collect()
    }

    /// Some stretches of it, each a separate piece: (piece, samples).
    pub(in crate::signal) fn cut(&self, stretches: &[(usize, Range<usize>)]) -> PreparedLog<'_> {
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
}

/// Step 1 alone, for [`PreparedLog::align`] at several cut-offs up to 1.4 times that of `pipeline`.
///
/// # Errors
/// As [`crate::signal::align`].
pub fn prepare<'a>(
    robot: &Robot,
    log: &'a Recording,
    pipeline: &Pipeline,
) -> Result<PreparedLog<'a>> {
    PreparedLog::new(joint_facts(robot), log, pipeline)
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
