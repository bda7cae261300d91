//! Which components resemble which: the exchanges that a walk through models may need.
//!
//! A payload and the last link's mass moments together with its tensor say almost the same. Going from one story to the
//! other by flips alone passes through models that nobody believes.

use super::standard::Standard;
use super::walker::{Step, Walker};
use crate::linear_algebra::Cholesky;

/// Components that share less of their columns than this are no pair: two flips do the same.
const ALIKE: f64 = 0.3;
/// Exchanges per component, the most alike first.
const PER_COMPONENT: usize = 5;

/// Two sets of components that can stand for each other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Exchange {
    pub(super) left: Vec<usize>,
    pub(super) right: Vec<usize>,
}

impl Exchange {
    /// The step that the present model allows: one side wholly in, the other wholly out.
    pub(super) fn step(&self, walker: &Walker<'_>) -> Option<Step> {
        let holds = |side: &[usize]| side.iter().filter(|&&b| walker.tableau.holds(b)).count();
        let (left, right) = (holds(&self.left), holds(&self.right));
        if left == self.left.len() && right == 0 {
            Some(Step {
                leaving: self.left.clone(),
                entering: self.right.clone(),
            })
        } else if right == self.right.len() && left == 0 {
            Some(Step {
                leaving: self.right.clone(),
                entering: self.left.clone(),
            })
        } else {
            None
        }
    }
}

/// Exchanges among `active` components: one for one, and one of several columns for two. `single` keeps those of two
/// single columns as well.
pub(super) fn exchanges(standard: &Standard, active: &[usize], single: bool) -> Vec<Exchange> {
    let mut all: Vec<Exchange> = Vec::new();
    for &a in active {
        let mut alike: Vec<(f64, usize)> = active
            .iter()
            .filter(|&&b| b != a)
            .map(|&b| (shared(standard, a, b), b))
            .filter(|(share, _)| *share > ALIKE * ALIKE)
            .collect();
        alike.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        alike.truncate(PER_COMPONENT);
        let wide = |b: usize| standard.blocks[b].len > 1;
        for &(_, b) in &alike {
            if single || wide(a) || wide(b) {
                all.push(Exchange {
                    left: vec![a.min(b)],
                    right: vec![a.max(b)],
                });
            }
        }
        if wide(a) {
            for (i, &(_, b)) in alike.iter().enumerate() {
                for &(_, c) in alike[i + 1..].iter().filter(|(_, c)| wide(b) || wide(*c)) {
                    all.push(Exchange {
                        left: vec![a],
                        right: vec![b.min(c), b.max(c)],
                    });
                }
            }
        }
    }
    all.sort_by(|x, y| (&x.left, &x.right).cmp(&(&y.left, &y.right)));
    all.dedup();
    all
}

/// Share of the smaller component's columns that lies in the span of the other, slab included:
/// `tr(A_aa⁻¹ A_ab A_bb⁻¹ A_ba) / min(|a|, |b|)`.
fn shared(standard: &Standard, a: usize, b: usize) -> f64 {
    let size = standard.size();
    let (a, b) = (standard.blocks[a], standard.blocks[b]);
    let at = |i: usize, j: usize| standard.matrix[i * size + j];
    if a.len == 1 && b.len == 1 {
        return at(a.start, b.start) * at(a.start, b.start);
    }
    let square = |block: &super::standard::Block| -> Option<Cholesky> {
        let values: Vec<f64> = block
            .range()
            .flat_map(|i| block.range().map(move |j| at(i, j)))
            .collect();
        Cholesky::new(&values, block.len).ok()
    };
    let (Some(own), Some(other)) = (square(&a), square(&b)) else {
        return 1.0;
    };
    // Rows of L_a⁻¹ A_ab, each then through L_b⁻¹: the squared norm is the trace.
    let mut cross = vec![0.0; a.len * b.len];
    for (j, column) in b.range().enumerate() {
        let mut x: Vec<f64> = a.range().map(|i| at(i, column)).collect();
        own.solve_lower(&mut x);
        for (i, x) in x.iter().enumerate() {
            cross[i * b.len + j] = *x;
        }
    }
    let norm: f64 = cross
        .chunks_exact_mut(b.len)
        .map(|row| {
            other.solve_lower(row);
            row.iter().map(|x| x * x).sum::<f64>()
        })
        .sum();
    norm / a.len.min(b.len) as f64
}
