//! When a joint is at rest: where its position is constant. There friction is anywhere between ± its Coulomb value and says nothing.

use super::travel::{count, white_noise};
use std::collections::VecDeque;

/// Shortest rest, s.
pub(crate) const SHORTEST: f64 = 0.15;
/// Slowest motion, rad/s or m/s: a third of the slowest at which friction of geared arms is measured.
pub(crate) const SLOWEST: f64 = 1e-3;
/// What a position at rest spans at most: in counts of its encoder (two on either side), and in standard deviations of noise beyond that
/// of counting (150 readings of a normal variable span more than 8 of them with a probability of 2e-4).
const COUNTS: f64 = 4.5;
const DEVIATIONS: f64 = 8.0;
/// Standard deviation of the noise that counting alone leaves in motion, in counts.
const COUNTING: f64 = 0.7;
/// Third differences that the noise is estimated from, about.
const SAMPLED: usize = 1 << 16;

/// What the position of a joint spans at most in [`SHORTEST`] at rest, rad or m; `logged`: as logged, `pieces`: the same on even clocks.
pub(crate) fn span<'a>(logged: &[f64], pieces: impl Iterator<Item = &'a [f64]> + Clone) -> f64 {
    let count = count(logged);
    let all: usize = pieces.clone().map(<[f64]>::len).sum();
    let stride = all.div_ceil(SAMPLED).max(1);
    let third = |w: &[f64]| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0];
    let squares = pieces.flat_map(|q| q.windows(4).step_by(stride).map(|w| third(w).powi(2)));
    let noise = white_noise(squares.collect());
    let beyond = (noise.powi(2) - (COUNTING * count).powi(2)).max(0.0).sqrt();
    (SLOWEST * SHORTEST).max(COUNTS * count + DEVIATIONS * beyond)
}

/// Marks the samples of all stretches of [`SHORTEST`] in which position spans no more than `span`.
pub(crate) fn at_rest(q: &[f64], span: f64, interval: f64) -> Vec<bool> {
    let mut still = vec![false; q.len()];
    let steps = ((SHORTEST / interval + 1e-6) as usize).max(2);
    // Indices of falling values, and of rising ones: the first is the window's largest, or smallest.
    let (mut high, mut low) = (VecDeque::new(), VecDeque::new());
    let mut marked = 0;
    for i in 0..q.len() {
        while high.back().is_some_and(|&last: &usize| q[last] <= q[i]) {
            high.pop_back();
        }
        while low.back().is_some_and(|&last: &usize| q[last] >= q[i]) {
            low.pop_back();
        }
        high.push_back(i);
        low.push_back(i);
        let Some(from) = i.checked_sub(steps) else {
            continue;
        };
        for ends in [&mut high, &mut low] {
            while ends.front().is_some_and(|&first| first < from) {
                ends.pop_front();
            }
        }
        if q[high[0]] - q[low[0]] <= span {
            still[marked.max(from)..=i].fill(true);
            marked = i + 1;
        }
    }
    still
}

/// Marks the samples where |q̇| stays below `velocity` for longer than `seconds`.
pub(crate) fn slower_than(qd: &[f64], velocity: f64, seconds: f64, interval: f64) -> Vec<bool> {
    let mut still = vec![false; qd.len()];
    let mut start = 0;
    for i in 0..=qd.len() {
        if i < qd.len() && qd[i].abs() < velocity {
            continue;
        }
        if i > start && (i - start - 1) as f64 * interval > seconds {
            still[start..i].fill(true);
        }
        start = i + 1;
    }
    still
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::worlds::{MOTIONS, Motion, World};

    #[test]
    fn only_long_slow_stretches_are_marked() {
        // 0.3 s at rest, motion with one zero crossing, 0.05 s at rest
        let mut qd = vec![0.0; 300];
        qd.extend((0..400).map(|i| (f64::from(i) * 0.0157).sin() + 0.001));
        qd.extend(vec![0.0; 50]);
        let still = slower_than(&qd, 0.02, 0.2, 0.001);
        let marked: Vec<usize> = (0..still.len()).filter(|&i| still[i]).collect();
        assert_eq!(marked.first(), Some(&0));
        assert!((300..305).contains(&marked.len()), "{}", marked.len());
        assert!(slower_than(&qd, 0.0, 0.2, 0.001).iter().all(|s| !s));
    }

    /// Brute force: all windows, all their samples.
    #[test]
    fn the_sliding_window_marks_what_all_windows_mark() {
        for seed in 0..20 {
            let world = World {
                seconds: 3.0,
                rate: 100.0,
                ..World::new(Motion::PointToPoint, seed)
            };
            let q = &world.clean().joints[0].q;
            let (steps, span) = (15, 1e-4 * seed as f64);
            let mut expected = vec![false; q.len()];
            for from in 0..q.len() - steps {
                let window = &q[from..=from + steps];
                let high = window.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let low = window.iter().copied().fold(f64::INFINITY, f64::min);
                if high - low <= span {
                    expected[from..=from + steps].fill(true);
                }
            }
            assert_eq!(at_rest(q, span, 0.01), expected);
        }
    }

    /// Encoders of 2^16 to 2^20 counts, silent or dithering, 125 Hz to 1 kHz: dwells are rest, motion from 0.003 rad/s on is none, but for the
    /// last 0.05 s of a move, in which position is constant to some counts.
    #[test]
    fn dwells_are_rest_and_slow_motion_is_motion() {
        for motion in MOTIONS {
            for counts in [1 << 16, 1 << 18, 1 << 20] {
                for rate in [125.0, 250.0, 1000.0] {
                    for dither in [0.0, 0.5] {
                        let world = World {
                            rate,
                            counts: f64::from(counts),
                            dither,
                            ..World::new(motion, 5)
                        };
                        let log = world.clean();
                        let q = &log.joints[0].q;
                        let still = at_rest(q, span(q, std::iter::once(&q[..])), 1.0 / rate);
                        let speed = |i: usize| motion.at(0, log.time[i])[1].abs();
                        let (mut dwell, mut in_dwell, mut moving, mut in_motion) = (0, 0, 0, 0);
                        for (i, &still) in still.iter().enumerate() {
                            let rests = speed(i) == 0.0;
                            dwell += usize::from(rests);
                            in_dwell += usize::from(rests && still);
                            let near = |t: f64| motion.at(0, log.time[i] + t)[1].abs() > 0.003;
                            let moves = near(0.0) && near(-0.05) && near(0.05);
                            moving += usize::from(moves);
                            in_motion += usize::from(moves && still);
                        }
                        assert!(
                            in_dwell as f64 >= 0.99 * dwell as f64,
                            "{world:?}: {in_dwell} of {dwell}"
                        );
                        assert!(
                            in_motion as f64 <= 0.002 * moving as f64,
                            "{world:?}: {in_motion} of {moving}"
                        );
                    }
                }
            }
        }
    }

    /// A dwell of 0.15 s between moves.
    #[test]
    fn the_shortest_dwell_is_found() {
        for rate in [125.0, 500.0, 1000.0] {
            let q: Vec<f64> = (0..(2.15 * rate) as usize)
                .map(|i| {
                    let t = f64::from(i as u32) / rate;
                    0.5 * (t.min(1.0) + (t - 1.15).max(0.0))
                })
                .collect();
            let still = at_rest(&q, span(&q, std::iter::once(&q[..])), 1.0 / rate);
            let seconds = still.iter().filter(|still| **still).count() as f64 / rate;
            assert!((seconds - 0.15).abs() < 0.02, "{seconds}");
        }
    }
}
