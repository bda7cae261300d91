//! One log on even clocks: cut, unfolded, resampled where the clock is uneven; nothing filtered yet.

use super::clock::{Run, even_interval, read_clock, report_jitter};
use super::jumps::cut_jumps;
use super::spline::resample;
use super::units::refuse_degrees;
use super::unwrap::unwrap_angle;
use super::{Channels, Corrections, Recording};
use crate::error::{Error, Finding, Result, Severity};
use crate::robot::{JointKind, Robot};

/// Fewest samples of a log with the filter on: anything shorter cannot hold a kernel.
pub(crate) const MINIMUM_SAMPLES: usize = 10;
/// Fewest samples of a run that is resampled.
const MINIMUM_RUN: usize = 8;

/// What the pipeline has to know of a moving joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointFacts {
    /// Name in the model.
    pub(crate) name: String,
    /// Only angles are unfolded.
    pub(crate) kind: JointKind,
    /// Upper less lower limit where the model states both, rad or m.
    pub(crate) range: Option<f64>,
    /// Largest torque that the model states, N·m or N.
    pub(crate) effort: Option<f64>,
}

/// The moving joints of a robot.
pub(crate) fn joint_facts(robot: &Robot) -> Vec<JointFacts> {
    let names = robot.joint_names();
    (0..robot.dof())
        .map(|joint| {
            let limits = robot.joint(joint).limits;
            JointFacts {
                name: names[joint].to_owned(),
                kind: robot.joint_kind(joint),
                range: limits.lower.zip(limits.upper).map(|(low, high)| high - low),
                effort: limits.effort,
            }
        })
        .collect()
}

/// A run of samples on one even clock.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Piece {
    /// Grid, s: the stamps themselves when they are even.
    pub(crate) time: Vec<f64>,
    /// Interval, s.
    pub(crate) interval: f64,
    /// Rows of the recording; one per grid sample unless `resampled`.
    pub(crate) rows: Vec<usize>,
    /// The stamps were uneven.
    pub(crate) resampled: bool,
    /// Values on the grid.
    pub(crate) joints: Vec<Channels>,
}

impl Piece {
    /// Keeps these samples of the grid.
    fn keep(&mut self, range: std::ops::Range<usize>) {
        let cut = |values: &mut Vec<f64>| *values = values[range.clone()].to_vec();
        cut(&mut self.time);
        if !self.resampled {
            self.rows = self.rows[range.clone()].to_vec();
        }
        for channels in &mut self.joints {
            cut(&mut channels.q);
            let others = [&mut channels.qd, &mut channels.qdd, &mut channels.tau];
            others.into_iter().flatten().for_each(cut);
        }
    }
}

/// A log as pieces.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Prepared {
    /// In the log's order.
    pub(crate) pieces: Vec<Piece>,
    /// Median step of the log, s.
    pub(crate) interval: f64,
}

/// Step 1 of method section 1. With `every_row` (pipeline off) values stay as they are and only cuts are found.
pub(crate) fn prepare(
    joints: &[JointFacts],
    log: &Recording,
    every_row: bool,
    corrections: &Corrections,
    findings: &mut Vec<Finding>,
) -> Result<Prepared> {
    if log.joints.len() != joints.len() {
        return Err(Error::Log {
            log: log.name.clone(),
            problem: format!(
                "{} joints, the model has {} moving ones",
                log.joints.len(),
                joints.len()
            ),
            remedy: "give one set of channels per moving joint of the model".into(),
        });
    }
    let names: Vec<String> = joints.iter().map(|j| j.name.clone()).collect();
    let minimum = if every_row { 2 } else { MINIMUM_SAMPLES };
    let clock = read_clock(log, &names, minimum, every_row, findings)?;
    refuse_degrees(joints, log)?;
    let unfolded = unfold(joints, log, &clock.runs, every_row, findings);
    let runs = cut_jumps(joints, log, &unfolded, &clock, every_row, findings);
    let channels = |joint: usize, run: &Run| Channels {
        q: unfolded[joint].as_ref().map_or_else(
            || {
                run.rows
                    .iter()
                    .map(|&row| log.joints[joint].q[row])
                    .collect()
            },
            |q| run.rows.iter().map(|&row| q[row]).collect(),
        ),
        qd: pick(&log.joints[joint].qd, run).filter(|_| !corrections.velocity_from_position),
        qdd: pick(&log.joints[joint].qdd, run),
        tau: pick(&log.joints[joint].tau, run),
    };
    let mut pieces = Vec::with_capacity(runs.len());
    let (mut short, mut short_rows, mut resampled) = (0_u64, 0_u64, 0_u64);
    // Without torque nothing has to move, and the grid keeps its ends.
    let moves = corrections.moves(joints) && log.joints.iter().any(|c| c.tau.is_some());
    for run in &runs {
        if run.rows.len() < MINIMUM_RUN && !every_row {
            short += 1;
            short_rows += run.rows.len() as u64;
            continue;
        }
        let stamps: Vec<f64> = run.rows.iter().map(|&row| log.time[row]).collect();
        let values: Vec<Channels> = (0..joints.len())
            .map(|joint| channels(joint, run))
            .collect();
        let even = if every_row {
            Some(clock.interval)
        } else {
            even_interval(&stamps)
        };
        let logged = moves.then(|| (stamps.clone(), values.clone()));
        let mut piece = match even {
            Some(interval) => Piece {
                time: stamps,
                interval,
                rows: run.rows.clone(),
                resampled: false,
                joints: values,
            },
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
                short += 1;
                short_rows += piece.rows.len() as u64;
                continue;
            }
        }
        pieces.push(piece);
    }
    report_jitter(log, &runs, clock.interval, resampled, findings);
    report_short(log, short, short_rows, findings);
    Ok(Prepared {
        pieces,
        interval: clock.interval,
    })
}

/// Says how many runs were too short to use.
pub(crate) fn report_short(log: &Recording, short: u64, rows: u64, findings: &mut Vec<Finding>) {
    if short > 0 {
        findings.push(Finding::new(
            Severity::Warning,
            "short_segments",
            &log.name,
            format!("{short} segments between cuts ({rows} rows) are shorter than the motion filter and were dropped"),
            rows,
        ));
    }
}

fn pick(channel: &Option<Vec<f64>>, run: &Run) -> Option<Vec<f64>> {
    channel
        .as_ref()
        .map(|values| run.rows.iter().map(|&row| values[row]).collect())
}

/// A run on the log's median step by cubic splines.
fn on_grid(stamps: &[f64], run: &Run, values: &[Channels], interval: f64) -> Piece {
    let span = stamps[stamps.len() - 1] - stamps[0];
    let steps = (span / interval * (1.0 + 1e-12)).floor() as usize;
    let grid: Vec<f64> = (0..=steps)
        .map(|i| stamps[0] + i as f64 * interval)
        .collect();
    let spline = |values: &Vec<f64>| resample(stamps, values, &grid);
    Piece {
        interval,
        rows: run.rows.clone(),
        resampled: true,
        joints: values
            .iter()
            .map(|c| Channels {
                q: spline(&c.q),
                qd: c.qd.as_ref().map(spline),
                qdd: c.qdd.as_ref().map(spline),
                tau: c.tau.as_ref().map(spline),
            })
            .collect(),
        time: grid,
    }
}

/// Unfolded positions, by joint, where there was something to unfold.
fn unfold(
    joints: &[JointFacts],
    log: &Recording,
    runs: &[Run],
    every_row: bool,
    findings: &mut Vec<Finding>,
) -> Vec<Option<Vec<f64>>> {
    let mut cuts = Vec::with_capacity(runs.len());
    let mut rows = 0;
    for run in runs {
        cuts.push(rows);
        rows += run.rows.len();
    }
    joints
        .iter()
        .enumerate()
        .map(|(joint, facts)| {
            if !matches!(facts.kind, JointKind::Revolute | JointKind::Continuous) {
                return None;
            }
            let mut q: Vec<f64> = runs
                .iter()
                .flat_map(|run| run.rows.iter().map(|&row| log.joints[joint].q[row]))
                .collect();
            let jumps = unwrap_angle(&mut q, &cuts);
            if jumps == 0 {
                return None;
            }
            let done = if every_row {
                "left as logged because the filter is off: unfold them if the library has springs"
            } else {
                "unfolded"
            };
            let severity = if every_row {
                Severity::Warning
            } else {
                Severity::Note
            };
            findings.push(Finding::new(
                severity,
                "wrapped_angle",
                &log.name,
                format!(
                    "joint `{}`: {jumps} jumps by a full turn, {done}",
                    facts.name
                ),
                jumps,
            ));
            if every_row {
                return None;
            }
            let mut all = log.joints[joint].q.clone();
            for (row, value) in runs.iter().flat_map(|run| run.rows.iter()).zip(q) {
                all[*row] = value;
            }
            Some(all)
        })
        .collect()
}
