//! The history channels of a trajectory, made of its smooth motion and of what its log says of temperature.

use super::history::{
    CHANNELS, JointHistory, STOPS, Warmth, known_temperatures, stop, temperature_at,
};
use super::pipeline::Pipeline;
use super::trajectory::Trajectory;
use crate::error::{Code, Finding, Severity};
use crate::lanes::tanh;
use crate::signal::log::recording::Recording;
use rayon::prelude::*;

impl Pipeline {
    /// History channels of a joint.
    pub(crate) fn channels(&self) -> usize {
        if self.history.is_empty() { 0 } else { CHANNELS }
    }

    /// Adds the history channels of every segment and masks what comes before an operator's state is known. `start`: first stamp of the log
    /// that this is a part of, s.
    pub(super) fn remember(
        &self,
        log: &Recording,
        start: f64,
        trajectory: &mut Trajectory,
        findings: &mut Vec<Finding>,
    ) {
        if self.history.len() != trajectory.dof {
            return;
        }
        let temperatures = self.temperatures(log, findings);
        for segment in &mut trajectory.segments {
            let len = segment.time.len();
            segment.history = vec![0.0; trajectory.dof * CHANNELS * len];
            let of_joints = (segment.history.par_chunks_exact_mut(CHANNELS * len))
                .zip(segment.standstill.par_chunks_exact_mut(len))
                .zip(&self.history)
                .zip(&temperatures)
                .enumerate();
            let (q, qd, time) = (&segment.q, &segment.qd, &segment.time);
            of_joints.for_each(|(joint, (((channels, masked), history), temperature))| {
                let own = joint * len..(joint + 1) * len;
                let (stops, warmth) = channels.split_at_mut(STOPS * len);
                let (warmth, later) = warmth.split_at_mut(len);
                self.stops(history, (&q[own.clone()], &qd[own]), stops, masked);
                match history.warmth {
                    Some(Warmth::Time {
                        constant,
                        mean,
                        later_mean,
                    }) => {
                        for ((w, later), t) in warmth.iter_mut().zip(later).zip(time) {
                            let since = (t - start) / constant;
                            let left = (-since).exp();
                            (*w, *later) = (left - mean, since * left - later_mean);
                        }
                    }
                    Some(Warmth::Temperature { mean, sd }) => {
                        if let Some(known) = temperature {
                            let of = |t: &f64| (temperature_at(known, *t) - mean) / sd;
                            warmth.iter_mut().zip(time).for_each(|(w, t)| *w = of(t));
                        }
                    }
                    None => {}
                }
            });
        }
    }

    /// What the log says of each joint's temperature, as stamps and values; a warning where a joint's friction needs it and it is missing.
    fn temperatures(
        &self,
        log: &Recording,
        findings: &mut Vec<Finding>,
    ) -> Vec<Option<Vec<(f64, f64)>>> {
        let temperatures: Vec<_> = (self.history.iter().zip(&log.joints))
            .map(|(joint, channels)| match joint.warmth {
                Some(Warmth::Temperature { .. }) => {
                    known_temperatures(&log.time, &channels.temperature)
                }
                _ => None,
            })
            .collect();
        let asks = |joint: &JointHistory| matches!(joint.warmth, Some(Warmth::Temperature { .. }));
        let cold = self.history.iter().zip(&temperatures);
        let cold = cold.filter(|(joint, known)| asks(joint) && known.is_none());
        let cold = cold.count() as u64;
        if cold > 0 {
            findings.push(Finding::new(
                Severity::Warning,
                Code::TemperatureMissing,
                &log.name,
                format!("the log has no temperature of {cold} joints whose friction changes with it: the training logs' mean is taken"),
                cold,
            ));
        }
        temperatures
    }

    /// Channels of a joint's stop operators; masks the samples before all of them are known.
    fn stops(
        &self,
        history: &JointHistory,
        (q, qd): (&[f64], &[f64]),
        channels: &mut [f64],
        masked: &mut [bool],
    ) {
        if history.thresholds.is_empty() {
            return;
        }
        let mut sense = qd.to_vec();
        directions(&mut sense, self.coulomb_velocity);
        let mut known = 0;
        for (r, channel) in history
            .thresholds
            .iter()
            .zip(channels.chunks_exact_mut(q.len()))
        {
            known = known.max(stop(q, *r, channel));
            let both = channel.iter_mut().zip(&sense);
            both.for_each(|(e, sense)| *e -= sense);
        }
        masked[..known].fill(true);
    }
}

/// Rates to tanh(q̇/v_s), or their signs for v_s = 0.
fn directions(rates: &mut [f64], velocity: f64) {
    if velocity > 0.0 {
        rates.iter_mut().for_each(|rate| *rate /= velocity);
        return pulp::Arch::new().dispatch(Tanh(rates));
    }
    for rate in rates.iter_mut().filter(|rate| **rate != 0.0) {
        *rate = rate.signum();
    }
}

/// Numbers to their hyperbolic tangents.
struct Tanh<'a>(&'a mut [f64]);

impl pulp::WithSimd for Tanh<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let (lanes, rest) = S::as_mut_simd_f64s(self.0);
        lanes.iter_mut().for_each(|x| *x = tanh(simd, *x));
        rest.iter_mut().for_each(|x| *x = x.tanh());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slow sliding in either direction: the channel is 0 up to the width of tanh.
    #[test]
    fn a_channel_is_zero_while_the_joint_slides_on() {
        let len = 1000;
        let q: Vec<f64> = (0..len).map(|i| 0.3e-3 * f64::from(i)).collect();
        let qd = vec![0.3; len as usize];
        let pipeline = Pipeline {
            coulomb_velocity: 0.02,
            ..Pipeline::off(1)
        };
        let history = JointHistory {
            thresholds: vec![1.5e-3, 5e-3, 15e-3],
            warmth: None,
        };
        let (mut channels, mut masked) = (vec![0.0; 3 * len as usize], vec![false; len as usize]);
        pipeline.stops(&history, (&q, &qd), &mut channels, &mut masked);
        let known = masked.iter().position(|masked| !masked).unwrap_or(0);
        assert!(
            (99..=102).contains(&known),
            "30 mrad at 0.3 mrad a sample: {known}"
        );
        for channel in channels.chunks_exact(len as usize) {
            assert!(channel[known..].iter().all(|h| h.abs() < 1e-9));
        }
    }
}
