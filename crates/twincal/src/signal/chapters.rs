//! Walks through the chapters of a log: each by itself, or with what filters need of its neighbours. What chapters say of themselves
//! is said once for the log, see [`told_once`].

use super::clock::{GAP, median_step};
use super::{Channels, JointHistory, LongLog, Pipeline, Recording};
use crate::error::{Code, Error, Finding, Result, Severity};
use std::ops::Range;

/// Share of the samples in chapters that cannot be used beyond which the log counts as degraded.
const LEFT_OUT_LIMIT: f64 = 0.01;

/// Samples beyond the filter's reach, so that splines and interpolation do not feel the ends.
const NEAREST: f64 = 24.0;

/// What position has to span in thresholds of a stop operator until its state is that of any beginning, and a tenth for what is smoothed.
const SPANNED: f64 = 2.2;

/// A chapter between its neighbours.
#[derive(Debug)]
struct Place<'a> {
    before: Option<&'a Recording>,
    chapter: &'a Recording,
    after: Option<&'a Recording>,
}

/// The motion of a chapter with what filters need of its neighbours.
#[derive(Debug)]
pub struct ChapterMotion<'a> {
    /// Without torque: what is missing there would cut the motion.
    pub motion: Recording,
    /// The chapter's own rows in `motion`.
    pub own: Range<usize>,
    /// The chapter itself.
    pub chapter: &'a Recording,
}

impl LongLog {
    /// Visits all chapters in order, by their number; one that cannot be used is left out, and said, unless none can.
    ///
    /// # Errors
    /// Of chapters that cannot be read, the first of all if no chapter can be used, and any that is not about the log.
    pub fn visit(
        &self,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(usize, &Recording, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        self.walk(false, findings, |number, place, said| {
            visit(number, place.chapter, said)
        })
    }

    /// The same with what the motion filter needs of the neighbours on either side, as far as nothing cuts it, so that no row is lost
    /// where chapters meet.
    ///
    /// # Errors
    /// Those of [`LongLog::visit`].
    pub fn visit_motion(
        &self,
        pipeline: &Pipeline,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(&ChapterMotion<'_>, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        self.walk(true, findings, |_, place, said| {
            visit(&place.motion(pipeline), said)?;
            // What filters trim of a part says nothing of the log: most of it is another chapter's.
            said.retain(|finding| finding.code != Code::Borders);
            Ok(())
        })
    }

    fn walk(
        &self,
        neighbours: bool,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(usize, &Place<'_>, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        let chapters = self.chapters();
        let (mut said, mut unused, mut rows) = (Vec::new(), Vec::new(), 0);
        let read = |chapter: usize| {
            (chapter < chapters)
                .then(|| self.chapter(chapter))
                .transpose()
        };
        let mut before = None;
        let mut next = read(0)?;
        let mut after = if neighbours { read(1)? } else { None };
        for number in 0..chapters {
            let Some(chapter) = next.take() else {
                break;
            };
            let place = Place {
                before: before.as_ref(),
                chapter: &chapter,
                after: after.as_ref(),
            };
            let mut of_chapter = Vec::new();
            // The next chapter is read meanwhile.
            let (visited, ahead) = rayon::join(
                || visit(number, &place, &mut of_chapter),
                || read(number + 1 + usize::from(neighbours)),
            );
            let ahead = ahead?;
            // What cannot be put away is no fault of the chapter.
            if let Some(failure) = self.shelf.as_ref().and_then(|shelf| shelf.failure()) {
                return Err(failure);
            }
            match visited {
                Ok(()) => said.extend(of_chapter.into_iter().map(|finding| (number, finding))),
                Err(Error::Log {
                    log,
                    problem,
                    remedy,
                }) => {
                    rows += self.samples[number] as u64;
                    unused.push((number, log, problem, remedy));
                }
                Err(other) => return Err(other),
            }
            if neighbours {
                before = Some(chapter);
                next = std::mem::replace(&mut after, ahead);
            } else {
                next = ahead;
            }
        }
        findings.extend(self.folding.findings(&self.name));
        findings.extend(told_once(said, chapters));
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
                Code::ChaptersLeftOut,
                &self.name,
                format!(
                    "{count} of {chapters} chapters cannot be used and were left out; the first is number {}: {problem}; {remedy}",
                    chapter + 1
                ),
                rows,
            )
            .with([
                ("chapters_left_out", count as f64), ("chapters", chapters as f64),
                ("first_chapter", (chapter + 1) as f64),
            ]));
        }
        Ok(())
    }

    /// That it is long, as a note; `cut`: filters end where chapters do.
    pub fn say(&self, cut: bool) -> Finding {
        let samples: usize = self.samples.iter().sum();
        let ends = if cut { ", each cut at its ends" } else { "" };
        Finding::new(
            Severity::Note,
            Code::Chapters,
            &self.name,
            format!(
                "the log is long ({samples} samples) and was read in {} chapters of up to {} samples{ends}",
                self.chapters(),
                self.samples.iter().max().unwrap_or(&0),
            ),
            samples as u64,
        )
        .with([
            ("chapters", self.chapters() as f64),
            ("samples_at_most", self.samples.iter().max().copied().unwrap_or(0) as f64),
        ])
    }
}

impl<'a> Place<'a> {
    fn motion(&self, pipeline: &Pipeline) -> ChapterMotion<'a> {
        let chapter = self.chapter;
        let reach = Reach::of(chapter, pipeline);
        let lead = self.before.map(|before| {
            let seconds = reach.seconds + unknown(before, pipeline);
            let further = Reach { seconds, ..reach };
            (before, further.back(before, chapter))
        });
        let tail = self.after.map(|after| (after, reach.on(chapter, after)));
        let whole = 0..chapter.time.len();
        let parts: Vec<(&Recording, Range<usize>)> = (lead.into_iter())
            .chain([(chapter, whole)])
            .chain(tail)
            .collect();
        let start = if self.before.is_some() {
            parts[0].1.len()
        } else {
            0
        };
        ChapterMotion {
            motion: joined(&parts),
            own: start..start + chapter.time.len(),
            chapter,
        }
    }
}

/// How far a chapter looks into its neighbours.
struct Reach {
    seconds: f64,
    /// Longest step without a cut, s.
    longest: f64,
    /// Rows without motion are usual (a table that joins topics of different rates), and cut nothing.
    sparse: bool,
}

impl Reach {
    fn of(chapter: &Recording, pipeline: &Pipeline) -> Self {
        let rows: Vec<usize> = (0..chapter.time.len())
            .filter(|&row| finite(chapter, row))
            .collect();
        let stamps: Vec<f64> = rows.iter().map(|&row| chapter.time[row]).collect();
        let interval = median_step(&stamps).unwrap_or(0.0);
        let seconds = if pipeline.is_off() {
            0.0
        } else {
            pipeline.motion_half_length() + NEAREST * interval.max(pipeline.motion_interval)
        };
        let beside = rows.windows(2).filter(|pair| pair[1] == pair[0] + 1);
        Self {
            seconds,
            longest: GAP * interval,
            sparse: 2 * beside.count() < rows.len(),
        }
    }

    /// Rows at the end of `before` that go on in `chapter` without a cut.
    fn back(&self, before: &Recording, chapter: &Recording) -> Range<usize> {
        let len = before.time.len();
        let own = (0..chapter.time.len()).map(|row| (chapter, row));
        let theirs = (0..len).rev().map(|row| (before, row));
        len - self.taken(own, theirs, -1.0)..len
    }

    /// Rows at the beginning of `after` that go on from `chapter` without a cut.
    fn on(&self, chapter: &Recording, after: &Recording) -> Range<usize> {
        let own = (0..chapter.time.len()).rev().map(|row| (chapter, row));
        let theirs = (0..after.time.len()).map(|row| (after, row));
        0..self.taken(own, theirs, 1.0)
    }

    /// How many of the rows behind a border are taken, in the direction of time: the chapter's own rows come from the border inwards,
    /// the others outwards.
    fn taken<'r>(
        &self,
        mut own: impl Iterator<Item = (&'r Recording, usize)>,
        theirs: impl Iterator<Item = (&'r Recording, usize)>,
        direction: f64,
    ) -> usize {
        let edge = if self.sparse {
            own.find(|(recording, row)| finite(recording, *row))
        } else {
            own.next()
                .filter(|(recording, row)| finite(recording, *row))
        };
        let Some((recording, row)) = edge else {
            return 0;
        };
        let edge = recording.time[row];
        let (mut last, mut taken) = (edge, 0);
        for (seen, (recording, row)) in theirs.enumerate() {
            if !finite(recording, row) {
                if self.sparse {
                    continue;
                }
                break;
            }
            let stamp = recording.time[row];
            let step = direction * (stamp - last);
            if !(0.0..=self.longest).contains(&step) || (stamp - edge).abs() > self.seconds {
                break;
            }
            (last, taken) = (stamp, seen + 1);
        }
        taken
    }
}

/// How far back from the end of a recording the states of stop operators may depend on what was, s: until every joint that has some has
/// spanned twice the largest threshold; all of it where it does not.
fn unknown(before: &Recording, pipeline: &Pipeline) -> f64 {
    let end = before.time.iter().rfind(|time| time.is_finite());
    let of_joint = |(history, joint): (&JointHistory, &Channels)| -> f64 {
        let (Some(&end), Some(threshold)) = (end, history.thresholds.last()) else {
            return 0.0;
        };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (time, q) in before.time.iter().zip(&joint.q).rev() {
            if time.is_finite() && q.is_finite() {
                (low, high) = (low.min(*q), high.max(*q));
                if high - low > SPANNED * threshold {
                    return end - time;
                }
            }
        }
        f64::INFINITY
    };
    let joints = pipeline.history.iter().zip(&before.joints);
    joints.map(of_joint).fold(0.0, f64::max)
}

/// Whether the motion of a row is, and its stamp.
fn finite(recording: &Recording, row: usize) -> bool {
    let of_joint = |joint: &Channels| {
        let channels = [Some(&joint.q), joint.qd.as_ref(), joint.qdd.as_ref()];
        channels
            .into_iter()
            .flatten()
            .all(|values| values[row].is_finite())
    };
    recording.time[row].is_finite() && recording.joints.iter().all(of_joint)
}

/// The motion of some rows, one behind the other.
fn joined(parts: &[(&Recording, Range<usize>)]) -> Recording {
    let first = parts[0].0;
    let join = |channel: &dyn Fn(&Recording) -> Option<&Vec<f64>>| -> Option<Vec<f64>> {
        let slices: Option<Vec<&[f64]>> = parts
            .iter()
            .map(|(recording, rows)| Some(&channel(recording)?[rows.clone()]))
            .collect();
        Some(slices?.concat())
    };
    let joint = |joint: usize| Channels {
        q: join(&|log| Some(&log.joints[joint].q)).unwrap_or_default(),
        qd: join(&|log| log.joints[joint].qd.as_ref()),
        qdd: join(&|log| log.joints[joint].qdd.as_ref()),
        tau: None,
        temperature: join(&|log| log.joints[joint].temperature.as_ref()),
    };
    Recording {
        unfolded: first.unfolded,
        start_ns: first.start_ns,
        name: first.name.clone(),
        time: join(&|log| Some(&log.time)).unwrap_or_default(),
        joints: (0..first.joints.len()).map(joint).collect(),
        payload: first.payload,
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
            let numbers = [
                ("chapter", (chapter + 1) as f64),
                ("chapters", chapters as f64),
                ("chapters_alike", others as f64),
            ];
            let told = Finding {
                message: format!("{} ({place}{more})", worst.message),
                count,
                ..worst
            };
            Some(told.with(numbers))
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
                Code::Standstill,
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
