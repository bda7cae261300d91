//! How far two sets of inertias are apart: by the torque between them.

use crate::likelihood::JointNoise;
use crate::rigid_body::Link;
use crate::robot::{
    BLOCK, Motion, Regressor, RegressorBlock, Robot, nominal_torque, to_body_frame,
};

/// Share of a joint's rms torque below which no noise is believed: a metric needs no more digits.
const LEAST_NOISE: f64 = 1e-3;

/// T of `½ δᵀ T δ`, δ the change of the ten parameters of every link, each in its link's frame (10 L × 10 L, row-major).
///
/// ```text
/// T = Σ_j n_eff,j/σ_j² · mean_s r_js r_jsᵀ
/// ```
/// r_js: what each parameter adds to the torque of joint j in state s (the regressor's row); n_eff,j/σ_j²: what the training rows
/// say of torque on that joint, σ_j at least a thousandth of its torque. On states spread like the training rows it would be the likelihood's part of the
/// posterior's metric; on states spread evenly over their range it is the torque that an exported model may be asked for.
///
/// All ten parameters count, also those without a component in the twin: what makes a body of first moments that were found is
/// a tensor, which slow motion does not show.
pub(super) fn torque_metric(
    robot: &Robot,
    noise: &[JointNoise],
    states: Motion<'_>,
    links: &[Link<'_>],
) -> Vec<f64> {
    let size = 10 * links.len();
    let mut metric = vec![0.0; size * size];
    let homes: Vec<Option<Home>> = links
        .iter()
        .map(|link| {
            let (body, placement) = robot.body_of_link(link.name)?;
            let map = to_body_frame(&placement);
            Some(Home { body, map })
        })
        .collect();
    let weights = weights(robot, noise, states);
    let regressor = Regressor::new(robot);
    let mut block = regressor.block(robot);
    let mut row = vec![0.0; size];
    for start in (0..states.len).step_by(BLOCK) {
        let samples = start..(start + BLOCK).min(states.len);
        regressor.evaluate(robot, states, samples.clone(), &mut block);
        for (joint, &weight) in weights.iter().enumerate() {
            let own = regressor.pairs().iter().enumerate();
            let own: Vec<_> = own.filter(|(_, pair)| pair.coordinate == joint).collect();
            for sample in 0..samples.len() {
                row.fill(0.0);
                for (row, home) in row.chunks_exact_mut(10).zip(&homes) {
                    let Some(home) = home else { continue };
                    for (index, _) in own.iter().filter(|(_, pair)| pair.body == home.body) {
                        home.add(&block, *index, sample, row);
                    }
                }
                add_square(&mut metric, &row, weight);
            }
        }
    }
    metric
}

/// n_eff/σ² of every joint, per state.
fn weights(robot: &Robot, noise: &[JointNoise], states: Motion<'_>) -> Vec<f64> {
    let mut torque = vec![0.0; states.q.len()];
    nominal_torque(robot, states, &mut torque);
    let joints = torque.chunks_exact(states.len).zip(noise);
    joints
        .map(|(torque, noise)| {
            let mean = torque.iter().map(|t| t * t).sum::<f64>() / states.len as f64;
            let variance = (noise.sigma * noise.sigma).max(LEAST_NOISE * LEAST_NOISE * mean);
            let weight = noise.n_eff / (variance * states.len as f64);
            if weight.is_finite() { weight } else { 0.0 }
        })
        .collect()
}

/// Where a link is: its body, and that body's parameters of a unit of each of the link's own.
struct Home {
    body: usize,
    map: [[f64; 10]; 10],
}

impl Home {
    /// Adds the torque of each of the link's parameters in one sample.
    fn add(&self, block: &RegressorBlock, pair: usize, sample: usize, row: &mut [f64]) {
        for (parameter, map) in self.map.iter().enumerate() {
            let torque = block.column(pair, parameter)[sample];
            for (row, map) in row.iter_mut().zip(map) {
                *row += torque * map;
            }
        }
    }
}

/// T += weight · row rowᵀ.
fn add_square(metric: &mut [f64], row: &[f64], weight: f64) {
    for (a, metric) in row.iter().zip(metric.chunks_exact_mut(row.len())) {
        if *a != 0.0 {
            for (metric, b) in metric.iter_mut().zip(row) {
                *metric += weight * a * b;
            }
        }
    }
}
