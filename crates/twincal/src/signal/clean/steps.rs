//! What the channels of a log resolve: the step by which each of them changes (case 27).

use super::travel::usual_size;
use crate::error::Result;
use crate::robot::Robot;
use crate::signal::log::long::Log;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Steps of one joint's channels; `None` for a channel that is not quantised, or not logged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Steps {
    /// Name of the joint.
    pub joint: String,
    /// Of position, rad or m.
    pub position: Option<f64>,
    /// Of velocity, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Of torque, N·m or N.
    pub torque: Option<f64>,
}

/// Steps of every moving joint's channels in a log.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn steps(robot: &Robot, log: &Log<'_>) -> Result<Vec<Steps>> {
    let names = robot.joint_names();
    let mut found = vec![[const { Vec::new() }; 3]; names.len()];
    log.until(|recording| {
        let joints = found.par_iter_mut().zip(&recording.joints);
        joints.for_each(|(found, channels)| {
            let values = [
                Some(&channels.q),
                channels.qd.as_ref(),
                channels.tau.as_ref(),
            ];
            for (steps, values) in found.iter_mut().zip(values) {
                // A channel at rest says nothing.
                if let Some(values) = values.filter(|values| changes(values)) {
                    steps.push(quantum(std::iter::once(values.as_slice())));
                }
            }
        });
        false
    })?;
    let joints = names.into_iter().zip(&found);
    Ok(joints
        .map(|(name, found)| {
            let [position, velocity, torque] = found.each_ref().map(|steps| common_step(steps));
            Steps {
                joint: name.to_owned(),
                position,
                velocity,
                torque,
            }
        })
        .collect())
}

/// Whether a channel ever changes.
pub(in crate::signal) fn changes(values: &[f64]) -> bool {
    values.iter().any(|value| *value != values[0])
}

/// The step of a channel from that of each part of a log: the smallest, if at least every second part has one.
pub(in crate::signal) fn common_step(steps: &[Option<f64>]) -> Option<f64> {
    let known = || steps.iter().flatten().copied();
    let count = known().count();
    (count > 0 && 2 * count >= steps.len()).then(|| known().fold(f64::INFINITY, f64::min))
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
