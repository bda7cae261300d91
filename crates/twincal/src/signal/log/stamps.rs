//! Time stamps of a log: where they begin, their usual step, and whether they are an even grid.

use super::recording::Recording;

/// A step longer than this many median intervals is a gap: the log is cut there.
pub(crate) const GAP: f64 = 5.0;
/// Largest distance from an even grid, in intervals, that still counts as even.
pub(crate) const EVEN: f64 = 1e-3;

/// Median of the steps between stamps that go forward, s; `None` where time does not pass.
pub(crate) fn median_step(time: &[f64]) -> Option<f64> {
    median_positive(time.windows(2).map(|pair| pair[1] - pair[0]))
}

/// Whether logs of robots have such a usual step, s: otherwise the stamps are in another unit, and what lasts how long is not known.
pub(crate) fn is_plausible_step(interval: f64) -> bool {
    (1e-5..0.5).contains(&interval)
}

/// Median of the steps that are above 0; `None` without any.
pub(crate) fn median_positive(steps: impl Iterator<Item = f64>) -> Option<f64> {
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The interval if the stamps are an even grid, or one that was rounded to decimals; else `None`.
pub(crate) fn even_interval(time: &[f64]) -> Option<f64> {
    let n = time.len();
    if n < 2 {
        return None;
    }
    let (mut interval, mut offset) = ((time[n - 1] - time[0]) / (n - 1) as f64, 0.0);
    // Least-squares line through the stamps, in two rounds for rounding's sake.
    let middle = (n - 1) as f64 / 2.0;
    let spread = (n as f64) * ((n as f64).powi(2) - 1.0) / 12.0;
    for _ in 0..2 {
        let (mut sum, mut moment) = (0.0, 0.0);
        for (i, t) in time.iter().enumerate() {
            let rest = t - time[0] - offset - interval * i as f64;
            sum += rest;
            moment += rest * (i as f64 - middle);
        }
        interval += moment / spread;
        offset += sum / n as f64 - moment / spread * middle;
    }
    let worst = time
        .iter()
        .enumerate()
        .map(|(i, t)| (t - time[0] - offset - interval * i as f64).abs())
        .fold(0.0, f64::max);
    if worst <= EVEN * interval {
        return Some(interval);
    }
    // Stamps printed with few decimals: the whole deviation is less than half a unit of the last one.
    let quantum = (0..=9)
        .map(|digits| 10.0_f64.powi(-digits))
        .find(|quantum| {
            time.iter().all(|t| {
                let units = t / quantum;
                (units - units.round()).abs() < 1e-6 * units.abs().max(1.0).sqrt()
            })
        })?;
    (worst <= 0.51 * quantum && interval > 1.5 * quantum).then_some(interval)
}

/// First stamp of a log, s.
pub(crate) fn first_stamp(log: &Recording) -> Option<f64> {
    log.time.iter().copied().find(|time| time.is_finite())
}
