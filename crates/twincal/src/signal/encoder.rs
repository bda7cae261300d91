//! What an encoder can tell: its step, and the noise that it leaves in velocity and acceleration.

use super::cutoff::JointSpectra;
use super::fir::{MotionKernels, noise_gain};
use super::prepare::JointFacts;
use super::spectrum::Noise;
use super::travel::usual_size;
use super::{DerivedFrom, Pipeline};
use crate::error::{Code, Finding, Severity};
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
    let (mut velocity, mut acceleration, mut position) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut travel = 0.0_f64;
    for log in spectra {
        let kernels = MotionKernels::new(pipeline.motion_cutoff_hz, 1.0 / log.position_noise.rate);
        let derivatives = [&kernels.smooth, &kernels.first, &kernels.second];
        // Noise that was differenced n times and is differentiated m times more.
        let after = |noise: Noise, more: i32| {
            noise.sd() * noise_gain(derivatives[(noise.order + more).clamp(0, 2) as usize])
        };
        position = position.max(log.position_noise.sd());
        travel = travel.max(after(log.position_noise, 1));
        velocity = velocity.max(match log.velocity_noise {
            Some(noise) if has_qd => after(noise, 0),
            _ => after(log.position_noise, 1),
        });
        let (noise, more) = log.source(derived);
        acceleration = acceleration.max(after(noise, more));
    }
    if !has_qdd {
        let source = match derived {
            DerivedFrom::Velocity => "the logged velocity",
            DerivedFrom::Position => "position, twice",
        };
        findings.push(Finding::new(
            Severity::Note,
            Code::DerivedAcceleration,
            &facts.name,
            format!(
                "joint `{}`: acceleration is not logged and was derived from {source}, by the motion filter at {:.3} Hz; position noise of {}, as the spectrum has it, leaves a noise of {} in velocity and {} in acceleration (SI units, per sample)",
                facts.name, pipeline.motion_cutoff_hz, significant(position, 2), significant(velocity, 2), significant(acceleration, 2)
            ),
            0,
        )
        .with([
            ("motion_cutoff", pipeline.motion_cutoff_hz), ("position_noise", position),
            ("velocity_noise", velocity), ("acceleration_noise", acceleration),
        ]));
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
    stepping.max(3.0 * travel)
}

/// Noise that an encoder of this step leaves in velocity and acceleration after the motion filter: uniform rounding has
/// sd `step / √12`.
fn quantisation_floor(step: f64, spectra: &[&JointSpectra], pipeline: &Pipeline) -> [f64; 2] {
    let sd = step / 12.0_f64.sqrt();
    let mut floor = [0.0_f64; 2];
    for log in spectra {
        let kernels = MotionKernels::new(pipeline.motion_cutoff_hz, 1.0 / log.position_noise.rate);
        for (floor, kernel) in floor.iter_mut().zip([&kernels.first, &kernels.second]) {
            *floor = floor.max(sd * noise_gain(kernel));
        }
    }
    floor
}

/// Step of a quantised channel: the smallest change, if changes are multiples of it and many are 0 or 1 steps.
pub(crate) fn quantum<'a>(runs: impl Iterator<Item = &'a [f64]> + Clone) -> Option<f64> {
    let changes = || {
        runs.clone()
            .flat_map(|run| run.windows(2))
            .map(|pair| (pair[1] - pair[0]).abs())
    };
    // What is smaller is rounding of the file's decimals. A few glitches are no scale.
    let scale = usual_size(runs.clone().flatten());
    let step = changes()
        .filter(|c| *c > 1e-7 * scale)
        .fold(f64::INFINITY, f64::min);
    if !step.is_finite() {
        return None;
    }
    let all: usize = runs.clone().map(|run| run.len().saturating_sub(1)).sum();
    let mostly = |multiples: usize| multiples as f64 > 0.95 * all as f64;
    let (mut others, mut small) = (0, 0);
    for change in changes() {
        let units = change / step;
        small += usize::from(units < 1.5);
        // A change to or from a missing value is none.
        let multiple = (units - units.round()).abs() < (0.05 + 1e-3 * units).min(0.2);
        if !multiple {
            others += 1;
            // A smooth channel has said so long before its end.
            if !mostly(all - others) {
                return None;
            }
        }
    }
    (mostly(all - others) && small as f64 > 0.05 * all as f64).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion, and the same by an encoder of 3.8e-4 rad.
    fn smooth_and_coarse() -> (Vec<f64>, Vec<f64>) {
        let smooth: Vec<f64> = (0..2000).map(|i| (f64::from(i) * 0.003).sin()).collect();
        let coarse = smooth.iter().map(|q| (q / 3.8e-4).round() * 3.8e-4);
        let coarse = coarse.collect();
        (smooth, coarse)
    }

    /// One glitch of 1e8 rad among 2000 samples: the step is that of the encoder, and smooth data has none.
    #[test]
    fn a_glitch_is_no_encoder_step() {
        let (smooth, coarse) = smooth_and_coarse();
        for (clean, expected) in [(smooth, None), (coarse, Some(3.8e-4))] {
            let mut q = clean;
            q[1000] = 1e8;
            let step = quantum(std::iter::once(q.as_slice()));
            let near = |step: f64| expected.is_some_and(|e: f64| (step / e - 1.0).abs() < 1e-6);
            assert!(step.map_or(expected.is_none(), near), "{step:?}");
        }
    }

    #[test]
    fn the_encoder_step_is_found_and_smooth_data_has_none() {
        let (smooth, coarse) = smooth_and_coarse();
        let step = quantum(std::iter::once(coarse.as_slice())).unwrap();
        assert!((step / 3.8e-4 - 1.0).abs() < 1e-6);
        assert_eq!(quantum(std::iter::once(smooth.as_slice())), None);
        // Gaps are no steps: with many of them nothing is told.
        let mut holes = coarse;
        holes.iter_mut().step_by(10).for_each(|q| *q = f64::NAN);
        assert_eq!(quantum(std::iter::once(holes.as_slice())), None);
    }
}
