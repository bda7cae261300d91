//! A few hundred smoothed samples of a trajectory: enough to tell gross mistakes, cheap enough to try many readings.

use crate::signal::{Agreement, Pipeline, Segment, Trajectory, velocity_agreement};

/// Samples that are taken of one trajectory, at least and at most where it has as many, and of all about.
pub(super) const LEAST: usize = 100;
const MOST: usize = 800;
const OF_ALL: usize = 24_000;
/// Width of the moving average in periods of the cut-off.
const WINDOW: f64 = 0.5;

/// Squared correlation of velocity and change of position from which the two are one motion.
const SAME_MOTION: f64 = 0.99;
/// Independent samples below which a factor is not told: a second of motion looks like one of its five columns by chance.
pub(super) const LEAST_INDEPENDENT: f64 = 90.0;

/// Motion and torque at a few samples, averaged alike over half a period of the cut-off.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Sample {
    /// Samples.
    pub(super) len: usize,
    /// Half periods of the cut-off in the time of the log: how many of the samples are independent at most.
    pub(super) independent: f64,
    /// Position, velocity, acceleration, torque: `channels[k][joint][sample]`.
    pub(super) channels: [Vec<Vec<f64>>; 4],
    /// Whether the joint moves there: `moves[joint][sample]`.
    pub(super) moves: Vec<Vec<bool>>,
    /// Whether a joint's velocity is minus the change of its position, in every log in which it moves; `None` where it moves in none.
    pub(super) opposite: Vec<Option<bool>>,
    /// Slope of each joint's velocity over the change of its position, where the two are one motion; `None` elsewhere.
    pub(super) slopes: Vec<Option<f64>>,
    /// ∫ q̈ dq̇ of each joint: negative where acceleration is that of the position and velocity the opposite of its change.
    pub(super) follows: Vec<f64>,
}

impl Sample {
    /// Takes samples that are spread evenly over one of `logs` trajectories; `None` without torque.
    pub(super) fn take(pipeline: &Pipeline, trajectory: &Trajectory, logs: usize) -> Option<Self> {
        let dof = trajectory.dof;
        let total: usize = trajectory.segments.iter().map(|s| s.time.len()).sum();
        if total == 0 || trajectory.segments.iter().any(|s| s.tau.is_empty()) {
            return None;
        }
        let step = total.div_ceil((OF_ALL / logs.max(1)).clamp(LEAST, MOST));
        let agreement = velocity_agreement(trajectory, &pipeline.standstill_velocity);
        let mut sample = Self {
            len: 0,
            independent: 0.0,
            channels: std::array::from_fn(|_| vec![Vec::new(); dof]),
            moves: vec![Vec::new(); dof],
            opposite: agreement
                .iter()
                .map(|agreement| agreement.map(Agreement::is_opposite))
                .collect(),
            slopes: agreement.iter().map(|a| a.and_then(one_motion)).collect(),
            follows: vec![0.0; dof],
        };
        for segment in &trajectory.segments {
            sample.append(pipeline, segment, dof, step);
        }
        (sample.len > 0).then_some(sample)
    }

    fn append(&mut self, pipeline: &Pipeline, segment: &Segment, dof: usize, step: usize) {
        let len = segment.time.len();
        let half = if pipeline.is_off() {
            0
        } else {
            (0.5 * WINDOW / pipeline.cutoff_hz / segment.interval).round() as usize
        };
        let centres = || (half..len.saturating_sub(half)).step_by(step);
        self.len += centres().count();
        self.independent += match pipeline.is_off() {
            true => len as f64,
            false => 2.0 * pipeline.cutoff_hz * segment.interval * len as f64,
        };
        for joint in 0..dof {
            let all = joint * len..(joint + 1) * len;
            let from = [&segment.q, &segment.qd, &segment.qdd, &segment.tau];
            for (to, from) in self.channels.iter_mut().zip(from) {
                let values = &from[all.clone()];
                to[joint].extend(centres().map(|i| mean(&values[i - half..=i + half])));
            }
            let (qd, qdd) = (&segment.qd[all.clone()], &segment.qdd[all.clone()]);
            let steps = qd.windows(2).zip(qdd.windows(2));
            self.follows[joint] += steps
                .map(|(v, a)| 0.5 * (a[0] + a[1]) * (v[1] - v[0]))
                .sum::<f64>();
            let still = &segment.standstill[all];
            self.moves[joint].extend(centres().map(|i| !still[i]));
        }
    }

    /// Samples of several logs as one.
    pub(super) fn pool(samples: &[Self]) -> Self {
        let Some((first, rest)) = samples.split_first() else {
            return Self::default();
        };
        let mut all = first.clone();
        for sample in rest {
            all.len += sample.len;
            all.independent += sample.independent;
            for (to, from) in all.channels.iter_mut().zip(&sample.channels) {
                for (to, from) in to.iter_mut().zip(from) {
                    to.extend_from_slice(from);
                }
            }
            for (to, from) in all.moves.iter_mut().zip(&sample.moves) {
                to.extend_from_slice(from);
            }
            for (to, from) in all.follows.iter_mut().zip(&sample.follows) {
                *to += from;
            }
            for (to, from) in all.slopes.iter_mut().zip(&sample.slopes) {
                *to = to.or(*from);
            }
            for (to, from) in all.opposite.iter_mut().zip(&sample.opposite) {
                *to = match (*to, *from) {
                    (Some(a), Some(b)) => Some(a && b),
                    (one, other) => one.or(other),
                };
            }
        }
        all
    }
}

/// Slope of the velocity where it is the change of position times a number: their squared correlation is `slope² / (2 slope − R²)`.
fn one_motion(agreement: Agreement) -> Option<f64> {
    let Agreement { r2, slope } = agreement;
    let correlation = slope * slope / (2.0 * slope - r2);
    (slope > 0.0 && correlation > SAME_MOTION).then_some(slope)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
