//! Uphill from a motion: gradient, conjugate directions, and a metric that keeps away from the limits.
//!
//! ```text
//! F(c) = value(M(c)) + ν Σ_states barrier      barrier: ln of what is left to the torque limits and to the margin
//! p    = H⁻¹ g + β p_before                    H: Dikin's metric ([`Metric`])
//! ```
//! The gradient goes through the states: how each of them changes F by small differences, how control points move it by the spline.
//!
//! # Source
//! Conjugate directions: Polak and Ribière 1969.

use super::clearance::NearSlope;
use super::found::Found;
use super::information::{Objective, states_of};
use super::limits::JointLimits;
use super::metric::Metric;
use super::spline::{DEGREE, HELD, SAMPLES, Spline, StateWeights, steps};
use super::task::Task;
use crate::excitation::States;
use crate::linear_algebra::dot;

/// Factors on the motion about its start, of which the first that is within torque and clearance counts: a climb begins inside its limits.
const INSIDE: [f64; 4] = [0.97, 0.98, 0.99, 0.995];
/// Weight of the barriers at the beginning and at the end.
const BARRIER: [f64; 2] = [0.5, 0.05];
/// Step of a difference, as a share of a limit: smaller ones are lost in rounding where hardly anything is shown yet.
const DIFFERENCE: f64 = 1e-6;
/// The same where distances are concerned: they have a kink wherever another corner or face is the nearest.
const SMOOTH: f64 = 3e-3;
/// Largest step as a share of the way to the nearest limit.
const NEARLY: f64 = 0.95;
/// Share of what the slope promises that a step has to gain.
const GAINED: f64 = 1e-4;
/// Share of the way to the nearest limit below which a step is none.
const STALLED: f64 = 1e-5;
/// Halvings of a step.
const HALVINGS: usize = 10;
/// Largest share of a torque limit that the barrier sees.
const FULL: f64 = 0.9999;

/// Samples of a span at which distances are looked at; between two of them what moves adds to the margin.
const PER_SPAN: usize = 512;
/// Moments that are watched at most; the oldest goes first.
const MOMENTS: usize = 200;

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

/// Something near, and when.
type Near = (NearSlope, Moment);

/// A moment of a motion.
#[derive(Debug, Clone)]
struct Moment {
    span: usize,
    weights: StateWeights,
}

impl Moment {
    /// The slope over the position at this moment as slopes over the control points that move.
    fn add_slope(&self, slope: f64, points: &mut [f64]) {
        let mut own = [0.0; DEGREE + 1];
        (self.weights).add_transposed([slope, 0.0, 0.0], 1.0, &mut own);
        for (i, slope) in own.iter().enumerate() {
            let at = (self.span + i).checked_sub(HELD);
            if let Some(point) = at.and_then(|at| points.get_mut(at)) {
                *point += slope;
            }
        }
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
            bounds: task.limits.iter().map(JointLimits::bounds).collect(),
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
        let near = self.near();
        let Some(gradient) = self.gradient(weight, &near) else {
            return false;
        };
        let mut metric = Metric::new(&self.now.splines, &self.bounds, self.inner());
        for (own, moment) in &near {
            metric.add_near(own, moment.span, &moment.weights);
        }
        let scaled = metric.scaled(&gradient);
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
        if self.search(&direction, dot(&direction, &gradient), weight) && self.reach > STALLED {
            self.before = Some(Before {
                gradient,
                square,
                direction,
            });
            return true;
        }
        self.search(&scaled, square, weight) && self.reach > STALLED
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
        let (mut close, mut good) = (None, None);
        for _ in 0..HALVINGS {
            let needed = here + GAINED * step * slope;
            match self.tried(&whole, step, (weight, needed)) {
                Tried::Good(found) => good = Some(found),
                Tried::TooClose(time) => close = Some(time),
                Tried::Bad => {}
            }
            if good.is_some() {
                break;
            }
            step *= 0.5;
        }
        if let Some(time) = close {
            self.watch(time);
        }
        let gained = good.is_some();
        if let Some(found) = good {
            self.reach = step / most;
            self.now = found;
            self.refused = None;
            if self.now.value > self.best.value {
                self.best = self.now.clone();
            }
        }
        gained
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
        match self
            .task
            .too_close(&splines, (0..self.spans, None), PER_SPAN)
        {
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
        let Some(clearance) = self.task.clearance else {
            return torque;
        };
        let nearness = |q: &[f64], len: usize| clearance.nearness(q, len).iter().sum::<f64>();
        let watched = nearness(&self.watched_positions(splines), self.watched.len());
        torque + nearness(&states.q, states.len) + watched
    }

    /// Positions at the watched moments, `[joint * moments + moment]`.
    fn watched_positions(&self, splines: &[Spline]) -> Vec<f64> {
        let at = |spline: &Spline| -> Vec<f64> {
            let moments = self.watched.iter();
            moments
                .map(|own| spline.state(own.span, &own.weights)[0])
                .collect()
        };
        splines.iter().flat_map(at).collect()
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

    /// ∂F/∂c of the control points that move, joint after joint.
    fn gradient(&self, weight: f64, near: &[Near]) -> Option<Vec<f64>> {
        let matrix = (self.objective).gradient(&self.now.sums, self.rows, self.duration)?;
        let states = self.states();
        let total = |states: &States| -> Vec<f64> {
            let shown = self.objective.shown(&matrix, states);
            let torque = self.torque_barriers(states);
            let both = shown.iter().zip(torque);
            both.map(|(shown, torque)| shown + weight * torque)
                .collect()
        };
        let here = total(&states);
        let mut gradient = Vec::new();
        for (joint, spline) in self.now.splines.iter().enumerate() {
            let range = joint * states.len..(joint + 1) * states.len;
            let slopes = [0, 1, 2].map(|order| {
                let by = self.difference(joint, order);
                let mut moved = states.clone();
                let own = [&mut moved.q, &mut moved.qd, &mut moved.qdd]
                    .into_iter()
                    .nth(order);
                let own = own.into_iter().flat_map(|own| &mut own[range.clone()]);
                own.for_each(|x| *x += by);
                let there = total(&moved);
                (there.iter().zip(&here).map(|(a, b)| (a - b) / by)).collect::<Vec<f64>>()
            });
            let mut points = through(spline, &slopes, self.spans);
            for (own, moment) in near {
                moment.add_slope(weight * own.slopes[joint], &mut points);
            }
            gradient.extend(points);
        }
        gradient.iter().all(|x| x.is_finite()).then_some(gradient)
    }

    /// A small change of a joint's position, velocity or acceleration.
    fn difference(&self, joint: usize, order: usize) -> f64 {
        let [low, high] = self.bounds[joint][order];
        DIFFERENCE * (high - low)
    }

    /// What is near at the states and at the watched moments.
    fn near(&self) -> Vec<Near> {
        let Some(clearance) = self.task.clearance else {
            return Vec::new();
        };
        let steps = self
            .bounds
            .iter()
            .map(|own| SMOOTH * (own[0][1] - own[0][0]));
        let steps: Vec<f64> = steps.collect();
        let states = self.states();
        let sampled = clearance.nearness_slopes(&states.q, states.len, &steps);
        let sampled = sampled.into_iter().map(|own| {
            let weights = StateWeights::of_sample(own.state % SAMPLES);
            let span = own.state / SAMPLES;
            (own, Moment { span, weights })
        });
        let positions = self.watched_positions(&self.now.splines);
        let watched = clearance.nearness_slopes(&positions, self.watched.len(), &steps);
        let watched = watched.into_iter().map(|own| {
            let moment = self.watched[own.state].clone();
            (own, moment)
        });
        sampled.chain(watched).collect()
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
            || task
                .too_close(&splines, (0..spans, None), PER_SPAN)
                .is_some();
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

    /// Splines whose free points are moved by so much of a direction.
    fn moved(splines: &[Spline], direction: &[f64], by: f64) -> Vec<Spline> {
        let mut moved = splines.to_vec();
        let inner = direction.len() / splines.len();
        for (spline, along) in moved.iter_mut().zip(direction.chunks_exact(inner)) {
            let own = spline.points[HELD..HELD + inner].iter_mut();
            own.zip(along).for_each(|(c, d)| *c += by * d);
        }
        moved
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
            recorded: None,
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
        let gradient = climb(splines.clone())
            .gradient(weight, &[])
            .expect("the gradient of a motion that shows something");
        for _ in 0..8 {
            let direction: Vec<f64> = gradient.iter().map(|_| random.normal()).collect();
            let moved = |by: f64| total(moved(&splines, &direction, by));
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
}
