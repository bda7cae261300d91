//! A slow motion in a fast log: every d-th sample is enough, behind a filter that leaves the motion as it is.
//!
//! What follows reads nothing above the motion filter's stop band, so that a fine clock only costs time and memory. The
//! filter here is flat up to that band at the widest cut-off of the sweep and stopped (120 dB) where the coarse clock
//! would fold; its kernel is exact on polynomials up to degree 9. Torque passes the same filter: columns and torque then
//! meet the same F. How coarse the clock may be: [`coarsest`].

use super::decimate::Decimator;
use super::fir::thinning_kernel;
use super::pipeline::Pipeline;
use super::trajectory::Trajectory;
#[cfg(test)]
use crate::signal::clean::pieces::Values;
use crate::signal::clean::pieces::{Piece, Prepared};
use rayon::prelude::*;
use std::borrow::Cow;

/// Coarse samples per period of the motion filter's cut-off. The stop band of the widest cut-off of the sweep begins at
/// 1.8 f_q; columns are products of motion: what three of them fold to lies above F's stop band.
const SAMPLES_PER_PERIOD: f64 = 7.0;
/// Friction that turns round is a step as wide as v_s is in time; sampled every h seconds its mean is off by
/// `2 exp(−π² v_s / (|q̈| h))` (Poisson's summation of sech²): 1.4 % of Coulomb friction at the least `v_s/(|q̈| h)` of a half.
const STEPS_PER_REVERSAL: f64 = 0.5;
/// Peak over root mean square of the acceleration that is reckoned with.
const PEAK: f64 = 3.0;
/// Samples that are filtered at a time, about.
const CHUNK: usize = 64;

/// Longest sampling interval, s, that loses nothing of the motion: 0 for every sample.
///
/// `acceleration`: root mean square of the fastest joint, rad/s² or m/s².
pub(crate) fn coarsest(motion_cutoff: f64, coulomb_velocity: f64, acceleration: f64) -> f64 {
    let reversal = coulomb_velocity / (STEPS_PER_REVERSAL * PEAK * acceleration);
    (1.0 / (SAMPLES_PER_PERIOD * motion_cutoff)).min(reversal)
}

impl Pipeline {
    /// The same with another v_s, and a clock that is fine enough for it in this motion. Standstill stays what it is.
    pub(crate) fn turning(&self, coulomb_velocity: f64, motion: &[Trajectory]) -> Self {
        let (mut sum, mut count) = (vec![0.0; self.standstill_velocity.len()], 0);
        for segment in motion.iter().flat_map(|trajectory| &trajectory.segments) {
            let of_joints = segment.qdd.chunks_exact(segment.time.len());
            for (sum, qdd) in sum.iter_mut().zip(of_joints) {
                *sum += qdd.iter().map(|a| a * a).sum::<f64>();
            }
            count += segment.time.len();
        }
        let fastest = sum.into_iter().fold(0.0, f64::max);
        let acceleration = (fastest / (count as f64).max(1.0)).sqrt();
        let interval = coarsest(self.motion_cutoff_hz, coulomb_velocity, acceleration);
        Self {
            coulomb_velocity,
            motion_interval: self.motion_interval.min(interval),
            ..self.clone()
        }
    }
}

/// How many samples of a log become one: the largest number that divides the distance of rows, so that rows stay where they
/// would be.
pub(crate) fn factor(pipeline: &Pipeline, interval: f64) -> usize {
    let most = (pipeline.motion_interval / interval * (1.0 + 1e-9)) as usize;
    let step = pipeline.step(interval);
    (1..=most.max(1))
        .rev()
        .find(|d| step.is_multiple_of(*d))
        .unwrap_or(1)
}

/// Every d-th sample of every piece; pieces that are shorter than the filter are dropped and counted (pieces, rows).
pub(crate) fn thin(prepared: &mut Prepared<'_>, pipeline: &Pipeline) -> (u64, u64) {
    let every = factor(pipeline, prepared.interval);
    let (mut short, mut rows) = (0, 0);
    if every > 1 {
        prepared.pieces.retain_mut(|piece| {
            let long = thinned(piece, pipeline, every).is_some();
            if !long {
                short += 1;
                rows += piece.rows.len() as u64;
            }
            long
        });
    }
    (short, rows)
}

/// `None`, and the piece as it was, if it does not hold the kernel.
fn thinned(piece: &mut Piece<'_>, pipeline: &Pipeline, every: usize) -> Option<()> {
    let kernel = thinning_kernel(
        pipeline.motion_cutoff_hz,
        pipeline.motion_interval,
        piece.interval,
    );
    let (half, len) = (kernel.len() / 2, piece.time.len());
    let count = len.checked_sub(kernel.len())? / every + 1;
    piece.joints.par_iter_mut().for_each(|values| {
        let channels: Vec<&[f64]> = values.channels().collect();
        let mut thin = decimated(&kernel, every, count, &channels).into_iter();
        values.for_each(|channel| *channel = Cow::Owned(thin.next().unwrap_or_default()));
    });
    let centres = || (0..count).map(|i| half + i * every);
    piece.time = centres().map(|i| piece.time[i]).collect();
    if !piece.resampled() {
        piece.grid_rows = centres().map(|i| piece.grid_rows[i]).collect();
    }
    piece.interval *= every as f64;
    piece.every = every;
    Some(())
}

/// Filtered signals at every d-th sample. An offset goes past the sum, so that rounding is that of the motion.
fn decimated(kernel: &[f64], every: usize, count: usize, signals: &[&[f64]]) -> Vec<Vec<f64>> {
    let mut decimator = Decimator::new(kernel, every, count, signals.len());
    let end = (count - 1) * every + kernel.len();
    // Whole steps, so that all chunks are weighed alike.
    let samples = (CHUNK / every).max(1) * every;
    let mut chunk = Vec::with_capacity(signals.len() * samples);
    for from in (0..end).step_by(samples) {
        let to = end.min(from + samples);
        chunk.clear();
        for x in signals {
            chunk.extend(x[from..to].iter().map(|value| value - x[0]));
        }
        decimator.add(from, to - from, &[(0, &chunk)]);
    }
    let with_offset = |(i, x): (usize, &&[f64])| -> Vec<f64> {
        let sums = &decimator.sums(i, 1)[..count];
        sums.iter().map(|sum| sum + x[0]).collect()
    };
    signals.iter().enumerate().map(with_offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force: the kernel summed at every d-th sample, and the clock that belongs to it.
    #[test]
    fn every_sample_that_is_left_is_the_filtered_one_at_its_own_time() {
        let len = 1003;
        let wave =
            |a: f64| -> Vec<f64> { (0..len).map(|i| 5.0 + (a * f64::from(i)).sin()).collect() };
        let (q, tau) = (wave(0.02), wave(0.7));
        let mut pipeline = Pipeline::off(1);
        (
            pipeline.cutoff_hz,
            pipeline.motion_cutoff_hz,
            pipeline.rate_hz,
        ) = (5.0, 20.0, 12.5);
        pipeline.motion_interval = coarsest(20.0, 0.02, 0.1);
        assert_eq!(
            factor(&pipeline, 0.001),
            5,
            "the largest divisor of 80 up to 7"
        );
        let rows: Vec<usize> = (10..10 + len as usize).collect();
        let mut prepared = Prepared {
            time: None,
            interval: 0.001,
            pieces: vec![Piece {
                time: (0..len).map(|i| 3.0 + 0.001 * f64::from(i)).collect(),
                interval: 0.001,
                every: 1,
                rows: rows.clone(),
                grid_rows: rows.clone(),
                joints: vec![Values {
                    q: Cow::Borrowed(&q),
                    qd: None,
                    qdd: None,
                    tau: Some(Cow::Borrowed(&tau)),
                }],
            }],
        };
        let mut short = prepared.clone();
        short.pieces[0].time.truncate(20);
        assert_eq!(thin(&mut short, &pipeline), (1, 1003));
        assert!(short.pieces.is_empty());

        assert_eq!(thin(&mut prepared, &pipeline), (0, 0));
        let piece = &prepared.pieces[0];
        let kernel = thinning_kernel(20.0, pipeline.motion_interval, 0.001);
        let half = kernel.len() / 2;
        assert_eq!(piece.time.len(), (1003 - kernel.len()) / 5 + 1);
        assert!((piece.interval - 0.005).abs() < 1e-15 && piece.rows == rows);
        for i in 0..piece.time.len() {
            let sum =
                |x: &[f64]| -> f64 { kernel.iter().zip(&x[5 * i..]).map(|(h, x)| h * x).sum() };
            let thin = piece.joints[0].tau.as_ref().map_or(0.0, |tau| tau[i]);
            assert!((piece.joints[0].q[i] - sum(&q)).abs() < 1e-12);
            assert!((thin - sum(&tau)).abs() < 1e-12);
            // Slow motion is untouched: 3.2 Hz.
            assert!((piece.joints[0].q[i] - q[half + 5 * i]).abs() < 1e-9);
            assert!((piece.time[i] - (3.0 + 0.001 * (half + 5 * i) as f64)).abs() < 1e-12);
            assert_eq!(piece.grid_rows[i], 10 + half + 5 * i);
        }
    }

    #[test]
    fn fast_reversals_sharp_friction_and_slow_clocks_keep_every_sample() {
        let mut pipeline = Pipeline::off(1);
        (
            pipeline.cutoff_hz,
            pipeline.motion_cutoff_hz,
            pipeline.rate_hz,
        ) = (5.0, 20.0, 12.5);
        for (velocity, acceleration, interval, expected) in [
            (0.02, 1.0, 0.001, 5),
            (0.02, 10.0, 0.001, 1),
            (0.0, 1.0, 0.001, 1),
            (0.02, 1.0, 0.008, 1),
        ] {
            pipeline.motion_interval = coarsest(20.0, velocity, acceleration);
            assert_eq!(
                factor(&pipeline, interval),
                expected,
                "{velocity} {acceleration} {interval}"
            );
        }
        pipeline.motion_interval = 0.0;
        assert_eq!(factor(&pipeline, 0.001), 1);
    }
}
