//! A log that is ready for any cut-off: prepared in memory, or prepared again chapter by chapter whenever it is visited.

use crate::error::{Finding, Result};
use crate::robot::Robot;
use crate::signal::filter::pipeline::Pipeline;
use crate::signal::filter::prepared_log::PreparedLog;
use crate::signal::log::joints::{JointFacts, joint_facts};
use crate::signal::log::long::{Log, LongLog};
use crate::signal::log::recording::Payload;
use crate::signal::log::stamps::median_step;

/// A log as [`crate::signal::choose_and_prepare`] gives it.
#[derive(Debug)]
pub enum ReadyLog<'a> {
    /// In memory.
    Whole(PreparedLog<'a>),
    /// In chapters.
    Long(LongReady),
}

/// A log in chapters with what preparing them takes.
#[derive(Debug, Clone)]
pub struct LongReady {
    pub(crate) log: LongLog,
    pub(crate) joints: Vec<JointFacts>,
    /// Sampling interval, s.
    pub(crate) interval: f64,
}

/// [`crate::signal::prepare`] of a log that may be in chapters.
///
/// # Errors
/// As [`crate::signal::align`], and of chapters that cannot be read.
pub fn ready<'a>(robot: &Robot, log: &'a Log<'_>, pipeline: &Pipeline) -> Result<ReadyLog<'a>> {
    ReadyLog::new(&joint_facts(robot), log, pipeline)
}

impl<'a> ReadyLog<'a> {
    /// A log for a pipeline that was chosen from others.
    pub(crate) fn new(
        joints: &[JointFacts],
        log: &'a Log<'_>,
        pipeline: &Pipeline,
    ) -> Result<Self> {
        Ok(match log {
            Log::Whole(recording) => {
                Self::Whole(PreparedLog::new(joints.to_vec(), recording, pipeline)?)
            }
            Log::Long(log) => {
                let first = log.chapter(0)?;
                let interval = median_step(&first.time);
                Self::Long(LongReady {
                    log: log.clone(),
                    joints: joints.to_vec(),
                    interval: interval.unwrap_or(f64::INFINITY),
                })
            }
        })
    }

    /// Name as given by the user.
    pub fn name(&self) -> &str {
        match self {
            Self::Whole(log) => &log.recording().name,
            Self::Long(long) => &long.log.name,
        }
    }

    /// What the robot carried.
    pub fn payload(&self) -> Payload {
        match self {
            Self::Whole(log) => log.recording().payload,
            Self::Long(long) => long.log.payload,
        }
    }

    /// Parts that are read one after the other.
    pub fn chapters(&self) -> usize {
        match self {
            Self::Whole(_) => 1,
            Self::Long(long) => long.log.chapters(),
        }
    }

    /// Whether the columns and the motion of its rows leave memory.
    pub fn puts_away(&self) -> bool {
        match self {
            Self::Whole(_) => false,
            Self::Long(long) => long.log.shelf().is_some(),
        }
    }

    /// Samples that are held at once, on the clock at which motion is held.
    pub fn samples(&self) -> usize {
        match self {
            Self::Whole(log) => log.samples(),
            // The next chapter is read while one is visited.
            Self::Long(long) => 2 * long.log.samples().iter().copied().max().unwrap_or(0),
        }
    }

    /// Rows that a fit with this pipeline keeps at most.
    pub fn rows_at_most(&self, pipeline: &Pipeline) -> usize {
        match self {
            Self::Whole(log) => log.rows_at_most(pipeline),
            Self::Long(long) => long.rows_at_most(pipeline),
        }
    }

    /// The same without recordings in memory, see [`PreparedLog::detached`].
    #[must_use]
    pub fn detached(self) -> ReadyLog<'static> {
        match self {
            Self::Whole(log) => ReadyLog::Whole(log.detached()),
            Self::Long(long) => ReadyLog::Long(long),
        }
    }
}

impl LongReady {
    /// Rows that a fit with this pipeline keeps at most, about.
    pub(crate) fn rows_at_most(&self, pipeline: &Pipeline) -> usize {
        let step = pipeline.step(self.interval);
        self.log.samples().iter().map(|n| n.div_ceil(step)).sum()
    }

    /// Visits the chapters, prepared for a pipeline; see [`LongLog::visit`].
    ///
    /// # Errors
    /// Those of [`LongLog::visit`].
    pub(crate) fn visit(
        &self,
        pipeline: &Pipeline,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(usize, &PreparedLog<'_>, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        self.log.visit(findings, |number, chapter, said| {
            let prepared = PreparedLog::new(self.joints.clone(), chapter, pipeline)?;
            visit(number, &prepared.since(self.log.start()), said)
        })
    }
}
