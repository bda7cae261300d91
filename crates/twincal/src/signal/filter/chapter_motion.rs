//! The motion of a chapter with what filters need of its neighbours, so that no row is lost where chapters meet.

use super::history::JointHistory;
use super::pipeline::Pipeline;
use crate::error::{Code, Finding, Result};
use crate::signal::log::chapters::Place;
use crate::signal::log::long::LongLog;
use crate::signal::log::recording::{Channels, Recording};
use crate::signal::log::stamps::{GAP, median_step};
use std::ops::Range;

/// Samples beyond the filter's reach, so that splines and interpolation do not feel the ends.
const NEAREST: f64 = 24.0;

/// What position has to span in thresholds of a stop operator until its state is that of any beginning, and a tenth for what is smoothed.
const SPANNED: f64 = 2.2;

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
    /// [`LongLog::visit`] with what the motion filter needs of the neighbours on either side, as far as nothing cuts it, so that no row is lost
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
