//! What no model below a node outweighs, so that subtrees without weight need no visit.
//!
//! Below a node the columns that are included or yet to decide are free, the others are fixed at zero. The model that holds all that are
//! free fits at least as well as any other there, pivots √(r/v) are at most 1, and the prior factors below a node sum to one at most:
//!
//! ```text
//! Σ_{models below} weight · Π factor · (1 + c)^−a_n ≤ weight of the node · Π factor · (1 + c_free)^−a_n,     c_free = c − hᵀ S⁻¹ h
//! ```

use super::eliminate::{include, reciprocal};
use super::node::View;
use super::sums::triangle;
use super::tally::Tally;
use super::tree::Tree;
use crate::lanes::{exp, ln};
use pulp::Simd;

/// Columns yet to decide, this many and fewer: to find the misfit of those free costs more than it saves. The one found above holds.
const TOO_FEW: usize = 8;

impl<V: Copy> Tree<V> {
    /// Whether the models below a node may be left out, in which case the tally says so. Finds `node.ceiling`, `(1 + c_free)^−a_n` or more,
    /// where a column was excluded since it was found and that is worth the work. `scratch`: at least [`room`] of m.
    #[inline(always)]
    pub(super) fn leaves_out<S: Simd<f64s = V>>(
        &self,
        simd: S,
        m: usize,
        node: &mut View<'_, V>,
        scratch: &mut [V],
        tally: &mut Tally,
    ) -> bool {
        let most = |node: &View<'_, V>| simd.mul_f64s(node.weight, node.ceiling);
        let negligible = |most: V| simd.reduce_max_f64s(most) < self.least;
        let mut bound = most(node);
        if !negligible(bound) {
            if m <= TOO_FEW || !node.stale || self.least == 0.0 {
                return false;
            }
            (node.ceiling, node.stale) = (self.ceiling(simd, m, *node, scratch), false);
            bound = most(node);
            if !negligible(bound) {
                return false;
            }
        }
        tally.leave_out(simd.reduce_sum_f64s(bound));
        true
    }

    /// `(1 + c_free)^−a_n`: all m columns of a node minimised over, one after the other.
    #[inline(always)]
    fn ceiling<'a, S: Simd<f64s = V>>(
        &self,
        simd: S,
        m: usize,
        mut node: View<'a, V>,
        mut scratch: &'a mut [V],
    ) -> V {
        for m in (1..=m).rev() {
            let (s, rest) = scratch.split_at_mut(triangle(m - 1));
            let (h, rest) = rest.split_at_mut(m - 1);
            let r = reciprocal(simd, node.s[0], self.levels[m - 1].precision);
            let c = include(simd, m, node, r, s, h);
            node = View { s, h, c, ..node };
            scratch = rest;
        }
        self.likelihood(simd, node.c, 0.0).1
    }

    /// `1 + c`, and `e^reference (1 + c)^−a_n`.
    #[inline(always)]
    pub(super) fn likelihood<S: Simd<f64s = V>>(&self, simd: S, c: V, reference: f64) -> (V, V) {
        // c ≥ 0 but for rounding.
        let one = simd.splat_f64s(1.0);
        let ratio = simd.max_f64s(simd.add_f64s(c, one), one);
        let power = simd.mul_add_e_f64s(
            simd.splat_f64s(-self.shape),
            ln(simd, ratio),
            simd.splat_f64s(reference),
        );
        (ratio, exp(simd, power))
    }
}

/// Vectors that minimising over m columns needs.
pub(super) fn room(m: usize) -> usize {
    (1..=m).map(|m| triangle(m - 1) + m - 1).sum()
}
