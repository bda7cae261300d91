//! How long a step is, so that one of length 1 breaks no limit: Dikin's ellipsoid about a motion.
//!
//! ```text
//! H = Σ_k D_kᵀ diag(1/s²) D_k + Σ_near g gᵀ      D_k: k-th difference of control points, s: what is left to its two limits
//!                                                g: slope of ln(distance beyond the margin) over the control points
//! ```
//! Control points of one time stand together, joint by joint: H is a band.
//!
//! # Source
//! Affine scaling: Dikin 1967, Barnes 1986.

use super::clearance::NearSlope;
use super::spline::{DEGREE, HELD, Spline, StateWeights};

/// Least distance from a limit that the metric sees, as a share of its range.
const LEAST: f64 = 1e-6;

/// H of the control points that move.
pub(super) struct Metric {
    joints: usize,
    /// Control points of a joint that move.
    inner: usize,
    /// Below the diagonal.
    width: usize,
    /// Lower triangle, `[row * (width + 1) + column − row + width]`; row: `point * joints + joint`.
    band: Vec<f64>,
}

impl Metric {
    /// Of the limits on position, velocity, acceleration and jerk of every joint.
    pub(super) fn new(splines: &[Spline], bounds: &[[[f64; 2]; 4]], inner: usize) -> Self {
        let joints = splines.len();
        let width = (DEGREE + 1) * joints - 1;
        let mut metric = Self {
            joints,
            inner,
            width,
            band: vec![0.0; inner * joints * (width + 1)],
        };
        for (joint, (spline, bounds)) in splines.iter().zip(bounds).enumerate() {
            metric.add_limits(joint, spline, bounds);
        }
        metric
    }

    fn add_limits(&mut self, joint: usize, spline: &Spline, bounds: &[[f64; 2]; 4]) {
        let mut stencil = vec![1.0];
        for (order, [low, high]) in bounds.iter().enumerate() {
            if order > 0 {
                let before = stencil.iter().map(|w| -w / spline.span).chain([0.0]);
                let after = std::iter::once(0.0).chain(stencil.iter().map(|w| w / spline.span));
                stencil = before.zip(after).map(|(a, b)| a + b).collect();
            }
            let least = LEAST * (high - low);
            for (first, x) in spline.derivative(order).iter().enumerate() {
                let left = [(high - x).max(least), (x - low).max(least)];
                let weight = left[0].powi(-2) + left[1].powi(-2);
                for (i, a) in stencil.iter().enumerate() {
                    for (j, b) in stencil.iter().enumerate() {
                        self.add([first + i, first + j], [joint; 2], weight * a * b);
                    }
                }
            }
        }
    }

    /// Adds g gᵀ of something near, at a moment of a span.
    pub(super) fn add_near(&mut self, near: &NearSlope, span: usize, weights: &StateWeights) {
        let mut own = [0.0; DEGREE + 1];
        weights.add_transposed([1.0, 0.0, 0.0], 1.0, &mut own);
        for (i, a) in own.iter().enumerate() {
            for (j, b) in own.iter().enumerate() {
                for (one, g) in near.slopes.iter().enumerate() {
                    for (other, h) in near.slopes.iter().enumerate() {
                        self.add([span + i, span + j], [one, other], a * b * g * h);
                    }
                }
            }
        }
    }

    /// Adds to the entry of two control points, where both move and it is in the lower triangle.
    fn add(&mut self, points: [usize; 2], joints: [usize; 2], value: f64) {
        let [row, column] = [0, 1].map(|at| {
            let point = points[at].checked_sub(HELD);
            let moves = point.filter(|&point| point < self.inner);
            moves.map(|point| point * self.joints + joints[at])
        });
        if let (Some(row), Some(column)) = (row, column)
            && column <= row
        {
            self.band[row * (self.width + 1) + column + self.width - row] += value;
        }
    }

    /// H⁻¹ g, joint after joint; g as it is where H has no Cholesky factor.
    pub(super) fn scaled(mut self, gradient: &[f64]) -> Vec<f64> {
        let mut x = self.by_time(gradient);
        if !self.factorise() {
            return gradient.to_vec();
        }
        let (size, width) = (x.len(), self.width);
        for row in 0..size {
            let first = row.saturating_sub(width);
            let known: f64 = (first..row).map(|k| self.at(row, k) * x[k]).sum();
            x[row] = (x[row] - known) / self.at(row, row);
        }
        for row in (0..size).rev() {
            let last = (row + width).min(size - 1);
            let known: f64 = (row + 1..=last).map(|k| self.at(k, row) * x[k]).sum();
            x[row] = (x[row] - known) / self.at(row, row);
        }
        let joints = 0..self.joints;
        let of = |joint| (0..self.inner).map(move |point| (point, joint));
        joints
            .flat_map(of)
            .map(|(point, joint)| x[point * self.joints + joint])
            .collect()
    }

    /// L in place of H.
    fn factorise(&mut self) -> bool {
        let (size, width) = (self.inner * self.joints, self.width);
        for row in 0..size {
            let first = row.saturating_sub(width);
            for column in first..=row {
                let from = first.max(column.saturating_sub(width));
                let sum: f64 = (from..column)
                    .map(|k| self.at(row, k) * self.at(column, k))
                    .sum();
                let rest = self.at(row, column) - sum;
                let value = match row == column {
                    true if rest > 0.0 => rest.sqrt(),
                    true => return false,
                    false => rest / self.at(column, column),
                };
                self.band[row * (width + 1) + column + width - row] = value;
            }
        }
        true
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.band[row * (self.width + 1) + column + self.width - row]
    }

    /// Numbers joint after joint in the order of the band.
    fn by_time(&self, numbers: &[f64]) -> Vec<f64> {
        let of = |point: usize| (0..self.joints).map(move |joint| joint * self.inner + point);
        (0..self.inner).flat_map(of).map(|at| numbers[at]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::spline::steps;
    use crate::linear_algebra::{Cholesky, dot};
    use crate::random::Random;

    const BOUNDS: [[f64; 2]; 4] = [[-1.0, 1.4], [-1.7, 1.7], [-6.0, 6.0], [-70.0, 70.0]];

    fn wavy(spans: usize, phase: f64) -> Spline {
        let mut spline = Spline::at(0.1, spans, 0.25);
        let last = spline.points.len() - HELD;
        for (k, point) in spline.points[HELD..last].iter_mut().enumerate() {
            *point += 0.3 * (0.4 * k as f64 + phase).sin().powi(2) * (k as f64).min(1.0);
        }
        spline
    }

    /// Dikin's ellipsoid lies within the limits, whatever the direction.
    #[test]
    fn a_step_of_length_one_breaks_no_limit() {
        let (spans, mut random) = (14, Random::new(7, 0));
        let spline = wavy(spans, 0.0);
        let inner = spans + DEGREE - 2 * HELD;
        let metric = Metric::new(std::slice::from_ref(&spline), &[BOUNDS], inner);
        for _ in 0..200 {
            let own: Vec<f64> = (0..inner).map(|_| random.normal()).collect();
            let of = |i: usize, j: usize| {
                let (row, column) = (i.max(j), i.min(j));
                let near = row - column <= metric.width;
                if near { metric.at(row, column) } else { 0.0 }
            };
            let square: f64 = (0..inner)
                .flat_map(|i| (0..inner).map(move |j| (i, j)))
                .map(|(i, j)| own[i] * of(i, j) * own[j])
                .sum();
            let mut moved = vec![0.0; spline.points.len()];
            for (to, x) in moved[HELD..HELD + inner].iter_mut().zip(&own) {
                *to = x / square.sqrt();
            }
            let [low, high] =
                steps(&spline, &moved, &BOUNDS).expect("the spline is within its bounds");
            assert!(low <= -1.0 && high >= 1.0, "{low} {high}");
        }
    }

    /// H⁻¹ g is that of H as a whole, with what is near; along g of something near the step is shorter than without it.
    #[test]
    fn the_band_is_solved_as_the_whole_matrix() {
        let (spans, mut random) = (12, Random::new(3, 0));
        let splines = [wavy(spans, 0.0), wavy(spans, 1.0)];
        let inner = spans + DEGREE - 2 * HELD;
        let of = || Metric::new(&splines, &[BOUNDS; 2], inner);
        let gradient: Vec<f64> = (0..2 * inner).map(|_| random.normal()).collect();
        let far = of().scaled(&gradient);
        let mut metric = of();
        let near = NearSlope {
            state: 0,
            slopes: vec![30.0, -20.0],
        };
        metric.add_near(&near, 6, &StateWeights::at(0.3));
        let size = 2 * inner;
        let mut whole = vec![0.0; size * size];
        for row in 0..size {
            for column in row.saturating_sub(metric.width)..=row {
                let places = [row, column].map(|at| (at % 2) * inner + at / 2);
                whole[places[0] * size + places[1]] = metric.at(row, column);
                whole[places[1] * size + places[0]] = metric.at(row, column);
            }
        }
        let mut wanted = gradient.clone();
        Cholesky::new(&whole, size)
            .expect("H is positive definite")
            .solve(&mut wanted);
        let found = metric.scaled(&gradient);
        let length = dot(&wanted, &wanted).sqrt();
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!((found - wanted).abs() < 1e-9 * length, "{found} {wanted}");
        }
        assert!(dot(&gradient, &found) < dot(&gradient, &far));
    }
}
