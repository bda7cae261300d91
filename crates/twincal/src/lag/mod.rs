//! How much later than the motion torque was logged (case 17).
//!
//! ```text
//! Δτ(t + L) ≈ Σ_c b_c Δx_c(t)       x: nominal torque, friction of four shapes, acceleration
//! ```
//! Differences from sample to sample, because what the model misses is slow and a slow error looks like a lag of many
//! samples; both sides have passed the motion filter. The share of Δτ that is left has its minimum at the lag; a parabola
//! through the three lowest points gives parts of a sample, leaving out one piece of the log after the other its error.
//! A lag is the same at all frequencies, what the model misses is not: differences over a quarter of the cut-off's period
//! are looked at too, and what they disagree by counts as error.
//!
//! Source: cross-correlation of prewhitened series (Box, Jenkins & Reinsel, ch. 12); delete-one jackknife (Efron 1982);
//! joints are pooled with random effects (DerSimonian & Laird 1986).

mod profile;

use crate::error::{Finding, Severity};
use crate::robot::{Motion, Robot, nominal_torque};
use crate::signal::convolve::correlate;
use crate::signal::fir::MotionKernels;
use crate::signal::{Lag, Pipeline, Segment, Trajectory};
use profile::Products;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Longest lag that is looked for, s, and in samples at least and at most.
const REACH: f64 = 0.05;
const LEAST_REACH: usize = 10;
const MOST_REACH: usize = 100;
/// Samples of a piece at most, how many pieces are looked at, and how many there are at least.
const PIECE: usize = 2048;
const PIECES: usize = 16;
const FEWEST_PIECES: usize = 8;
/// Shortest piece that says anything, samples.
const SHORTEST: usize = 30;
/// A joint speaks if no more than this share of its torque's changes is left at the lag.
const EXPLAINED: f64 = 0.4;
/// The same where it is the only joint that speaks: no other can contradict it.
const EXPLAINED_ALONE: f64 = 0.15;
/// Error of the parabola, samples.
const PARABOLA: f64 = 0.05;
/// A lag must be longer than a sample by this many standard deviations.
const CLEARLY: f64 = 3.0;
/// Step of the slow differences, in periods of the cut-off; in samples without filter, at least and at most.
const SLOW: f64 = 0.25;
const SLOW_SAMPLES: usize = 10;
const SLOWEST: usize = 200;
/// Velocities of the friction's shapes, rad/s or m/s.
const DRY: [f64; 2] = [0.02, 0.2];

/// Lag of one joint in one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointLag {
    /// Name of the joint.
    pub joint: String,
    /// How much later torque is logged than the motion, s; negative where it is first.
    pub lag: f64,
    /// The same from slow differences, s; `None` where the log does not say it.
    pub slow: Option<f64>,
    /// Its standard deviation, s; `None` where the log does not say it.
    pub sd: Option<f64>,
    /// Share of the changes of torque that is not explained: as logged, and with torque moved back by the lag.
    pub left: [f64; 2],
    /// Whether enough is explained to believe it.
    pub speaks: bool,
}

/// Lag of one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogLag {
    /// Name of the log.
    pub log: String,
    /// Sampling interval, s.
    pub interval: f64,
    /// Joints that move, in order.
    pub joints: Vec<JointLag>,
    /// What more than half of the joints agree on: mean and standard deviation over joints, s.
    pub common: Option<[f64; 2]>,
}

impl LogLag {
    /// The common lag if it is clearly longer than one sample.
    pub fn clear(&self) -> Option<f64> {
        let [lag, sd] = self.common?;
        (lag.abs() - self.interval > CLEARLY * sd).then_some(lag)
    }

    /// The common lag where it is certainly there and longer than half a sample, but not clearly longer than one.
    pub fn slight(&self) -> Option<f64> {
        let [lag, sd] = self.common?;
        let there = lag.abs() > CLEARLY * sd && lag.abs() > 0.5 * self.interval;
        (there && self.clear().is_none()).then_some(lag)
    }
}

/// Estimates the lag of a log, joint by joint; `None` without torque or for logs that are too short.
pub fn estimate_lag(robot: &Robot, pipeline: &Pipeline, trajectory: &Trajectory) -> Option<LogLag> {
    let first = trajectory.segments.first()?;
    if trajectory.segments.iter().any(|s| s.tau.is_empty()) {
        return None;
    }
    let interval = first.interval;
    let reach = ((REACH / interval).round() as usize).clamp(LEAST_REACH, MOST_REACH);
    let kernel = if pipeline.is_off() {
        vec![1.0]
    } else {
        let cutoff = pipeline.motion_cutoff_hz.min(0.45 / interval);
        MotionKernels::new(cutoff, interval).smooth
    };
    let slow = if pipeline.is_off() {
        SLOW_SAMPLES
    } else {
        let samples = SLOW / pipeline.cutoff_hz / interval;
        (samples.round() as usize).clamp(2, SLOWEST)
    };
    let pieces = pieces(&trajectory.segments, reach + kernel.len() / 2, slow)?;
    let products: Vec<Vec<[Products; 2]>> = pieces
        .par_iter()
        .map(|piece| piece.products(robot, reach, &kernel))
        .collect();
    let names = robot.joint_names();
    let joints: Vec<JointLag> = (0..robot.dof())
        .filter_map(|joint| {
            let [fast, slow] = [0, 1].map(|step| -> Vec<&Products> {
                products.iter().map(|piece| &piece[joint][step]).collect()
            });
            joint_lag(names[joint], &fast, &slow, reach, interval)
        })
        .collect();
    let common = common(&joints, interval);
    Some(LogLag {
        log: trajectory.name.clone(),
        interval: first.logged_interval,
        joints,
        common,
    })
}

/// One finding per log whose torque is clearly off by more than a sample: degraded (exit code 3) unless the user has said
/// what the lag is, or most of the logs, which are all moved alike, do not say the same. A lag that is there and not
/// clearly longer than a sample is a note, unless the user has said what it is.
pub fn lag_findings(pipeline: &Pipeline, lags: &[LogLag]) -> Vec<Finding> {
    let said = pipeline.corrections.lag != Lag::Unsaid;
    lags.iter()
        .filter_map(|log| {
            let (Some(lag), [_, sd]) = (log.clear(), log.common?) else {
                return slight_lag(log).filter(|_| !said);
            };
            let order = if lag > 0.0 { "after" } else { "before" };
            let speak = log.joints.iter().filter(|joint| joint.speaks).count();
            let same = |other: &&LogLag| other.clear().is_some_and(|own| own * lag > 0.0);
            let (alike, all) = (lags.iter().filter(same).count(), lags.len());
            let most = 2 * alike >= all;
            let severity = match said || !most {
                true => Severity::Warning,
                false => Severity::Degraded,
            };
            let others = match most {
                true => String::new(),
                false => format!(
                    "; only {alike} of {all} logs say so, and a lag moves all of them: try it, and keep what predicts held-out torque better"
                ),
            };
            let still = if said { " still" } else { "" };
            Some(Finding::new(
                severity,
                "torque_lag",
                &log.log,
                format!(
                    "torque{still} comes {:.2} ± {:.2} ms ({:.1} samples) {order} the motion, as {speak} of {} moving joints say: rows \
                     pair it with the wrong motion; move it with [signal] lag = {:.4}, or say lag = 0{others}",
                    1e3 * lag.abs(),
                    1e3 * sd,
                    lag.abs() / log.interval,
                    log.joints.len(),
                    lag + pipeline.corrections.common_lag()
                ),
                0,
            ))
        })
        .collect()
}

/// The note on a lag that is there and not clearly longer than a sample.
fn slight_lag(log: &LogLag) -> Option<Finding> {
    let (lag, [_, sd]) = (log.slight()?, log.common?);
    let order = if lag > 0.0 { "after" } else { "before" };
    Some(Finding::new(
        Severity::Note,
        "torque_lag",
        &log.log,
        format!(
            "torque comes {:.2} ± {:.2} ms ({:.2} samples) {order} the motion, not for certain more than one sample, so that it is \
             left as it is: try [signal] lag = {lag:.4}, and keep it if it predicts held-out torque better",
            1e3 * lag.abs(),
            1e3 * sd,
            lag.abs() / log.interval,
        ),
        0,
    ))
}

/// A run of samples whose torque is known `margin` samples further on either side.
struct Piece<'a> {
    segment: &'a Segment,
    from: usize,
    len: usize,
    margin: usize,
    /// Step of the slow differences.
    slow: usize,
}

/// Evenly spread pieces of one length.
fn pieces(segments: &[Segment], margin: usize, slow: usize) -> Option<Vec<Piece<'_>>> {
    let inner = |segment: &Segment| (segment.time.len()).saturating_sub(2 * margin + slow);
    let total: usize = segments.iter().map(inner).sum();
    let len = PIECE.min(total / FEWEST_PIECES);
    if len < SHORTEST {
        return None;
    }
    let all: Vec<Piece<'_>> = segments
        .iter()
        .flat_map(|segment| {
            (0..inner(segment) / len).map(move |k| Piece {
                segment,
                from: margin + k * len,
                len,
                margin,
                slow,
            })
        })
        .collect();
    let (count, wanted) = (all.len(), all.len().min(PIECES));
    let mut chosen: Vec<Piece<'_>> = Vec::with_capacity(wanted);
    for (index, piece) in all.into_iter().enumerate() {
        if index * wanted / count >= chosen.len() {
            chosen.push(piece);
        }
    }
    (chosen.len() >= FEWEST_PIECES / 2).then_some(chosen)
}

impl Piece<'_> {
    /// Sums of products of every joint, of differences over one sample and of slow ones.
    fn products(&self, robot: &Robot, reach: usize, kernel: &[f64]) -> Vec<[Products; 2]> {
        let (dof, all, len) = (robot.dof(), self.segment.time.len(), self.len + self.slow);
        let stacked = |values: &[f64]| -> Vec<f64> {
            (0..dof)
                .flat_map(|joint| &values[joint * all + self.from..joint * all + self.from + len])
                .copied()
                .collect()
        };
        let [q, qd, qdd] =
            [&self.segment.q, &self.segment.qd, &self.segment.qdd].map(|v| stacked(v));
        let mut nominal = vec![0.0; dof * len];
        let (q, qd, qdd) = (&q[..], &qd[..], &qdd[..]);
        nominal_torque(robot, Motion { len, q, qd, qdd }, &mut nominal);
        (0..dof)
            .map(|joint| {
                let own = joint * len..(joint + 1) * len;
                let (n, v, a) = (&nominal[own.clone()], &qd[own.clone()], &qdd[own]);
                let still = &self.segment.standstill[joint * all + self.from..][..len];
                let shapes: [&dyn Fn(usize) -> f64; profile::COLUMNS] = [
                    &|i| n[i],
                    &|i| v[i],
                    &|i| (v[i] / DRY[0]).tanh(),
                    &|i| (v[i] / DRY[1]).tanh(),
                    &|i| v[i].abs() * v[i],
                    &|i| a[i],
                ];
                let columns = shapes.map(|shape| (0..len).map(shape).collect::<Vec<f64>>());
                let raw = self.from - self.margin..self.from + len + self.margin;
                let raw = &self.segment.tau[joint * all..(joint + 1) * all][raw];
                let mut tau = vec![0.0; len + 2 * reach];
                correlate(kernel, raw, &mut tau);
                [1, self.slow].map(|step| {
                    let moves: Vec<f64> = (0..self.len)
                        .map(|i| {
                            if still[i] || still[i + step] {
                                0.0
                            } else {
                                1.0
                            }
                        })
                        .collect();
                    let differences = |values: &[f64]| -> Vec<f64> {
                        let pairs = values.iter().zip(&values[step..]);
                        pairs.map(|(before, after)| after - before).collect()
                    };
                    let columns = columns.each_ref().map(|values| -> Vec<f64> {
                        let moved = differences(values).into_iter().zip(&moves);
                        moved.map(|(x, moves)| moves * x).collect()
                    });
                    Products::new(&columns, &moves, &differences(&tau), reach)
                })
            })
            .collect()
    }
}

/// The lag of one joint; `None` where it hardly moves.
fn joint_lag(
    name: &str,
    parts: &[&Products],
    slow: &[&Products],
    reach: usize,
    interval: f64,
) -> Option<JointLag> {
    let left = profile::left(parts, None)?;
    let at = profile::lowest(&left);
    let inside = at.filter(|at| (0.0..=2.0 * reach as f64).contains(at));
    let without: Option<Vec<f64>> = (0..parts.len())
        .map(|part| profile::lowest(&profile::left(parts, Some(part))?))
        .collect();
    let slow = profile::lowest(&profile::left(slow, None)?);
    let lowest = left.iter().copied().fold(f64::INFINITY, f64::min);
    let sd = inside.and(without).map(|at| {
        let count = at.len() as f64;
        let mean = at.iter().sum::<f64>() / count;
        let squares: f64 = at.iter().map(|at| (at - mean).powi(2)).sum();
        ((count - 1.0) / count * squares + PARABOLA * PARABOLA).sqrt()
    });
    let end = left.iter().position(|l| *l == lowest).unwrap_or(reach) as f64;
    Some(JointLag {
        joint: name.to_owned(),
        lag: (inside.unwrap_or(end) - reach as f64) * interval,
        slow: slow.map(|slow| (slow - reach as f64) * interval),
        sd: sd.map(|sd| sd * interval),
        left: [left[reach], lowest],
        speaks: sd.is_some() && slow.is_some() && lowest < EXPLAINED,
    })
}

/// Mean over the joints that speak, if they are more than half of those that move; what they disagree by counts, and what
/// slow differences say otherwise.
fn common(joints: &[JointLag], interval: f64) -> Option<[f64; 2]> {
    let speak: Vec<[f64; 3]> = joints
        .iter()
        .filter(|joint| joint.speaks)
        .filter_map(|joint| Some([joint.lag, joint.sd?.max(PARABOLA * interval), joint.slow?]))
        .collect();
    let alone = speak.len() == 1;
    let doubtful = |joint: &&JointLag| joint.speaks && joint.left[1] > EXPLAINED_ALONE;
    if 2 * speak.len() <= joints.len() || alone && joints.iter().any(|j| doubtful(&j)) {
        return None;
    }
    // Sum of weights and of their squares, mean lag and mean of the slow ones.
    let pooled = |between: f64| -> [f64; 4] {
        let mut sums = [0.0; 4];
        for [lag, sd, slow] in &speak {
            let weight = 1.0 / (sd * sd + between);
            let terms = [weight, weight * weight, weight * lag, weight * slow];
            sums.iter_mut()
                .zip(terms)
                .for_each(|(sum, term)| *sum += term);
        }
        [sums[0], sums[1], sums[2] / sums[0], sums[3] / sums[0]]
    };
    let [sum, squares, mean, _] = pooled(0.0);
    let q: f64 = speak
        .iter()
        .map(|[lag, sd, _]| ((lag - mean) / sd).powi(2))
        .sum();
    let beyond = q - (speak.len() - 1) as f64;
    let between = if speak.len() > 1 {
        (beyond / (sum - squares / sum)).max(0.0)
    } else {
        0.0
    };
    let [sum, _, mean, slow] = pooled(between);
    Some([mean, (1.0 / sum + (mean - slow).powi(2)).sqrt()])
}

#[cfg(test)]
mod tests;
