//! The held-out traces as the script draws them: thinned by rows of the extremes, with breaks at pauses.

use super::figures::torque::{longest_step, runs, scores};
use super::text::clean;
use super::view::{Joint, rows};
use serde::Serialize;
use std::ops::Range;
use twincal::validate::Trace;

/// Rows over all traces: with the figures the page stays below two megabytes.
const ROWS: usize = 8_000;
/// Fewest and most rows of a trace.
const FEWEST: usize = 200;
const MOST: usize = 2_000;
/// Rows kept of a bucket: smallest and largest measured torque, smallest and largest residual.
const KEPT: usize = 4;
/// Significant digits of a torque.
const DIGITS: usize = 5;

/// The data block.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Traces {
    /// Index of the trace that is shown first.
    pub(super) first: usize,
    pub(super) traces: Vec<Plotted>,
}

/// One trace. Arrays have one length; a row of `None` breaks the lines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Plotted {
    joint: String,
    log: String,
    unit: &'static str,
    /// Errors before and after, in one line.
    error: String,
    /// Rows before thinning.
    rows: usize,
    /// s.
    time: Vec<f64>,
    /// As it was logged; empty where nothing is filtered.
    logged: Vec<Option<f64>>,
    measured: Vec<Option<f64>>,
    nominal: Vec<Option<f64>>,
    calibrated: Vec<Option<f64>>,
    low: Vec<Option<f64>>,
    high: Vec<Option<f64>>,
    /// First and last time of each range in which the joint is at rest, s.
    rest: Vec<[f64; 2]>,
}

/// The traces of all joints, at most `most` of each, worst first; `hero` is the joint that is shown first. `None` without held-out rows.
pub(super) fn traces(joints: &[Joint<'_>], hero: &Joint<'_>, most: usize) -> Option<Traces> {
    let all: Vec<(&Joint<'_>, &Trace)> = joints
        .iter()
        .flat_map(|joint| {
            joint
                .traces
                .iter()
                .take(most)
                .map(move |trace| (joint, *trace))
        })
        .filter(|(_, trace)| rows(trace) > 1)
        .collect();
    let budget = (ROWS / all.len().max(1)).clamp(FEWEST, MOST);
    let first = all.iter().position(|(joint, _)| joint.name == hero.name)?;
    let traces = all
        .iter()
        .map(|(joint, trace)| plotted(joint, trace, budget));
    Some(Traces {
        first,
        traces: traces.collect(),
    })
}

fn plotted(joint: &Joint<'_>, trace: &Trace, budget: usize) -> Plotted {
    let kept = kept(trace, budget);
    let breaks = breaks(trace, &kept);
    let values = |of: &dyn Fn(usize) -> Option<f64>| -> Vec<Option<f64>> {
        let mut out = Vec::with_capacity(kept.len());
        for &row in &kept {
            if breaks.contains(&row) {
                out.push(None);
            }
            let value = of(row).filter(|value| value.is_finite());
            out.push(value.map(|value| rounded(value, DIGITS)));
        }
        out
    };
    let column = |all: &[f64]| values(&|row| all.get(row).copied());
    let mut time = Vec::with_capacity(kept.len());
    for &row in &kept {
        // The break stands just before the row behind the pause.
        if breaks.contains(&row) {
            time.push(rounded_time(trace.time[row]) - 1e-5);
        }
        time.push(rounded_time(trace.time[row]));
    }
    Plotted {
        joint: clean(joint.name),
        log: clean(&trace.log),
        unit: joint.units.torque,
        error: clean(&scores(joint, trace)),
        rows: rows(trace),
        time,
        logged: match trace.logged.is_empty() {
            true => Vec::new(),
            false => values(&|row| trace.logged.get(row).copied().flatten()),
        },
        measured: column(&trace.measured),
        nominal: column(&trace.nominal),
        calibrated: column(&trace.calibrated),
        low: column(&trace.low),
        high: column(&trace.high),
        rest: runs(&trace.standstill, &(0..rows(trace)))
            .into_iter()
            .map(|run| [run.start, run.end - 1].map(|row| rounded_time(trace.time[row])))
            .collect(),
    }
}

/// Rows that are drawn, in order: all, or those of the extremes of each bucket, so that hover values are values of the trace.
fn kept(trace: &Trace, budget: usize) -> Vec<usize> {
    let all = rows(trace);
    if all <= budget {
        return (0..all).collect();
    }
    let size = all.div_ceil(budget / KEPT);
    let mut out = Vec::with_capacity(budget + 2);
    for start in (0..all).step_by(size) {
        let bucket = start..(start + size).min(all);
        let mut rows: Vec<usize> = extremes(bucket.clone(), |row| trace.measured[row]).to_vec();
        rows.extend(extremes(bucket, |row| {
            trace.measured[row] - trace.calibrated[row]
        }));
        out.extend(rows);
    }
    out.extend([0, all - 1]);
    out.sort_unstable();
    out.dedup();
    out
}

/// Rows of the smallest and of the largest value; values that are not finite are passed over where there are others.
fn extremes(bucket: Range<usize>, value: impl Fn(usize) -> f64) -> [usize; 2] {
    let mut out = [bucket.start; 2];
    for row in bucket {
        let x = value(row);
        if x < value(out[0]) || !value(out[0]).is_finite() {
            out[0] = row;
        }
        if x > value(out[1]) || !value(out[1]).is_finite() {
            out[1] = row;
        }
    }
    out
}

/// Kept rows behind a pause of the trace that is longer than five usual steps.
fn breaks(trace: &Trace, kept: &[usize]) -> Vec<usize> {
    let time = &trace.time[..rows(trace)];
    let limit = longest_step(time);
    let behind = |row: &usize| *row > 0 && time[*row] - time[*row - 1] > limit;
    let pauses: Vec<usize> = (0..time.len()).filter(behind).collect();
    kept.windows(2)
        .filter(|pair| {
            pauses
                .iter()
                .any(|pause| (pair[0] + 1..=pair[1]).contains(pause))
        })
        .map(|pair| pair[1])
        .collect()
}

/// `value` with so many significant digits.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

/// A time to 0.1 ms.
fn rounded_time(time: f64) -> f64 {
    (time * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, view};

    /// 10 000 rows at 100 Hz with one peak of torque, one of the residual, and a pause of ten seconds.
    fn long() -> Trace {
        let n = 10_000;
        let time = (0..n).map(|row| row as f64 / 100.0 + if row < 5_000 { 0.0 } else { 10.0 });
        let mut measured: Vec<f64> = (0..n).map(|row| (row as f64 * 0.01).sin()).collect();
        let mut calibrated = measured.clone();
        (measured[1_234], calibrated[1_234]) = (9.0, 9.0);
        calibrated[8_765] = -5.0;
        Trace {
            time: time.collect(),
            nominal: vec![0.0; n],
            low: calibrated.iter().map(|x| x - 0.1).collect(),
            high: calibrated.iter().map(|x| x + 0.1).collect(),
            standstill: vec![false; n],
            measured,
            calibrated,
            ..Trace::default()
        }
    }

    #[test]
    fn thinning_keeps_the_extremes_the_ends_and_the_order() {
        let trace = long();
        let kept = kept(&trace, 600);
        assert!(kept.len() <= 602 && kept.is_sorted());
        for row in [0, 1_234, 8_765, 9_999] {
            assert!(kept.contains(&row), "{row}");
        }
        assert_eq!(super::kept(&trace, 10_000).len(), 10_000);
    }

    #[test]
    fn a_pause_is_one_row_without_values() {
        let calibration = fixture::two_joints();
        let joints = view::joints(&calibration);
        let plotted = plotted(&joints[0], &long(), 600);
        let empty: Vec<usize> = (0..plotted.time.len())
            .filter(|row| plotted.measured[*row].is_none())
            .collect();
        assert_eq!(empty.len(), 1);
        assert!(plotted.time.is_sorted() && plotted.time[empty[0]] > 59.9);
        assert_eq!(plotted.time.len(), plotted.high.len());
    }

    #[test]
    fn torque_as_it_was_logged_lies_behind_the_filtered_one() {
        let calibration = fixture::two_joints();
        let joints = view::joints(&calibration);
        let mut trace = long();
        assert!(plotted(&joints[0], &trace, 600).logged.is_empty());
        let logged = trace.measured.iter().map(|tau| Some(tau + 0.5));
        trace.logged = logged.collect();
        trace.logged[0] = None;
        let plotted = plotted(&joints[0], &trace, 600);
        assert_eq!(plotted.logged.len(), plotted.measured.len());
        assert_eq!(plotted.logged[0], None);
        let both = plotted.logged.iter().zip(&plotted.measured);
        let mut apart =
            both.filter_map(|(logged, measured)| Some(logged.as_ref()? - measured.as_ref()?));
        assert!(apart.all(|apart| (apart - 0.5).abs() < 1e-2));
    }

    #[test]
    fn values_that_are_not_numbers_are_no_extremes() {
        let values = [f64::NAN, 2.0, f64::NAN, 1.0];
        assert_eq!(extremes(0..4, |row| values[row]), [3, 1]);
        assert_eq!(extremes(0..1, |row| values[row]), [0, 0]);
    }

    #[test]
    fn names_are_clean_and_the_size_is_bounded() {
        let calibration = fixture::many_logs();
        let joints = view::joints(&calibration);
        let traces = traces(&joints, &joints[1], 8).expect("there are held-out rows");
        assert_eq!((traces.traces.len(), traces.first), (16, 8));
        let text = crate::report::script::json(&traces).expect("numbers and names are JSON");
        assert!(text.len() < 500_000, "{}", text.len());
    }
}
