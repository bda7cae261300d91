//! The elimination tree from the root over the lanes and the thread pool's tasks down to the subtrees of one task.

use super::near_root::{join, leaves_out, split};
use super::node::{Node, from_lanes, lanes};
use super::plan::{Plan, Top, plan};
use super::subtree::{descend, scratch_len};
use super::sums::Layout;
use super::tally::Tally;
use super::tree::{LOG_REFERENCE, Root, Tree};
use crate::infer::standard::Standard;
use crate::prior::Prior;
use pulp::bytemuck::Pod;
use pulp::{Simd, WithSimd};

/// Subtrees of up to this many components (2^14 models in every lane) are one task.
const TASK_COMPONENTS: usize = 14;
/// Up to so many components to decide, the sums are true to more digits: walking further costs next to nothing.
const FEW: usize = 20;
/// What is taken off the limit of a second walk besides what the first one left out too much.
const LIGHTER: f64 = -1.0;

/// How much of the models may stay unvisited.
#[derive(Clone, Copy)]
struct Unvisited {
    /// ln of the share of a single model's weight below which a subtree is not visited, at first; where all those subtrees together
    /// may weigh more than `most`, what they weigh too much and so much more is taken off it.
    light: f64,
    /// Share of the sum that all models that are not visited may weigh together, by their bounds; what they did weigh in tests was a
    /// hundredth of that or less.
    most: f64,
}

impl Unvisited {
    fn of(open: usize) -> Self {
        if open <= FEW {
            Self {
                light: -32.0,
                most: 1e-10,
            }
        } else {
            Self {
                light: -26.0,
                most: 1e-8,
            }
        }
    }
}

/// Sums over all models ([`Layout`] of K columns; weights times e^[`LOG_REFERENCE`]) and the heaviest of them, as sets
/// of the components after the first `certain` ones, which every model holds. `reference`: ln of the weight of any model; −∞ to visit
/// every one. The tree is walked until what is not visited weighs no more than it may ([`Unvisited`]), mostly once.
pub(super) fn sum_all_models(
    standard: &Standard,
    prior: &Prior,
    certain: usize,
    reference: f64,
) -> (Vec<f64>, Tally) {
    let Unvisited { mut light, most } = Unvisited::of(standard.blocks.len() - certain);
    loop {
        let (sums, tally, bound) = sum_but(standard, prior, certain, reference + light);
        // Not a number where nothing has weight: another walk gains nothing.
        if bound <= most || bound.is_nan() {
            return (sums, tally);
        }
        light += LIGHTER - (bound / most).ln();
    }
}

/// The same but for subtrees whose ln weight is below `least`, and the share of the sum that they weigh at most.
pub(super) fn sum_but(
    standard: &Standard,
    prior: &Prior,
    certain: usize,
    least: f64,
) -> (Vec<f64>, Tally, f64) {
    let factors: f64 = standard.blocks.iter().map(|b| b.factor.ln()).sum();
    let (sums, tally) = pulp::Arch::new().dispatch(Root {
        standard,
        prior,
        certain,
        least: (least - factors).exp(),
    });
    let left_out = tally.not_visited().ln() + factors + LOG_REFERENCE;
    let weight = sums[Layout::new(standard.size()).weight()];
    (sums, tally, (left_out - weight.ln()).exp())
}

impl WithSimd for Root<'_> {
    type Output = (Vec<f64>, Tally);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        root(simd, self)
    }
}

/// The certain columns, then the columns of the first components (3 with eight lanes): lane l includes component d where
/// bit d of l is set.
fn root<S: Simd>(simd: S, about: Root<'_>) -> (Vec<f64>, Tally) {
    let Plan { tree, top, padded } = plan::<S>(about);
    let mut node = undecided(simd, about.standard, padded);
    let mut above = Vec::new();
    for (d, column) in top.iter().enumerate() {
        let (mut inside, outside) = split(
            simd,
            &tree.levels[padded - d - 1],
            padded - d,
            &node,
            column.odds,
        );
        leave_lanes(column, &mut inside, &outside);
        above.push(std::mem::replace(&mut node, inside));
    }
    let (mut sums, tally) = branch(simd, &tree, padded - top.len(), node);
    for (d, (node, column)) in above.iter().zip(&top).enumerate().rev() {
        let (inside, outside): (Vec<_>, Vec<_>) =
            sums.iter().map(|x| sides(simd, column, x)).unzip();
        sums = join(
            simd,
            &tree.levels[padded - d - 1],
            padded - d,
            node,
            &inside,
            &outside,
        );
    }
    (of_first_lane(&sums, padded, about.standard.size()), tally)
}

/// The node of `padded` columns before any is decided.
fn undecided<S: Simd>(simd: S, standard: &Standard, padded: usize) -> Node<S::f64s> {
    let size = standard.size();
    let mut node = Node::<S::f64s>::blank(padded);
    let pairs = (0..padded).flat_map(|i| (i..padded).map(move |j| (i, j)));
    for (entry, (i, j)) in node.s.iter_mut().zip(pairs) {
        // Columns that only fill the lanes are never included.
        *entry = simd.splat_f64s(if j < size {
            standard.matrix[i * size + j]
        } else {
            f64::from(i == j)
        });
    }
    for (h, offset) in node.h.iter_mut().zip(&standard.offset) {
        *h = simd.splat_f64s(*offset);
    }
    (node.weight, node.ceiling) = (simd.splat_f64s(1.0), simd.splat_f64s(1.0));
    node
}

/// Puts the node without a column in the lanes that leave its component out.
fn leave_lanes<V: Pod>(column: &Top<V>, inside: &mut Node<V>, outside: &Node<V>) {
    let takes = |lane: usize| column.bit.is_none_or(|bit| lane >> bit & 1 == 1);
    let select = |a: &mut V, b: &V| {
        *a = from_lanes(|lane| {
            if takes(lane) {
                lanes(a)[lane]
            } else {
                lanes(b)[lane]
            }
        });
    };
    let pairs = inside.s.iter_mut().zip(&outside.s);
    pairs.for_each(|(a, b)| select(a, b));
    let pairs = inside.h.iter_mut().zip(&outside.h);
    pairs.for_each(|(a, b)| select(a, b));
    select(&mut inside.c, &outside.c);
    select(&mut inside.weight, &outside.weight);
    (inside.count, inside.set) = (0, 0);
    inside.stale |= outside.stale;
}

/// A sum over the models with a column and over those without it, in the lanes of both.
fn sides<S: Simd>(simd: S, column: &Top<S::f64s>, x: &S::f64s) -> (S::f64s, S::f64s) {
    match column.bit {
        None => (*x, simd.splat_f64s(0.0)),
        // Each lane meets the one that differs from it in this component only.
        Some(bit) if column.first => (
            from_lanes(|lane| lanes(x)[lane | 1 << bit]),
            from_lanes(|lane| lanes(x)[lane & !(1 << bit)]),
        ),
        Some(bit) => {
            let own =
                |lane: usize, side: usize| f64::from(lane >> bit & 1 == side) * lanes(x)[lane];
            (
                from_lanes(|lane| own(lane, 1)),
                from_lanes(|lane| own(lane, 0)),
            )
        }
    }
}

/// The sums of the first lane, without the columns that only fill the lanes.
fn of_first_lane<V: Pod>(sums: &[V], padded: usize, size: usize) -> Vec<f64> {
    let (wide, own) = (Layout::new(padded), Layout::new(size));
    let first = |index: usize| lanes(&sums[index])[0];
    let mut out = vec![0.0; own.len()];
    out[own.weight()] = first(wide.weight());
    out[own.noise()] = first(wide.noise());
    for j in 0..size {
        out[own.inclusion(j)] = first(wide.inclusion(j));
        out[own.shift(j)] = first(wide.shift(j));
        for l in j..size {
            out[own.moment(j, l)] = first(wide.moment(j, l));
        }
    }
    out
}

/// Nodes near the root: their two branches may run on two threads.
fn branch<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    mut node: Node<S::f64s>,
) -> (Vec<S::f64s>, Tally) {
    let mut tally = Tally::new(&tree.heavy);
    if leaves_out(simd, tree, m, &mut node, &mut tally) {
        return (vec![simd.splat_f64s(0.0); Layout::new(m).len()], tally);
    }
    let level = m.checked_sub(1).map(|last| &tree.levels[last]);
    let Some(level) = level.filter(|level| level.left > TASK_COMPONENTS) else {
        let zero = simd.splat_f64s(0.0);
        let mut out = vec![zero; Layout::new(m).len()];
        let mut scratch = vec![zero; scratch_len(m)];
        descend(
            simd,
            tree,
            m,
            node.view(),
            &mut out,
            &mut scratch,
            &mut tally,
        );
        return (out, tally);
    };
    let (inside, outside) = split(simd, level, m, &node, level.odds(node.count));
    let nothing = || vec![simd.splat_f64s(0.0); Layout::new(m - 1).len()];
    match level.branches(node.set) {
        (true, true) => {
            let ((inside, first), (outside, second)) = rayon::join(
                || branch(simd, tree, m - 1, inside),
                || branch(simd, tree, m - 1, outside),
            );
            (
                join(simd, level, m, &node, &inside, &outside),
                first.merge(second),
            )
        }
        (true, false) => {
            let (inside, tally) = branch(simd, tree, m - 1, inside);
            (join(simd, level, m, &node, &inside, &nothing()), tally)
        }
        (false, true) => {
            let (outside, tally) = branch(simd, tree, m - 1, outside);
            (join(simd, level, m, &node, &nothing(), &outside), tally)
        }
        (false, false) => (vec![simd.splat_f64s(0.0); Layout::new(m).len()], tally),
    }
}
