//! Exact derivatives, each computed once.

use super::graph::{Function, Graph, Id, Node, Variable};

impl Graph {
    /// ∂expression/∂variable, all other coordinates held.
    pub(crate) fn derivative(&mut self, expression: Id, variable: Variable) -> Id {
        if let Some(&known) = self.derivatives.get(&(expression, variable)) {
            return known;
        }
        let result = match self.node(expression).clone() {
            Node::Constant(_) => self.constant(0.0),
            Node::Variable(own) => self.constant(f64::from(u8::from(own == variable))),
            Node::Sum(_, parts) => {
                let parts: Vec<(f64, Id)> = parts
                    .iter()
                    .map(|&(c, part)| (c.get(), self.derivative(part, variable)))
                    .collect();
                self.sum(0.0, &parts)
            }
            Node::Product(factors) => {
                // Σᵢ eᵢ fᵢ' fᵢ^(eᵢ−1) Π_{j≠i} fⱼ^eⱼ
                let mut parts = Vec::new();
                for (i, &(factor, exponent)) in factors.iter().enumerate() {
                    let inner = self.derivative(factor, variable);
                    if self.is_zero(inner) || self.is_exhausted() {
                        continue;
                    }
                    let mut rest = factors.to_vec();
                    rest[i].1 -= 1;
                    rest.push((inner, 1));
                    parts.push((f64::from(exponent), self.product(&rest)));
                }
                self.sum(0.0, &parts)
            }
            Node::Power(base, exponent) => {
                let inner = self.derivative(base, variable);
                let lower = self.power(base, exponent.get() - 1.0);
                let product = self.product(&[(inner, 1), (lower, 1)]);
                self.scaled(exponent.get(), product)
            }
            Node::Function(function, argument) => {
                let inner = self.derivative(argument, variable);
                if self.is_zero(inner) {
                    inner
                } else {
                    let outer = self.outer_derivative(function, argument, expression);
                    self.product(&[(outer, 1), (inner, 1)])
                }
            }
        };
        self.derivatives.insert((expression, variable), result);
        result
    }

    /// f'(x), where `value` is f(x).
    fn outer_derivative(&mut self, function: Function, x: Id, value: Id) -> Id {
        match function {
            Function::Sin => self.function(Function::Cos, x),
            Function::Cos => {
                let sine = self.function(Function::Sin, x);
                self.scaled(-1.0, sine)
            }
            Function::Tan => {
                let square = self.product(&[(value, 2)]);
                self.sum(1.0, &[(1.0, square)])
            }
            Function::Exp => value,
            Function::Log => self.product(&[(x, -1)]),
            Function::Sqrt => {
                let reciprocal = self.product(&[(value, -1)]);
                self.scaled(0.5, reciprocal)
            }
            Function::Sinh => self.function(Function::Cosh, x),
            Function::Cosh => self.function(Function::Sinh, x),
            Function::Tanh => {
                let square = self.product(&[(value, 2)]);
                self.sum(1.0, &[(-1.0, square)])
            }
            Function::Atan => {
                let square = self.product(&[(x, 2)]);
                let denominator = self.sum(1.0, &[(1.0, square)]);
                self.product(&[(denominator, -1)])
            }
            Function::Sign => self.constant(0.0),
        }
    }
}
