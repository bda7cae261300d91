//! The automatic cut-off: from the spectrum of the motion, with the encoder's noise in mind.
//!
//! 1. `f_m`, the frequency below which 99 % of the power of q̇ lies that stands clearly (10 times) above the noise floor of
//!    q; per joint over all training logs, then the largest of the joints that move.
//! 2. `f_c = max(5 Hz, 2 f_m)`. Inertial and gravity torques are products of motion, so they reach to 2 f_m and beyond;
//!    below 5 Hz friction reversals of arms blur, and experts chose 5 Hz for slow machines too.
//! 3. Lowered (not below 1.5 f_m) while the noise in q̈ would bias coefficients by more than a third of their standard
//!    deviation. A regressor with noise-to-signal ratio r shrinks its coefficient by r² and gives it the relative
//!    standard deviation r/√n, so the rule is `r √n ≤ 0.3` with n = 2.5 f_c T rows and r² = noise power of q̈ below f_c over power of q̈.
//! 4. Raised so that the kernels' ends take at most a third of the longest segment; at most 0.11 of the log's rate, so that the
//!    motion filter at 4 f_c fits below 0.45 of it.
//!
//! [`wider`] is four times that where rules 3 and 4 hold there, too.

use crate::signal::clean::correct::DerivedFrom;
use crate::signal::clean::pieces::Prepared;
use crate::signal::filter::spectrum::{Noise, Spectrum, Welch};
use rayon::prelude::*;
use std::f64::consts::PI;

/// What f_c never falls below without reason, Hz.
const USUAL_CUTOFF: f64 = 5.0;
/// A bin counts as motion from this multiple of the noise floor.
const CLEARLY: f64 = 10.0;
/// Half the width over which the lines of rounding are averaged, Hz.
const ROUNDING: f64 = 2.0;
/// Share of the velocity power below f_m.
const SHARE: f64 = 0.99;
/// r √n that is allowed.
const ALLOWED_BIAS: f64 = 0.3;
/// Highest f_c as a share of the log's rate.
const HIGHEST: f64 = 0.11;
/// A wider band than the automatic one, in f_c.
const WIDER: f64 = 4.0;

/// Noise in velocity over its rms from which friction suffers.
const NOISY: f64 = 0.02;
/// How much more noise than the change of position a logged velocity must have to be left out.
const NOISIER: f64 = 2.0;

/// Spectra of one joint in one log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointSpectra {
    /// Position.
    pub(crate) position: Spectrum,
    /// Noise of position.
    pub(crate) position_noise: Noise,
    /// Noise of logged velocity.
    pub(crate) velocity_noise: Option<Noise>,
    /// Noise of logged acceleration.
    pub(crate) acceleration_noise: Option<Noise>,
    /// Seconds of data.
    pub(crate) duration: f64,
    /// Half the width over which a bin is averaged before it counts as motion, Hz: narrow for a line, at least two bins.
    pub(crate) half_width: f64,
}

impl JointSpectra {
    /// With at least the noise of an encoder of this step in position: rounding has the variance `step² / 12`, however little of it lies where the
    /// floor is measured. In slow or periodic motion it is not white but lines, which are not to be taken for motion.
    pub(crate) fn quantised(&self, step: Option<f64>) -> Self {
        let mut all = self.clone();
        if let Some(step) = step {
            let floor = step * step / (6.0 * self.position_noise.rate);
            all.position.floor = self.position.floor.max(floor);
            all.half_width = ROUNDING;
            if self.position_noise.floor < floor {
                all.position_noise.floor = floor;
                all.position_noise.order = 0;
            }
        }
        all
    }

    /// Noise of what q̈ is made from and how many derivatives are taken of it.
    pub(crate) fn source(&self, derived: DerivedFrom) -> (Noise, i32) {
        match (self.acceleration_noise, self.velocity_noise, derived) {
            (Some(noise), _, _) => (noise, 0),
            (None, Some(noise), DerivedFrom::Velocity) => (noise, 1),
            _ => (self.position_noise, 2),
        }
    }
}

/// Spectra of every joint of a log; `None` if the log is too short.
pub(crate) fn spectra(prepared: &Prepared<'_>) -> Option<Vec<JointSpectra>> {
    let pieces = &prepared.pieces;
    let interval = prepared.interval;
    let dof = pieces.first()?.joints.len();
    let duration = pieces.iter().map(|p| p.time.len()).sum::<usize>() as f64 * interval;
    let longest = pieces.iter().map(|p| p.time.len()).max()?;
    let welch = Welch::new(longest, interval)?;
    (0..dof)
        .into_par_iter()
        .map(|joint| {
            let channels = || pieces.iter().map(move |p| &p.joints[joint]);
            let position = welch.of(channels().map(|c| &*c.q))?;
            let qd = welch.of(channels().filter_map(|c| c.qd.as_deref()));
            let qdd = welch.of(channels().filter_map(|c| c.qdd.as_deref()));
            Some(JointSpectra {
                position_noise: position.noise(0),
                velocity_noise: qd.map(|spectrum| spectrum.noise(1)),
                acceleration_noise: qdd.map(|spectrum| spectrum.noise(2)),
                position,
                duration,
                half_width: 0.0,
            })
        })
        .collect()
}

/// Whether q̈ has less noise below `cutoff` from q or from q̇; q̇ unless q is better by a factor 2 in power.
pub(crate) fn derived_from(logs: &[&JointSpectra], cutoff: f64) -> DerivedFrom {
    let power = |derived: DerivedFrom| -> f64 {
        let one = |log: &&JointSpectra| {
            let (noise, more) = log.source(derived);
            log.duration * noise.power(more, cutoff)
        };
        logs.iter().map(one).sum()
    };
    let (position, velocity) = (power(DerivedFrom::Position), power(DerivedFrom::Velocity));
    let has_velocity = logs.iter().all(|log| log.velocity_noise.is_some());
    if has_velocity && velocity <= 2.0 * position {
        DerivedFrom::Velocity
    } else {
        DerivedFrom::Position
    }
}

/// Noise below `cutoff` of a logged velocity that is not worth using, and of the change of position, rad/s or m/s: where that is by far less and the
/// logged one's is more than a small share of the motion. `None` where the logged velocity is as good, or is not in every log.
pub(crate) fn noisy_velocity(logs: &[&JointSpectra], cutoff: f64) -> Option<[f64; 2]> {
    let time: f64 = logs.iter().map(|log| log.duration).sum();
    let (mut logged, mut travel) = (0.0, 0.0);
    for log in logs {
        logged += log.duration * log.velocity_noise?.power(0, cutoff);
        travel += log.duration * log.position_noise.power(1, cutoff);
    }
    let matters = NOISY * motion_band(logs).1;
    let noise = [logged, travel].map(|energy| (energy / time).sqrt());
    (noise[0] > NOISIER * noise[1] && noise[0] > matters).then_some(noise)
}

/// Frequency f_m and rms velocity of one joint over all logs.
pub(crate) fn motion_band(logs: &[&JointSpectra]) -> (f64, f64) {
    let mut bins: Vec<(f64, f64)> = Vec::new();
    let total_time: f64 = logs.iter().map(|l| l.duration).sum();
    for log in logs {
        let spectrum = &log.position;
        for (i, &density) in spectrum.density.iter().enumerate() {
            // A running mean over five bins or more decides, so that single noise peaks do not.
            let half = 2.max((log.half_width / spectrum.width) as usize);
            let far = (i + half + 1).min(spectrum.density.len());
            let near = &spectrum.density[i.saturating_sub(half)..far];
            if near.iter().sum::<f64>() > CLEARLY * spectrum.floor * near.len() as f64 {
                let omega = 2.0 * PI * spectrum.frequency(i);
                let power = (density - spectrum.floor).max(0.0) * omega * omega * spectrum.width;
                bins.push((spectrum.frequency(i), power * log.duration / total_time));
            }
        }
    }
    bins.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = bins.iter().map(|b| b.1).sum();
    let mut sum = 0.0;
    let band = bins.iter().find(|(_, power)| {
        sum += power;
        sum >= SHARE * total
    });
    (band.map_or(0.0, |b| b.0), total.sqrt())
}

/// Noise power of q̈ below `cutoff` over its signal power, pooled over logs.
fn noise_ratio(logs: &[&JointSpectra], cutoff: f64, band: f64) -> f64 {
    let derived = derived_from(logs, cutoff);
    let noise = logs.iter().map(|log| {
        let (source, more) = log.source(derived);
        log.duration * source.power(more, cutoff)
    });
    noise.sum::<f64>() / acceleration_energy(logs, band)
}

/// Root mean square of the acceleration of one joint over all logs, rad/s² or m/s².
pub(crate) fn rms_acceleration(logs: &[&JointSpectra]) -> f64 {
    let time: f64 = logs.iter().map(|log| log.duration).sum();
    (acceleration_energy(logs, motion_band(logs).0) / time).sqrt()
}

/// ∫ q̈² over all logs, from what of position lies below 3 f_m and above its noise.
fn acceleration_energy(logs: &[&JointSpectra], band: f64) -> f64 {
    let mut signal = 0.0;
    for log in logs {
        let spectrum = &log.position;
        let below = spectrum
            .density
            .iter()
            .enumerate()
            .take_while(|(i, _)| spectrum.frequency(*i) <= 3.0 * band)
            .map(|(i, d)| {
                (d - spectrum.floor).max(0.0) * (2.0 * PI * spectrum.frequency(i)).powi(4)
            })
            .sum::<f64>();
        signal += log.duration * below * spectrum.width;
    }
    signal
}

/// The rule at the top of this file. `moving[j]` lists the spectra of a joint that moves; the longest segment is in s.
pub(crate) fn automatic(moving: &[Vec<&JointSpectra>], longest: f64, lowest_rate: f64) -> f64 {
    let bands: Vec<f64> = moving.iter().map(|logs| motion_band(logs).0).collect();
    let band = bands.iter().copied().fold(0.0, f64::max);
    let mut cutoff = (2.0 * band).max(USUAL_CUTOFF);
    let least = (1.5 * band).max(0.5);
    while cutoff > least && biased(moving, &bands, cutoff) {
        cutoff *= 0.95;
    }
    // 2 · (2.44 + 3.02/4) / f_c of borders in at most a third of the segment.
    let cutoff = cutoff.max(19.2 / longest).min(HIGHEST * lowest_rate);
    // Two digits are enough and make the same choice for logs that differ in the last bit.
    let digits = 10.0_f64.powf(1.0 - cutoff.log10().floor());
    (cutoff * digits).round() / digits
}

/// Rule 3: whether the noise in q̈ below `cutoff` would bias the coefficients of some joint.
fn biased(moving: &[Vec<&JointSpectra>], bands: &[f64], cutoff: f64) -> bool {
    moving.iter().zip(bands).any(|(logs, &band)| {
        let rows = 2.5 * cutoff * logs.iter().map(|l| l.duration).sum::<f64>();
        (noise_ratio(logs, cutoff, band) * rows).sqrt() > ALLOWED_BIAS
    })
}

/// Four times the automatic cut-off, where accelerations are known as well there and the logs are fast enough for it.
pub(crate) fn wider(moving: &[Vec<&JointSpectra>], cutoff: f64, lowest_rate: f64) -> Option<f64> {
    let wider = WIDER * cutoff;
    let fast = wider <= HIGHEST * lowest_rate;
    let bands = || -> Vec<f64> { moving.iter().map(|logs| motion_band(logs).0).collect() };
    (fast && !biased(moving, &bands(), wider)).then_some(wider)
}
