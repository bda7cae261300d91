//! One piece of a log as a segment: as logged, or with smooth motion.

use super::convolve::{correlate, correlate_two};
use super::fir::{MotionKernels, motion_half_samples};
use super::pipeline::Pipeline;
use super::prepared_log::{PreparedLog, Raw};
use super::trajectory::{LoggedSamples, Segment};
use crate::signal::clean::correct::DerivedFrom;
use crate::signal::clean::pieces::{Piece, Values, pick};
use crate::signal::clean::standstill::{at_rest, slower_than};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Samples as logged that are kept of a long log whose clock is thinned, about, and how many in a row.
const SPREAD: usize = 1 << 16;
const STRETCH: usize = 1 << 8;

/// Channels one after the other: `joint * len + sample`.
fn stacked<'a>(
    joints: &'a [Values<'a>],
    channel: impl Fn(&'a Values<'a>) -> Option<&'a Cow<'a, [f64]>>,
) -> Vec<f64> {
    let channels = joints.iter().filter_map(channel);
    channels.flat_map(|values| values.iter().copied()).collect()
}

/// Evenly spread stretches of some samples of a log of `all`.
fn spread(range: Range<usize>, all: usize) -> Vec<Range<usize>> {
    let every = all.div_ceil(SPREAD).max(1);
    let starts = (range.start..range.end).step_by(every * STRETCH);
    if every == 1 {
        return std::iter::once(range).collect();
    }
    starts
        .map(|start| start..range.end.min(start + STRETCH))
        .collect()
}

/// What of a piece goes into its segment beside motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kept {
    pub(super) with_tau: bool,
    pub(super) raw: Raw,
}

/// Pipeline off: the rows as they are.
pub(super) fn as_logged(piece: &Piece<'_>, with_tau: bool) -> Segment {
    Segment {
        time: piece.time.clone(),
        input_rows: piece.rows.clone(),
        logged_interval: piece.interval,
        logged: None,
        q: stacked(&piece.joints, |c| Some(&c.q)),
        qd: stacked(&piece.joints, |c| c.qd.as_ref()),
        qdd: stacked(&piece.joints, |c| c.qdd.as_ref()),
        tau: if with_tau {
            stacked(&piece.joints, |c| c.tau.as_ref())
        } else {
            Vec::new()
        },
        standstill: vec![false; piece.joints.len() * piece.time.len()],
        history: Vec::new(),
        interval: piece.interval,
    }
}

/// Step 2 of method section 1; `None` if the piece does not hold the kernel and a few samples more.
pub(super) fn smoothed(
    ready: &PreparedLog<'_>,
    piece: &Piece<'_>,
    pipeline: &Pipeline,
    cutoff: f64,
    kept: Kept,
) -> Option<Segment> {
    let half = motion_half_samples(cutoff, piece.interval);
    let len = piece
        .time
        .len()
        .checked_sub(2 * half)
        .filter(|len| *len >= 2)?;
    let kernels = MotionKernels::new(cutoff, piece.interval);
    let dof = piece.joints.len();
    let inner = half..half + len;
    let [mut q, mut qd, mut qdd] = [(); 3].map(|()| vec![0.0; dof * len]);
    let mut still = vec![false; dof * len];
    let of_joints = piece.joints.par_iter().enumerate();
    of_joints
        .zip(q.par_chunks_exact_mut(len))
        .zip(qd.par_chunks_exact_mut(len))
        .zip(qdd.par_chunks_exact_mut(len))
        .zip(still.par_chunks_exact_mut(len))
        .for_each(|(((((joint, channels), q), qd), qdd), still)| {
            let travel = derivatives(&kernels, channels, pipeline.sources(joint), [q, qd, qdd]);
            // As logged: a filtered position rings where a move ends.
            let rest = at_rest(&channels.q, ready.at_rest[joint], piece.interval);
            still.copy_from_slice(&rest[half..half + len]);
            let travel = travel.as_deref().unwrap_or(qd);
            add_slow(travel, (pipeline, joint), piece.interval, still);
        });
    let torque = piece.joints.iter().filter_map(|c| c.tau.as_ref());
    let tau = torque
        .filter(|_| kept.with_tau)
        .flat_map(|tau| tau[inner.clone()].iter().copied())
        .collect();
    let time = piece.time[inner.clone()].to_vec();
    let input_rows = if piece.resampled() {
        Vec::new()
    } else {
        piece.grid_rows[inner].to_vec()
    };
    let logged = (kept.raw != Raw::None && (piece.resampled() || piece.every > 1))
        .then(|| logged_samples(ready, &time, piece, pipeline, kept));
    Some(Segment {
        time,
        input_rows,
        logged,
        q,
        qd,
        qdd,
        tau,
        standstill: still,
        history: Vec::new(),
        interval: piece.interval,
        logged_interval: piece.interval / piece.every as f64,
    })
}

/// Adds samples at which a joint travels so slowly that it stands still.
fn add_slow(
    travel: &[f64],
    (pipeline, joint): (&Pipeline, usize),
    interval: f64,
    still: &mut [bool],
) {
    let limit = pipeline.standstill_velocity[joint];
    let seconds = pipeline.shortest_standstill();
    let slow = slower_than(travel, limit, seconds, interval);
    (still.iter_mut().zip(slow)).for_each(|(still, slow)| *still |= slow);
}

/// Smooth position, velocity and acceleration of one joint; the derivative of its position, where that is not the velocity.
fn derivatives(
    kernels: &MotionKernels,
    channels: &Values<'_>,
    [velocity_from, derived]: [DerivedFrom; 2],
    [q, qd, qdd]: [&mut [f64]; 3],
) -> Option<Vec<f64>> {
    let logged = channels.qd.as_ref();
    let Some(velocity) = logged.filter(|_| velocity_from == DerivedFrom::Velocity) else {
        correlate_two([&kernels.smooth, &kernels.first], &channels.q, [q, qd]);
        match &channels.qdd {
            Some(logged) => correlate(&kernels.smooth, logged, qdd),
            None => correlate(&kernels.second, &channels.q, qdd),
        }
        return None;
    };
    let mut travel = vec![0.0; q.len()];
    correlate_two(
        [&kernels.smooth, &kernels.first],
        &channels.q,
        [q, &mut travel],
    );
    match (&channels.qdd, derived) {
        (None, DerivedFrom::Velocity) => {
            correlate_two([&kernels.smooth, &kernels.first], velocity, [qd, qdd]);
        }
        (logged, _) => {
            correlate(&kernels.smooth, velocity, qd);
            match logged {
                Some(logged) => correlate(&kernels.smooth, logged, qdd),
                None => correlate(&kernels.second, &channels.q, qdd),
            }
        }
    }
    Some(travel)
}

/// The rows as logged that lie within the borders of a segment; torque moved back by its lag.
fn logged_samples(
    ready: &PreparedLog<'_>,
    time: &[f64],
    piece: &Piece<'_>,
    pipeline: &Pipeline,
    kept: Kept,
) -> LoggedSamples {
    let PreparedLog { log, joints, .. } = ready;
    let time_of_rows = ready.pieces.time.as_ref().unwrap_or(&log.time);
    let stamps = pick(time_of_rows, &piece.rows);
    let logged: Vec<Values<'_>> = log
        .joints
        .iter()
        .map(|channels| Values {
            q: Cow::Borrowed(&[]),
            qd: None,
            qdd: None,
            tau: (channels.tau.as_deref().filter(|_| kept.with_tau))
                .map(|tau| pick(tau, &piece.rows)),
        })
        .collect();
    let mut moved = logged.clone();
    let corrections = &pipeline.corrections;
    if corrections.moves(joints) {
        corrections.move_torque(joints, &stamps, &logged, &stamps, &mut moved);
    }
    let (first, last) = (time[0], time[time.len() - 1]);
    let from = stamps.partition_point(|t| *t < first);
    let to = stamps.partition_point(|t| *t <= last);
    let stretches = match kept.raw {
        Raw::Spread if piece.every > 1 => spread(from..to, log.time.len()),
        _ => std::iter::once(from..to).collect(),
    };
    let kept = |values: &[f64]| -> Vec<f64> {
        stretches
            .iter()
            .flat_map(|stretch| &values[stretch.clone()])
            .copied()
            .collect()
    };
    let rows = stretches
        .iter()
        .flat_map(|stretch| &piece.rows[stretch.clone()]);
    LoggedSamples {
        time: kept(&stamps),
        tau: (moved.iter().filter_map(|channels| channels.tau.as_deref()))
            .flat_map(&kept)
            .collect(),
        input_rows: rows.copied().collect(),
    }
}
