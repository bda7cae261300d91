//! Samples that no joint can have: one that leaves its neighbours and comes back, and a step between two of them.
//!
//! One wrong sample in a hundred thousand raises the noise that an encoder seems to have so far that slow motion passes
//! for standstill, and rings through every filter.

use super::clock::{Clock, Run};
use super::travel::{count, median};
use crate::error::Code;
use crate::error::{Finding, Severity};
use crate::robot::JointKind;
use crate::signal::log::joints::JointFacts;
use crate::signal::log::recording::Recording;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// How many times the usual change of slope a jump has.
const USUAL: f64 = 50.0;
/// How many steps of its own a channel jumps by at least: fewer are quantisation.
const COUNTS: f64 = 8.0;
/// Share of a step of position that the logged velocity may explain.
const EXPLAINED: f64 = 0.5;
/// Slopes beside a jump are below this share of it.
const QUIET: f64 = 0.2;
/// The ways out and back of a spike differ by less than this share of it.
const BACK: f64 = 0.4;
/// A step this near to a full turn, relative, is that of a folded angle.
const FOLDED: f64 = 0.05;
/// Slopes that the usual change is taken from, about.
const SAMPLED: usize = 4096;

/// Jumps of one channel of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Jumps {
    /// Samples that leave their neighbours, and by how much.
    pub(crate) spikes: Vec<(usize, f64)>,
    /// Samples that lie a step above the sample before, with all after them, and its size.
    pub(crate) steps: Vec<(usize, f64)>,
}

/// Finds the jumps of evenly meant samples; `interval` is the usual step of `time`.
///
/// Slopes are per interval: a row that is missing is no jump, and stamps that crowd make none.
pub(crate) fn jumps(time: &[f64], values: &[f64], interval: f64) -> Jumps {
    let mut found = Jumps::default();
    if values.len() < 8 {
        return found;
    }
    // From sample i − 1 to i.
    let slope = |i: usize| {
        let step = time[i] - time[i - 1];
        (values[i] - values[i - 1]) * (interval / step).min(1.0)
    };
    let usual = usual_change(values.len(), slope);
    if usual == 0.0 {
        return found;
    }
    let limit = (USUAL * usual).max(COUNTS * count(values));
    let last = values.len() - 2;
    let mut i = 2;
    while i < last {
        let (here, next) = (slope(i), slope(i + 1));
        if here.abs() <= limit {
            i += 1;
            continue;
        }
        let quiet = |i: usize| slope(i).abs() < QUIET * here.abs();
        if (here + next).abs() < BACK * here.abs() && quiet(i - 1) && quiet(i + 2) {
            found.spikes.push((i, 0.5 * (here - next)));
            i += 2;
            continue;
        }
        if quiet(i - 1) && quiet(i + 1) {
            found.steps.push((i, here));
        }
        i += 1;
    }
    found
}

/// Whether the velocity about sample `i` explains that position changes by `size` there. The median of four samples: a drive that differences
/// its encoder logs a spike beside the step.
fn explains(time: &[f64], velocity: &[f64], (i, size): (usize, f64)) -> bool {
    let usual = median(velocity[i - 2..(i + 2).min(velocity.len())].to_vec());
    (size - usual * (time[i] - time[i - 1])).abs() <= EXPLAINED * size.abs()
}

/// Median of what the slope changes by from one sample to the next, of those that are not zero.
fn usual_change(len: usize, slope: impl Fn(usize) -> f64) -> f64 {
    let stride = len.div_ceil(SAMPLED);
    let mut changes: Vec<f64> = (1..len - 1)
        .step_by(stride)
        .map(|i| (slope(i + 1) - slope(i)).abs())
        .filter(|change| *change > 0.0)
        .collect();
    let middle = changes.len() / 2;
    if changes.is_empty() {
        return 0.0;
    }
    *changes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Jumps of one channel of a log, by row of the recording.
struct Found {
    joint: usize,
    channel: &'static str,
    /// After "rad" or "m".
    per: &'static str,
    jumps: Jumps,
}

/// The runs of a log without the samples that no joint can have, cut there and at steps of position. With `every_row`
/// (pipeline off) the runs stay and the jumps are only told. `unfolded` are positions that replace the logged ones.
pub(crate) fn cut_jumps(
    joints: &[JointFacts],
    log: &Recording,
    unfolded: &[Option<Vec<f64>>],
    clock: &Clock,
    every_row: bool,
    findings: &mut Vec<Finding>,
) -> Vec<Run> {
    let of_log = LogMotion {
        joints,
        log,
        clock,
        every_row,
    };
    let times: Vec<Vec<f64>> = clock
        .runs
        .iter()
        .map(|run| run.rows.iter().map(|&row| clock.stamp(log, row)).collect())
        .collect();
    let all: Vec<Found> = of_log
        .channels(unfolded)
        .into_par_iter()
        .map(|channel| of_log.found(&times, channel))
        .collect();
    all.iter()
        .for_each(|found| findings.extend(tell(joints, log, found, every_row)));
    if every_row {
        return clock.runs.clone();
    }
    let rows = |pick: fn(&Jumps) -> &[(usize, f64)]| -> BTreeSet<usize> {
        let picked = all.iter().flat_map(|found| pick(&found.jumps));
        picked.map(|(row, _)| *row).collect()
    };
    let (spikes, steps) = (rows(|jumps| &jumps.spikes), rows(|jumps| &jumps.steps));
    let mut runs = Vec::with_capacity(clock.runs.len());
    for run in &clock.runs {
        let mut rest = Run::default();
        for &row in &run.rows {
            let spike = spikes.contains(&row);
            if (spike || steps.contains(&row)) && !rest.rows.is_empty() {
                runs.push(std::mem::take(&mut rest));
            }
            if !spike {
                rest.rows.push(row);
            }
        }
        runs.push(rest);
    }
    runs.retain(|run| !run.rows.is_empty());
    runs
}

/// One channel of a joint's motion.
struct Channel<'a> {
    joint: usize,
    name: &'static str,
    /// After "rad" or "m".
    per: &'static str,
    /// Row by row of the recording.
    values: &'a [f64],
}

/// The motion in a log whose clock is read.
struct LogMotion<'a> {
    joints: &'a [JointFacts],
    log: &'a Recording,
    clock: &'a Clock,
    every_row: bool,
}

impl LogMotion<'_> {
    /// The channels of motion that the log has, joint by joint.
    fn channels<'a>(&'a self, unfolded: &'a [Option<Vec<f64>>]) -> Vec<Channel<'a>> {
        (0..self.joints.len())
            .flat_map(|joint| {
                let position = self.clock.sampled.position(self.log, joint);
                let [qd, qdd] = self.clock.sampled.derivatives(self.log, joint);
                let position = unfolded[joint].as_deref().or(Some(position));
                [
                    ("position", "", position),
                    ("velocity", "/s", qd),
                    ("acceleration", "/s²", qdd),
                ]
                .into_iter()
                .filter_map(move |(name, per, values)| {
                    let values = values?;
                    Some(Channel {
                        joint,
                        name,
                        per,
                        values,
                    })
                })
            })
            .collect()
    }

    /// The jumps of one channel; `times` are the stamps of the clock's runs.
    fn found(&self, times: &[Vec<f64>], channel: Channel<'_>) -> Found {
        let (joint, every_row) = (channel.joint, self.every_row);
        let mut in_log = Jumps::default();
        for (run, time) in self.clock.runs.iter().zip(times) {
            let own: Vec<f64> = run.rows.iter().map(|&row| channel.values[row]).collect();
            let mut in_run = jumps(time, &own, self.clock.interval);
            if let (false, [Some(logged), _]) =
                (every_row, self.clock.sampled.derivatives(self.log, joint))
            {
                let velocity: Vec<f64> = run.rows.iter().map(|&row| logged[row]).collect();
                in_run
                    .steps
                    .retain(|step| !explains(time, &velocity, *step));
            }
            let row = |(i, size): (usize, f64)| (run.rows[i], size);
            in_log.spikes.extend(in_run.spikes.into_iter().map(row));
            // Velocity steps where something is hit; a folded angle by a full turn, which is told elsewhere.
            let turns = self.joints[joint].kind != JointKind::Prismatic;
            let folded = |size: f64| turns && (size.abs() / TAU - 1.0).abs() < FOLDED;
            let of_position = in_run
                .steps
                .into_iter()
                .filter(|(_, size)| channel.name == "position" && !(every_row && folded(*size)));
            in_log.steps.extend(of_position.map(row));
        }
        Found {
            joint,
            channel: channel.name,
            per: channel.per,
            jumps: in_log,
        }
    }
}

/// A warning for the spikes and one for the steps of a channel.
fn tell(joints: &[JointFacts], log: &Recording, found: &Found, every_row: bool) -> Vec<Finding> {
    let facts = &joints[found.joint];
    let unit = match facts.kind {
        JointKind::Prismatic => "m",
        _ => "rad",
    };
    let Found {
        channel,
        per,
        jumps,
        ..
    } = found;
    let kinds = [
        (
            Code::MotionSpike,
            &jumps.spikes,
            "leaves its neighbours for one sample",
            "the samples were left out and the log is cut there",
        ),
        (
            Code::PositionStep,
            &jumps.steps,
            "steps from one sample to the next",
            "the log is cut there; look whether the encoder was reset, then one side has a wrong zero",
        ),
    ];
    let of_kind = |(code, jumps, what, done): (Code, &Vec<(usize, f64)>, &str, &str)| {
        let largest = jumps
            .iter()
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let times = match jumps.len() {
            1 => "once".to_owned(),
            count => format!("{count} times"),
        };
        let done = if every_row {
            "left as logged because the filter is off"
        } else {
            done
        };
        let size = match largest.1 {
            small if small.abs() < 1e-2 => format!("{small:+.2e}"),
            size => format!("{size:+.3}"),
        };
        let message = format!(
            "joint `{}`: {channel} {what}, {times}, most by {size} {unit}{per} at {:.3} s, as no joint moves; {done}",
            facts.name, log.time[largest.0]
        );
        let count = jumps.len() as u64;
        let finding = Finding::new(Severity::Warning, code, &log.name, message, count);
        let finding = finding.of_joint(&facts.name);
        Some(finding.with([("largest", largest.1), ("largest_at", log.time[largest.0])]))
    };
    kinds.into_iter().filter_map(of_kind).collect()
}

#[cfg(test)]
mod grid_tests;
#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 0.01;

    fn time(len: usize) -> Vec<f64> {
        (0..len).map(|i| i as f64 * INTERVAL).collect()
    }

    /// Motion, rests between moves, an encoder's steps.
    fn moves(encoder: f64) -> Vec<f64> {
        let position = |t: f64| {
            let phase = t.rem_euclid(4.0);
            let way = if phase < 1.0 {
                phase - (std::f64::consts::TAU * phase).sin() / std::f64::consts::TAU
            } else if phase < 2.0 {
                1.0
            } else if phase < 2.5 {
                1.0 - (2.0 * (phase - 2.0)).powi(2) * (3.0 - 4.0 * (phase - 2.0))
            } else {
                0.0
            };
            1.5 * way
        };
        (0..2000)
            .map(|i| (position(i as f64 * INTERVAL) / encoder).round() * encoder)
            .collect()
    }

    #[test]
    fn a_spike_and_a_step_are_found_where_they_are() {
        for encoder in [1e-9, 1e-5, 1e-3] {
            let mut values = moves(encoder);
            values[700] += 0.5;
            values[1201] -= 6.3;
            values[1500..].iter_mut().for_each(|v| *v += 1.0);
            let found = jumps(&time(2000), &values, INTERVAL);
            let places = |found: &[(usize, f64)]| -> Vec<usize> {
                found.iter().map(|(place, _)| *place).collect()
            };
            assert_eq!(places(&found.spikes), [700, 1201], "{encoder}");
            assert!((found.spikes[0].1 - 0.5).abs() < 0.03);
            assert!((found.spikes[1].1 + 6.3).abs() < 0.03);
            assert_eq!(places(&found.steps), [1500], "{encoder}");
            assert!((found.steps[0].1 - 1.0).abs() < 0.03);
        }
    }

    #[test]
    fn moves_rests_encoder_steps_and_slow_channels_are_no_jumps() {
        for encoder in [1e-9, 1e-6, 1e-4, 1e-2] {
            let values = moves(encoder);
            assert_eq!(jumps(&time(2000), &values, INTERVAL), Jumps::default());
            // A channel that changes every fourth row only.
            let slow: Vec<f64> = (0..2000).map(|i| values[i / 4 * 4]).collect();
            assert_eq!(jumps(&time(2000), &slow, INTERVAL), Jumps::default());
        }
    }

    #[test]
    fn missing_rows_and_crowded_stamps_are_no_jumps() {
        let (mut time, mut values) = (time(2000), moves(1e-9));
        // Late stamps: the next one follows at once.
        for i in (50..1950).step_by(37) {
            time[i] += 0.85 * INTERVAL;
        }
        for i in (100..1900).step_by(301).rev() {
            time.drain(i..i + 3);
            values.drain(i..i + 3);
        }
        assert_eq!(jumps(&time, &values, INTERVAL), Jumps::default());
    }

    #[test]
    fn nothing_is_found_in_a_constant_or_a_short_run() {
        assert_eq!(jumps(&time(100), &[0.3; 100], INTERVAL), Jumps::default());
        assert_eq!(
            jumps(&time(5), &[0.0, 0.0, 9.0, 0.0, 0.0], INTERVAL),
            Jumps::default()
        );
    }
}
