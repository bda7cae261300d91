//! How far each joint travels from row to row, by its position alone: what tells a repeated row from a joint at rest.
//!
//! A velocity that the controller computed as change of position over a nominal step says nothing of the step itself. The
//! slope of position over several rows does: there stamps that jitter and rows that repeat average out.

use crate::signal::log::recording::Recording;
use crate::signal::log::stamps::GAP;
use rayon::prelude::*;
use std::ops::Range;

/// Time on either side of a step whose mean positions give the velocity there, s, and its bounds in rows.
const REACH: f64 = 0.016;
const FEWEST_ROWS: usize = 3;
const MOST_ROWS: usize = 16;
/// Encoder counts that a joint has to travel per step to count as moving. A reading that dithers by a count on either side
/// changes by less than three.
const COUNTS: f64 = 4.0;
/// The same in standard deviations of the position noise: two readings agree all the same with a probability of 6e-12.
const DEVIATIONS: f64 = 10.0;
/// Changes below this share of the largest position are rounding.
const ROUNDING: f64 = 1e-7;
/// Values that the size of a channel, and third differences that its noise, are estimated from, about.
const SAMPLED: usize = 1 << 16;
/// Variance of a standard normal variable below its median modulus.
const LOWER_HALF: f64 = 0.142_6;
/// Variance of the third difference of white noise of variance 1.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Most rows that repeat one after the other: more are a joint at rest, an encoder that is stuck or a slow channel.
pub(super) const LONGEST: usize = 3;

/// Rows of a log that are looked at, and what its joints travel between them.
pub(super) struct Rows<'a> {
    pub(super) log: &'a Recording,
    /// Ascending indices into the recording.
    pub(super) rows: Vec<usize>,
    /// Whether a row follows the one before without a cut.
    pub(super) joined: Vec<bool>,
    /// Median step, s.
    pub(super) interval: f64,
    /// By joint.
    pub(super) joints: Vec<Travel>,
}

/// Travel of one joint.
pub(super) struct Travel {
    /// Change of position from the row before, rad or m.
    pub(super) step: Vec<f64>,
    /// Velocity times the median step, rad or m; 0 where it is not known.
    pub(super) usual: Vec<f64>,
    /// Least |`usual`| that a fresh reading of position cannot hide, rad or m.
    pub(super) least: f64,
}

impl<'a> Rows<'a> {
    /// `kept`: rows that are finite; `cut_before`: whether rows were dropped right before each of them. `None` where no position
    /// repeats and the stamps are even.
    pub(super) fn of(
        log: &'a Recording,
        kept: &[usize],
        cut_before: &[bool],
        interval: f64,
    ) -> Option<Self> {
        let (mut rows, mut joined) = (Vec::with_capacity(kept.len()), Vec::new());
        let mut cut = true;
        for (&row, &before) in kept.iter().zip(cut_before) {
            cut |= before;
            let last: Option<&usize> = rows.last();
            let step = last.map_or(0.0, |&last| log.time[row] - log.time[last]);
            // A row that was written twice is the business of `clock.rs`.
            if step == 0.0 && last.is_some_and(|&last| repeats(log, last, row)) {
                continue;
            }
            joined.push(!cut && (0.0..=GAP * interval).contains(&step));
            rows.push(row);
            cut = false;
        }
        if !is_suspect(log, &rows, &joined, interval) {
            return None;
        }
        let time: Vec<f64> = rows.iter().map(|&row| log.time[row]).collect();
        let joints = log.joints.par_iter().map(|joint| {
            let q: Vec<f64> = rows.iter().map(|&row| joint.q[row]).collect();
            Travel::of(&time, &q, &joined, interval)
        });
        Some(Self {
            joints: joints.collect(),
            log,
            rows,
            joined,
            interval,
        })
    }

    /// How many rows there are.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Stamp of a row, s.
    pub(super) fn stamp(&self, k: usize) -> f64 {
        self.log.time[self.rows[k]]
    }

    /// Short runs of rows in which a joint's position repeats while it moves.
    pub(super) fn held(&self, joint: &Travel) -> Vec<Range<usize>> {
        let held = runs(self.len(), |k| self.joined[k] && joint.step[k] == 0.0);
        let shows =
            |run: &Range<usize>| run.len() <= LONGEST && run.clone().all(|k| joint.moves(k));
        held.into_iter().filter(shows).collect()
    }

    /// Whether all channels of a row have the values of the row before.
    pub(super) fn repeats(&self, k: usize) -> bool {
        self.joined[k] && repeats(self.log, self.rows[k - 1], self.rows[k])
    }
}

/// Runs of rows for which `inside` holds.
pub(super) fn runs(len: usize, inside: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let (mut runs, mut k) = (Vec::new(), 0);
    while k < len {
        let start = k;
        while k < len && inside(k) {
            k += 1;
        }
        if k > start {
            runs.push(start..k);
        }
        k += 1;
    }
    runs
}

/// Whether all channels have the same values in two rows.
fn repeats(log: &Recording, a: usize, b: usize) -> bool {
    log.joints.iter().all(|joint| {
        let others = [&joint.qd, &joint.qdd, &joint.tau];
        joint.q[a] == joint.q[b]
            && (others.into_iter().flatten()).all(|values| values[a] == values[b])
    })
}

/// Whether a position repeats anywhere, or stamps are off an even step by more than a fiftieth of it.
fn is_suspect(log: &Recording, rows: &[usize], joined: &[bool], interval: f64) -> bool {
    let uneven = |pair: &[usize]| {
        let step = log.time[pair[1]] - log.time[pair[0]];
        (step / interval - 1.0).abs() > 0.02
    };
    let held = |pair: &[usize]| {
        let mut joints = log.joints.iter();
        joints.any(|joint| joint.q[pair[0]] == joint.q[pair[1]])
    };
    let mut pairs = rows.windows(2).zip(&joined[1.min(joined.len())..]);
    pairs.any(|(pair, joined)| *joined && (uneven(pair) || held(pair)))
}

impl Travel {
    fn of(time: &[f64], q: &[f64], joined: &[bool], interval: f64) -> Self {
        let len = q.len();
        let step: Vec<f64> = (0..len)
            .map(|k| if joined[k] { q[k] - q[k - 1] } else { 0.0 })
            .collect();
        let reach = ((REACH / interval).ceil() as usize).clamp(FEWEST_ROWS, MOST_ROWS);
        let mut usual = vec![0.0; len];
        let mut start = 0;
        for end in 1..=len {
            if end < len && joined[end] {
                continue;
            }
            for k in start + 1..end {
                let w = reach.min(k - start).min(end - k);
                if w >= 2 {
                    usual[k] = interval * slope(time, q, k, w);
                }
            }
            start = end;
        }
        let least = least(q, &step, &usual, joined);
        Self { step, usual, least }
    }

    /// Whether the joint moves at a step so fast that no fresh reading repeats.
    pub(super) fn moves(&self, k: usize) -> bool {
        let usual = self.usual[k].abs();
        usual >= self.least && usual > 0.0
    }
}

/// Mean velocity about the step to row `k`: between the means of `w` rows on either side.
fn slope(time: &[f64], q: &[f64], k: usize, w: usize) -> f64 {
    let apart = |values: &[f64]| -> f64 {
        let pairs = values[k - w..k].iter().zip(&values[k..k + w]);
        pairs.map(|(before, after)| after - before).sum()
    };
    let seconds = apart(time);
    if seconds > 0.0 {
        apart(q) / seconds
    } else {
        0.0
    }
}

/// What a joint has to travel in a step so that its position cannot read the same: some counts of its encoder, and some
/// standard deviations of its noise (from third differences in the faster half of the rows; the lower half of them, so that
/// steps over missing or repeated rows do not count).
fn least(q: &[f64], step: &[f64], usual: &[f64], joined: &[bool]) -> f64 {
    let count = least_change(q, step.iter().copied());
    if !count.is_finite() {
        return f64::INFINITY;
    }
    let fast = median(usual.iter().map(|usual| usual.abs()).collect());
    let third = |k: usize| step[k] - 2.0 * step[k - 1] + step[k - 2];
    let inside = |k: &usize| (k - 2..=*k).all(|k| joined[k]) && usual[*k].abs() >= fast;
    let stride = q.len().div_ceil(SAMPLED);
    let squares = (3..q.len())
        .step_by(stride.max(1))
        .filter(inside)
        .map(|k| third(k).powi(2));
    (COUNTS * count).max(DEVIATIONS * white_noise(squares.collect()))
}

/// Standard deviation of white noise from squares of third differences: the lower half of them, so that what happens now and then does
/// not count. 0 of nothing.
pub(super) fn white_noise(mut squares: Vec<f64>) -> f64 {
    let half = squares.len() / 2;
    if half == 0 {
        return 0.0;
    }
    squares.select_nth_unstable_by(half, f64::total_cmp);
    let lower: f64 = squares[..half].iter().sum::<f64>() / half as f64;
    (lower / LOWER_HALF / THIRD_DIFFERENCE).sqrt()
}

/// Median; 0 of nothing.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Smallest change of a channel that is no rounding, one count of an encoder; 0 without a change.
pub(super) fn count(values: &[f64]) -> f64 {
    let changes = values.windows(2).map(|pair| pair[1] - pair[0]);
    let count = least_change(values, changes);
    if count.is_finite() { count } else { 0.0 }
}

/// The smallest of these changes of a channel that is no rounding; infinite without one.
fn least_change(values: &[f64], changes: impl Iterator<Item = f64>) -> f64 {
    let stride = values.len().div_ceil(SAMPLED).max(1);
    let rounding = ROUNDING * usual_size(values.iter().step_by(stride));
    changes
        .map(f64::abs)
        .filter(|change| *change > rounding)
        .fold(f64::INFINITY, f64::min)
}

/// Size that one value in a hundred is beyond: a glitch is no scale of what a channel rounds to.
pub(super) fn usual_size<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(|v| v.abs()).filter(|v| v.is_finite()).collect();
    let at = sizes.len() - sizes.len() / 100;
    match at.checked_sub(1) {
        Some(at) => *sizes.select_nth_unstable_by(at, f64::total_cmp).1,
        None => 0.0,
    }
}
