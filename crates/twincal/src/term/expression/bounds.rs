//! Values of all nodes at one state together with a bound on their rounding error.
//!
//! "This column is zero" must not depend on a tolerance somebody guessed: a value that is smaller than its own rounding
//! error says nothing, one that is larger is really there. First-order running error analysis (Higham, Accuracy and
//! Stability of Numerical Algorithms, section 3.3).

use super::graph::{Function, Graph, Id, Node, Number, Variable};

/// Relative rounding error of one operation, at most.
const EPS: f64 = f64::EPSILON;

/// A value and a bound on its absolute rounding error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounded {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

impl Bounded {
    /// True if value and error are numbers.
    pub(crate) fn is_finite(self) -> bool {
        self.value.is_finite() && self.error.is_finite()
    }
    /// True if rounding alone can explain the value.
    pub(crate) fn may_be_zero(self) -> bool {
        self.value.abs() <= 8.0 * self.error
    }
}

/// Every node of `graph` at the state that `coordinate` gives; entry i belongs to node i.
pub(crate) fn bounded_values(graph: &Graph, coordinate: impl Fn(Variable) -> f64) -> Vec<Bounded> {
    let mut all: Vec<Bounded> = Vec::with_capacity(graph.nodes().len());
    for node in graph.nodes() {
        let entry = match node {
            Node::Constant(c) => Bounded {
                value: c.get(),
                error: 0.0,
            },
            Node::Variable(variable) => Bounded {
                value: coordinate(*variable),
                error: 0.0,
            },
            Node::Sum(constant, parts) => sum(&all, constant.get(), parts),
            Node::Product(factors) => product(&all, factors),
            &Node::Power(base, exponent) => {
                let x = all[base.0 as usize];
                let value = x.value.powf(exponent.get());
                let slope = exponent.get() * x.value.powf(exponent.get() - 1.0);
                Bounded {
                    value,
                    error: slope.abs() * x.error + 4.0 * EPS * value.abs(),
                }
            }
            &Node::Function(function, argument) => of_function(function, all[argument.0 as usize]),
        };
        all.push(entry);
    }
    all
}

/// constant + Σ coefficient · part.
fn sum(all: &[Bounded], constant: f64, parts: &[(Number, Id)]) -> Bounded {
    let (mut value, mut error, mut size) = (constant, 0.0, constant.abs());
    for &(c, part) in parts {
        let x = all[part.0 as usize];
        value += c.get() * x.value;
        error += c.get().abs() * x.error;
        size += (c.get() * x.value).abs();
    }
    Bounded {
        value,
        error: error + EPS * size * (parts.len() as f64 + 1.0),
    }
}

/// Π factor^exponent.
fn product(all: &[Bounded], factors: &[(Id, i32)]) -> Bounded {
    let (mut value, mut largest) = (1.0, 1.0);
    for &(factor, exponent) in factors {
        let x = all[factor.0 as usize];
        value *= x.value.powi(exponent);
        let reach = if exponent > 0 {
            x.value.abs() + x.error
        } else {
            (x.value.abs() - x.error).max(0.0)
        };
        largest *= reach.powi(exponent); // 1/0 = ∞: unusable
    }
    let steps = factors
        .iter()
        .map(|&(_, e)| f64::from(e).abs())
        .sum::<f64>();
    Bounded {
        value,
        error: (largest - value.abs()) + EPS * steps * largest,
    }
}

/// f(x), with the error of x by f's slope.
fn of_function(function: Function, x: Bounded) -> Bounded {
    let value = function.value(x.value);
    let slope = match function {
        Function::Sin | Function::Cos | Function::Atan => 1.0,
        Function::Tan => 1.0 + value * value,
        Function::Exp => value,
        Function::Log => 1.0 / x.value,
        Function::Sqrt => 0.5 / value,
        Function::Sinh | Function::Cosh => value.abs() + 1.0,
        Function::Tanh => 1.0,
        Function::Sign => 0.0,
    };
    let inherited = if x.error == 0.0 {
        0.0
    } else {
        slope.abs() * x.error
    };
    Bounded {
        value,
        error: inherited + 4.0 * EPS * value.abs(),
    }
}
