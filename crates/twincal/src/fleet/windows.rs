//! Windows of time that the logs of a fleet are in.

use super::logs::KeptLog;

/// 5 January 1970 was a Monday: windows of a week begin on Mondays, s.
const MONDAY: f64 = 4.0 * 86_400.0;

/// One window of a fleet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowSpan {
    /// Windows since the first Monday of 1970; `None` for logs without a date.
    pub number: Option<i64>,
    /// Start since 1970, s; `None` for logs without a date.
    pub since: Option<f64>,
}

/// The logs of one unit, by window.
#[derive(Debug)]
pub(super) struct FleetUnit {
    pub(super) name: String,
    pub(super) logs: Vec<KeptLog>,
}

/// Windows that hold a log of the fleet, in time; logs without a date are in one of their own before all others.
pub(super) fn spans(units: &[FleetUnit], window: f64) -> Vec<WindowSpan> {
    let logs = units.iter().flat_map(|unit| &unit.logs);
    let mut numbers: Vec<Option<i64>> = logs.map(|log| number(log, window)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let span = |number: Option<i64>| WindowSpan {
        number,
        since: number.map(|n| n as f64 * window + MONDAY),
    };
    numbers.into_iter().map(span).collect()
}

/// Number of the window that a log is in; `None` for one without a date.
pub(super) fn number(log: &KeptLog, window: f64) -> Option<i64> {
    let start = log.since_1970()?;
    Some(((start - MONDAY) / window).floor() as i64)
}
