//! One chain of local changes to a motion, each within all limits, by the information that it gives.

use super::ascent::Climb;
use super::found::Found;
use super::information::{Objective, states_of};
use super::limits::JointLimits;
use super::spline::{HELD, Spline, steps};
use super::task::Task;
use crate::random::Random;
use std::f64::consts::PI;
use std::ops::Range;

/// Half widths of a change, control points.
const WIDTHS: [usize; 6] = [1, 2, 4, 6, 10, 16];
/// Share of changes whose step is drawn from all that is feasible; the others are small.
const WIDE: f64 = 0.3;
/// sd of a small step, as a share of the feasible range.
const SMALL: f64 = 0.1;
/// Accepted changes after which sums are taken anew: rounding.
const ANEW: usize = 500;
/// Loss that is accepted with probability 1/e at the start; it falls linearly to 0 at half of the proposals.
const WARM: f64 = 0.3;

/// Samples of a span at which distances are looked at after a random change; between two of them what moves adds to the margin.
const PER_CHANGE: usize = 256;

/// One chain of the search.
pub(super) struct Chain<'a> {
    task: &'a Task<'a>,
    objective: &'a dyn Objective,
    bounds: Vec<[[f64; 2]; 4]>,
    spans: usize,
    rows: f64,
    duration: f64,
    random: Random,
    now: Found,
    best: Found,
    accepted: usize,
    refused: Option<String>,
}

impl<'a> Chain<'a> {
    pub(super) fn new(
        task: &'a Task<'a>,
        objective: &'a dyn Objective,
        (spans, span): (usize, f64),
        (seed, stream): (u64, u64),
    ) -> Self {
        let at_rest = |own: &JointLimits| Spline::at(own.start, spans, span);
        let splines: Vec<Spline> = task.limits.iter().map(at_rest).collect();
        let states = states_of(&splines, 0..spans);
        let (sums, rows) = (objective.of(&states), states.len as f64);
        let duration = span * spans as f64;
        let value = objective.value(&sums, rows, duration);
        let now = Found {
            splines,
            sums,
            value,
        };
        Self {
            task,
            objective,
            bounds: task.limits.iter().map(JointLimits::bounds).collect(),
            spans,
            rows,
            duration,
            random: Random::new(seed, stream),
            best: now.clone(),
            now,
            accepted: 0,
            refused: None,
        }
    }

    /// The best motion, and what forbade the last change where none was possible at all.
    pub(super) fn into_best(self) -> (Found, Option<String>) {
        let never = self.refused.filter(|_| self.accepted == 0);
        (self.best, never)
    }

    /// The best motion goes on uphill.
    pub(super) fn climb(&self) -> Climb<'a> {
        let never = self.refused.clone().filter(|_| self.accepted == 0);
        let found = (self.best.clone(), never);
        let size = (self.spans, self.rows, self.duration);
        Climb::new(self.task, self.objective, found, size)
    }

    /// Goes on from what was found uphill.
    pub(super) fn resume(&mut self, (found, refused): (Found, Option<String>)) {
        // Where nothing forbids a change, some were made.
        self.accepted += usize::from(refused.is_none());
        self.refused = refused;
        self.now = found.clone();
        self.best = found;
    }

    pub(super) fn best(&self) -> f64 {
        self.best.value
    }

    /// One proposal; `done` is the share of all proposals that were made.
    pub(super) fn step(&mut self, done: f64) {
        let joint = self.below(self.bounds.len());
        let inner = self.spans + 5 - 2 * HELD;
        let centre = HELD + self.below(inner);
        let width = WIDTHS[self.below(WIDTHS.len())];
        let Some((direction, changed)) = self.change(joint, centre, width) else {
            return;
        };
        let mut splines = self.now.splines.clone();
        (splines[joint].points.iter_mut().zip(&direction)).for_each(|(c, d)| *c += d);
        let after = states_of(&splines, changed.clone());
        if let Some(problem) = self.task.too_much_torque(&after) {
            self.refused = Some(problem);
            return;
        }
        let before = states_of(&self.now.splines, changed.clone());
        let mut sums = self.objective.of(&after);
        let old = self.objective.of(&before);
        for ((sum, old), now) in sums.iter_mut().zip(&old).zip(&self.now.sums) {
            *sum += now - old;
        }
        let value = self.objective.value(&sums, self.rows, self.duration);
        let warmth = WARM * (1.0 - 2.0 * done).max(0.0);
        let threshold = self.now.value + warmth * self.random.uniform().ln();
        if value.is_nan() || value < threshold {
            return;
        }
        if let Some(approach) = self
            .task
            .too_close(&splines, (changed, Some(joint)), PER_CHANGE)
        {
            self.refused = Some(approach.in_words());
            return;
        }
        self.now = Found {
            splines,
            sums,
            value,
        };
        self.accepted += 1;
        if self.accepted.is_multiple_of(ANEW) {
            let all = states_of(&self.now.splines, 0..self.spans);
            self.now.sums = self.objective.of(&all);
            self.now.value = (self.objective).value(&self.now.sums, self.rows, self.duration);
        }
        if self.now.value > self.best.value {
            self.best = self.now.clone();
        }
    }

    /// A feasible step of a bump of control points, and the spans that it moves.
    fn change(
        &mut self,
        joint: usize,
        centre: usize,
        width: usize,
    ) -> Option<(Vec<f64>, Range<usize>)> {
        let spline = &self.now.splines[joint];
        let count = spline.points.len();
        let first = (centre + 1).saturating_sub(width).max(HELD);
        let last = (centre + width - 1).min(count - HELD - 1);
        let mut direction = vec![0.0; count];
        for (i, own) in direction.iter_mut().enumerate().take(last + 1).skip(first) {
            let away = i.abs_diff(centre) as f64 / width as f64;
            *own = (0.5 * PI * away).cos().powi(2);
        }
        let [low, high] = steps(spline, &direction, &self.bounds[joint])?;
        let step = match self.random.uniform() < WIDE {
            true => low + (high - low) * self.random.uniform(),
            false => (SMALL * (high - low) * self.random.normal()).clamp(low, high),
        };
        direction.iter_mut().for_each(|own| *own *= step);
        Some((
            direction,
            first.saturating_sub(5)..(last + 1).min(self.spans),
        ))
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.random.uniform() * count as f64) as usize).min(count - 1)
    }
}
