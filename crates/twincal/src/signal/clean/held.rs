//! Torque that holds its value while its joint moves: a stale value, or a drive that publishes it a few times a second.

use crate::error::Code;
use crate::error::{Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::log::long::Logs;
use crate::signal::log::recording::{Channels, Recording};

/// Difference of two values, as a share of their range, up to which they are the same: scaling rounds.
const ROUNDING: f64 = 1e-9;
/// Shortest time for which a value is held, s: half of a drive's 200 ms.
const HELD: f64 = 0.1;
/// Fewest samples in a row with the same number.
const IN_A_ROW: usize = 5;
/// Jump at the end of a held value in steps of the column: less is resolution.
const JUMP: f64 = 8.0;
/// Change of a joint's velocity while a value is held, as a share of its largest: inertia then needs another torque.
const FASTER: f64 = 0.05;
/// Share of a joint's time in motion from which held values spoil a fit.
const SPOILS: f64 = 0.02;
/// Chapters of a long log that are looked at.
const CHAPTERS: usize = 4;

/// Torque that holds its value for a tenth of a second or more while its joint changes its speed, then jumps.
///
/// | finding | what was seen |
/// |---|---|
/// | `torque_held` | values are held for 2 % of the joint's time in motion or more (degraded) |
/// | `stale_torque` | values are held for less than that (note) |
///
/// # Errors
/// Of chapters that cannot be read.
pub(super) fn held_torque(robot: &Robot, logs: &Logs<'_>) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    for log in &logs.0 {
        let mut held = vec![Held::default(); robot.dof()];
        let mut chapters = 0;
        log.until(|recording| {
            for (held, channels) in held.iter_mut().zip(&recording.joints) {
                held.see(recording, channels);
            }
            chapters += 1;
            chapters >= CHAPTERS
        })?;
        let names = robot.joint_names().into_iter().zip(&held);
        let seen = names.filter(|(_, held)| held.count > 0);
        findings.extend(seen.map(|(name, held)| held.finding(log.name(), name)));
    }
    Ok(findings)
}

/// What a joint's torque held in one log.
#[derive(Debug, Clone, Copy, Default)]
struct Held {
    /// Stretches, their time and the longest of them, s.
    count: u64,
    time: f64,
    longest: f64,
    /// When the first begins, s.
    first: f64,
    /// Time in motion, s.
    moving: f64,
}

impl Held {
    fn see(&mut self, recording: &Recording, channels: &Channels) {
        let Some(tau) = &channels.tau else { return };
        let (time, q) = (&recording.time[..], &channels.q[..]);
        let len = time.len().min(q.len()).min(tau.len());
        let runs = runs(&tau[..len]);
        let long = |run: &&std::ops::Range<usize>| {
            run.len() >= IN_A_ROW && run.end < len && time[run.end] - time[run.start] >= HELD
        };
        // At the ends of its range torque is saturated, which is told elsewhere.
        let ends = tau[..len].iter().filter(|tau| tau.is_finite());
        let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], tau| {
            [low.min(*tau), high.max(*tau)]
        });
        let mut step = None;
        let mut largest = None;
        let inside = |run: &&std::ops::Range<usize>| tau[run.start] > low && tau[run.start] < high;
        for run in runs.iter().filter(long).filter(inside) {
            let fastest = *largest.get_or_insert_with(|| fastest(time, &q[..len]));
            let middle = usize::midpoint(run.start, run.end - 1);
            let speed = |a: usize, b: usize| (q[b] - q[a]) / (time[b] - time[a]);
            let change = speed(middle, run.end - 1) - speed(run.start, middle);
            if change.is_nan() || change.abs() <= FASTER * fastest {
                continue;
            }
            let step = *step.get_or_insert_with(|| smallest_step(&tau[..len]));
            if (tau[run.end] - tau[run.start]).abs() < JUMP * step {
                continue;
            }
            let lasts = time[run.end] - time[run.start];
            if self.count == 0 {
                self.first = time[run.start];
            }
            self.count += 1;
            self.time += lasts;
            self.longest = self.longest.max(lasts);
        }
        if let Some(fastest) = largest {
            let steps = (1..len).filter(|&i| {
                ((q[i] - q[i - 1]) / (time[i] - time[i - 1])).abs() > FASTER * fastest
            });
            self.moving += steps.map(|i| time[i] - time[i - 1]).sum::<f64>();
        }
    }

    fn finding(&self, log: &str, joint: &str) -> Finding {
        let spoils = self.time >= SPOILS * self.moving;
        let (severity, code, remedy) = match spoils {
            true => (
                Severity::Degraded,
                Code::TorqueHeld,
                "log its torque in every row, or leave this log out",
            ),
            false => (Severity::Note, Code::StaleTorque, "nothing has to be done"),
        };
        Finding::new(
            severity,
            code,
            joint,
            format!(
                "log `{log}`: the torque of joint `{joint}` holds its value while the joint changes its speed: {} times, {:.0} ms at the longest, \
                 {:.2} s in all, the first at t = {:.2} s: {remedy}",
                self.count,
                1e3 * self.longest,
                self.time,
                self.first
            ),
            self.count,
        )
        .with([("longest", self.longest), ("seconds", self.time), ("first_at", self.first)])
    }
}

/// Stretches of the same number.
fn runs(values: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut runs = Vec::new();
    let mut start = 0;
    for i in 1..=values.len() {
        if i == values.len() || values[i] != values[start] {
            if i - start >= IN_A_ROW {
                runs.push(start..i);
            }
            start = i;
        }
    }
    runs
}

/// Speed that a joint exceeds in a hundredth of its samples, rad/s or m/s.
fn fastest(time: &[f64], q: &[f64]) -> f64 {
    let speeds = (IN_A_ROW..q.len())
        .map(|i| ((q[i] - q[i - IN_A_ROW]) / (time[i] - time[i - IN_A_ROW])).abs());
    let mut speeds: Vec<f64> = speeds.filter(|v| v.is_finite()).collect();
    if speeds.is_empty() {
        return f64::INFINITY;
    }
    let at = speeds.len() - 1 - speeds.len() / 100;
    *speeds.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Smallest difference between two values of a column: its resolution.
fn smallest_step(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let range = sorted
        .last()
        .zip(sorted.first())
        .map_or(0.0, |(high, low)| high - low);
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    steps
        .filter(|step| *step > ROUNDING * range)
        .fold(f64::INFINITY, f64::min)
}
