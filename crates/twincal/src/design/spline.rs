//! Joint motion as a uniform B-spline of degree five: its control points bound position and derivatives everywhere, not at samples alone.
//!
//! ```text
//! q(t) = Σ_i c_i B₅(t/h − i)      q̇ from Δc/h     q̈ from Δ²c/h²     jerk from Δ³c/h³
//! every value lies between the smallest and the largest control point of its spline, degree by degree (convex hull)
//! ```
//! The first and the last five control points of a joint are equal: at both ends the joint rests, with no velocity, acceleration or jerk.

/// Degree of the spline.
pub(super) const DEGREE: usize = 5;
/// Control points at either end that stay at the start position.
pub(super) const HELD: usize = DEGREE;
/// Samples of a span in the search.
pub(super) const SAMPLES: usize = 4;
/// Length of a span, s, where the motion is long enough.
pub(super) const SPAN: f64 = 0.25;

/// Motion of one joint.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spline {
    /// Control points, spans + 5.
    pub(super) points: Vec<f64>,
    /// Length of a span, s.
    pub(super) span: f64,
}

impl Spline {
    /// At rest at a position.
    pub(super) fn at(position: f64, spans: usize, span: f64) -> Self {
        Self {
            points: vec![position; spans + DEGREE],
            span,
        }
    }

    /// Position, velocity and acceleration at a place of a span: exactly 0 where control points are equal.
    pub(super) fn state(&self, span: usize, weights: &StateWeights) -> [f64; 3] {
        let own = &self.points[span..span + DEGREE + 1];
        let first: [f64; DEGREE] = std::array::from_fn(|i| (own[i + 1] - own[i]) / self.span);
        let second: [f64; DEGREE - 1] =
            std::array::from_fn(|i| (first[i + 1] - first[i]) / self.span);
        let sum = |weights: &[f64], points: &[f64]| -> f64 {
            weights.iter().zip(points).map(|(w, c)| w * c).sum()
        };
        [
            sum(&weights.position, own),
            sum(&weights.velocity, &first),
            sum(&weights.acceleration, &second),
        ]
    }

    /// Control points of the `order`-th derivative.
    pub(super) fn derivative(&self, order: usize) -> Vec<f64> {
        let mut points = self.points.clone();
        for _ in 0..order {
            points = points
                .windows(2)
                .map(|c| (c[1] - c[0]) / self.span)
                .collect();
        }
        points
    }
}

/// Weights of the control points of a span on position, and of their differences on velocity and acceleration.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StateWeights {
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl StateWeights {
    /// At the middle of a sample of the search.
    pub(super) fn of_sample(sample: usize) -> Self {
        Self::at((sample as f64 + 0.5) / SAMPLES as f64)
    }

    /// Adds to slopes over the control points of a span what slopes over position, velocity and acceleration are of them.
    pub(super) fn add_transposed(&self, [q, qd, qdd]: [f64; 3], span: f64, points: &mut [f64]) {
        for (point, weight) in points.iter_mut().zip(&self.position) {
            *point += q * weight;
        }
        for (i, weight) in self.velocity.iter().enumerate() {
            let slope = qd * weight / span;
            points[i] -= slope;
            points[i + 1] += slope;
        }
        for (i, weight) in self.acceleration.iter().enumerate() {
            let slope = qdd * weight / (span * span);
            points[i] += slope;
            points[i + 1] -= 2.0 * slope;
            points[i + 2] += slope;
        }
    }

    /// At a share of a span, 0 to 1.
    pub(super) fn at(part: f64) -> Self {
        Self {
            position: weights(DEGREE, part),
            velocity: weights(DEGREE - 1, part),
            acceleration: weights(DEGREE - 2, part),
        }
    }
}

/// Values of the degree + 1 uniform B-splines that are not 0 in a span, by de Boor's recursion.
fn weights(degree: usize, part: f64) -> Vec<f64> {
    let mut weights = vec![1.0];
    for own in 1..=degree {
        let mut next = vec![0.0; own + 1];
        for (i, weight) in weights.iter().enumerate() {
            // Of the i-th spline of the degree below the support begins own − 1 − i spans before this one.
            let before = (own - 1 - i) as f64 + part;
            next[i] += weight * (own as f64 - before) / own as f64;
            next[i + 1] += weight * before / own as f64;
        }
        weights = next;
    }
    weights
}

/// Steps along a direction of control points that keep a joint within bounds on position, velocity, acceleration and jerk.
///
/// `bounds[order]` is for the `order`-th derivative. Empty where not even 0 is within.
pub(super) fn steps(
    spline: &Spline,
    direction: &[f64],
    bounds: &[[f64; 2]; 4],
) -> Option<[f64; 2]> {
    let moved = Spline {
        points: direction.to_vec(),
        span: spline.span,
    };
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for (order, [low, high]) in bounds.iter().enumerate() {
        let (own, by) = (spline.derivative(order), moved.derivative(order));
        for (c, d) in own.iter().zip(&by) {
            if *d == 0.0 {
                continue;
            }
            let ends = [(low - c) / d, (high - c) / d];
            range[0] = range[0].max(ends[0].min(ends[1]));
            range[1] = range[1].min(ends[0].max(ends[1]));
        }
    }
    (range[0] <= range[1]).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the cubic at a knot are (1, 4, 1)/6, of the quintic (1, 26, 66, 26, 1)/120 (de Boor 1978), and sums are 1.
    #[test]
    fn weights_are_those_of_the_textbook() {
        let near = |a: &[f64], b: &[f64]| {
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() < 1e-14, "{a} {b}");
            }
        };
        near(&weights(3, 0.0), &[1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0]);
        let quintic = [1.0, 26.0, 66.0, 26.0, 1.0, 0.0].map(|w| w / 120.0);
        near(&weights(5, 0.0), &quintic);
        for part in [0.1, 0.37, 0.9] {
            assert!((weights(5, part).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
    }

    /// Derivatives are those of finite differences, and all stay within the hull of their control points.
    #[test]
    fn states_are_smooth_and_within_their_control_points() {
        let mut spline = Spline::at(0.3, 12, 0.4);
        for (i, point) in spline.points.iter_mut().enumerate().skip(5).take(7) {
            *point += ((i * i) as f64).sin();
        }
        let time = |span: usize, part: f64| 0.4 * (span as f64 + part);
        let at = |t: f64| {
            let span = ((t / 0.4) as usize).min(11);
            spline.state(span, &StateWeights::at(t / 0.4 - span as f64))
        };
        let hull = |order: usize| {
            let points = spline.derivative(order);
            let low = points.iter().copied().fold(f64::INFINITY, f64::min);
            [
                low,
                points.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ]
        };
        for span in 0..12 {
            for part in [0.0, 0.21, 0.5, 0.83] {
                let (t, e) = (time(span, part).clamp(1e-4, 4.8 - 1e-4), 1e-5);
                let [_, v, a] = at(t);
                let (before, after) = (at(t - e), at(t + e));
                assert!(((after[0] - before[0]) / (2.0 * e) - v).abs() < 1e-6);
                assert!(((after[1] - before[1]) / (2.0 * e) - a).abs() < 1e-5);
                for (order, value) in at(t).into_iter().enumerate() {
                    let [low, high] = hull(order);
                    assert!(low - 1e-12 <= value && value <= high + 1e-12);
                }
            }
        }
        assert_eq!(at(0.0), [0.3, 0.0, 0.0]);
    }

    #[test]
    fn the_largest_step_touches_one_bound() {
        let spline = Spline::at(0.0, 10, 0.5);
        let mut direction = vec![0.0; 15];
        direction[7] = 1.0;
        let bounds = [[-1.0, 1.0], [-9.0, 9.0], [-99.0, 99.0], [-16.0, 16.0]];
        let [low, high] = steps(&spline, &direction, &bounds).expect("a step");
        // Jerk: third differences 1, −3, 3, −1 over 0.125 s³.
        assert!((high - 16.0 * 0.125 / 3.0).abs() < 1e-12 && (low + high).abs() < 1e-12);
    }
}
