//! Which components resemble which: the exchanges that a walk through models may need.
//!
//! A payload and the last link's mass moments together with its tensor say almost the same. Going from one story to the
//! other by flips alone passes through models that nobody believes.

use super::kin::{Kin, Step};
use super::standard::Standard;
use super::walker::Walker;
use crate::linear_algebra::Cholesky;
use crate::prior::Prior;

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

/// Exchanges among `active` components: one for one, one of several columns for two, and one for one with its parents: a
/// child can be far better than what it stands for, and its parent alone far worse. `single` keeps those of two single columns as well.
pub(super) fn exchanges(
    standard: &Standard,
    prior: &Prior,
    active: &[usize],
    single: bool,
) -> Vec<Exchange> {
    let shared = Shared::new(standard, active);
    let kin = Kin::new(standard, prior);
    let with_parents = |b: usize| -> Vec<usize> {
        let mut line = kin.as_ref().map_or(vec![b], |kin| kin.line(b));
        line.retain(|b| active.contains(b));
        line.sort_unstable();
        line
    };
    let mut all: Vec<Exchange> = Vec::new();
    for (place, &a) in active.iter().enumerate() {
        let mut alike: Vec<(f64, usize)> = active
            .iter()
            .enumerate()
            .filter(|&(other, _)| other != place)
            .map(|(other, &b)| (shared.of(place, other), b))
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
            let line = with_parents(b);
            if line.len() > 1 && !line.contains(&a) {
                all.push(Exchange {
                    left: vec![a],
                    right: line,
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
/// `tr(A_aa⁻¹ A_ab A_bb⁻¹ A_ba) / min(|a|, |b|)`, for all pairs.
struct Shared {
    count: usize,
    /// By place in `active`.
    shares: Vec<f64>,
}

impl Shared {
    fn new(standard: &Standard, active: &[usize]) -> Self {
        let (size, count) = (standard.size(), active.len());
        let at = |i: usize, j: usize| standard.matrix[i * size + j];
        let factors: Vec<Option<Cholesky>> = active
            .iter()
            .map(|&b| {
                let block = &standard.blocks[b];
                let values: Vec<f64> = block
                    .range()
                    .flat_map(|i| block.range().map(move |j| at(i, j)))
                    .collect();
                Cholesky::new(&values, block.len).ok()
            })
            .collect();
        let mut shares = vec![1.0; count * count];
        let (mut x, mut row) = (Vec::new(), Vec::new());
        for a in 0..count {
            let own = &standard.blocks[active[a]];
            for b in 0..a {
                let other = &standard.blocks[active[b]];
                let (Some(left), Some(right)) = (&factors[a], &factors[b]) else {
                    continue;
                };
                // L_a⁻¹ A_ab L_b⁻ᵀ: its squared norm is the trace
                let mut cross = vec![0.0; own.len * other.len];
                for (j, column) in other.range().enumerate() {
                    x.clear();
                    x.extend(own.range().map(|i| at(i, column)));
                    left.solve_lower(&mut x);
                    for (i, x) in x.iter().enumerate() {
                        cross[i * other.len + j] = *x;
                    }
                }
                let mut norm = 0.0;
                for values in cross.chunks_exact(other.len) {
                    row.clear();
                    row.extend_from_slice(values);
                    right.solve_lower(&mut row);
                    norm += row.iter().map(|x| x * x).sum::<f64>();
                }
                let share = norm / own.len.min(other.len) as f64;
                shares[a * count + b] = share;
                shares[b * count + a] = share;
            }
        }
        Self { count, shares }
    }

    fn of(&self, a: usize, b: usize) -> f64 {
        self.shares[a * self.count + b]
    }
}
