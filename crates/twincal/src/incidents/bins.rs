//! A trajectory averaged over bins: what contacts are looked for in.

use super::spikes::COLUMNS;
use crate::error::Result;
use crate::robot::{Motion, Robot, nominal_torque};
use crate::signal::{Numbers, Pipeline, Segment, Shelf, Trajectory};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// Width of the bins in periods of the cut-off; one sample without filter.
const BIN: f64 = 0.25;
/// Velocities of the friction's shapes, rad/s or m/s.
const DRY: [f64; 2] = [0.02, 0.2];
/// Channels of a joint: torque, nominal torque, velocity, acceleration and the shapes of dry friction.
const CHANNELS: usize = 6;

/// A segment, averaged over bins.
#[derive(Debug)]
pub(super) struct Bins {
    /// Sampling intervals of the segment and of the log, s.
    pub(super) intervals: [f64; 2],
    /// First and last stamp of each bin, s.
    pub(super) spans: Vec<[f64; 2]>,
    /// Samples of each bin.
    pub(super) width: u64,
    /// Whether the joint moves in the whole bin, alike: `joint * bins + bin`.
    moves: Vec<bool>,
    /// By joint, channel by channel.
    joints: Vec<Numbers>,
}

/// The bins of one joint.
pub(super) struct JointBins<'a> {
    values: Cow<'a, [f64]>,
    moves: &'a [bool],
}

/// A trajectory in bins; `stopped`: spans in which the drives were off, s.
pub(super) fn bins(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    stopped: &[[f64; 2]],
) -> Vec<Bins> {
    let width = |interval: f64| {
        if pipeline.is_off() {
            1
        } else {
            ((BIN / pipeline.cutoff_hz / interval) as usize).max(1)
        }
    };
    let first = trajectory.segments.first();
    let width = first.map_or(1, |segment| width(segment.interval));
    let segments = trajectory.segments.iter();
    segments
        .map(|segment| Bins::new(robot, segment, width, stopped))
        .collect()
}

impl Bins {
    fn new(robot: &Robot, segment: &Segment, width: usize, stopped: &[[f64; 2]]) -> Self {
        let (dof, len) = (robot.dof(), segment.time.len());
        let count = len / width;
        let mean = |values: &[f64]| -> Vec<f64> {
            let joints = values.chunks_exact(len.max(1));
            joints
                .flat_map(|joint| joint.chunks_exact(width))
                .map(|bin| bin.iter().sum::<f64>() / width as f64)
                .collect()
        };
        let [q, qd, qdd, tau] =
            [&segment.q, &segment.qd, &segment.qdd, &segment.tau].map(|values| mean(values));
        // Means of the shapes, since where a joint turns round that is not the shape of the mean.
        let shape = |velocity: f64| -> Vec<f64> {
            let of_bin = |bin: &[f64]| {
                bin.iter().map(|qd| (qd / velocity).tanh()).sum::<f64>() / width as f64
            };
            let joints = segment.qd.par_chunks_exact(len.max(1));
            let bins = joints.flat_map_iter(|joint| joint.chunks_exact(width).map(of_bin));
            bins.collect()
        };
        let mut nominal = vec![0.0; dof * count];
        let motion = Motion {
            len: count,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        nominal_torque(robot, motion, &mut nominal);
        let spans: Vec<[f64; 2]> = segment
            .time
            .chunks_exact(width)
            .map(|bin| [bin[0], bin[width - 1]])
            .collect();
        let stops = |span: &[f64; 2]| {
            let overlaps = |[from, to]: &[f64; 2]| span[1] >= *from && span[0] <= *to;
            stopped.iter().any(overlaps)
        };
        let still = segment.standstill.chunks_exact(len.max(1));
        let moves = still
            .flat_map(|joint| joint.chunks_exact(width).zip(&spans))
            .map(|(bin, span)| !stops(span) && bin.iter().all(|still| !still))
            .collect();
        let [slow, fast] = DRY.map(shape);
        let channels: [&Vec<f64>; CHANNELS] = [&tau, &nominal, &qd, &qdd, &slow, &fast];
        let joint = |joint: usize| {
            let own = |channel: &&Vec<f64>| channel[joint * count..(joint + 1) * count].to_vec();
            Numbers::Memory(channels.iter().flat_map(own).collect())
        };
        Self {
            intervals: [segment.interval, segment.logged_interval],
            spans,
            width: (width * segment.thinning()) as u64,
            moves,
            joints: (0..dof).map(joint).collect(),
        }
    }

    /// Leaves the channels on a shelf.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(super) fn put_away(&mut self, shelf: &Arc<dyn Shelf>) -> Result<()> {
        let mut joints = self.joints.iter_mut();
        joints.try_for_each(|numbers| numbers.put_away(shelf))
    }

    /// The bins of a joint.
    pub(super) fn joint(&self, joint: usize) -> JointBins<'_> {
        let count = self.spans.len();
        JointBins {
            values: self.joints[joint].get(),
            moves: &self.moves[joint * count..(joint + 1) * count],
        }
    }

    /// Whether a joint moves in each bin.
    pub(super) fn moves(&self, joint: usize) -> &[bool] {
        let count = self.spans.len();
        &self.moves[joint * count..(joint + 1) * count]
    }
}

impl JointBins<'_> {
    fn channel(&self, channel: usize) -> &[f64] {
        let count = self.moves.len();
        &self.values[channel * count..(channel + 1) * count]
    }

    /// Mean torque of each bin.
    pub(super) fn torque(&self) -> &[f64] {
        self.channel(0)
    }

    /// Whether the joint moves in a bin.
    pub(super) fn moves(&self, bin: usize) -> bool {
        self.moves[bin]
    }

    /// What explains the torque of a bin.
    pub(super) fn columns(&self, bin: usize) -> [f64; COLUMNS] {
        let [nominal, v, a, slow, fast] = [1, 2, 3, 4, 5].map(|channel| self.channel(channel)[bin]);
        [nominal, v, slow, fast, v.abs() * v, a, 1.0]
    }
}
