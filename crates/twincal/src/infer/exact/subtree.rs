//! The subtrees of one task: the kernel where all the time goes. Small ones are written out with constant sizes.

use super::eliminate::{exclude, include, reciprocal};
use super::node::View;
use super::sums::{Elimination, Layout, combine, triangle};
use super::tally::Tally;
use super::tree::{LOG_REFERENCE, Tree};
use pulp::{Simd, WithSimd};

/// Largest m whose whole subtree is written out.
pub(super) const WRITTEN_OUT: usize = 3;

/// Vectors that the subtree of m columns needs: the including child's S, a child's h, the sums of both children.
pub(super) fn scratch_len(m: usize) -> usize {
    (1..=m)
        .map(|m| triangle(m - 1) + (m - 1) + 2 * Layout::new(m - 1).len())
        .sum()
}

/// Whoever sums over the models below a child.
trait Below<S: Simd> {
    fn sum(
        &mut self,
        simd: S,
        tree: &Tree<S::f64s>,
        node: View<'_, S::f64s>,
        out: &mut [S::f64s],
        tally: &mut Tally,
    );
}

/// Room for the children of one node.
struct Room<'a, V> {
    s: &'a mut [V],
    h: &'a mut [V],
    inside: &'a mut [V],
    outside: &'a mut [V],
}

/// Sums over a node from those `below` its children; `branches` says which of them (included, excluded) exist.
#[expect(
    clippy::too_many_arguments,
    reason = "one call in the hot loop, all of it in registers"
)]
#[inline(always)]
fn visit<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: View<'_, S::f64s>,
    branches: (bool, bool),
    room: Room<'_, S::f64s>,
    below: &mut impl Below<S>,
    out: &mut [S::f64s],
    tally: &mut Tally,
) {
    let level = &tree.levels[m - 1];
    let Room {
        s,
        h,
        inside,
        outside,
    } = room;
    let r = reciprocal(simd, node.s[0], level.precision);
    let (include_odds, exclude_odds) = level.odds(node.count);
    if branches.0 {
        let c = include(simd, m, node, r, s, h);
        let odds = simd.mul_f64s(include_odds, simd.sqrt_f64s(r));
        let child = View {
            s,
            h,
            c,
            weight: simd.mul_f64s(node.weight, odds),
            count: node.count + level.step,
            set: node.set | level.bit,
            ..node
        };
        below.sum(simd, tree, child, inside, tally);
    } else {
        inside.fill(simd.splat_f64s(0.0));
    }
    if branches.1 {
        let child = without(simd, m, node, (level.center, exclude_odds), h);
        below.sum(simd, tree, child, outside, tally);
    } else {
        outside.fill(simd.splat_f64s(0.0));
    }
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
        out,
    );
}

/// The child without a column, whose coefficient is `center` from there, in the room of its h.
#[inline(always)]
fn without<'a, S: Simd>(
    simd: S,
    m: usize,
    node: View<'a, S::f64s>,
    (center, odds): (S::f64s, S::f64s),
    h: &'a mut [S::f64s],
) -> View<'a, S::f64s> {
    let c = exclude(simd, m, node, center, h);
    View {
        s: &node.s[m..],
        h,
        c,
        weight: simd.mul_f64s(node.weight, odds),
        stale: true,
        ..node
    }
}

/// Sums over the subtree of m columns below `node`.
pub(super) fn descend<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: View<'_, S::f64s>,
    out: &mut [S::f64s],
    scratch: &mut [S::f64s],
    tally: &mut Tally,
) {
    simd.vectorize(Descend {
        simd,
        tree,
        m,
        node,
        out,
        scratch,
        tally,
    });
}

/// Recursion loses the instruction set; `vectorize` gives it back at every level.
struct Descend<'a, S: Simd> {
    simd: S,
    tree: &'a Tree<S::f64s>,
    m: usize,
    node: View<'a, S::f64s>,
    out: &'a mut [S::f64s],
    scratch: &'a mut [S::f64s],
    tally: &'a mut Tally,
}

impl<S: Simd> WithSimd for Descend<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<Same: Simd>(self, _: Same) {
        let Self {
            simd,
            tree,
            m,
            node,
            out,
            scratch,
            tally,
        } = self;
        if m <= tree.written_out {
            match m {
                0 => Written::<0>.sum(simd, tree, node, out, tally),
                1 => Written::<1>.sum(simd, tree, node, out, tally),
                2 => Written::<2>.sum(simd, tree, node, out, tally),
                _ => Written::<3>.sum(simd, tree, node, out, tally),
            }
            return;
        }
        let mut node = node;
        if tree.leaves_out(simd, m, &mut node, scratch, tally) {
            out.fill(simd.splat_f64s(0.0));
            return;
        }
        // Constant sizes: loops without counters and without checks of length.
        let (s, h) = (node.s, node.h);
        macro_rules! of_constant_size {
            ($($size:literal)*) => {
                match m {
                    $($size => {
                        let node = View {
                            s: &s[..triangle($size)],
                            h: &h[..$size],
                            ..node
                        };
                        let out = &mut out[..Layout::new($size).len()];
                        step(simd, tree, $size, node, out, scratch, tally);
                    })*
                    _ => step(simd, tree, m, node, out, scratch, tally),
                }
            };
        }
        of_constant_size!(4 5 6 7 8);
    }
}

/// One level of the recursion.
#[inline(always)]
fn step<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: View<'_, S::f64s>,
    out: &mut [S::f64s],
    scratch: &mut [S::f64s],
    tally: &mut Tally,
) {
    let (s, scratch) = scratch.split_at_mut(triangle(m - 1));
    let (h, scratch) = scratch.split_at_mut(m - 1);
    let (inside, scratch) = scratch.split_at_mut(Layout::new(m - 1).len());
    let (outside, scratch) = scratch.split_at_mut(Layout::new(m - 1).len());
    let room = Room {
        s,
        h,
        inside,
        outside,
    };
    let branches = tree.levels[m - 1].branches(node.set);
    let below = &mut Deeper { m: m - 1, scratch };
    visit(simd, tree, m, node, branches, room, below, out, tally);
}

/// The recursion.
struct Deeper<'a, V> {
    m: usize,
    scratch: &'a mut [V],
}

impl<S: Simd> Below<S> for Deeper<'_, S::f64s> {
    #[inline(always)]
    fn sum(
        &mut self,
        simd: S,
        tree: &Tree<S::f64s>,
        node: View<'_, S::f64s>,
        out: &mut [S::f64s],
        tally: &mut Tally,
    ) {
        descend(simd, tree, self.m, node, out, self.scratch, tally);
    }
}

/// The subtree of the last M columns, each a component of its own, with all sizes constant.
struct Written<const M: usize>;

/// A leaf: `w = weight · e^600 (1 + c)^−a_n`.
impl<S: Simd> Below<S> for Written<0> {
    #[inline(always)]
    fn sum(
        &mut self,
        simd: S,
        tree: &Tree<S::f64s>,
        node: View<'_, S::f64s>,
        out: &mut [S::f64s],
        tally: &mut Tally,
    ) {
        let (ratio, likelihood) = tree.likelihood(simd, node.c, LOG_REFERENCE);
        let weight = simd.mul_f64s(node.weight, likelihood);
        tally.offer(simd, weight, node.set, &tree.heavy);
        out[0] = weight;
        out[1] = simd.mul_f64s(simd.mul_f64s(weight, ratio), simd.splat_f64s(tree.noise));
    }
}

/// Writes out the subtree of `$m` columns.
macro_rules! written_out {
    ($m:literal) => {
        impl<S: Simd> Below<S> for Written<$m> {
            #[inline(always)]
            fn sum(
                &mut self,
                simd: S,
                tree: &Tree<S::f64s>,
                node: View<'_, S::f64s>,
                out: &mut [S::f64s],
                tally: &mut Tally,
            ) {
                let (Some(s), Some(h)) = (
                    node.s.first_chunk::<{ triangle($m) }>(),
                    node.h.first_chunk::<$m>(),
                ) else {
                    return;
                };
                let Some(out) = out.first_chunk_mut::<{ Layout::new($m).len() }>() else {
                    return;
                };
                let zero = simd.splat_f64s(0.0);
                let room = Room {
                    s: &mut [zero; triangle($m - 1)],
                    h: &mut [zero; $m - 1],
                    inside: &mut [zero; Layout::new($m - 1).len()],
                    outside: &mut [zero; Layout::new($m - 1).len()],
                };
                let node = View { s, h, ..node };
                let below = &mut Written::<{ $m - 1 }>;
                visit(simd, tree, $m, node, (true, true), room, below, out, tally);
            }
        }
    };
}

written_out!(1);
written_out!(2);
written_out!(3);
