//! A straight-line program: every step a number, equal steps once, what is known beforehand computed beforehand.

use crate::term::Function;
use std::collections::HashMap;

/// A step of a [`Trace`].
pub(super) type Id = u32;

/// What a step computes from earlier ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A number.
    Constant(f64),
    /// Position of a joint (0-based), rad or m.
    Position(usize),
    /// Velocity.
    Velocity(usize),
    /// Acceleration.
    Acceleration(usize),
    /// a + b.
    Add(u32, u32),
    /// a − b.
    Subtract(u32, u32),
    /// a · b.
    Multiply(u32, u32),
    /// a / b.
    Divide(u32, u32),
    /// −a.
    Negate(u32),
    /// |a|.
    Absolute(u32),
    /// aᵇ with a constant b.
    Power(u32, f64),
    /// f(a).
    Apply(Function, u32),
}

/// A step as a key: numbers by their bits.
type Key = (u8, u64, u64);

impl Step {
    fn key(&self) -> Key {
        let two = |kind: u8, a: u32, b: u32| (kind, u64::from(a), u64::from(b));
        match *self {
            Self::Constant(value) => (0, value.to_bits(), 0),
            Self::Position(joint) => (1, joint as u64, 0),
            Self::Velocity(joint) => (2, joint as u64, 0),
            Self::Acceleration(joint) => (3, joint as u64, 0),
            // Sums and products do not care for order.
            Self::Add(a, b) => two(4, a.min(b), a.max(b)),
            Self::Subtract(a, b) => two(5, a, b),
            Self::Multiply(a, b) => two(6, a.min(b), a.max(b)),
            Self::Divide(a, b) => two(7, a, b),
            Self::Negate(a) => two(8, a, 0),
            Self::Absolute(a) => two(9, a, 0),
            Self::Power(a, exponent) => (10, u64::from(a), exponent.to_bits()),
            Self::Apply(function, a) => (11, u64::from(a), function as u64),
        }
    }

    /// Calls `visit` with every operand.
    pub(super) fn operands(&mut self, mut visit: impl FnMut(&mut u32)) {
        match self {
            Self::Constant(_) | Self::Position(_) | Self::Velocity(_) | Self::Acceleration(_) => {}
            Self::Negate(a) | Self::Absolute(a) | Self::Power(a, _) | Self::Apply(_, a) => visit(a),
            Self::Add(a, b) | Self::Subtract(a, b) | Self::Multiply(a, b) | Self::Divide(a, b) => {
                visit(a);
                visit(b);
            }
        }
    }
}

/// What every step is at one state.
pub(super) fn values(steps: &[Step], q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
    let mut values: Vec<f64> = Vec::with_capacity(steps.len());
    for step in steps {
        let at = |id: &u32| values[*id as usize];
        values.push(match step {
            Step::Constant(value) => *value,
            Step::Position(joint) => q[*joint],
            Step::Velocity(joint) => qd[*joint],
            Step::Acceleration(joint) => qdd[*joint],
            Step::Add(a, b) => at(a) + at(b),
            Step::Subtract(a, b) => at(a) - at(b),
            Step::Multiply(a, b) => at(a) * at(b),
            Step::Divide(a, b) => at(a) / at(b),
            Step::Negate(a) => -at(a),
            Step::Absolute(a) => at(a).abs(),
            Step::Power(a, exponent) => at(a).powf(*exponent),
            Step::Apply(function, a) => function.value(at(a)),
        });
    }
    values
}

/// Steps in the order in which they are computed.
#[derive(Debug, Clone, Default)]
pub(super) struct Trace {
    pub(super) steps: Vec<Step>,
    known: HashMap<Key, Id>,
}

impl Trace {
    /// A step, once.
    pub(super) fn step(&mut self, step: Step) -> Id {
        let next = self.steps.len() as Id;
        let id = *self.known.entry(step.key()).or_insert(next);
        if id == next {
            self.steps.push(step);
        }
        id
    }

    /// A number.
    pub(super) fn number(&mut self, value: f64) -> Id {
        // −0 is 0.
        self.step(Step::Constant(value + 0.0))
    }

    /// What is known of a step beforehand.
    pub(super) fn value(&self, id: Id) -> Option<f64> {
        match self.steps[id as usize] {
            Step::Constant(value) => Some(value),
            _ => None,
        }
    }

    fn negated(&self, id: Id) -> Option<Id> {
        match self.steps[id as usize] {
            Step::Negate(a) => Some(a),
            _ => None,
        }
    }

    /// a + b.
    pub(super) fn add(&mut self, a: Id, b: Id) -> Id {
        match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => self.number(x + y),
            (Some(0.0), _) => b,
            (_, Some(0.0)) => a,
            _ => match (self.negated(a), self.negated(b)) {
                (_, Some(b)) => self.subtract(a, b),
                (Some(a), _) => self.subtract(b, a),
                _ => self.step(Step::Add(a, b)),
            },
        }
    }

    /// a − b.
    pub(super) fn subtract(&mut self, a: Id, b: Id) -> Id {
        if a == b {
            return self.number(0.0);
        }
        match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => self.number(x - y),
            (Some(0.0), _) => self.negate(b),
            (_, Some(0.0)) => a,
            _ => match self.negated(b) {
                Some(b) => self.add(a, b),
                None => self.step(Step::Subtract(a, b)),
            },
        }
    }

    /// −a.
    pub(super) fn negate(&mut self, a: Id) -> Id {
        match (self.value(a), self.negated(a), self.steps[a as usize]) {
            (Some(x), ..) => self.number(-x),
            (_, Some(a), _) => a,
            (.., Step::Subtract(x, y)) => self.subtract(y, x),
            _ => self.step(Step::Negate(a)),
        }
    }

    /// a · b.
    pub(super) fn multiply(&mut self, a: Id, b: Id) -> Id {
        match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => self.number(x * y),
            (Some(0.0), _) | (_, Some(0.0)) => self.number(0.0),
            (Some(1.0), _) => b,
            (_, Some(1.0)) => a,
            (Some(-1.0), _) => self.negate(b),
            (_, Some(-1.0)) => self.negate(a),
            // Equal but for the sign is equal.
            (Some(x), _) if x < 0.0 => {
                let product = self.scale(-x, b);
                self.negate(product)
            }
            (_, Some(y)) if y < 0.0 => {
                let product = self.scale(-y, a);
                self.negate(product)
            }
            _ => match (self.negated(a), self.negated(b)) {
                (Some(a), Some(b)) => self.multiply(a, b),
                // The sign goes outside, where sums take it up.
                (Some(a), None) => {
                    let product = self.multiply(a, b);
                    self.negate(product)
                }
                (None, Some(b)) => {
                    let product = self.multiply(a, b);
                    self.negate(product)
                }
                (None, None) => self.step(Step::Multiply(a, b)),
            },
        }
    }

    /// a / b.
    pub(super) fn divide(&mut self, a: Id, b: Id) -> Id {
        match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => self.number(x / y),
            (_, Some(1.0)) => a,
            _ => self.step(Step::Divide(a, b)),
        }
    }

    /// c · a.
    pub(super) fn scale(&mut self, c: f64, a: Id) -> Id {
        let c = self.number(c);
        self.multiply(c, a)
    }

    /// f(a).
    pub(super) fn apply(&mut self, function: Function, a: Id) -> Id {
        if let Some(x) = self.value(a) {
            return self.number(function.value(x));
        }
        // sin 2x = 2 sin x cos x, cos 2x = 1 − 2 sin² x: products are cheaper than another sine.
        if let (Function::Sin | Function::Cos, Step::Multiply(x, y)) =
            (function, self.steps[a as usize])
        {
            let half = match (self.value(x), self.value(y)) {
                (Some(2.0), _) => Some(y),
                (_, Some(2.0)) => Some(x),
                _ => None,
            };
            if let Some(x) = half {
                let sine = self.apply(Function::Sin, x);
                let double = self.scale(2.0, sine);
                if function == Function::Sin {
                    let cosine = self.apply(Function::Cos, x);
                    return self.multiply(double, cosine);
                }
                let square = self.multiply(double, sine);
                let one = self.number(1.0);
                return self.subtract(one, square);
            }
        }
        self.step(Step::Apply(function, a))
    }

    /// aⁿ by squaring.
    pub(super) fn integer_power(&mut self, a: Id, exponent: u32) -> Id {
        match exponent {
            0 => self.number(1.0),
            1 => a,
            e => {
                let half = self.integer_power(a, e / 2);
                let square = self.multiply(half, half);
                if e % 2 == 0 {
                    square
                } else {
                    self.multiply(square, a)
                }
            }
        }
    }

    /// Σ a_k b_k.
    pub(super) fn dot(&mut self, a: &[Id], b: &[Id]) -> Id {
        let mut sum = self.number(0.0);
        for (&a, &b) in a.iter().zip(b) {
            let product = self.multiply(a, b);
            sum = self.add(sum, product);
        }
        sum
    }

    /// ∂/∂q of a joint of every step up to the last `wanted`, and their steps.
    pub(super) fn position_derivative(&mut self, joint: usize, wanted: &[Id]) -> Vec<Id> {
        let end = wanted.iter().max().map_or(0, |&last| last as usize + 1);
        let zero = self.number(0.0);
        let mut change: Vec<Id> = vec![zero; end];
        for at in 0..end {
            change[at] = match self.steps[at] {
                Step::Position(j) if j == joint => self.number(1.0),
                Step::Constant(_)
                | Step::Position(_)
                | Step::Velocity(_)
                | Step::Acceleration(_) => zero,
                Step::Add(a, b) => self.add(change[a as usize], change[b as usize]),
                Step::Subtract(a, b) => self.subtract(change[a as usize], change[b as usize]),
                Step::Multiply(a, b) => {
                    let left = self.multiply(change[a as usize], b);
                    let right = self.multiply(a, change[b as usize]);
                    self.add(left, right)
                }
                Step::Negate(a) => self.negate(change[a as usize]),
                Step::Apply(Function::Sin, a) => {
                    let cosine = self.apply(Function::Cos, a);
                    self.multiply(cosine, change[a as usize])
                }
                Step::Apply(Function::Cos, a) => {
                    let sine = self.apply(Function::Sin, a);
                    let product = self.multiply(sine, change[a as usize]);
                    self.negate(product)
                }
                // Dynamics have no other steps; what does not move with q has no change.
                Step::Divide(..) | Step::Absolute(_) | Step::Power(..) | Step::Apply(..) => zero,
            };
        }
        wanted.iter().map(|&id| change[id as usize]).collect()
    }

    /// Only the steps that `wanted` need, renumbered; `wanted` follow.
    pub(super) fn pruned(mut self, wanted: &mut [&mut [Id]]) -> Vec<Step> {
        let mut needed = vec![false; self.steps.len()];
        for id in wanted.iter().flat_map(|ids| ids.iter()) {
            needed[*id as usize] = true;
        }
        for at in (0..self.steps.len()).rev() {
            if needed[at] {
                self.steps[at].operands(|operand| needed[*operand as usize] = true);
            }
        }
        let mut place = vec![0; self.steps.len()];
        let mut kept = Vec::new();
        for (at, step) in self.steps.iter_mut().enumerate() {
            if needed[at] {
                step.operands(|operand| *operand = place[*operand as usize]);
                place[at] = kept.len() as Id;
                kept.push(*step);
            }
        }
        for id in wanted.iter_mut().flat_map(|ids| ids.iter_mut()) {
            *id = place[*id as usize];
        }
        kept
    }
}
