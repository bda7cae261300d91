//! Logs that are longer than memory should hold: consecutive chapters, each a recording of its own, read when they are needed.
//!
//! A chapter ends as a log does: filters need some seconds at either end of it, which become no rows. What a chapter says of
//! itself is said once for the log, see [`told_once`].

use super::{Payload, Recording};
use crate::error::{Error, Finding, Result, Severity};
use std::borrow::Cow;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

/// Share of the samples in chapters that cannot be used beyond which the log counts as degraded.
const LEFT_OUT_LIMIT: f64 = 0.01;

/// Where the chapters of a log come from.
pub trait ReadChapter: Debug + Send + Sync {
    /// Chapter number `chapter`, counted from 0; its name and what was carried do not matter.
    ///
    /// # Errors
    /// [`Error::Log`] where it cannot be read again.
    fn read(&self, chapter: usize) -> Result<Recording>;
}

/// Where numbers that are made of a long log are put away, so that they need not stay in memory.
pub trait Shelf: Debug + Send + Sync {
    /// Puts numbers away; the place where they are.
    ///
    /// # Errors
    /// [`Error::Log`] where there is no room.
    fn put(&self, numbers: &[f64]) -> Result<u64>;

    /// Takes back numbers that were put there, all but the first `skip`, as many as there is room for. Where they cannot be read they are
    /// NaN, and [`Shelf::failure`] says why: those who sum over rows have no better answer, and the calibration ends with it.
    fn get(&self, place: u64, skip: usize, numbers: &mut [f64]);

    /// The first failure of [`Shelf::put`] or [`Shelf::get`].
    fn failure(&self) -> Option<Error>;
}

/// Numbers in memory or on a shelf.
#[derive(Debug, Clone)]
pub enum Numbers {
    /// In memory.
    Memory(Vec<f64>),
    /// Away.
    Shelf {
        /// Where.
        shelf: Arc<dyn Shelf>,
        /// One behind the other: their first number, and the place.
        blocks: Vec<(usize, u64)>,
        /// Numbers of all blocks.
        len: usize,
    },
}

impl Default for Numbers {
    /// None, in memory.
    fn default() -> Self {
        Self::Memory(Vec::new())
    }
}

impl From<Vec<f64>> for Numbers {
    fn from(numbers: Vec<f64>) -> Self {
        Self::Memory(numbers)
    }
}

impl PartialEq for Numbers {
    /// The same numbers, wherever they are.
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl Numbers {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Memory(numbers) => numbers.len(),
            Self::Shelf { len, .. } => *len,
        }
    }

    /// Leaves them on a shelf, if they are not on one.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(crate) fn put_away(&mut self, shelf: &Arc<dyn Shelf>) -> Result<()> {
        if let Self::Memory(numbers) = self {
            let mut away = Self::Shelf {
                shelf: shelf.clone(),
                blocks: Vec::new(),
                len: 0,
            };
            away.append(numbers)?;
            *self = away;
        }
        Ok(())
    }

    /// Puts more behind them, where they are.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(crate) fn append(&mut self, more: &[f64]) -> Result<()> {
        match self {
            Self::Memory(numbers) => numbers.extend_from_slice(more),
            Self::Shelf { shelf, blocks, len } if !more.is_empty() => {
                blocks.push((*len, shelf.put(more)?));
                *len += more.len();
            }
            Self::Shelf { .. } => {}
        }
        Ok(())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All of them.
    pub fn get(&self) -> Cow<'_, [f64]> {
        self.some(0..self.len())
    }

    /// Some of them.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn some(&self, range: Range<usize>) -> Cow<'_, [f64]> {
        let (shelf, blocks, len) = match self {
            Self::Memory(numbers) => return Cow::Borrowed(&numbers[range]),
            Self::Shelf { shelf, blocks, len } => (shelf, blocks, *len),
        };
        let mut numbers = vec![0.0; range.len()];
        let ends = blocks.iter().skip(1).map(|(first, _)| *first);
        for (&(first, place), end) in blocks.iter().zip(ends.chain([len])) {
            let (from, to) = (range.start.max(first), range.end.min(end));
            if from < to {
                let room = &mut numbers[from - range.start..to - range.start];
                shelf.get(place, from - first, room);
            }
        }
        Cow::Owned(numbers)
    }
}

/// A log in chapters: all have the same joints and the same channels.
#[derive(Debug, Clone)]
pub struct LongLog {
    /// Name as given by the user.
    pub name: String,
    /// What the robot carried.
    pub payload: Payload,
    /// Samples of each chapter: at least one chapter, at least one sample in each.
    pub samples: Vec<usize>,
    /// Where they are.
    pub source: Arc<dyn ReadChapter>,
    /// Where its rows may be put; `None`: they stay in memory.
    pub shelf: Option<Arc<dyn Shelf>>,
}

impl LongLog {
    /// How many chapters there are.
    pub fn chapters(&self) -> usize {
        self.samples.len()
    }

    /// One of them.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    pub fn chapter(&self, chapter: usize) -> Result<Recording> {
        let mut recording = self.source.read(chapter)?;
        recording.name.clone_from(&self.name);
        recording.payload = self.payload;
        Ok(recording)
    }

    /// Visits all chapters in order, by their number; one that cannot be used is left out, and said, unless none can.
    ///
    /// # Errors
    /// Of chapters that cannot be read, the first of all if no chapter can be used, and any that is not about the log.
    pub(crate) fn visit(
        &self,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(usize, &Recording, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        let (mut said, mut unused, mut rows) = (Vec::new(), Vec::new(), 0);
        let mut next = Some(self.chapter(0)?);
        for chapter in 0..self.chapters() {
            let Some(recording) = next.take() else {
                break;
            };
            let mut of_chapter = Vec::new();
            // The next chapter is read meanwhile.
            let ahead = chapter + 1;
            let (visited, read) = rayon::join(
                || visit(chapter, &recording, &mut of_chapter),
                || (ahead < self.chapters()).then(|| self.chapter(ahead)),
            );
            next = read.transpose()?;
            // What cannot be put away is no fault of the chapter.
            if let Some(failure) = self.shelf.as_ref().and_then(|shelf| shelf.failure()) {
                return Err(failure);
            }
            match visited {
                Ok(()) => said.extend(of_chapter.into_iter().map(|finding| (chapter, finding))),
                Err(Error::Log {
                    log,
                    problem,
                    remedy,
                }) => {
                    rows += self.samples[chapter] as u64;
                    unused.push((chapter, log, problem, remedy));
                }
                Err(other) => return Err(other),
            }
        }
        let chapters = self.chapters();
        let unfolded = said
            .iter()
            .any(|(_, finding)| finding.code == "wrapped_angle");
        findings.extend(told_once(said, chapters));
        if unfolded {
            findings.push(Finding::new(
                Severity::Warning,
                "unfolded_by_chapter",
                &self.name,
                "angles were unfolded chapter by chapter: positions of two chapters may differ by whole turns, which springs and the range \
                 of the training data see; log angles that are not folded",
                0,
            ));
        }
        let count = unused.len();
        if let Some((chapter, log, problem, remedy)) = unused.into_iter().next() {
            if count == chapters {
                return Err(Error::Log {
                    log,
                    problem,
                    remedy,
                });
            }
            let all: usize = self.samples.iter().sum();
            let severity = if rows as f64 > LEFT_OUT_LIMIT * all as f64 {
                Severity::Degraded
            } else {
                Severity::Warning
            };
            findings.push(Finding::new(
                severity,
                "chapters_left_out",
                &self.name,
                format!(
                    "{count} of {chapters} chapters cannot be used and were left out; the first is number {}: {problem}; {remedy}",
                    chapter + 1
                ),
                rows,
            ));
        }
        Ok(())
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

    /// That it is long, as a note.
    pub(crate) fn say(&self) -> Finding {
        let samples: usize = self.samples.iter().sum();
        Finding::new(
            Severity::Note,
            "chapters",
            &self.name,
            format!(
                "the log is long ({samples} samples) and was read in {} chapters of up to {} samples, each cut at its ends",
                self.chapters(),
                self.samples.iter().max().unwrap_or(&0),
            ),
            samples as u64,
        )
    }
}

/// A log as a calibration takes it.
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
        let own = |recording| Log::Whole(Cow::Owned(recording));
        Self(recordings.into_iter().map(own).collect())
    }
}

impl<'a> From<&'a [Recording]> for Logs<'a> {
    fn from(recordings: &'a [Recording]) -> Self {
        let lent = |recording| Log::Whole(Cow::Borrowed(recording));
        Self(recordings.iter().map(lent).collect())
    }
}

impl<'a, const N: usize> From<&'a [Recording; N]> for Logs<'a> {
    fn from(recordings: &'a [Recording; N]) -> Self {
        Self::from(&recordings[..])
    }
}

impl<'a> From<Vec<Log<'a>>> for Logs<'a> {
    fn from(logs: Vec<Log<'a>>) -> Self {
        Self(logs)
    }
}

/// What the chapters of a log say (chapter, finding), said once: findings of one code about one thing are one, in the words of the
/// chapter where it matters most.
pub(crate) fn told_once(said: Vec<(usize, Finding)>, chapters: usize) -> Vec<Finding> {
    let mut groups: Vec<Vec<(usize, Finding)>> = Vec::new();
    for (chapter, finding) in said {
        let alike = |group: &&mut Vec<(usize, Finding)>| {
            let first = &group[0].1;
            (&first.code, &first.subject) == (&finding.code, &finding.subject)
                && named(&first.message) == named(&finding.message)
        };
        match groups.iter_mut().find(alike) {
            Some(group) => group.push((chapter, finding)),
            None => groups.push(vec![(chapter, finding)]),
        }
    }
    groups
        .into_iter()
        .filter_map(|group| {
            let count: u64 = group.iter().map(|(_, finding)| finding.count).sum();
            let others = group.len() - 1;
            let rank = |(chapter, finding): &(usize, Finding)| {
                (finding.severity, finding.count, std::cmp::Reverse(*chapter))
            };
            let (chapter, worst) = group.into_iter().max_by_key(rank)?;
            let place = format!("in chapter {} of {chapters}", chapter + 1);
            let more = match others {
                0 => String::new(),
                1 => "; one more is alike".to_owned(),
                others => format!("; {others} more are alike"),
            };
            Some(Finding {
                message: format!("{} ({place}{more})", worst.message),
                count,
                ..worst
            })
        })
        .collect()
}

/// The first name in a message: what comes in backquotes.
fn named(message: &str) -> Option<&str> {
    message.split('`').nth(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_of_chapters_are_told_once_in_the_words_of_the_worst() {
        let finding = |severity, joint: &str, count| {
            Finding::new(
                severity,
                "standstill",
                "run",
                format!("joint `{joint}` rests {count}"),
                count,
            )
        };
        let said = vec![
            (0, finding(Severity::Note, "elbow", 10)),
            (0, finding(Severity::Note, "wrist", 1)),
            (1, finding(Severity::Warning, "elbow", 5)),
            (3, finding(Severity::Note, "elbow", 20)),
        ];
        let told = told_once(said, 4);
        let words: Vec<(&str, u64, Severity)> = told
            .iter()
            .map(|f| (f.message.as_str(), f.count, f.severity))
            .collect();
        assert_eq!(
            words,
            [
                (
                    "joint `elbow` rests 5 (in chapter 2 of 4; 2 more are alike)",
                    35,
                    Severity::Warning
                ),
                (
                    "joint `wrist` rests 1 (in chapter 1 of 4)",
                    1,
                    Severity::Note
                ),
            ]
        );
    }
}
