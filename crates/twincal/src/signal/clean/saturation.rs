//! Torque that is flat at a limit: the drive gave what it had, not what the motion needed (case 26).

use std::collections::BTreeMap;
use std::ops::Range;

/// Fewest samples of a flat run at a limit that the model states.
const FEWEST_AT_LIMIT: usize = 3;
/// Fewest samples of a flat run at the log's own extreme.
const FEWEST: usize = 5;
/// A torque this near to a stated limit, relative, is at it.
const AT_LIMIT: f64 = 1e-3;
/// How many times longer than usual a run of equal values must be (slow channels repeat every value).
const LONGER: usize = 3;
/// How many of the channel's steps the torque must jump by into or out of a flat run: a quantised torque that turns around
/// smoothly does so in single steps.
const JUMP: f64 = 3.0;

/// Runs of samples at which torque is flat at its largest or smallest value, at `limit` (the model's effort) or at an
/// extreme that the log itself repeats exactly. `moves` says whether the joint moves during a run: a torque that is constant
/// at rest is no saturation.
pub(crate) fn flat_runs(
    tau: &[f64],
    limit: Option<f64>,
    moves: impl Fn(&Range<usize>) -> bool,
) -> Vec<Range<usize>> {
    let (low, high) = tau
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| {
            (l.min(*t), h.max(*t))
        });
    // Also without any finite sample.
    if high <= low {
        return Vec::new();
    }
    let stated = |extreme: f64| {
        limit.is_some_and(|limit| limit > 0.0 && (extreme.abs() / limit - 1.0).abs() < AT_LIMIT)
    };
    let usual = usual_run(tau);
    let step = smallest_step(tau);
    let mut found = Vec::new();
    for extreme in [low, high] {
        if extreme == 0.0 {
            continue;
        }
        let (width, fewest) = if stated(extreme) {
            (AT_LIMIT * extreme.abs(), FEWEST_AT_LIMIT)
        } else {
            (0.0, FEWEST.max(LONGER * usual))
        };
        let runs: Vec<Range<usize>> = runs(tau, |t| (t - extreme).abs() <= width)
            .into_iter()
            .filter(|run| run.len() >= fewest && moves(run))
            .collect();
        let jumps = |run: &Range<usize>| {
            let from = |i: Option<usize>| {
                i.and_then(|i| tau.get(i))
                    .is_some_and(|t| (t - extreme).abs() >= JUMP * step)
            };
            from(run.start.checked_sub(1)) || from(Some(run.end))
        };
        let jumping = runs.iter().filter(|run| jumps(run)).count();
        if stated(extreme) || 2 * jumping > runs.len() {
            found.extend(runs);
        }
    }
    found.sort_by_key(|run| run.start);
    found
}

/// Stretches of samples for which `inside` holds.
fn runs(tau: &[f64], inside: impl Fn(f64) -> bool) -> Vec<Range<usize>> {
    let (mut runs, mut start) = (Vec::new(), None);
    for i in 0..=tau.len() {
        match (i < tau.len() && inside(tau[i]), start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                runs.push(from..i);
                start = None;
            }
            _ => {}
        }
    }
    runs
}

/// Length of the run of equal values in which the median sample stands.
fn usual_run(tau: &[f64]) -> usize {
    let mut samples: BTreeMap<usize, usize> = BTreeMap::new();
    // Nearly all runs are of one sample: these need no map.
    let mut alone = 0;
    for run in tau.chunk_by(|a, b| a == b) {
        match run.len() {
            1 => alone += 1,
            length => *samples.entry(length).or_default() += length,
        }
    }
    if alone > tau.len() / 2 {
        return 1;
    }
    let mut seen = alone;
    let median = samples.iter().find(|(_, count)| {
        seen += **count;
        seen > tau.len() / 2
    });
    median.map_or(0, |(length, _)| *length)
}

/// Smallest difference between neighbours that is not zero: the channel's resolution.
fn smallest_step(tau: &[f64]) -> f64 {
    tau.windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|d| *d > 0.0)
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(len: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..len).map(|i| f(i as f64 * 0.01)).collect()
    }

    fn count(tau: &[f64], limit: Option<f64>) -> usize {
        flat_runs(tau, limit, |_| true)
            .into_iter()
            .map(|run| run.len())
            .sum()
    }

    #[test]
    fn clipped_torque_is_found_with_and_without_a_stated_limit() {
        let clipped = wave(2000, |t| (12.0 * (2.0 * t).sin()).clamp(-9.0, 10.0));
        let flat = clipped
            .iter()
            .filter(|t| **t == 10.0 || **t == -9.0)
            .count();
        assert!(flat > 400);
        assert_eq!(count(&clipped, None), flat);
        let near = wave(2000, |t| {
            let tau = (12.0 * (2.0 * t).sin()).clamp(-10.0, 10.0);
            tau * (1.0 - 4e-4 * (31.0 * t).sin().abs())
        });
        assert_eq!(count(&near, None), 0);
        assert!(count(&near, Some(10.0)) > 400);
        // A limit far away changes nothing.
        assert_eq!(count(&clipped, Some(300.0)), flat);
        // At rest a constant torque is the load.
        assert!(flat_runs(&clipped, None, |_| false).is_empty());
    }

    #[test]
    fn smooth_quantised_repeated_and_constant_torque_is_not_saturated() {
        let smooth = wave(2000, |t| 12.0 * (2.0 * t).sin() + 0.1 * (17.0 * t).cos());
        assert_eq!(count(&smooth, None), 0);
        let coarse = wave(2000, |t| (12.0 * (2.0 * t).sin()).round() * 0.5);
        assert_eq!(count(&coarse, None), 0);
        let held: Vec<f64> = (0..2000).map(|i| smooth[i / 8 * 8]).collect();
        assert_eq!(count(&held, None), 0);
        assert_eq!(count(&[3.0; 100], None), 0);
        assert_eq!(count(&[], None), 0);
    }
}
