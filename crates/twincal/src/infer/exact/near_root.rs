//! How the columns of a node near the root are split off and joined again.

use super::ahead::room;
use super::eliminate::{exclude, include, reciprocal};
use super::node::Node;
use super::sums::{Elimination, Layout, combine};
use super::tally::Tally;
use super::tree::{Level, Odds, Tree};
use pulp::{Simd, WithSimd};

/// Both children of a node.
pub(super) fn split<S: Simd>(
    simd: S,
    level: &Level<S::f64s>,
    m: usize,
    node: &Node<S::f64s>,
    odds: Odds<S::f64s>,
) -> (Node<S::f64s>, Node<S::f64s>) {
    simd.vectorize(Split {
        simd,
        level,
        m,
        node,
        odds,
    })
}

/// Carries its own instruction set, the one it is run with: vectors of another one would be other types.
struct Split<'a, S: Simd> {
    simd: S,
    level: &'a Level<S::f64s>,
    m: usize,
    node: &'a Node<S::f64s>,
    odds: Odds<S::f64s>,
}

impl<S: Simd> WithSimd for Split<'_, S> {
    type Output = (Node<S::f64s>, Node<S::f64s>);

    #[inline(always)]
    fn with_simd<Same: Simd>(self, _: Same) -> Self::Output {
        let Self {
            simd,
            level,
            m,
            node,
            odds,
        } = self;
        let (mut inside, mut outside) = (Node::blank(m - 1), Node::blank(m - 1));
        let r = reciprocal(simd, node.s[0], level.precision);
        inside.c = include(simd, m, node.view(), r, &mut inside.s, &mut inside.h);
        inside.weight = simd.mul_f64s(simd.mul_f64s(node.weight, odds.0), simd.sqrt_f64s(r));
        outside.c = exclude(simd, m, node.view(), level.center, &mut outside.h);
        outside.weight = simd.mul_f64s(node.weight, odds.1);
        outside.s.copy_from_slice(&node.s[m..]);
        (inside.ceiling, outside.ceiling) = (node.ceiling, node.ceiling);
        (inside.stale, outside.stale) = (node.stale, true);
        (inside.count, outside.count) = (node.count + level.step, node.count);
        (inside.set, outside.set) = (node.set | level.bit, node.set);
        (inside, outside)
    }
}

/// [`Tree::leaves_out`] of a node near the root, whose ceiling is kept.
pub(super) fn leaves_out<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: &mut Node<S::f64s>,
    tally: &mut Tally,
) -> bool {
    simd.vectorize(LeavesOut {
        simd,
        tree,
        m,
        node,
        tally,
    })
}

struct LeavesOut<'a, S: Simd> {
    simd: S,
    tree: &'a Tree<S::f64s>,
    m: usize,
    node: &'a mut Node<S::f64s>,
    tally: &'a mut Tally,
}

impl<S: Simd> WithSimd for LeavesOut<'_, S> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<Same: Simd>(self, _: Same) -> Self::Output {
        let Self {
            simd,
            tree,
            m,
            node,
            tally,
        } = self;
        let mut view = node.view();
        let mut scratch = vec![simd.splat_f64s(0.0); room(m)];
        let out = tree.leaves_out(simd, m, &mut view, &mut scratch, tally);
        (node.ceiling, node.stale) = (view.ceiling, view.stale);
        out
    }
}

/// Sums of a node from those of its children.
pub(super) fn join<S: Simd>(
    simd: S,
    level: &Level<S::f64s>,
    m: usize,
    node: &Node<S::f64s>,
    inside: &[S::f64s],
    outside: &[S::f64s],
) -> Vec<S::f64s> {
    simd.vectorize(Join {
        simd,
        level,
        m,
        node,
        inside,
        outside,
    })
}

struct Join<'a, S: Simd> {
    simd: S,
    level: &'a Level<S::f64s>,
    m: usize,
    node: &'a Node<S::f64s>,
    inside: &'a [S::f64s],
    outside: &'a [S::f64s],
}

impl<S: Simd> WithSimd for Join<'_, S> {
    type Output = Vec<S::f64s>;

    #[inline(always)]
    fn with_simd<Same: Simd>(self, _: Same) -> Self::Output {
        let Self {
            simd,
            level,
            m,
            node,
            inside,
            outside,
        } = self;
        let mut out = vec![simd.splat_f64s(0.0); Layout::new(m).len()];
        let r = reciprocal(simd, node.s[0], level.precision);
        combine(
            simd,
            m,
            Elimination {
                row: &node.s[..m],
                h: node.h[0],
                r,
                center: level.center,
            },
            inside,
            outside,
            &mut out,
        );
        out
    }
}
