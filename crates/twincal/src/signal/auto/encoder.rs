//! What noise an encoder leaves in velocity and acceleration, and the slowest motion that it resolves.

use super::cutoff::JointSpectra;
use crate::error::{Code, Finding, Severity};
use crate::signal::clean::correct::DerivedFrom;
use crate::signal::filter::fir::{MotionKernels, noise_gain};
use crate::signal::filter::pipeline::Pipeline;
use crate::signal::filter::spectrum::Noise;
use crate::signal::log::joints::JointFacts;
use crate::words::significant;

/// What is known of the encoder of a joint before anything is filtered.
pub(crate) struct Encoder<'a> {
    /// Its joint.
    pub(crate) facts: &'a JointFacts,
    /// Whether all logs hold its velocity, and its acceleration.
    pub(crate) logged: [bool; 2],
    /// Its step, rad or m, if it has one.
    pub(crate) step: Option<f64>,
}

/// Velocity that the encoder resolves after the motion filter; says what noise the derivatives carry.
pub(crate) fn velocity_resolution(
    joint: usize,
    encoder: &Encoder<'_>,
    spectra: &[&JointSpectra],
    pipeline: &Pipeline,
    findings: &mut Vec<Finding>,
) -> f64 {
    let Encoder {
        facts,
        logged: [has_qd, has_qdd],
        step,
    } = *encoder;
    let [velocity_from, derived] = pipeline.sources(joint);
    let has_qd = has_qd && velocity_from == DerivedFrom::Velocity;
    let noise = FilteredNoise::of(has_qd, derived, spectra, pipeline);
    if !has_qdd {
        findings.push(noise.finding(facts, derived, pipeline));
    }
    let stepping = step.map_or(0.0, |step| 4.0 * pipeline.motion_cutoff_hz * step);
    if let Some(step) = step.filter(|_| stepping > pipeline.coulomb_velocity) {
        let [velocity, acceleration] = quantisation_floor(step, spectra, pipeline);
        findings.push(Finding::new(
            Severity::Warning,
            Code::QuantisedEncoder,
            &facts.name,
            format!(
                "joint `{}`: the encoder steps by {}: quantisation alone leaves a noise of {} in velocity and {} in acceleration derived from \
                 position (SI units, after the motion filter; its whole noise may be more), and one step within the filter's window is {} per s, below which motion cannot be told from standstill; log the encoder's full resolution",
                facts.name, significant(step, 3), significant(velocity, 2), significant(acceleration, 2), significant(stepping, 3)
            ),
            0,
        )
        .with([
            ("step", step), ("velocity_noise", velocity), ("acceleration_noise", acceleration),
            ("step_velocity", stepping),
        ]));
    }
    stepping.max(3.0 * noise.of_position)
}

/// Noise after the motion filter, per sample: the most of all logs.
#[derive(Default)]
struct FilteredNoise {
    position: f64,
    velocity: f64,
    acceleration: f64,
    /// That of velocity derived from position.
    of_position: f64,
}

impl FilteredNoise {
    /// `has_qd`: velocity is logged; `derived`: what acceleration is the derivative of.
    fn of(
        has_qd: bool,
        derived: DerivedFrom,
        spectra: &[&JointSpectra],
        pipeline: &Pipeline,
    ) -> Self {
        let mut most = Self::default();
        let mut gains = Gains::default();
        for log in spectra {
            let gains = gains.of(log, pipeline);
            // Noise that was differenced n times and is differentiated m times more.
            let after = |noise: Noise, more: i32| {
                noise.sd() * gains[(noise.order + more).clamp(0, 2) as usize]
            };
            most.position = most.position.max(log.position_noise.sd());
            most.of_position = most.of_position.max(after(log.position_noise, 1));
            most.velocity = most.velocity.max(match log.velocity_noise {
                Some(noise) if has_qd => after(noise, 0),
                _ => after(log.position_noise, 1),
            });
            let (noise, more) = log.source(derived);
            most.acceleration = most.acceleration.max(after(noise, more));
        }
        most
    }

    /// That acceleration is derived, and what noise is in it.
    fn finding(&self, facts: &JointFacts, derived: DerivedFrom, pipeline: &Pipeline) -> Finding {
        let source = match derived {
            DerivedFrom::Velocity => "the logged velocity",
            DerivedFrom::Position => "position, twice",
        };
        Finding::new(
            Severity::Note,
            Code::DerivedAcceleration,
            &facts.name,
            format!(
                "joint `{}`: acceleration is not logged and was derived from {source}, by the motion filter at {:.3} Hz; position noise of {}, as the spectrum has it, leaves a noise of {} in velocity and {} in acceleration (SI units, per sample)",
                facts.name, pipeline.motion_cutoff_hz, significant(self.position, 2), significant(self.velocity, 2), significant(self.acceleration, 2)
            ),
            0,
        )
        .with([
            ("motion_cutoff", pipeline.motion_cutoff_hz), ("position_noise", self.position),
            ("velocity_noise", self.velocity), ("acceleration_noise", self.acceleration),
        ])
    }
}

/// Noise that an encoder of this step leaves in velocity and acceleration after the motion filter: uniform rounding has
/// sd `step / √12`.
fn quantisation_floor(step: f64, spectra: &[&JointSpectra], pipeline: &Pipeline) -> [f64; 2] {
    let sd = step / 12.0_f64.sqrt();
    let mut floor = [0.0_f64; 2];
    let mut gains = Gains::default();
    for log in spectra {
        let [_, first, second] = gains.of(log, pipeline);
        for (floor, gain) in floor.iter_mut().zip([first, second]) {
            *floor = floor.max(sd * gain);
        }
    }
    floor
}

/// What the motion filter and its two derivatives make of white noise, at the rate of the log before: logs of one robot mostly have one rate.
#[derive(Default)]
struct Gains {
    known: Option<(f64, [f64; 3])>,
}

impl Gains {
    fn of(&mut self, log: &JointSpectra, pipeline: &Pipeline) -> [f64; 3] {
        let rate = log.position_noise.rate;
        if let Some((_, gains)) = self.known.filter(|(known, _)| *known == rate) {
            return gains;
        }
        let kernels = MotionKernels::new(pipeline.motion_cutoff_hz, 1.0 / rate);
        let gains = [&kernels.smooth, &kernels.first, &kernels.second].map(|own| noise_gain(own));
        self.known = Some((rate, gains));
        gains
    }
}
