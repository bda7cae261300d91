//! Rows that repeat the row before while a joint moves: dropped or interpolated, on the controller's clock where the stamps are a receiver's.
//!
//! A position that does not change is a repeat, and no rest, where the joint travels by more than its encoder can hide
//! (`travel.rs`), for three rows at most, and where the next row makes up for it. Longer runs are an encoder that is stuck or a slow
//! channel, and are left alone.

use super::ticks::{Ticks, ticks};
use super::travel::{Rows, Travel};
use crate::error::{Code, Finding, Severity};
use crate::signal::log::recording::{Channels, Recording};
use crate::words::significant;
use std::ops::Range;

/// Share of a joint's rows in motion beyond which it is a slow channel.
const MOST: f64 = 0.25;
/// What the row after a repeat makes up for may be off by so many steps: a fresh reading is off by one.
const OFF: f64 = 0.5;
/// Steps beside both of them are at least this share of the usual one.
const BESIDE: f64 = 0.3;

/// Rows that may go on.
pub(crate) struct Cut<'a> {
    /// Ascending indices into the recording.
    pub(crate) kept: &'a [usize],
    /// Whether rows were dropped right before each of them.
    pub(crate) before: &'a [bool],
    /// Median step, s.
    pub(crate) interval: f64,
    /// The pipeline is off.
    pub(crate) every_row: bool,
}

/// What stands in place of the rows as logged.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Sampled {
    /// Stamps on the controller's clock, s, by row of the recording; `None`: as logged.
    pub(crate) time: Option<Vec<f64>>,
    /// The controller's step, s.
    pub(crate) interval: Option<f64>,
    /// Rows that are left out; empty or one for each of the recording.
    pub(crate) dropped: Vec<bool>,
    /// Motion of a joint in which single values were interpolated.
    pub(crate) filled: Vec<Option<Filled>>,
}

/// Channels of a joint with interpolated values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Filled {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Option<Vec<f64>>,
    pub(crate) qdd: Option<Vec<f64>>,
}

impl Sampled {
    /// Positions of a joint as they are used.
    pub(crate) fn position<'a>(&'a self, log: &'a Recording, joint: usize) -> &'a [f64] {
        match self.filled.get(joint).and_then(Option::as_ref) {
            Some(filled) => &filled.q,
            None => &log.joints[joint].q,
        }
    }

    /// Velocities and accelerations of a joint as they are used, where they are logged.
    pub(crate) fn derivatives<'a>(
        &'a self,
        log: &'a Recording,
        joint: usize,
    ) -> [Option<&'a [f64]>; 2] {
        let own = &log.joints[joint];
        match self.filled.get(joint).and_then(Option::as_ref) {
            Some(filled) => [filled.qd.as_deref(), filled.qdd.as_deref()],
            None => [own.qd.as_deref(), own.qdd.as_deref()],
        }
    }
}

/// Looks for repeated rows and for the controller's clock.
pub(crate) fn sampled(
    log: &Recording,
    names: &[String],
    cut: &Cut<'_>,
    findings: &mut Vec<Finding>,
) -> Sampled {
    let Some(rows) = Rows::of(log, cut.kept, cut.before, cut.interval) else {
        return Sampled::default();
    };
    if let Some(ticks) = ticks(&rows) {
        findings.push(on_controllers_clock(&rows, &ticks, cut.every_row));
        return if cut.every_row {
            Sampled::default()
        } else {
            retimed(&rows, ticks)
        };
    }
    let held: Vec<Vec<Range<usize>>> = rows.joints.iter().map(|joint| held(&rows, joint)).collect();
    if held.iter().all(Vec::is_empty) {
        return Sampled::default();
    }
    let (repaired, dropped) = repaired(&rows, &held);
    findings.push(held_positions(
        &rows,
        names,
        &held,
        (dropped, cut.every_row),
    ));
    if cut.every_row {
        Sampled::default()
    } else {
        repaired
    }
}

fn retimed(rows: &Rows<'_>, ticks: Ticks) -> Sampled {
    let mut time = rows.log.time.clone();
    for (&row, stamp) in rows.rows.iter().zip(&ticks.time) {
        time[row] = *stamp;
    }
    // A row that was written twice stays with the first of its kind.
    for (pair, stamp) in rows.rows.windows(2).zip(&ticks.time) {
        time[pair[0] + 1..pair[1]].fill(*stamp);
    }
    let mut dropped = vec![false; time.len()];
    for k in ticks.repeats {
        dropped[rows.rows[k]] = true;
    }
    Sampled {
        time: Some(time),
        interval: Some(ticks.interval),
        dropped,
        filled: Vec::new(),
    }
}

/// Runs of rows in which a joint's position repeats while it moves, and the row after makes up for it; none of a slow channel.
fn held(rows: &Rows<'_>, joint: &Travel) -> Vec<Range<usize>> {
    let makes_up = |run: &Range<usize>| {
        let next = run.end;
        let joined = |k: usize| k > 0 && k < rows.len() && rows.joined[k];
        let share = |k: usize| joint.step[k] / joint.usual[k];
        // A reset seems fast, too, but not beside itself.
        let before = run.start - 1;
        let fast = |k: usize| joined(k) && share(k) >= BESIDE;
        let beside =
            fast(before) && (fast(next + 1) || joined(next + 1) && joint.step[next + 1] == 0.0);
        beside && joined(next) && joint.moves(next) && {
            let steps = (rows.stamp(next) - rows.stamp(before)) / rows.interval;
            (share(next) - steps).abs() <= OFF
        }
    };
    let found: Vec<Range<usize>> = rows.held(joint).into_iter().filter(makes_up).collect();
    let moving = (0..rows.len()).filter(|&k| joint.moves(k)).count();
    let count: usize = found.iter().map(Range::len).sum();
    if count as f64 > MOST * moving as f64 {
        return Vec::new();
    }
    found
}

/// Rows whose channels all repeat are dropped; elsewhere the motion that repeats is interpolated. Also how many were dropped.
fn repaired(rows: &Rows<'_>, held: &[Vec<Range<usize>>]) -> (Sampled, usize) {
    let mut dropped = vec![false; rows.log.time.len()];
    let mut count = 0;
    let mut filled = Vec::with_capacity(held.len());
    for (joint, (runs, channels)) in held.iter().zip(&rows.log.joints).enumerate() {
        let mut own: Option<Filled> = None;
        for run in runs {
            for k in run.clone() {
                let row = rows.rows[k];
                if rows.repeats(k) {
                    count += usize::from(!dropped[row]);
                    dropped[row] = true;
                } else {
                    let own = own.get_or_insert_with(|| Filled::of(channels));
                    own.fill(rows, joint, run, k);
                }
            }
        }
        filled.push(own);
    }
    let repaired = Sampled {
        time: None,
        interval: None,
        dropped,
        filled,
    };
    (repaired, count)
}

impl Filled {
    fn of(channels: &Channels) -> Self {
        Self {
            q: channels.q.clone(),
            qd: channels.qd.clone(),
            qdd: channels.qdd.clone(),
        }
    }

    /// Row `k` of a run that repeats, by a cubic through two rows on either side of the run (a line where there are none).
    fn fill(&mut self, rows: &Rows<'_>, joint: usize, run: &Range<usize>, k: usize) {
        let (travel, channels) = (&rows.joints[joint], &rows.log.joints[joint]);
        let (before, after) = (run.start - 1, run.end);
        let mut nodes = vec![before, after];
        // Not through a row that repeats itself.
        let fresh = |k: usize| k < rows.len() && rows.joined[k] && travel.step[k] != 0.0;
        if before > 0 && fresh(before) && fresh(before - 1) && fresh(after + 1) {
            nodes.extend([before - 1, after + 1]);
        }
        let (row, last) = (rows.rows[k], rows.rows[k - 1]);
        let fill = |values: &mut Vec<f64>, logged: &[f64]| {
            if logged[row] == logged[last] {
                values[row] = interpolated(rows, &nodes, logged, k);
            }
        };
        fill(&mut self.q, &channels.q);
        for (values, logged) in [(&mut self.qd, &channels.qd), (&mut self.qdd, &channels.qdd)] {
            if let (Some(values), Some(logged)) = (values, logged) {
                fill(values, logged);
            }
        }
    }
}

/// The polynomial through some rows, at row `k` (Lagrange).
fn interpolated(rows: &Rows<'_>, nodes: &[usize], values: &[f64], k: usize) -> f64 {
    let t = rows.stamp(k);
    let weight = |a: usize| -> f64 {
        let others = nodes.iter().filter(|&&b| b != a);
        others
            .map(|&b| (t - rows.stamp(b)) / (rows.stamp(a) - rows.stamp(b)))
            .product()
    };
    nodes
        .iter()
        .map(|&a| weight(a) * values[rows.rows[a]])
        .sum()
}

fn on_controllers_clock(rows: &Rows<'_>, ticks: &Ticks, every_row: bool) -> Finding {
    let (all, count) = (rows.len(), ticks.shown);
    let step = significant(1e3 * ticks.interval, 4);
    let what = match count {
        0 => "no row repeats the row before".to_owned(),
        _ => format!(
            "{count} of {all} rows ({} %) repeat the row before",
            significant(100.0 * count as f64 / all as f64, 2)
        ),
    };
    let done = if every_row {
        "rows and stamps are left as logged because the filter is off"
    } else if count == 0 {
        "the rows are placed on that clock"
    } else {
        "the repeats are dropped and the rows placed on that clock"
    };
    let message = format!(
        "{what} and {} controller samples are missing; the stamps are a receiver's, off by {} % of a step (median), while positions advance by \
         whole steps of {step} ms; {done}; log the controller's own stamps",
        ticks.missing,
        significant(100.0 * ticks.jitter, 2)
    );
    let (severity, code) = match count {
        0 => (Severity::Note, Code::ControllerClock),
        _ => (Severity::Warning, Code::RepeatedSamples),
    };
    Finding::new(severity, code, &rows.log.name, message, count).with([
        ("rows", all as f64),
        ("share", count as f64 / all as f64),
        ("missing", ticks.missing as f64),
        ("jitter", ticks.jitter),
        ("interval", ticks.interval),
    ])
}

fn held_positions(
    rows: &Rows<'_>,
    names: &[String],
    held: &[Vec<Range<usize>>],
    (dropped, every_row): (usize, bool),
) -> Finding {
    let mut repeated = vec![false; rows.len()];
    let mut worst = (0, 0);
    for (joint, runs) in held.iter().enumerate() {
        runs.iter().for_each(|run| repeated[run.clone()].fill(true));
        let count: usize = runs.iter().map(Range::len).sum();
        if count > worst.1 {
            worst = (joint, count);
        }
    }
    let count = repeated.iter().filter(|repeated| **repeated).count();
    let first = repeated.iter().position(|repeated| *repeated).unwrap_or(0);
    let done = if every_row {
        "they are left as logged because the filter is off".to_owned()
    } else {
        match (dropped, count - dropped.min(count)) {
            (dropped, 0) => format!("all channels repeat in {dropped}, which are dropped"),
            (0, filled) => format!("the motion is interpolated in {filled}"),
            (dropped, filled) => format!(
                "all channels repeat in {dropped}, which are dropped; the motion is interpolated in the other {filled}"
            ),
        }
    };
    let message = format!(
        "{count} of {} rows ({} %) repeat a position of the row before while the joint moves, most on joint `{}` ({}), first at {:.3} s; {done}; \
         log each sample of the controller once",
        rows.len(),
        significant(100.0 * count as f64 / rows.len() as f64, 2),
        names[worst.0],
        worst.1,
        rows.stamp(first),
    );
    let finding = Finding::new(
        Severity::Warning,
        Code::RepeatedSamples,
        &rows.log.name,
        message,
        count as u64,
    )
    .with([
        ("rows", rows.len() as f64),
        ("share", count as f64 / rows.len() as f64),
        ("most_on_a_joint", worst.1 as f64),
        ("first_at", rows.stamp(first)),
    ]);
    match every_row {
        true => finding,
        false => finding.with([
            ("dropped", dropped as f64),
            ("interpolated", (count - dropped.min(count)) as f64),
        ]),
    }
}

#[cfg(test)]
mod tests;
