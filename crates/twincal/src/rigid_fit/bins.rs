//! A trajectory averaged over bins: what contacts and lags are looked for in.

use crate::error::Result;
use crate::robot::Robot;
use crate::signal::{Numbers, Pipeline, Segment, Shelf, Trajectory};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Width of the bins, s, and in periods of a cut-off below 5 Hz.
const WIDTH: f64 = 0.05;
const PERIODS: f64 = 0.25;
/// Velocities of the friction's shapes, rad/s or m/s.
const DRY: [f64; 2] = [0.02, 0.2];
/// Below this a joint turns round or creeps, and is at rest, rad/s or m/s.
const SLOW: f64 = 0.05;
const REST: f64 = 0.02;
/// How long before and after that friction remembers it, in bins: presliding.
const MEMORY: usize = 2;
/// Channels of a joint: torque, position, velocity, acceleration and the shapes of dry friction.
const CHANNELS: usize = 6;
/// Columns of a joint's own: velocity, two shapes of dry friction, velocity squared, acceleration, one, position.
pub(crate) const FRICTION: usize = 7;

/// What friction of a joint can be in a bin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Zone {
    /// It slides: friction is a function of velocity.
    Slides,
    /// A velocity reversal within a tenth of a second: friction is anything up to its static value.
    Reverses,
    /// At rest: the same, with no motion.
    Rests,
    /// The drives are off or torque is saturated.
    Unknown,
}

/// A segment, averaged over bins.
#[derive(Debug)]
pub(crate) struct Bins {
    /// Sampling intervals of the segment and of the log, s.
    pub(crate) intervals: [f64; 2],
    /// First and last stamp of each bin, s.
    pub(crate) spans: Vec<[f64; 2]>,
    /// Samples of each bin.
    pub(crate) width: u64,
    /// `joint * bins + bin`.
    zones: Vec<Zone>,
    /// By joint, channel by channel.
    joints: Vec<Numbers>,
}

/// Some bins of one joint.
pub(crate) struct JointBins<'a> {
    channels: [Cow<'a, [f64]>; CHANNELS],
}

/// A trajectory in bins; `stopped`: spans in which the drives were off, s.
pub(crate) fn bins(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    stopped: &[[f64; 2]],
) -> Vec<Bins> {
    let seconds = seconds(pipeline);
    let first = trajectory.segments.first();
    let width = first.map_or(1, |s| {
        ((seconds / s.interval * (1.0 + 1e-9)) as usize).max(1)
    });
    let segments = trajectory.segments.iter();
    segments
        .map(|segment| Bins::new(robot.dof(), segment, width, stopped))
        .collect()
}

/// Width of bins, s.
fn seconds(pipeline: &Pipeline) -> f64 {
    match pipeline.is_off() {
        true => WIDTH,
        false => WIDTH.max(PERIODS / pipeline.cutoff_hz),
    }
}

impl Bins {
    fn new(dof: usize, segment: &Segment, width: usize, stopped: &[[f64; 2]]) -> Self {
        let len = segment.time.len();
        let count = len / width;
        let spans: Vec<[f64; 2]> = segment
            .time
            .chunks_exact(width)
            .map(|bin| [bin[0], bin[width - 1]])
            .collect();
        let mean = |bin: &[f64]| bin.iter().sum::<f64>() / width as f64;
        let of_joint = |joint: usize| {
            let own = |values: &[f64]| -> Vec<f64> {
                let values = &values[joint * len..(joint + 1) * len];
                values.chunks_exact(width).map(mean).collect()
            };
            // Means of the shapes, since where a joint turns round that is not the shape of the mean.
            let dry = |velocity: f64| -> Vec<f64> {
                let velocities = &segment.qd[joint * len..(joint + 1) * len];
                let shape = |bin: &[f64]| {
                    bin.iter().map(|qd| (qd / velocity).tanh()).sum::<f64>() / width as f64
                };
                velocities.chunks_exact(width).map(shape).collect()
            };
            let [slow, fast] = DRY.map(dry);
            let Segment {
                tau, q, qd, qdd, ..
            } = segment;
            let channels = [own(tau), own(q), own(qd), own(qdd), slow, fast];
            (
                Numbers::Memory(channels.concat()),
                zones(segment, joint, width, (&spans, stopped)),
            )
        };
        let all: Vec<(Numbers, Vec<Zone>)> = (0..dof).into_par_iter().map(of_joint).collect();
        let (joints, zones): (Vec<Numbers>, Vec<Vec<Zone>>) = all.into_iter().unzip();
        debug_assert!(zones.iter().all(|zones| zones.len() == count));
        Self {
            intervals: [segment.interval, segment.logged_interval],
            spans,
            width: (width * segment.thinning()) as u64,
            zones: zones.concat(),
            joints,
        }
    }

    /// Each row as one bin; the shapes of dry friction are those of its velocity, which is the same where the joint slides. `motion`: position, velocity, acceleration and torque, joint by joint; `zones` likewise.
    pub(crate) fn of_rows(time: &[f64], motion: &[Vec<f64>; 4], zones: Vec<Zone>) -> Self {
        let count = time.len();
        let of_joint = |joint: usize| {
            let own = |values: &Vec<f64>| values[joint * count..(joint + 1) * count].to_vec();
            let [q, qd, qdd, tau] = motion.each_ref().map(own);
            let [slow, fast] = DRY.map(|dry| qd.iter().map(|v| (v / dry).tanh()).collect());
            Numbers::Memory([tau, q, qd, qdd, slow, fast].concat())
        };
        let joints = 0..zones.len().checked_div(count).unwrap_or(0);
        Self {
            intervals: [0.0; 2],
            spans: time.iter().map(|stamp| [*stamp; 2]).collect(),
            width: 1,
            joints: joints.map(of_joint).collect(),
            zones,
        }
    }

    /// How many bins there are.
    pub(crate) fn len(&self) -> usize {
        self.spans.len()
    }

    /// Leaves the channels on a shelf.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(crate) fn put_away(&mut self, shelf: &Arc<dyn Shelf>) -> Result<()> {
        let mut joints = self.joints.iter_mut();
        joints.try_for_each(|numbers| numbers.put_away(shelf))
    }

    /// Some bins of a joint.
    pub(crate) fn joint(&self, joint: usize, range: &Range<usize>) -> JointBins<'_> {
        let count = self.len();
        let numbers = &self.joints[joint];
        let channel = |k: usize| numbers.some(k * count + range.start..k * count + range.end);
        JointBins {
            channels: std::array::from_fn(channel),
        }
    }

    /// What friction of a joint can be in each bin.
    pub(crate) fn zones(&self, joint: usize) -> &[Zone] {
        let count = self.len();
        &self.zones[joint * count..(joint + 1) * count]
    }
}

/// Zones of a joint; `stopped`: beside the spans of the bins, those in which the drives were off.
fn zones(
    segment: &Segment,
    joint: usize,
    width: usize,
    (spans, stopped): (&[[f64; 2]], &[[f64; 2]]),
) -> Vec<Zone> {
    let len = segment.time.len();
    let own = joint * len..(joint + 1) * len;
    let (velocity, still) = (&segment.qd[own.clone()], &segment.standstill[own]);
    let ends: Vec<[f64; 2]> = velocity.chunks_exact(width).map(ends).collect();
    let slow: Vec<bool> = ends.iter().map(is_slow).collect();
    let off = |span: &[f64; 2]| {
        let overlaps = |[from, to]: &[f64; 2]| span[1] >= *from && span[0] <= *to;
        stopped.iter().any(overlaps)
    };
    let zone = |i: usize| {
        let masked = still[i * width..(i + 1) * width].iter().any(|still| *still);
        let near = i.saturating_sub(MEMORY)..(i + MEMORY + 1).min(slow.len());
        let turns = || slow[near].iter().any(|slow| *slow);
        match off(&spans[i]) {
            true => Zone::Unknown,
            false => Zone::of(ends[i], masked, turns),
        }
    };
    (0..ends.len()).map(zone).collect()
}

/// Least and largest velocity.
fn ends(velocity: &[f64]) -> [f64; 2] {
    let least = velocity.iter().copied().fold(f64::INFINITY, f64::min);
    let most = velocity.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [least, most]
}

/// It reverses or creeps.
fn is_slow([least, most]: &[f64; 2]) -> bool {
    least * most <= 0.0 || least.abs().min(most.abs()) < SLOW
}

impl Zone {
    /// Where velocity has these ends, torque is masked somewhere or not, and the joint reverses or creeps nearby.
    fn of([least, most]: [f64; 2], masked: bool, turns: impl FnOnce() -> bool) -> Self {
        let fastest = least.abs().max(most.abs());
        if masked && fastest > 2.0 * SLOW {
            Self::Unknown
        } else if fastest < REST {
            Self::Rests
        } else if turns() {
            Self::Reverses
        } else {
            Self::Slides
        }
    }

    /// Zone of a joint in these samples of a segment, without what is known of its drives.
    pub(crate) fn at(
        (pipeline, segment): (&Pipeline, &Segment),
        joint: usize,
        samples: &Range<usize>,
    ) -> Self {
        let len = segment.time.len();
        let own = joint * len..(joint + 1) * len;
        let (velocity, still) = (&segment.qd[own.clone()], &segment.standstill[own]);
        let memory = (MEMORY as f64 * seconds(pipeline) / segment.interval).round() as usize;
        let near = samples.start.saturating_sub(memory)..(samples.end + memory).min(len);
        let masked = still[samples.clone()].iter().any(|still| *still);
        let turns = || is_slow(&ends(&velocity[near]));
        Self::of(ends(&velocity[samples.clone()]), masked, turns)
    }
}

impl JointBins<'_> {
    /// Mean torque of each bin.
    pub(crate) fn torque(&self) -> &[f64] {
        &self.channels[0]
    }

    /// Mean position.
    pub(crate) fn position(&self) -> &[f64] {
        &self.channels[1]
    }

    /// Mean velocity.
    pub(crate) fn velocity(&self) -> &[f64] {
        &self.channels[2]
    }

    /// Mean acceleration.
    pub(crate) fn acceleration(&self) -> &[f64] {
        &self.channels[3]
    }

    /// Columns of friction, motor inertia, offset and spring of a bin.
    pub(crate) fn friction(&self, bin: usize) -> [f64; FRICTION] {
        let [q, v, a, slow, fast] = [1, 2, 3, 4, 5].map(|channel| self.channels[channel][bin]);
        [v, slow, fast, v.abs() * v, a, 1.0, q]
    }
}
