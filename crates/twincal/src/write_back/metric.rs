//! How far two sets of inertias are apart: by the torque between them.

use super::projection::Link;
use crate::likelihood::JointNoise;
use crate::robot::{BLOCK, Motion, Regressor, RegressorBlock, Robot, to_body_frame};

/// M of `½ δᵀ M δ`, δ the change of the ten parameters of every link, each in its link's frame (10 L × 10 L, row-major).
///
/// ```text
/// M = Σ_j n_eff,j/σ_j² · mean_s r_js r_jsᵀ  +  diag(1/unit²)
/// ```
/// r_js: what each parameter adds to the torque of joint j in state s (the regressor's row); n_eff,j/σ_j²: what the training rows
/// say of torque on that joint. With states as the training rows are it is the likelihood's part of the posterior's metric. The
/// second part is weak: a parameter that no torque shows moves as little as it can in its link's own units.
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
    for (k, unit) in links.iter().flat_map(Link::units).enumerate() {
        metric[k * (size + 1)] = unit.powi(-2);
    }
    let homes: Vec<Option<Home>> = links
        .iter()
        .map(|link| {
            let (body, placement) = robot.body_of_link(link.name)?;
            let map = to_body_frame(&placement);
            Some(Home { body, map })
        })
        .collect();
    let regressor = Regressor::new(robot);
    let mut block = regressor.block(robot);
    let mut row = vec![0.0; size];
    for start in (0..states.len).step_by(BLOCK) {
        let samples = start..(start + BLOCK).min(states.len);
        regressor.evaluate(robot, states, samples.clone(), &mut block);
        for (joint, noise) in noise.iter().enumerate() {
            let weight = noise.n_eff / (noise.sigma * noise.sigma * states.len as f64);
            if !(weight > 0.0 && weight.is_finite()) {
                continue;
            }
            for sample in 0..samples.len() {
                row.fill(0.0);
                for (pair, known) in regressor.pairs().iter().enumerate() {
                    let here = |home: &&Home| home.body == known.body;
                    for (own, home) in row.chunks_exact_mut(10).zip(&homes) {
                        if known.coordinate == joint
                            && let Some(home) = home.as_ref().filter(here)
                        {
                            home.add(&block, pair, sample, own);
                        }
                    }
                }
                add_square(&mut metric, &row, weight);
            }
        }
    }
    metric
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

/// M += weight · row rowᵀ.
fn add_square(metric: &mut [f64], row: &[f64], weight: f64) {
    for (a, metric) in row.iter().zip(metric.chunks_exact_mut(row.len())) {
        if *a != 0.0 {
            for (metric, b) in metric.iter_mut().zip(row) {
                *metric += weight * a * b;
            }
        }
    }
}
