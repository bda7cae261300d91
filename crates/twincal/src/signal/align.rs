//! One recording through the motion filter: segments of smooth motion, raw torque and standstill flags.

use super::agreement::{self, velocity_agreement};
use super::choose::{COLUMN_LIMIT, MOTION_LIMIT, require_derivatives};
use super::convolve::{correlate, correlate_two};
use super::fir::{MotionKernels, column_half_seconds, motion_half_samples, motion_half_seconds};
use super::mask::Saturated;
use super::prepare::{JointFacts, Piece, prepare, report_short};
use super::standstill::standstill;
use super::{Channels, DerivedFrom, LoggedSamples, Pipeline, Recording, Segment, Trajectory};
use crate::error::{Error, Finding, Result, Severity};
use rayon::prelude::*;

/// Standstill has to last for this many periods of the cut-off.
const STANDSTILL_PERIODS: f64 = 3.0;

/// Share of standstill from which a joint counts as not moving in a log.
const HARDLY_MOVES: f64 = 0.95;

/// See [`super::align`].
pub(crate) fn align(
    joints: &[JointFacts],
    log: &Recording,
    pipeline: &Pipeline,
) -> Result<(Trajectory, Vec<Finding>)> {
    let mut findings = Vec::new();
    let every_row = pipeline.is_off();
    if every_row {
        require_derivatives(joints, log)?;
    }
    let prepared = prepare(joints, log, every_row, &pipeline.corrections, &mut findings)?;
    let with_tau = log.joints.iter().all(|c| c.tau.is_some());
    let mut trajectory = Trajectory {
        name: log.name.clone(),
        dof: joints.len(),
        segments: Vec::with_capacity(prepared.pieces.len()),
        payload: log.payload,
        payload_acts: true,
    };
    if every_row {
        trajectory.segments = prepared
            .pieces
            .iter()
            .map(|piece| as_logged(piece, with_tau))
            .collect();
        Saturated::find(joints, log, pipeline).mask(log, &mut trajectory, &mut findings);
        return Ok((trajectory, findings));
    }
    let rate = 1.0 / prepared.interval;
    if pipeline.cutoff_hz > COLUMN_LIMIT * rate {
        return Err(Error::Log {
            log: log.name.clone(),
            problem: format!(
                "its rate of {rate:.3} Hz is too low for the cut-off of {} Hz",
                pipeline.cutoff_hz
            ),
            remedy: format!(
                "record at {:.3} Hz or more, or lower [signal] cutoff_hz",
                pipeline.cutoff_hz / COLUMN_LIMIT
            ),
        });
    }
    let cutoff = pipeline.motion_cutoff_hz.min(MOTION_LIMIT * rate);
    if cutoff < pipeline.motion_cutoff_hz {
        findings.push(Finding::new(
            Severity::Warning,
            "motion_filter_capped",
            &log.name,
            format!(
                "the motion filter's cut-off is {cutoff:.3} Hz here instead of {:.3} Hz: the log has only {rate:.3} Hz",
                pipeline.motion_cutoff_hz
            ),
            0,
        ));
    }
    let (mut short, mut short_rows, mut total, mut used) = (0, 0, 0.0, 0.0);
    for piece in &prepared.pieces {
        total += piece.time.len() as f64 * piece.interval;
        match smoothed(joints, piece, pipeline, cutoff, log, with_tau) {
            Some(segment) => {
                let border = 2.0 * column_half_seconds(pipeline.cutoff_hz);
                used += (segment.time.len() as f64 * piece.interval - border).max(0.0);
                trajectory.segments.push(segment);
            }
            None => {
                short += 1;
                short_rows += piece.rows.len() as u64;
            }
        }
    }
    report_short(log, short, short_rows, &mut findings);
    if trajectory.segments.is_empty() {
        return Err(Error::Log {
            log: log.name.clone(),
            problem: format!(
                "no stretch between cuts is longer than the motion filter ({:.3} s)",
                2.0 * motion_half_seconds(cutoff)
            ),
            remedy: "mend the gaps and NaN rows, or raise [signal] cutoff_hz".into(),
        });
    }
    findings.push(Finding::new(
        Severity::Note,
        "borders",
        &log.name,
        format!(
            "the filters need {:.3} s at either end of each segment: {used:.3} of {total:.3} s become rows",
            column_half_seconds(pipeline.cutoff_hz) + motion_half_seconds(cutoff)
        ),
        0,
    ));
    let names: Vec<&str> = joints.iter().map(|facts| facts.name.as_str()).collect();
    let agreement = velocity_agreement(&trajectory, &pipeline.standstill_velocity);
    findings.extend(agreement::findings(&names, &log.name, &agreement));
    report_standstill(joints, log, &trajectory, &mut findings);
    Saturated::find(joints, log, pipeline).mask(log, &mut trajectory, &mut findings);
    Ok((trajectory, findings))
}

/// Channels one after the other: `joint * len + sample`.
fn stacked<'a>(
    joints: &'a [Channels],
    channel: impl Fn(&'a Channels) -> Option<&'a Vec<f64>>,
) -> Vec<f64> {
    joints
        .iter()
        .filter_map(channel)
        .flatten()
        .copied()
        .collect()
}

/// Pipeline off: the rows as they are.
fn as_logged(piece: &Piece, with_tau: bool) -> Segment {
    Segment {
        time: piece.time.clone(),
        input_rows: piece.rows.clone(),
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
        interval: piece.interval,
    }
}

/// Step 2 of method section 1; `None` if the piece does not hold the kernel and a few samples more.
fn smoothed(
    joints: &[JointFacts],
    piece: &Piece,
    pipeline: &Pipeline,
    cutoff: f64,
    log: &Recording,
    with_tau: bool,
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
            let travel = derivatives(
                &kernels,
                channels,
                pipeline.derived_from[joint],
                [q, qd, qdd],
            );
            // Position tells standstill: a drive's velocity is often a difference of counts and far noisier at rest.
            still.copy_from_slice(&standstill(
                travel.as_deref().unwrap_or(qd),
                pipeline.standstill_velocity[joint],
                STANDSTILL_PERIODS / pipeline.cutoff_hz,
                piece.interval,
            ));
        });
    let logged_torque = piece.joints.iter().filter_map(|c| c.tau.as_ref());
    let tau = logged_torque
        .filter(|_| with_tau)
        .flat_map(|tau| tau[inner.clone()].iter().copied())
        .collect();
    let time = piece.time[inner.clone()].to_vec();
    let (input_rows, logged) = if piece.resampled {
        (
            Vec::new(),
            Some(logged_samples(
                joints, &time, piece, log, pipeline, with_tau,
            )),
        )
    } else {
        (piece.rows[inner].to_vec(), None)
    };
    Some(Segment {
        time,
        input_rows,
        logged,
        q,
        qd,
        qdd,
        tau,
        standstill: still,
        interval: piece.interval,
    })
}

/// Smooth position, velocity and acceleration of one joint; the derivative of its position, where that is not the velocity.
fn derivatives(
    kernels: &MotionKernels,
    channels: &Channels,
    derived: DerivedFrom,
    [q, qd, qdd]: [&mut [f64]; 3],
) -> Option<Vec<f64>> {
    let Some(velocity) = &channels.qd else {
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

/// The rows as logged that lie within the borders of a resampled segment; torque moved back by its lag.
fn logged_samples(
    joints: &[JointFacts],
    time: &[f64],
    piece: &Piece,
    log: &Recording,
    pipeline: &Pipeline,
    with_tau: bool,
) -> LoggedSamples {
    let of_rows =
        |values: &[f64]| -> Vec<f64> { piece.rows.iter().map(|&row| values[row]).collect() };
    let stamps = of_rows(&log.time);
    let logged: Vec<Channels> = log
        .joints
        .iter()
        .map(|channels| Channels {
            q: Vec::new(),
            qd: None,
            qdd: None,
            tau: channels.tau.as_deref().filter(|_| with_tau).map(of_rows),
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
    LoggedSamples {
        time: stamps[from..to].to_vec(),
        tau: moved
            .iter()
            .filter_map(|channels| channels.tau.as_deref())
            .flat_map(|tau| tau[from..to].iter().copied())
            .collect(),
        input_rows: piece.rows[from..to].to_vec(),
    }
}

fn report_standstill(
    joints: &[JointFacts],
    log: &Recording,
    trajectory: &Trajectory,
    findings: &mut Vec<Finding>,
) {
    for (joint, facts) in joints.iter().enumerate() {
        let (mut still, mut all) = (0_usize, 0_usize);
        for segment in &trajectory.segments {
            let len = segment.time.len();
            all += len;
            still += segment.standstill[joint * len..(joint + 1) * len]
                .iter()
                .filter(|s| **s)
                .count();
        }
        if still == 0 {
            continue;
        }
        let share = 100.0 * still as f64 / all as f64;
        let (severity, code, text) = if still as f64 >= HARDLY_MOVES * all as f64 {
            (
                Severity::Warning,
                "joint_stands_still",
                format!("does not move in {share:.1} % of this log"),
            )
        } else {
            (
                Severity::Note,
                "standstill",
                format!("stands still in {share:.1} % of this log"),
            )
        };
        findings.push(Finding::new(
            severity,
            code,
            &log.name,
            format!(
                "joint `{}` {text}; its torque there is not used",
                facts.name
            ),
            still as u64,
        ));
    }
}
