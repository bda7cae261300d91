//! Uphill from a motion: gradient, conjugate directions, and a metric that keeps away from the limits.
//!
//! ```text
//! F(c) = value(M(c)) + ν Σ_states barrier      barrier: ln of what is left to the torque limits and to the margin
//! H    = Σ_k D_kᵀ diag(1/s²) D_k               D_k: k-th difference of control points, s: what is left to its two limits
//! p    = H⁻¹ g + β p_before                    steps within pᵀ H p < 1 break no limit (Dikin)
//! ```
//! The gradient goes through the states: how each of them changes F by small differences, how control points move it by the spline.
//!
//! # Source
//! Affine scaling: Dikin 1967, Barnes 1986. Conjugate directions: Polak and Ribière 1969.

use super::Task;
use super::information::{Objective, SAMPLES, states_of};
use super::search::{Found, PER_SPAN};
use super::spline::{DEGREE, HELD, Spline, StateWeights, steps};
use crate::excitation::States;
use crate::linear_algebra::{Cholesky, dot};

/// Factors on the motion about its start, of which the first that is within torque and clearance counts: a climb begins inside its limits.
const INSIDE: [f64; 4] = [0.97, 0.98, 0.99, 0.995];
/// Weight of the barriers at the beginning and at the end.
const BARRIER: [f64; 2] = [0.5, 0.05];
/// Step of a difference, as a share of a limit: smaller ones are lost in rounding where hardly anything is shown yet.
const DIFFERENCE: f64 = 1e-6;
/// Least distance from a limit that the metric sees, as a share of its range.
const LEAST: f64 = 1e-6;
/// Largest step as a share of the way to the nearest limit.
const NEARLY: f64 = 0.95;
/// Share of what the slope promises that a step has to gain.
const GAINED: f64 = 1e-4;
/// Halvings of a step.
const HALVINGS: usize = 10;
/// Largest share of a torque limit that the barrier sees.
const FULL: f64 = 0.9999;

/// Moments that are watched at most; the oldest goes first.
const MOMENTS: usize = 60;

/// What comes of a step.
enum Tried {
    Good(Found),
    /// Something comes too close, at this time, s.
    TooClose(f64),
    Bad,
}

/// A motion that climbs.
pub(super) struct Climb<'a> {
    task: &'a Task<'a>,
    objective: &'a dyn Objective,
    bounds: Vec<[[f64; 2]; 4]>,
    spans: usize,
    rows: f64,
    duration: f64,
    now: Found,
    best: Found,
    before: Option<Before>,
    /// Moments between the samples at which something came too close: the barrier looks there, too.
    watched: Vec<Moment>,
    /// What forbade every change before, until a step is made.
    refused: Option<String>,
    /// Share of the way to the nearest limit that the next step tries.
    reach: f64,
}

/// A moment of a motion.
struct Moment {
    span: usize,
    weights: StateWeights,
}

impl Moment {
    fn position(&self, splines: &[Spline]) -> Vec<f64> {
        let at = |spline: &Spline| spline.state(self.span, &self.weights)[0];
        splines.iter().map(at).collect()
    }
}

/// What the last step leaves for the next direction.
struct Before {
    gradient: Vec<f64>,
    /// gᵀ H⁻¹ g.
    square: f64,
    direction: Vec<f64>,
}

impl<'a> Climb<'a> {
    pub(super) fn new(
        task: &'a Task<'a>,
        objective: &'a dyn Objective,
        (found, refused): (Found, Option<String>),
        (spans, rows, duration): (usize, f64, f64),
    ) -> Self {
        let now = inside(task, objective, &found, (spans, rows, duration));
        Self {
            task,
            objective,
            bounds: task.limits.iter().map(super::search::bounds).collect(),
            spans,
            rows,
            duration,
            best: found,
            now,
            before: None,
            watched: Vec::new(),
            refused,
            reach: 0.5,
        }
    }

    pub(super) fn best(&self) -> &Found {
        &self.best
    }

    /// The best motion, and what forbade every change where there was none.
    pub(super) fn into_best(self) -> (Found, Option<String>) {
        (self.best, self.refused)
    }

    /// One step; `done` is the share of all steps that were made. False where none gains anything.
    pub(super) fn step(&mut self, done: f64) -> bool {
        let weight = BARRIER[0] * (BARRIER[1] / BARRIER[0]).powf(done);
        let Some(gradient) = self.gradient(weight) else {
            return false;
        };
        let scaled = self.scaled(&gradient);
        let square = dot(&gradient, &scaled);
        let conjugate = self.before.take().map(|before| {
            let turned = square - dot(&before.gradient, &scaled);
            let beta = (turned / before.square).max(0.0);
            let along = scaled.iter().zip(&before.direction);
            along
                .map(|(own, last)| own + beta * last)
                .collect::<Vec<f64>>()
        });
        let uphill = conjugate.filter(|own| dot(own, &gradient) > 0.0);
        let direction = uphill.unwrap_or_else(|| scaled.clone());
        if self.search(&direction, dot(&direction, &gradient), weight) {
            self.before = Some(Before {
                gradient,
                square,
                direction,
            });
            return true;
        }
        self.search(&scaled, square, weight)
    }

    /// Control points that move.
    fn inner(&self) -> usize {
        self.spans + DEGREE - 2 * HELD
    }

    /// A step along a direction that gains enough, by halving.
    fn search(&mut self, direction: &[f64], slope: f64, weight: f64) -> bool {
        let inner = self.inner();
        let mut most = f64::INFINITY;
        let mut whole: Vec<Vec<f64>> = Vec::new();
        for (joint, own) in direction.chunks_exact(inner).enumerate() {
            let spline = &self.now.splines[joint];
            let mut along = vec![0.0; spline.points.len()];
            along[HELD..HELD + inner].copy_from_slice(own);
            let Some([_, high]) = steps(spline, &along, &self.bounds[joint]) else {
                return false;
            };
            most = most.min(high);
            whole.push(along);
        }
        if !(slope > 0.0 && most > 0.0 && most.is_finite()) {
            return false;
        }
        let here = self.now.value + weight * self.barrier(&self.now.splines, &self.states());
        let mut step = (2.0 * self.reach).min(NEARLY) * most;
        let mut close = None;
        for _ in 0..HALVINGS {
            let needed = here + GAINED * step * slope;
            match self.tried(&whole, step, (weight, needed)) {
                Tried::Good(found) => {
                    self.reach = step / most;
                    self.now = found;
                    self.refused = None;
                    if self.now.value > self.best.value {
                        self.best = self.now.clone();
                    }
                    return true;
                }
                Tried::TooClose(time) => close = Some(time),
                Tried::Bad => {}
            }
            step *= 0.5;
        }
        if let Some(time) = close {
            self.watch(time);
        }
        false
    }

    /// Looks at a moment from now on.
    fn watch(&mut self, time: f64) {
        let place = (time / self.now.splines[0].span).clamp(0.0, self.spans as f64);
        let span = (place as usize).min(self.spans - 1);
        let weights = StateWeights::at(place - span as f64);
        let moment = Moment { span, weights };
        if self.watched.len() == MOMENTS {
            self.watched.remove(0);
        }
        self.watched.push(moment);
        self.before = None;
    }

    /// The motion a step away; `None` where F is less than needed, or torque or clearance forbid it.
    fn tried(&self, direction: &[Vec<f64>], step: f64, (weight, needed): (f64, f64)) -> Tried {
        let mut splines = self.now.splines.clone();
        for (spline, along) in splines.iter_mut().zip(direction) {
            (spline.points.iter_mut().zip(along)).for_each(|(c, d)| *c += step * d);
        }
        let states = states_of(&splines, 0..self.spans);
        if self.task.too_much_torque(&states).is_some() {
            return Tried::Bad;
        }
        let sums = self.objective.of(&states);
        let value = self.objective.value(&sums, self.rows, self.duration);
        let total = value + weight * self.barrier(&splines, &states);
        if !total.is_finite() || total < needed {
            return Tried::Bad;
        }
        match self.task.too_close(&splines, 0..self.spans, PER_SPAN) {
            Some(approach) => Tried::TooClose(approach.time),
            None => Tried::Good(Found {
                splines,
                sums,
                value,
            }),
        }
    }

    fn states(&self) -> States {
        states_of(&self.now.splines, 0..self.spans)
    }

    /// Of a motion with its states.
    fn barrier(&self, splines: &[Spline], states: &States) -> f64 {
        let torque: f64 = self.torque_barriers(states).iter().sum();
        let clearance = self.clearance_barriers(states, &vec![true; states.len]);
        let watched = self.watched.iter();
        let watched: f64 = watched
            .map(|own| self.nearness(&own.position(splines)))
            .sum();
        torque + clearance.iter().sum::<f64>() + watched
    }

    fn nearness(&self, q: &[f64]) -> f64 {
        self.task.clearance.map_or(0.0, |own| own.nearness(q))
    }

    /// Σ_j ln(1 − share²) of each state.
    fn torque_barriers(&self, states: &States) -> Vec<f64> {
        let mut barriers = vec![0.0; states.len];
        let Some(torque) = self.task.torque else {
            return barriers;
        };
        for shares in torque.shares(states).chunks_exact(states.len) {
            for (barrier, share) in barriers.iter_mut().zip(shares) {
                *barrier += (1.0 - share.min(FULL).powi(2)).ln();
            }
        }
        barriers
    }

    /// Nearness of the states that are asked for, 0 of the others.
    fn clearance_barriers(&self, states: &States, asked: &[bool]) -> Vec<f64> {
        let Some(clearance) = self.task.clearance else {
            return vec![0.0; states.len];
        };
        let near = |(k, asked): (usize, &bool)| {
            let q = || {
                states
                    .q
                    .iter()
                    .skip(k)
                    .step_by(states.len)
                    .copied()
                    .collect::<Vec<f64>>()
            };
            if *asked {
                clearance.nearness(&q())
            } else {
                0.0
            }
        };
        asked.iter().enumerate().map(near).collect()
    }

    /// ∂F/∂c of the control points that move, joint after joint.
    fn gradient(&self, weight: f64) -> Option<Vec<f64>> {
        let matrix = (self.objective).gradient(&self.now.sums, self.rows, self.duration)?;
        let states = self.states();
        let total = |states: &States, clearance: &[f64]| -> Vec<f64> {
            let (shown, torque) = (
                self.objective.shown(&matrix, states),
                self.torque_barriers(states),
            );
            let barriers = torque.iter().zip(clearance).map(|(a, b)| weight * (a + b));
            shown
                .iter()
                .zip(barriers)
                .map(|(shown, barrier)| shown + barrier)
                .collect()
        };
        let clearance = self.clearance_barriers(&states, &vec![true; states.len]);
        let near: Vec<bool> = clearance.iter().map(|own| *own < 0.0).collect();
        let here = total(&states, &clearance);
        let mut gradient = Vec::new();
        for (joint, spline) in self.now.splines.iter().enumerate() {
            let range = joint * states.len..(joint + 1) * states.len;
            let slopes = [0, 1, 2].map(|order| {
                let [low, high] = self.bounds[joint][order];
                let by = DIFFERENCE * (high - low);
                let mut moved = states.clone();
                let own = [&mut moved.q, &mut moved.qd, &mut moved.qdd]
                    .into_iter()
                    .nth(order);
                let own = own.into_iter().flat_map(|own| &mut own[range.clone()]);
                own.for_each(|x| *x += by);
                // Distances depend on positions alone.
                let there = match order {
                    0 => total(&moved, &self.clearance_barriers(&moved, &near)),
                    _ => total(&moved, &clearance),
                };
                there.iter().zip(&here).map(|(a, b)| (a - b) / by).collect()
            });
            let mut points = through(spline, &slopes, self.spans);
            self.add_watched(joint, weight, &mut points);
            gradient.extend(points);
        }
        gradient.iter().all(|x| x.is_finite()).then_some(gradient)
    }

    /// Slopes of the watched moments' barrier over the control points of a joint that move.
    fn add_watched(&self, joint: usize, weight: f64, points: &mut [f64]) {
        let [low, high] = self.bounds[joint][0];
        let by = DIFFERENCE * (high - low);
        for moment in &self.watched {
            let mut q = moment.position(&self.now.splines);
            let here = self.nearness(&q);
            q[joint] += by;
            let slope = weight * (self.nearness(&q) - here) / by;
            let mut own = [0.0; DEGREE + 1];
            (moment.weights).add_transposed([slope, 0.0, 0.0], 1.0, &mut own);
            for (i, slope) in own.iter().enumerate() {
                let at = (moment.span + i).checked_sub(HELD);
                if let Some(point) = at.and_then(|at| points.get_mut(at)) {
                    *point += slope;
                }
            }
        }
    }

    /// H⁻¹ g, joint by joint.
    fn scaled(&self, gradient: &[f64]) -> Vec<f64> {
        let inner = self.inner();
        let mut scaled = gradient.to_vec();
        for (joint, own) in scaled.chunks_exact_mut(inner).enumerate() {
            let metric = metric(&self.now.splines[joint], &self.bounds[joint], inner);
            if let Ok(factor) = Cholesky::new(&metric, inner) {
                factor.solve(own);
            }
        }
        scaled
    }
}

/// A motion a little smaller about its start, away from what bounds its control points.
fn inside(
    task: &Task<'_>,
    objective: &dyn Objective,
    found: &Found,
    (spans, rows, duration): (usize, f64, f64),
) -> Found {
    for factor in INSIDE {
        let mut splines = found.splines.clone();
        for spline in &mut splines {
            let start = spline.points[0];
            (spline.points.iter_mut()).for_each(|c| *c = start + factor * (*c - start));
        }
        let states = states_of(&splines, 0..spans);
        let forbidden = task.too_much_torque(&states).is_some()
            || task.too_close(&splines, 0..spans, PER_SPAN).is_some();
        if !forbidden {
            let sums = objective.of(&states);
            let value = objective.value(&sums, rows, duration);
            return Found {
                splines,
                sums,
                value,
            };
        }
    }
    found.clone()
}

/// Slopes over states as slopes over the control points that move: the transposed spline.
fn through(spline: &Spline, slopes: &[Vec<f64>; 3], spans: usize) -> Vec<f64> {
    let weights: [StateWeights; SAMPLES] = std::array::from_fn(StateWeights::of_sample);
    let mut points = vec![0.0; spline.points.len()];
    for span in 0..spans {
        for (sample, weights) in weights.iter().enumerate() {
            let at = span * SAMPLES + sample;
            let slope = [0, 1, 2].map(|order| slopes[order][at]);
            let own = &mut points[span..span + DEGREE + 1];
            weights.add_transposed(slope, spline.span, own);
        }
    }
    points[HELD..points.len() - HELD].to_vec()
}

/// Σ_k D_kᵀ diag(1/s²) D_k of the control points of one joint that move.
fn metric(spline: &Spline, bounds: &[[f64; 2]; 4], inner: usize) -> Vec<f64> {
    let mut metric = vec![0.0; inner * inner];
    let mut stencil = vec![1.0];
    for (order, [low, high]) in bounds.iter().enumerate() {
        if order > 0 {
            let before = stencil.iter().map(|w| -w / spline.span).chain([0.0]);
            let after = std::iter::once(0.0).chain(stencil.iter().map(|w| w / spline.span));
            stencil = before.zip(after).map(|(a, b)| a + b).collect();
        }
        let least = LEAST * (high - low);
        for (first, x) in spline.derivative(order).iter().enumerate() {
            let weight = (high - x).max(least).powi(-2) + (x - low).max(least).powi(-2);
            for (i, a) in stencil.iter().enumerate() {
                for (j, b) in stencil.iter().enumerate() {
                    let (row, column) =
                        ((first + i).checked_sub(HELD), (first + j).checked_sub(HELD));
                    if let (Some(row), Some(column)) = (row, column)
                        && row < inner
                        && column < inner
                    {
                        metric[row * inner + column] += weight * a * b;
                    }
                }
            }
        }
    }
    metric
}

#[cfg(test)]
mod tests {
    use super::super::tests::{library, stated};
    use super::super::{NominalTorque, joint_limits};
    use super::*;
    use crate::design::information::Information;
    use crate::random::Random;
    use crate::robot::testing::tree;

    fn wavy(start: f64, spans: usize, random: &mut Random) -> Spline {
        let mut spline = Spline::at(start, spans, 0.25);
        let last = spline.points.len() - HELD;
        (spline.points[HELD..last].iter_mut()).for_each(|c| *c += 0.05 * random.normal());
        spline
    }

    /// The slope along eight directions is that of F itself by central differences, torque's barrier included; forward differences of Coulomb
    /// friction's tanh(q̇/v_s) are off by less than 0.5 %.
    #[test]
    fn the_gradient_is_that_of_differences() {
        let robot = tree();
        let limits = joint_limits(&robot, &stated(&robot, Some(60.0))).expect("limits");
        let (library, torque) = (library(&robot), NominalTorque::new(&robot, &limits));
        let information = Information::new(&robot, &library);
        let task = Task {
            robot: &robot,
            library: &library,
            questions: None,
            limits: &limits,
            torque: Some(&torque),
            clearance: None,
        };
        let (spans, mut random) = (16, Random::new(5, 0));
        let splines: Vec<Spline> = (limits.iter())
            .map(|own| wavy(own.start, spans, &mut random))
            .collect();
        let (rows, weight) = ((spans * SAMPLES) as f64, 0.2);
        let found = |splines: Vec<Spline>| {
            let sums = information.of(&states_of(&splines, 0..spans));
            let value = information.value(&sums, rows, 4.0);
            Found {
                splines,
                sums,
                value,
            }
        };
        let climb = |splines| {
            Climb::new(
                &task,
                &information,
                (found(splines), None),
                (spans, rows, 4.0),
            )
        };
        let total = |splines: Vec<Spline>| {
            let own = climb(splines);
            own.now.value + weight * own.barrier(&own.now.splines, &own.states())
        };
        let gradient = climb(splines.clone()).gradient(weight).expect("a gradient");
        let inner = spans + DEGREE - 2 * HELD;
        for _ in 0..8 {
            let direction: Vec<f64> = gradient.iter().map(|_| random.normal()).collect();
            let moved = |by: f64| {
                let mut moved = splines.clone();
                for (spline, along) in moved.iter_mut().zip(direction.chunks_exact(inner)) {
                    let own = spline.points[HELD..HELD + inner].iter_mut();
                    own.zip(along).for_each(|(c, d)| *c += by * d);
                }
                total(moved)
            };
            let by = 1e-6;
            let wanted = (moved(by) - moved(-by)) / (2.0 * by);
            let slope = dot(&gradient, &direction);
            let size = dot(&gradient, &gradient).sqrt();
            assert!(
                (slope - wanted).abs() < 5e-3 * size,
                "{slope} {wanted} of {size}"
            );
        }
    }

    /// Dikin's ellipsoid lies within the limits, whatever the direction.
    #[test]
    fn a_step_of_length_one_breaks_no_limit() {
        let bounds = [[-1.0, 1.4], [-1.7, 1.7], [-6.0, 6.0], [-70.0, 70.0]];
        let (spans, mut random) = (14, Random::new(7, 0));
        let mut spline = Spline::at(0.1, spans, 0.25);
        let inner = spans + DEGREE - 2 * HELD;
        for (k, point) in spline.points[HELD..HELD + inner].iter_mut().enumerate() {
            *point += 0.3 * (0.4 * k as f64).sin().powi(2);
        }
        let metric = metric(&spline, &bounds, inner);
        for _ in 0..200 {
            let own: Vec<f64> = (0..inner).map(|_| random.normal()).collect();
            let square: f64 = (0..inner)
                .map(|i| own[i] * dot(&metric[i * inner..(i + 1) * inner], &own))
                .sum();
            let mut moved = vec![0.0; spline.points.len()];
            for (to, x) in moved[HELD..HELD + inner].iter_mut().zip(&own) {
                *to = x / square.sqrt();
            }
            let [low, high] = steps(&spline, &moved, &bounds).expect("within");
            assert!(low <= -1.0 && high >= 1.0, "{low} {high}");
        }
    }
}
