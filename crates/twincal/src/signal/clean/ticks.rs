//! The controller's clock of a log whose stamps are those of a receiver that polls: how many of the controller's steps lie between rows.
//!
//! Change of position over velocity is the time between two rows as the controller has it. Where it is whole steps and the
//! stamps are not, the stamps are the receiver's. Rows are then counted in steps, one after the other: travel decides where
//! a joint moves, the stamps (known to about a step) where all of them rest.

use super::travel::{LONGEST as LONGEST_RUN, Rows, Travel, median, runs};

/// Fewest rows in motion that show whose clock it is.
const FEWEST: usize = 200;
/// Median deviation of the stamps, in steps, below which they are good enough.
const GOOD: f64 = 0.02;
/// Median deviation from whole steps, as a share of that from the stamps. Were the stamps right, it would be 1 or more, known to
/// 8 % from 200 rows: below a half with a probability of less than 1e-9.
const WHOLE: f64 = 0.5;
/// Share of the rows that lie within so much of a whole step: of a time that is no whole number three in ten do, by chance nine in ten with a
/// probability of less than 1e-60.
const NEAR: f64 = 0.15;
const MOST: f64 = 0.9;
/// How far the sum of steps and the stamps may be apart, relative.
const APART: f64 = 0.05;
/// Most steps between two rows: below a gap.
const LONGEST: usize = 4;
/// Standard deviation of travel over velocity at the least travel that counts, and of velocity itself, relative.
const TRAVEL: f64 = 0.14;
const VELOCITY: f64 = 0.03;
/// Standard deviation of the receiver's stamps, in steps (a poll falls anywhere in a step: 0.29), and rows over which their mean is taken.
const STAMPS: f64 = 0.4;
const REMEMBERED: f64 = 2000.0;
/// Fewest rows in motion, one after the other, whose stamps show how long a step is.
const IN_A_ROW: usize = 50;
/// Most that one row of travel can weigh (χ²).
const TRAVEL_WEIGHS: f64 = 40.0;
/// The same of one stamp where joints move.
const STAMP_WEIGHS: f64 = 16.0;
/// Deviation of a stamp, in standard deviations, beyond which it weighs by its size and no more by its square (Huber).
const OUTLIER: f64 = 2.0;
/// What counting may change of the step that rows in motion show, relative.
const CHANGES: f64 = 1e-4;
/// Rows on either side among which fewer than a quarter repeat where torque is noisy at rest.
const BESIDE: usize = 50;
const SILENT: f64 = 0.25;

/// The rows of a log on the controller's clock.
pub(super) struct Ticks {
    /// Stamps by row of [`Rows`], s.
    pub(super) time: Vec<f64>,
    /// The controller's step, s.
    pub(super) interval: f64,
    /// Rows (of [`Rows`]) that lie on the step of the row before.
    pub(super) repeats: Vec<usize>,
    /// Those of them that motion or torque shows to be repeats.
    pub(super) shown: u64,
    /// Steps of the controller without a row.
    pub(super) missing: u64,
    /// Median deviation of the stamps from that clock, in steps.
    pub(super) jitter: f64,
}

/// Time between a row and the one before, in steps, with its standard deviation.
#[derive(Clone, Copy)]
struct Travelled {
    steps: f64,
    sd: f64,
    shows: bool,
}

/// How many steps of the controller's clock (in median steps of the stamps) lie between rows in motion.
struct Clock {
    /// In median steps.
    step: f64,
    /// Share of the rows in motion by steps since the row before.
    share: [f64; LONGEST + 1],
    jitter: f64,
}

/// `None` where the stamps are as good as the controller's, or nothing shows that they are not.
pub(super) fn ticks(rows: &Rows<'_>) -> Option<Ticks> {
    let travelled: Vec<Option<Travelled>> = (0..rows.len()).map(|k| travelled(rows, k)).collect();
    let clock = find(rows, &travelled)?;
    let counted = count(rows, &travelled, &clock);
    let (time, interval) = stamps(rows, &counted.ticks, clock.step * rows.interval);
    Some(Ticks {
        time,
        interval,
        repeats: counted.repeats,
        shown: counted.shown,
        missing: counted.missing,
        jitter: clock.jitter,
    })
}

/// By the joint that moves most for its encoder.
fn travelled(rows: &Rows<'_>, k: usize) -> Option<Travelled> {
    if !rows.joined[k] {
        return None;
    }
    let clear = |joint: &&Travel| joint.usual[k].abs() / joint.least;
    let moving = rows.joints.iter().filter(|joint| joint.usual[k] != 0.0);
    let joint = moving.max_by(|a, b| clear(a).total_cmp(&clear(b)))?;
    let clear = clear(&joint);
    (clear > 0.0).then(|| Travelled {
        steps: joint.step[k] / joint.usual[k],
        sd: TRAVEL / clear + VELOCITY,
        shows: clear >= 1.0,
    })
}

fn find(rows: &Rows<'_>, travelled: &[Option<Travelled>]) -> Option<Clock> {
    let shown = || {
        let all = travelled.iter().enumerate();
        all.filter_map(|(k, travelled)| Some((k, travelled.filter(|t| t.shows)?.steps)))
    };
    if shown().count() < FEWEST {
        return None;
    }
    let mut step = median(shown().map(|(_, a)| a).filter(|a| *a > 0.5).collect());
    for _ in 0..2 {
        let whole = |a: f64| (a / step).round();
        let (mut sum, mut count) = (0.0, 0.0);
        for (_, a) in shown().filter(|(_, a)| (a / step - whole(*a)).abs() < 0.25) {
            sum += a;
            count += whole(a);
        }
        if count < FEWEST as f64 {
            return None;
        }
        step = sum / count;
    }
    let off = |a: f64| (a / step - (a / step).round()).abs();
    let stamped = |k: usize| (rows.stamp(k) - rows.stamp(k - 1)) / rows.interval;
    let whole = median(shown().map(|(_, a)| off(a)).collect());
    let jitter = median(
        shown()
            .map(|(k, a)| (a - stamped(k)).abs() / step)
            .collect(),
    );
    let all = shown().count() as f64;
    let near = shown().filter(|(_, a)| off(*a) <= NEAR).count() as f64;
    let steps: f64 = shown().map(|(_, a)| (a / step).round()).sum();
    let seconds: f64 = shown().map(|(k, _)| stamped(k)).sum();
    let is_controller = jitter >= GOOD
        && whole < WHOLE * jitter
        && near >= MOST * all
        && (steps * step / seconds - 1.0).abs() < APART;
    let mut share = [1.0 / all; LONGEST + 1];
    for (_, a) in shown() {
        let steps = (a / step).round().clamp(0.0, LONGEST as f64);
        share[steps as usize] += 1.0 / all;
    }
    is_controller.then(|| Clock {
        step: as_received(rows, travelled, step).unwrap_or(seconds / steps),
        share,
        jitter,
    })
}

/// The controller's step as the receiver's stamps have it, in median steps: slope of the stamps over whole steps within stretches of motion.
fn as_received(rows: &Rows<'_>, travelled: &[Option<Travelled>], step: f64) -> Option<f64> {
    let shows = |k: usize| travelled[k].is_some_and(|t| t.shows);
    let mut line = Line::default();
    for run in runs(rows.len(), shows) {
        if run.len() < IN_A_ROW {
            continue;
        }
        let start = rows.stamp(run.start);
        let mut ticks = 0.0;
        let points = run.map(|k| {
            ticks += travelled[k].map_or(0.0, |t| (t.steps / step).round());
            [ticks, (rows.stamp(k) - start) / rows.interval]
        });
        line.add(&points.collect::<Vec<_>>());
    }
    line.slope()
}

/// Least-squares slope of stretches that have an offset each.
#[derive(Default)]
struct Line {
    product: f64,
    square: f64,
}

impl Line {
    /// A stretch of points `[x, y]`.
    fn add(&mut self, points: &[[f64; 2]]) {
        let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64;
        let middle = [mean(0), mean(1)];
        for [x, y] in points {
            self.product += (x - middle[0]) * (y - middle[1]);
            self.square += (x - middle[0]).powi(2);
        }
    }

    fn slope(&self) -> Option<f64> {
        (self.square > 0.0).then(|| self.product / self.square)
    }
}

/// Rows in steps since the first of their stretch.
struct Counted {
    ticks: Vec<f64>,
    repeats: Vec<usize>,
    shown: u64,
    missing: u64,
}

fn count(rows: &Rows<'_>, travelled: &[Option<Travelled>], clock: &Clock) -> Counted {
    let len = rows.len();
    let repeated: Vec<bool> = (0..len).map(|k| rows.repeats(k)).collect();
    let shown = shown_repeats(rows, &repeated);
    let mut counted = Counted {
        ticks: vec![0.0; len],
        repeats: Vec::new(),
        shown: 0,
        missing: 0,
    };
    let (mut start, mut mean) = (0, 0.0);
    for k in 1..len {
        if !rows.joined[k] {
            (start, mean) = (k, 0.0);
            continue;
        }
        let stamp = (rows.stamp(k) - rows.stamp(start)) / (clock.step * rows.interval);
        let before = counted.ticks[k - 1];
        let shows = travelled[k].filter(|t| t.shows);
        // At rest what is usual weighs half: rows that repeat would put all others late.
        let usual = if shows.is_some() { 2.0 } else { 1.0 };
        let cost = |steps: usize| {
            let of_stamp = huber((stamp - before - steps as f64 - mean) / STAMPS);
            let of_travel = shows.map_or(0.0, |t| ((t.steps - steps as f64) / t.sd).powi(2));
            let of_stamp = if shows.is_some() {
                of_stamp.min(STAMP_WEIGHS)
            } else {
                of_stamp
            };
            of_stamp + of_travel.min(TRAVEL_WEIGHS) - usual * clock.share[steps].ln()
        };
        let fewest = usize::from(!repeated[k]);
        let steps = if shown[k] {
            0
        } else {
            let steps = (fewest..=LONGEST).min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
            steps.unwrap_or(fewest)
        };
        counted.ticks[k] = before + steps as f64;
        counted.missing += steps.saturating_sub(1) as u64;
        if steps == 0 {
            counted.repeats.push(k);
            counted.shown += u64::from(shown[k]);
        }
        mean += (stamp - counted.ticks[k] - mean) / REMEMBERED;
    }
    counted
}

/// Square of a deviation, of an outlier twice its size less the square of where outliers begin.
fn huber(deviation: f64) -> f64 {
    let size = deviation.abs();
    if size <= OUTLIER {
        size * size
    } else {
        OUTLIER * (2.0 * size - OUTLIER)
    }
}

/// Rows that motion shows to be repeats, or, where all joints rest, torque that is noisy there.
fn shown_repeats(rows: &Rows<'_>, repeated: &[bool]) -> Vec<bool> {
    let len = rows.len();
    let mut sum = vec![0_usize; len + 1];
    for k in 0..len {
        sum[k + 1] = sum[k] + usize::from(repeated[k]);
    }
    let noisy = |k: usize| {
        let (from, to) = (k.saturating_sub(BESIDE), (k + BESIDE).min(len));
        ((sum[to] - sum[from]) as f64) < SILENT * (to - from) as f64
    };
    let mut shown = vec![false; len];
    for run in rows.joints.iter().flat_map(|joint| rows.held(joint)) {
        shown[run].fill(true);
    }
    let short = |run: &std::ops::Range<usize>| run.len() <= LONGEST_RUN && noisy(run.start);
    for run in runs(len, |k| repeated[k]).into_iter().filter(short) {
        shown[run].fill(true);
    }
    shown
}

/// Stamps of an even clock, and its step: a line through the receiver's stamps, of one slope for the log and one offset for each stretch.
fn stamps(rows: &Rows<'_>, ticks: &[f64], step: f64) -> (Vec<f64>, f64) {
    let len = rows.len();
    let starts: Vec<usize> = (0..len).filter(|&k| !rows.joined[k]).collect();
    let ends = starts.iter().skip(1).copied().chain([len]);
    let stretches: Vec<(usize, usize)> = starts.iter().copied().zip(ends).collect();
    let mut line = Line::default();
    for &(from, to) in &stretches {
        let off = |k: usize| [ticks[k], rows.stamp(k) - rows.stamp(from) - step * ticks[k]];
        line.add(&(from..to).map(off).collect::<Vec<_>>());
    }
    let change = line.slope().filter(|change| change.abs() < CHANGES * step);
    let step = step + change.unwrap_or(0.0);
    let mut time = vec![0.0; len];
    for &(from, to) in &stretches {
        let start = rows.stamp(from);
        let late = (from..to).map(|k| rows.stamp(k) - start - step * ticks[k]);
        let offset = late.sum::<f64>() / (to - from) as f64;
        for k in from..to {
            time[k] = start + offset + step * ticks[k];
        }
    }
    (time, step)
}
