//! Hash-consed expressions: equal expressions are one node, so common subexpressions exist once by construction.
//!
//! Sums and products are flat and sorted, like parts are merged, constants are folded: `q1*2 + 3*q1` IS `5*q1`.

use std::collections::HashMap;

/// Largest integer power that is written as repeated multiplication.
pub(crate) const LARGEST_INTEGER_POWER: i32 = 1024;
/// Operands of all nodes together before the graph calls itself exhausted (about 100 MB).
const OPERAND_LIMIT: usize = 2_000_000;

/// A node of a [`Graph`]; operands always have smaller numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Id(pub(crate) u32);

/// A coordinate of the motion, 0-based.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Variable {
    /// q̇ᵢ.
    Velocity(usize),
    /// qᵢ.
    Position(usize),
    /// q̈ᵢ: only in images, never in a Lagrangian.
    Acceleration(usize),
    /// A channel of the motion's history: only in images, as a coordinate of its own.
    History(usize),
}

/// Functions of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Function {
    /// sin x.
    Sin,
    /// cos x.
    Cos,
    /// tan x.
    Tan,
    /// eˣ.
    Exp,
    /// ln x.
    Log,
    /// √x.
    Sqrt,
    /// sinh x.
    Sinh,
    /// cosh x.
    Cosh,
    /// tanh x.
    Tanh,
    /// atan x.
    Atan,
    /// −1, 0 or 1; only in Coulomb columns, not in the grammar.
    Sign,
}

impl Function {
    /// f(x).
    #[inline(always)]
    pub(crate) fn value(self, x: f64) -> f64 {
        match self {
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Exp => x.exp(),
            Self::Log => x.ln(),
            Self::Sqrt => x.sqrt(),
            Self::Sinh => x.sinh(),
            Self::Cosh => x.cosh(),
            Self::Tanh => x.tanh(),
            Self::Atan => x.atan(),
            Self::Sign => {
                if x == 0.0 {
                    0.0
                } else {
                    1.0_f64.copysign(x)
                }
            }
        }
    }
}

/// A number that can be a key: compared by its bits, −0 is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Number(u64);

impl Number {
    /// The key of `value`.
    pub(crate) fn new(value: f64) -> Self {
        Self(if value == 0.0 { 0 } else { value.to_bits() })
    }
    /// The number.
    pub(crate) fn get(self) -> f64 {
        f64::from_bits(self.0)
    }
}

/// What a node computes.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    /// A number.
    Constant(Number),
    /// A coordinate.
    Variable(Variable),
    /// constant + Σ coefficient · part; parts ascending, none of them a sum or a constant.
    Sum(Number, Box<[(Number, Id)]>),
    /// Π factor^exponent; factors ascending, none of them a product, a constant or a multiple of one part.
    Product(Box<[(Id, i32)]>),
    /// base^exponent with an exponent that is no (small) integer.
    Power(Id, Number),
    /// f(argument).
    Function(Function, Id),
}

/// All expressions of one library.
#[derive(Debug, Clone, Default)]
pub(crate) struct Graph {
    nodes: Vec<Node>,
    ids: HashMap<Node, Id>,
    operands: usize,
    /// d(node)/d(variable), filled by `derivative`.
    pub(super) derivatives: HashMap<(Id, Variable), Id>,
}

impl Graph {
    /// All nodes; the operands of a node stand before it.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// What `id` computes.
    pub(crate) fn node(&self, id: Id) -> &Node {
        &self.nodes[id.0 as usize]
    }

    /// The number of `node` if it exists already.
    pub(crate) fn find(&self, node: &Node) -> Option<Id> {
        self.ids.get(node).copied()
    }

    /// True once the graph has refused to grow; every expression made since then is meaningless.
    pub(crate) fn is_exhausted(&self) -> bool {
        self.operands > OPERAND_LIMIT
    }

    fn intern(&mut self, node: Node) -> Id {
        if let Some(&id) = self.ids.get(&node) {
            return id;
        }
        self.operands += match &node {
            Node::Sum(_, parts) => parts.len() + 1,
            Node::Product(factors) => factors.len() + 1,
            _ => 1,
        };
        if self.is_exhausted() {
            return Id(0);
        }
        let id = Id(self.nodes.len() as u32);
        self.nodes.push(node.clone());
        self.ids.insert(node, id);
        id
    }

    /// A number.
    pub(crate) fn constant(&mut self, value: f64) -> Id {
        self.intern(Node::Constant(Number::new(value)))
    }

    /// A coordinate.
    pub(crate) fn variable(&mut self, variable: Variable) -> Id {
        self.intern(Node::Variable(variable))
    }

    /// The number that `id` is, if it is one.
    pub(crate) fn as_constant(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Constant(value) => Some(value.get()),
            _ => None,
        }
    }

    /// True if `id` is the number 0.
    pub(crate) fn is_zero(&self, id: Id) -> bool {
        self.as_constant(id) == Some(0.0)
    }

    /// constant + Σ coefficient · part.
    pub(crate) fn sum(&mut self, constant: f64, parts: &[(f64, Id)]) -> Id {
        let mut constant = constant;
        let mut flat: Vec<(Id, f64)> = Vec::with_capacity(parts.len());
        for &(coefficient, part) in parts {
            match self.node(part) {
                Node::Constant(value) => constant += coefficient * value.get(),
                Node::Sum(inner, inner_parts) => {
                    constant += coefficient * inner.get();
                    flat.extend(
                        inner_parts
                            .iter()
                            .map(|&(c, id)| (id, coefficient * c.get())),
                    );
                }
                _ => flat.push((part, coefficient)),
            }
        }
        flat.sort_by_key(|&(id, _)| id); // stable: like parts are added in the order written
        let mut merged: Vec<(f64, Id)> = Vec::with_capacity(flat.len());
        for (id, coefficient) in flat {
            match merged.last_mut() {
                Some((total, last)) if *last == id => *total += coefficient,
                _ => merged.push((coefficient, id)),
            }
        }
        merged.retain(|&(coefficient, _)| coefficient != 0.0);
        match merged[..] {
            [] => self.constant(constant),
            [(1.0, part)] if constant == 0.0 => part,
            _ => {
                let parts = merged
                    .into_iter()
                    .map(|(c, id)| (Number::new(c), id))
                    .collect();
                self.intern(Node::Sum(Number::new(constant), parts))
            }
        }
    }

    /// coefficient · part.
    pub(crate) fn scaled(&mut self, coefficient: f64, part: Id) -> Id {
        self.sum(0.0, &[(coefficient, part)])
    }

    /// Π factor^exponent.
    pub(crate) fn product(&mut self, factors: &[(Id, i32)]) -> Id {
        let mut coefficient = 1.0;
        let mut flat: Vec<(Id, i32)> = Vec::with_capacity(factors.len());
        for &(factor, exponent) in factors {
            let mut factor = factor;
            if let Node::Sum(constant, parts) = self.node(factor)
                && let ([(scale, part)], 0.0) = (&parts[..], constant.get())
            {
                coefficient *= scale.get().powi(exponent);
                factor = *part;
            }
            match self.node(factor) {
                Node::Constant(value) => coefficient *= value.get().powi(exponent),
                Node::Product(inner) => flat.extend(
                    inner
                        .iter()
                        .map(|&(id, e)| (id, e.saturating_mul(exponent))),
                ),
                _ => flat.push((factor, exponent)),
            }
        }
        flat.sort_by_key(|&(id, _)| id);
        let mut merged: Vec<(Id, i32)> = Vec::with_capacity(flat.len());
        for (id, exponent) in flat {
            match merged.last_mut() {
                Some((last, total)) if *last == id => *total = total.saturating_add(exponent),
                _ => merged.push((id, exponent)),
            }
        }
        merged.retain(|&(_, exponent)| exponent != 0);
        let product = match merged[..] {
            [] => return self.constant(coefficient),
            _ if coefficient == 0.0 => return self.constant(0.0),
            [(factor, 1)] => factor,
            _ => self.intern(Node::Product(merged.into())),
        };
        self.scaled(coefficient, product)
    }

    /// base^exponent for a real exponent.
    pub(crate) fn power(&mut self, base: Id, exponent: f64) -> Id {
        if let Some(value) = self.as_constant(base) {
            return self.constant(value.powf(exponent));
        }
        let limit = f64::from(LARGEST_INTEGER_POWER);
        let largest = match self.node(base) {
            Node::Product(factors) => factors
                .iter()
                .map(|&(_, e)| e.unsigned_abs())
                .max()
                .unwrap_or(1),
            _ => 1,
        };
        if exponent == exponent.trunc() && exponent.abs() * f64::from(largest) <= limit {
            return self.product(&[(base, exponent as i32)]);
        }
        self.intern(Node::Power(base, Number::new(exponent)))
    }

    /// f(argument).
    pub(crate) fn function(&mut self, function: Function, argument: Id) -> Id {
        match self.as_constant(argument) {
            Some(value) => self.constant(function.value(value)),
            None => self.intern(Node::Function(function, argument)),
        }
    }

    /// Frees what only further derivatives would need.
    pub(crate) fn forget_derivatives(&mut self) {
        self.derivatives = HashMap::new();
    }

    /// Calls `visit` with every operand of `id`.
    pub(crate) fn operands(&self, id: Id, mut visit: impl FnMut(Id)) {
        match self.node(id) {
            Node::Constant(_) | Node::Variable(_) => {}
            Node::Sum(_, parts) => parts.iter().for_each(|&(_, part)| visit(part)),
            Node::Product(factors) => factors.iter().for_each(|&(factor, _)| visit(factor)),
            Node::Power(base, _) => visit(*base),
            Node::Function(_, argument) => visit(*argument),
        }
    }

    /// The coordinates that occur in `id`, ascending.
    pub(crate) fn variables(&self, id: Id) -> Vec<Variable> {
        let mut seen = vec![false; id.0 as usize + 1];
        let mut stack = vec![id];
        let mut found = Vec::new();
        while let Some(id) = stack.pop() {
            if std::mem::replace(&mut seen[id.0 as usize], true) {
                continue;
            }
            if let Node::Variable(variable) = self.node(id) {
                found.push(*variable);
            }
            self.operands(id, |operand| stack.push(operand));
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_expressions_are_one_node() {
        let mut g = Graph::default();
        let x = g.variable(Variable::Position(0));
        let y = g.variable(Variable::Position(1));
        let (xy, yx) = (g.product(&[(x, 1), (y, 1)]), g.product(&[(y, 1), (x, 1)]));
        assert_eq!(xy, yx);
        let five_x = g.scaled(5.0, x);
        assert_eq!(g.sum(0.0, &[(2.0, x), (3.0, x)]), five_x);
        assert_eq!(g.product(&[(five_x, 1), (y, 1)]), g.scaled(5.0, xy));
        let zero = g.sum(0.0, &[(1.0, xy), (-1.0, yx)]);
        assert!(g.is_zero(zero));
        let cube = g.product(&[(x, 3)]);
        assert_eq!(g.product(&[(cube, 1), (x, -2)]), x);
        assert_eq!(g.power(cube, 2.0), g.product(&[(x, 6)]));
    }

    #[test]
    fn variables_are_found_once_and_in_order() {
        let mut g = Graph::default();
        let x = g.variable(Variable::Position(1));
        let v = g.variable(Variable::Velocity(0));
        let sine = g.function(Function::Sin, x);
        let term = g.product(&[(v, 2), (sine, 1), (x, 1)]);
        assert_eq!(
            g.variables(term),
            [Variable::Velocity(0), Variable::Position(1)]
        );
    }

    #[test]
    fn a_graph_that_would_eat_the_memory_says_so() {
        let mut g = Graph::default();
        let parts: Vec<(f64, Id)> = (0..2000)
            .map(|i| (1.0, g.variable(Variable::Position(i))))
            .collect();
        for i in 0..2000 {
            g.sum(f64::from(i), &parts);
        }
        assert!(g.is_exhausted());
    }
}
