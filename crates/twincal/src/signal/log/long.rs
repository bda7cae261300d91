//! Logs that are longer than memory should hold: consecutive chapters, each a separate recording, read when they are needed.
//!
//! For a fit a chapter ends as a log does: filters need some seconds at either end of it, which become no rows (`chapters.rs` visits them).
//! Angles are unfolded as those of the whole log.

use super::read_chapter::ReadChapter;
use super::recording::{Payload, Recording};
use super::shelf::Shelf;
use super::stamps::first_stamp;
use super::unwrap::Folding;
use crate::error::{Error, Result};
use crate::robot::Robot;
use std::borrow::Cow;
use std::sync::Arc;

/// A log in chapters: all have the same joints and the same channels.
#[derive(Debug, Clone)]
pub struct LongLog {
    /// Name as given by the user.
    pub name: String,
    /// What the robot carried.
    pub payload: Payload,
    /// First stamp of the whole log, s.
    pub(super) start: Option<f64>,
    pub(super) samples: Vec<usize>,
    source: Arc<dyn ReadChapter>,
    pub(super) shelf: Option<Arc<dyn Shelf>>,
    pub(super) folding: Folding,
}

impl LongLog {
    /// A log whose chapters have so many samples each: at least one chapter, at least one sample in each. All positions are read once, since only
    /// the whole log shows whether angles were folded.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    pub fn new(robot: &Robot, samples: Vec<usize>, source: Arc<dyn ReadChapter>) -> Result<Self> {
        Ok(Self {
            name: String::new(),
            payload: Payload::None,
            start: first_stamp(&source.read(0)?),
            folding: Folding::find(robot, samples.len(), &*source)?,
            samples,
            source,
            shelf: None,
        })
    }

    /// The same log, whose rows may be put away.
    #[must_use]
    pub fn with_shelf(self, shelf: Arc<dyn Shelf>) -> Self {
        Self {
            shelf: Some(shelf),
            ..self
        }
    }

    /// Where its rows may be put; `None`: they stay in memory.
    pub fn shelf(&self) -> Option<&Arc<dyn Shelf>> {
        self.shelf.as_ref()
    }

    /// Where its chapters come from.
    pub fn source(&self) -> &Arc<dyn ReadChapter> {
        &self.source
    }

    /// First stamp of the whole log, s.
    pub fn start(&self) -> Option<f64> {
        self.start
    }

    /// Samples of each chapter.
    pub fn samples(&self) -> &[usize] {
        &self.samples
    }

    /// How many chapters there are.
    pub fn chapters(&self) -> usize {
        self.samples.len()
    }

    /// That it has none, or none that can be used.
    pub(crate) fn without_chapters(&self) -> Error {
        Error::Log {
            log: self.name.clone(),
            problem: "it has no chapters".into(),
            remedy: "give a log with samples".into(),
        }
    }

    /// One of them.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    pub fn chapter(&self, chapter: usize) -> Result<Recording> {
        let mut recording = self.source.read(chapter)?;
        recording.name.clone_from(&self.name);
        recording.payload = self.payload;
        self.folding.unfold(chapter, &mut recording);
        recording.unfolded = true;
        Ok(recording)
    }

    /// All chapters as one recording.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    pub fn whole(&self) -> Result<Recording> {
        let mut whole = self.chapter(0)?;
        for chapter in 1..self.chapters() {
            let Recording { time, joints, .. } = self.chapter(chapter)?;
            whole.time.extend(time);
            for (to, from) in whole.joints.iter_mut().zip(joints) {
                to.q.extend(from.q);
                for (to, from) in [
                    (&mut to.qd, from.qd),
                    (&mut to.qdd, from.qdd),
                    (&mut to.tau, from.tau),
                    (&mut to.temperature, from.temperature),
                ] {
                    if let (Some(to), Some(from)) = (to, from) {
                        to.extend(from);
                    }
                }
            }
        }
        Ok(whole)
    }
}

/// A log as a calibration takes it.
///
/// # Example
/// ```
/// use twincal::prelude::*;
///
/// let recording = Recording::new("run1", [0.0, 0.1, 0.2]).joint([0.1; 3], [4.0; 3])?;
/// let mut log = Log::from(&recording); // lent: the numbers are not copied
/// assert_eq!((log.name(), log.samples()), ("run1", 3));
/// assert_eq!(log.rename("monday"), "run1");
/// assert_eq!(log.name(), "monday");
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub enum Log<'a> {
    /// In memory.
    Whole(Cow<'a, Recording>),
    /// In chapters.
    Long(LongLog),
}

impl Log<'_> {
    /// Name as given by the user.
    pub fn name(&self) -> &str {
        match self {
            Self::Whole(recording) => &recording.name,
            Self::Long(long) => &long.name,
        }
    }

    /// Gives it another name; returns that which it had.
    pub fn rename(&mut self, name: &str) -> String {
        let own = match self {
            Self::Whole(recording) => &mut recording.to_mut().name,
            Self::Long(long) => &mut long.name,
        };
        std::mem::replace(own, name.to_owned())
    }

    /// Samples as logged.
    pub fn samples(&self) -> u64 {
        match self {
            Self::Whole(recording) => recording.time.len() as u64,
            Self::Long(long) => long.samples.iter().map(|n| *n as u64).sum(),
        }
    }

    /// What the robot carried.
    pub fn payload(&self) -> Payload {
        match self {
            Self::Whole(recording) => recording.payload,
            Self::Long(long) => long.payload,
        }
    }

    /// Where its rows may be put.
    pub(crate) fn shelf(&self) -> Option<Arc<dyn Shelf>> {
        match self {
            Self::Whole(_) => None,
            Self::Long(long) => long.shelf.clone(),
        }
    }

    /// The same, lent.
    pub fn lent(&self) -> Log<'_> {
        match self {
            Self::Whole(recording) => Log::Whole(Cow::Borrowed(recording)),
            Self::Long(long) => Log::Long(long.clone()),
        }
    }

    /// Asks one of the recordings that it consists of, which have the same channels.
    ///
    /// # Errors
    /// Those of `ask` and of [`ReadChapter::read`].
    pub fn any_recording<T>(&self, ask: impl FnOnce(&Recording) -> Result<T>) -> Result<T> {
        match self {
            Self::Whole(recording) => ask(recording),
            Self::Long(long) => ask(&long.chapter(0)?),
        }
    }

    /// Visits the recordings that it consists of, until one was enough.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    pub(crate) fn until(&self, mut enough: impl FnMut(&Recording) -> bool) -> Result<()> {
        match self {
            Self::Whole(recording) => {
                enough(recording);
            }
            Self::Long(long) => {
                for chapter in 0..long.chapters() {
                    if enough(&long.chapter(chapter)?) {
                        break;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Several logs: recordings, given away or lent, or logs in chapters among them.
#[derive(Debug, Clone)]
pub struct Logs<'a>(pub Vec<Log<'a>>);

impl From<Vec<Recording>> for Logs<'_> {
    fn from(recordings: Vec<Recording>) -> Self {
        Self(recordings.into_iter().map(Log::from).collect())
    }
}

impl<'a> From<&'a [Recording]> for Logs<'a> {
    fn from(recordings: &'a [Recording]) -> Self {
        Self(recordings.iter().map(Log::from).collect())
    }
}

impl<'a, const N: usize> From<&'a [Recording; N]> for Logs<'a> {
    fn from(recordings: &'a [Recording; N]) -> Self {
        Self::from(&recordings[..])
    }
}

impl<'a> From<Recording> for Log<'a> {
    fn from(recording: Recording) -> Self {
        Self::Whole(Cow::Owned(recording))
    }
}

impl<'a> From<&'a Recording> for Log<'a> {
    fn from(recording: &'a Recording) -> Self {
        Self::Whole(Cow::Borrowed(recording))
    }
}

impl<'a> From<&'a [Log<'_>]> for Logs<'a> {
    fn from(logs: &'a [Log<'_>]) -> Self {
        Self(logs.iter().map(Log::lent).collect())
    }
}

impl<'a> From<Vec<Log<'a>>> for Logs<'a> {
    fn from(logs: Vec<Log<'a>>) -> Self {
        Self(logs)
    }
}
