//! One log on even clocks: cut, unfolded, resampled where the clock is uneven; nothing filtered yet.

use super::clock::{Clock, Run, read_clock, report_jitter};
use super::correct::{Corrections, DerivedFrom};
use super::jumps::cut_jumps;
use super::pieces::{Piece, Prepared, Values, pick};
use super::spline::resample;
use super::units::refuse_degrees;
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::robot::JointKind;
use crate::signal::log::joints::JointFacts;
use crate::signal::log::recording::Recording;
use crate::signal::log::stamps::even_interval;
use crate::signal::log::unwrap::{unfolded, unwrap_angle};
use rayon::prelude::*;
use std::borrow::Cow;

/// Fewest samples of a log with the filter on: anything shorter cannot hold a kernel.
pub(crate) const MINIMUM_SAMPLES: usize = 10;
/// Fewest samples of a run that is resampled.
const MINIMUM_RUN: usize = 8;

/// Step 1 of method section 1. With `every_row` (pipeline off) values stay as they are and only cuts are found.
pub(crate) fn prepare<'a>(
    joints: &[JointFacts],
    log: &'a Recording,
    every_row: bool,
    corrections: &Corrections,
    findings: &mut Vec<Finding>,
) -> Result<Prepared<'a>> {
    refuse_joints(joints, log)?;
    let names: Vec<String> = joints.iter().map(|j| j.name.clone()).collect();
    let minimum = if every_row { 2 } else { MINIMUM_SAMPLES };
    let clock = read_clock(log, &names, minimum, every_row, findings)?;
    refuse_degrees(joints, log)?;
    let unfolded = unfold(joints, log, &clock, every_row, findings);
    let runs = cut_jumps(joints, log, &unfolded, &clock, every_row, findings);
    let values = |joint: usize, run: &Run| {
        let mut values = logged(log, &clock, &unfolded, (joint, run));
        values.qd = (values.qd).filter(|_| corrections.velocity != Some(DerivedFrom::Position));
        values
    };
    let mut pieces = Vec::with_capacity(runs.len());
    // Rows of every run that is too short.
    let (mut short, mut resampled) = (Vec::new(), 0_u64);
    // Without torque nothing has to move, and the grid keeps its ends.
    let moves = corrections.moves(joints) && log.joints.iter().any(|c| c.tau.is_some());
    for run in &runs {
        if run.rows.len() < MINIMUM_RUN && !every_row {
            short.push(run.rows.len() as u64);
            continue;
        }
        let stamps: Vec<f64> = run.rows.iter().map(|&row| clock.stamp(log, row)).collect();
        let values: Vec<Values<'a>> = (0..joints.len()).map(|joint| values(joint, run)).collect();
        let logged = moves.then(|| (stamps.clone(), values.clone()));
        let mut piece = match step_of(&stamps, &clock, every_row) {
            Some(interval) => on_stamps(stamps, run, values, interval),
            None => {
                resampled += stamps.len() as u64;
                on_grid(&stamps, run, &values, clock.interval)
            }
        };
        if let Some((stamps, values)) = logged {
            let (time, moved) = (&piece.time, &mut piece.joints);
            let kept = corrections.move_torque(joints, &stamps, &values, time, moved);
            piece.keep(kept);
            if piece.time.len() < MINIMUM_RUN {
                short.push(piece.rows.len() as u64);
                continue;
            }
        }
        pieces.push(piece);
    }
    report_jitter(log, &runs, &clock, resampled, findings);
    report_short(log, short.len() as u64, short.iter().sum(), findings);
    Ok(Prepared {
        pieces,
        interval: clock.interval,
        time: clock.sampled.time,
    })
}

/// An error where a log has another number of joints than the model.
fn refuse_joints(joints: &[JointFacts], log: &Recording) -> Result<()> {
    if log.joints.len() == joints.len() {
        return Ok(());
    }
    Err(Error::Log {
        log: log.name.clone(),
        problem: format!(
            "{} joints, the model has {} moving ones",
            log.joints.len(),
            joints.len()
        ),
        remedy: "give one set of channels per moving joint of the model".into(),
    })
}

/// Channels of a joint in a run, unfolded, single values interpolated where they repeat.
fn logged<'a>(
    log: &'a Recording,
    clock: &Clock,
    unfolded: &[Option<Vec<f64>>],
    (joint, run): (usize, &Run),
) -> Values<'a> {
    let own = &log.joints[joint];
    let channel = |values: &'a Option<Vec<f64>>| Some(pick(values.as_deref()?, &run.rows));
    let tau = channel(&own.tau);
    let of_run = |values: &[f64]| run.rows.iter().map(|&row| values[row]).collect();
    let mut values = match clock.sampled.filled.get(joint).and_then(Option::as_ref) {
        None => Values {
            q: pick(&own.q, &run.rows),
            qd: channel(&own.qd),
            qdd: channel(&own.qdd),
            tau,
        },
        Some(filled) => Values {
            q: of_run(&filled.q),
            qd: filled.qd.as_deref().map(of_run),
            qdd: filled.qdd.as_deref().map(of_run),
            tau,
        },
    };
    if let Some(q) = &unfolded[joint] {
        values.q = of_run(q);
    }
    values
}

/// Says how many runs were too short to use.
pub(crate) fn report_short(log: &Recording, short: u64, rows: u64, findings: &mut Vec<Finding>) {
    if short > 0 {
        findings.push(Finding::new(
            Severity::Warning,
            Code::ShortSegments,
            &log.name,
            match short {
                1 => format!("a segment between cuts ({rows} samples) is shorter than the motion filter and was dropped"),
                _ => format!("{short} segments between cuts ({rows} samples) are shorter than the motion filter and were dropped"),
            },
            rows,
        )
        .with([("segments", short as f64)]));
    }
}

/// Step of a run that keeps its stamps; `None` where they are uneven.
fn step_of(stamps: &[f64], clock: &Clock, every_row: bool) -> Option<f64> {
    match every_row {
        true => Some(clock.interval),
        false => even_interval(stamps),
    }
}

/// A run with its stamps as they are.
fn on_stamps<'a>(time: Vec<f64>, run: &Run, joints: Vec<Values<'a>>, interval: f64) -> Piece<'a> {
    Piece {
        time,
        interval,
        every: 1,
        rows: run.rows.clone(),
        grid_rows: run.rows.clone(),
        joints,
    }
}

/// A run on the log's median step by cubic splines.
fn on_grid<'a>(stamps: &[f64], run: &Run, values: &[Values<'a>], interval: f64) -> Piece<'a> {
    let span = stamps[stamps.len() - 1] - stamps[0];
    let steps = (span / interval * (1.0 + 1e-12)).floor() as usize;
    let grid: Vec<f64> = (0..=steps)
        .map(|i| stamps[0] + i as f64 * interval)
        .collect();
    let mut joints = values.to_vec();
    joints.par_iter_mut().for_each(|values| {
        values.for_each(|channel| *channel = Cow::Owned(resample(stamps, channel, &grid)));
    });
    Piece {
        interval,
        every: 1,
        rows: run.rows.clone(),
        grid_rows: Vec::new(),
        joints,
        time: grid,
    }
}

/// Unfolded positions, by joint, where there was something to unfold.
fn unfold(
    joints: &[JointFacts],
    log: &Recording,
    clock: &Clock,
    every_row: bool,
    findings: &mut Vec<Finding>,
) -> Vec<Option<Vec<f64>>> {
    let runs = &clock.runs;
    let mut cuts = Vec::with_capacity(runs.len());
    let mut rows = 0;
    for run in runs {
        cuts.push(rows);
        rows += run.rows.len();
    }
    let one = |(joint, facts): (usize, &JointFacts)| {
        if log.unfolded || !matches!(facts.kind, JointKind::Revolute | JointKind::Continuous) {
            return None;
        }
        let logged = clock.sampled.position(log, joint);
        let mut q: Vec<f64> = runs
            .iter()
            .flat_map(|run| run.rows.iter().map(|&row| logged[row]))
            .collect();
        let jumps = unwrap_angle(&mut q, &cuts);
        if jumps == 0 {
            return None;
        }
        if every_row {
            let name = &facts.name;
            let finding = Finding::new(
                Severity::Warning,
                Code::WrappedAngle,
                &log.name,
                format!(
                    "joint `{name}`: {jumps} jumps by a full turn, left as logged because the filter is off: unfold them if the library has \
                     springs"
                ),
                jumps,
            );
            return Some((finding.of_joint(name), None));
        }
        let mut all = logged.to_vec();
        for (row, value) in runs.iter().flat_map(|run| run.rows.iter()).zip(q) {
            all[*row] = value;
        }
        Some((unfolded(&log.name, &facts.name, jumps), Some(all)))
    };
    let found: Vec<Option<(Finding, Option<Vec<f64>>)>> =
        joints.par_iter().enumerate().map(one).collect();
    found
        .into_iter()
        .map(|found| {
            let (finding, unfolded) = found?;
            findings.push(finding);
            unfolded
        })
        .collect()
}
