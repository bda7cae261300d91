//! Angles that a counter folded into one turn, unfolded.

use super::read_chapter::ReadChapter;
use super::recording::Recording;
use super::stamps::{GAP, median_step};
use crate::error::{Code, Finding, Result, Severity};
use crate::robot::{JointKind, Robot};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Range of an angle, rad, that can have been folded: more than half a turn, not more than a whole one.
fn can_be_folded(low: f64, high: f64) -> bool {
    high - low > PI && high - low <= TAU * 1.001
}

/// Turns that a folded angle has made.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Turns {
    turns: f64,
    /// As logged.
    last: Option<f64>,
}

impl Turns {
    /// Unfolds the next value; whether it jumped. What is not finite is not there.
    fn unfold(&mut self, value: &mut f64) -> bool {
        if !value.is_finite() {
            return false;
        }
        let step = self.last.map_or(0.0, |last| *value - last);
        self.last = Some(*value);
        let jumps = step.abs() > PI;
        if jumps {
            self.turns -= step.signum();
        }
        *value += self.turns * TAU;
        jumps
    }
}

/// How the angles of a log in chapters are folded, which only the whole log shows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Folding {
    /// Those that are.
    angles: Vec<Folded>,
}

/// A folded angle.
#[derive(Debug, Clone)]
struct Folded {
    joint: usize,
    name: String,
    jumps: u64,
    /// Before each chapter.
    turns: Vec<Turns>,
}

impl Folding {
    /// Looks at all positions, by the rule of [`unwrap_angle`], whatever other channels lack there; a jump right where two chapters meet alone is none.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    pub(crate) fn find(robot: &Robot, chapters: usize, source: &dyn ReadChapter) -> Result<Self> {
        let names = robot.joint_names();
        let angles: Vec<Option<Folded>> = (names.par_iter().enumerate())
            .map(|(joint, name)| match robot.joint_kind(joint) {
                JointKind::Revolute | JointKind::Continuous => {
                    Folded::find(joint, name, chapters, source)
                }
                _ => Ok(None),
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            angles: angles.into_iter().flatten().collect(),
        })
    }

    /// Unfolds the angles of a chapter.
    pub(crate) fn unfold(&self, chapter: usize, recording: &mut Recording) {
        for angle in &self.angles {
            let mut turns = angle.turns[chapter];
            for value in &mut recording.joints[angle.joint].q {
                turns.unfold(value);
            }
        }
    }

    /// What was unfolded.
    pub(crate) fn findings(&self, log: &str) -> impl Iterator<Item = Finding> {
        self.angles
            .iter()
            .map(move |angle| unfolded(log, &angle.name, angle.jumps))
    }
}

impl Folded {
    fn find(
        joint: usize,
        name: &str,
        chapters: usize,
        source: &dyn ReadChapter,
    ) -> Result<Option<Self>> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut now = Turns::default();
        let (mut turns, mut jumped, mut jumps) = (Vec::with_capacity(chapters), Vec::new(), 0);
        for chapter in 0..chapters {
            turns.push(now);
            let before = jumps;
            for mut value in source.positions(chapter, joint)? {
                if value.is_finite() {
                    (low, high) = (low.min(value), high.max(value));
                }
                jumps += u64::from(now.unfold(&mut value));
            }
            if high - low > PI && !can_be_folded(low, high) {
                return Ok(None);
            }
            if jumps > before {
                jumped.push(chapter);
            }
        }
        if !can_be_folded(low, high) {
            return Ok(None);
        }
        for chapter in jumped {
            let Recording { time, joints, .. } = source.read(chapter)?;
            let limit = GAP * median_step(&time).unwrap_or(f64::INFINITY);
            let pairs = time.windows(2).zip(joints[joint].q.windows(2));
            let mut pairs = pairs.map(|(t, q)| (t[1] - t[0], (q[1] - q[0]).abs()));
            if pairs.any(|(step, jump)| jump > PI && (0.0..=limit).contains(&step)) {
                return Ok(Some(Self {
                    joint,
                    name: name.to_owned(),
                    jumps,
                    turns,
                }));
            }
        }
        Ok(None)
    }
}

/// Says that a joint's angle was unfolded.
pub(crate) fn unfolded(log: &str, joint: &str, jumps: u64) -> Finding {
    Finding::new(
        Severity::Note,
        Code::WrappedAngle,
        log,
        format!("joint `{joint}`: {jumps} jumps by a full turn, unfolded"),
        jumps,
    )
    .of_joint(joint)
}

/// Unfolds an angle in place and returns the number of jumps.
///
/// Only a signal that stays within one turn can have been folded, so one that leaves it is left alone. A jump is a step
/// of more than half a turn from one row to the next; `cuts` (ascending) are the rows right after a cut; across a cut the
/// nearest turn is taken once a jump has been seen.
pub(crate) fn unwrap_angle(q: &mut [f64], cuts: &[usize]) -> u64 {
    let (low, high) = q
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(*v), h.max(*v))
        });
    if !can_be_folded(low, high) {
        return 0;
    }
    let mut jumps = 0;
    let folded =
        (1..q.len()).any(|i| (q[i] - q[i - 1]).abs() > PI && cuts.binary_search(&i).is_err());
    if !folded {
        return 0;
    }
    let mut turns = Turns::default();
    for value in q.iter_mut() {
        jumps += u64::from(turns.unfold(value));
    }
    jumps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folded_ramp_unfolds_to_the_ramp() {
        let truth: Vec<f64> = (0..400).map(|i| 0.05 * f64::from(i) - 3.0).collect();
        let mut q: Vec<f64> = truth
            .iter()
            .map(|t| (t + PI).rem_euclid(TAU) - PI)
            .collect();
        let expected = ((truth[399] + PI) / TAU).floor() - ((truth[0] + PI) / TAU).floor();
        assert_eq!(unwrap_angle(&mut q, &[]) as f64, expected);
        assert!(q.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_joint_that_turns_further_than_once_was_not_folded() {
        let mut q = vec![-3.0, 0.0, 3.0, 6.0, 2.0];
        assert_eq!(unwrap_angle(&mut q, &[]), 0);
        assert_eq!(q, [-3.0, 0.0, 3.0, 6.0, 2.0]);
    }

    #[test]
    fn a_jump_only_over_a_cut_is_motion() {
        let mut q = vec![-2.0, -2.0, 2.0, 2.0];
        assert_eq!(unwrap_angle(&mut q, &[2]), 0);
        assert_eq!(q, [-2.0, -2.0, 2.0, 2.0]);
    }
}
