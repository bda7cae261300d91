//! The elimination tree from the root over the lanes and the thread pool's tasks down to the subtrees of one task.

use super::heaviest::{Heaviest, Threshold};
use super::subtree::{descend, exclude, include, reciprocal, scratch_len};
use super::sums::{Elimination, Layout, combine, triangle};
use crate::infer::standard::Standard;
use crate::prior::Prior;
use pulp::{Simd, WithSimd, bytemuck};

/// ln of the factor on all weights: puts the misfit of the full model at e^600, so that both far better priors and far
/// worse misfits stay within the range of a double.
pub(super) const LOG_REFERENCE: f64 = 600.0;
/// Subtrees of up to this many columns (2^13 models in every lane) are one task.
const TASK_COLUMNS: usize = 13;

/// One column in the tree. `V` is a vector with one model per lane.
pub(super) struct Level<V> {
    /// β̂.
    pub(super) center: V,
    /// Least pivot 1/v.
    pub(super) precision: f64,
    /// P(z = 1 | members of the family so far) · √(1/v), by members decided below the lanes.
    pub(super) include: Vec<V>,
    /// P(z = 0 | …).
    pub(super) exclude: Vec<V>,
    /// The next column is of the same family: go on counting.
    carries: bool,
    /// Bit of this column in a set.
    pub(super) bit: u32,
    /// Leaving it out is not worth a visit.
    pub(super) certain: bool,
}

impl<V> Level<V> {
    /// Members of the family for the including and the excluding child.
    #[inline(always)]
    pub(super) fn counts(&self, count: usize) -> (usize, usize) {
        if self.carries {
            (count + 1, count)
        } else {
            (0, 0)
        }
    }
}

/// Everything that is the same in the whole tree.
pub(super) struct Tree<V> {
    /// By number of columns yet to decide, minus one.
    pub(super) levels: Vec<Level<V>>,
    /// a_n.
    pub(super) shape: f64,
    /// Mean of φ per (1 + c), or 0 where φ has no mean.
    pub(super) noise: f64,
    pub(super) heavy: Threshold,
}

/// What is known at a node: `c + 2 hᵀδ + δᵀS δ` over the m columns yet to decide, the weight so far, members of the
/// family so far, and the set of included positions below the lanes.
struct Node<V> {
    s: Vec<V>,
    h: Vec<V>,
    c: V,
    weight: V,
    count: usize,
    set: u32,
}

/// The same, borrowed.
#[derive(Clone, Copy)]
pub(super) struct View<'a, V> {
    pub(super) s: &'a [V],
    pub(super) h: &'a [V],
    pub(super) c: V,
    pub(super) weight: V,
    pub(super) count: usize,
    pub(super) set: u32,
}

impl<V: bytemuck::Pod> Node<V> {
    fn blank(m: usize) -> Self {
        let zero = V::zeroed();
        Self {
            s: vec![zero; triangle(m)],
            h: vec![zero; m],
            c: zero,
            weight: zero,
            count: 0,
            set: 0,
        }
    }

    fn view(&self) -> View<'_, V> {
        View {
            s: &self.s,
            h: &self.h,
            c: self.c,
            weight: self.weight,
            count: self.count,
            set: self.set,
        }
    }
}

/// The lanes of a vector as numbers.
fn lanes<V: bytemuck::Pod>(vector: &V) -> &[f64] {
    bytemuck::cast_slice(std::slice::from_ref(vector))
}

/// A vector from a function of the lane.
fn from_lanes<V: bytemuck::Pod>(value: impl Fn(usize) -> f64) -> V {
    let mut vector = [V::zeroed()];
    let numbers: &mut [f64] = bytemuck::cast_slice_mut(&mut vector);
    numbers
        .iter_mut()
        .enumerate()
        .for_each(|(lane, number)| *number = value(lane));
    vector[0]
}

/// Sums over all 2^K models ([`Layout`] of K columns; weights times e^[`LOG_REFERENCE`]) and the heaviest of them.
pub(super) fn sum_all_models(
    standard: &Standard,
    prior: &Prior,
    certain: &[bool],
) -> (Vec<f64>, Heaviest) {
    pulp::Arch::new().dispatch(Root {
        standard,
        prior,
        certain,
    })
}

/// What the tree is about; `certain` by column.
#[derive(Clone, Copy)]
struct Root<'a> {
    standard: &'a Standard,
    prior: &'a Prior,
    certain: &'a [bool],
}

impl WithSimd for Root<'_> {
    type Output = (Vec<f64>, Heaviest);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        root(simd, self)
    }
}

/// The first columns (3 with eight lanes): lane l includes column d where bit d of l is set.
fn root<S: Simd>(simd: S, about: Root<'_>) -> (Vec<f64>, Heaviest) {
    let standard = about.standard;
    let size = standard.size();
    let lane_columns = S::F64_LANES.ilog2() as usize;
    let padded = size.max(lane_columns);
    let (tree, odds) = plan::<S>(about, padded, lane_columns);
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
    node.weight = simd.splat_f64s(1.0);
    let mut above = Vec::new();
    for (d, &odds) in odds.iter().enumerate() {
        let m = padded - d;
        let (mut inside, outside) = split(simd, &tree, m, &node, odds);
        let select = |a: &mut S::f64s, b: &S::f64s| {
            *a = from_lanes(|lane| {
                if lane >> d & 1 == 1 {
                    lanes(a)[lane]
                } else {
                    lanes(b)[lane]
                }
            });
        };
        inside
            .s
            .iter_mut()
            .zip(&outside.s)
            .for_each(|(a, b)| select(a, b));
        inside
            .h
            .iter_mut()
            .zip(&outside.h)
            .for_each(|(a, b)| select(a, b));
        select(&mut inside.c, &outside.c);
        select(&mut inside.weight, &outside.weight);
        (inside.count, inside.set) = (0, 0);
        above.push(std::mem::replace(&mut node, inside));
    }
    let (mut sums, heavy) = branch(simd, &tree, padded - lane_columns, node);
    for (d, node) in above.iter().enumerate().rev() {
        // Each lane meets the one that differs from it in column d only.
        let pick = |bit: usize| -> Vec<S::f64s> {
            sums.iter()
                .map(|x| from_lanes(|lane| lanes(x)[(lane & !(1 << d)) | bit << d]))
                .collect()
        };
        sums = join(simd, &tree, padded - d, node, &pick(1), &pick(0));
    }
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
    (out, heavy)
}

/// Prior factors (included, excluded) of one column.
type Odds<V> = (V, V);

/// Tables of the tree, and the prior factors of the columns that the lanes decide.
fn plan<S: Simd>(
    Root {
        standard,
        prior,
        certain,
    }: Root<'_>,
    padded: usize,
    lane_columns: usize,
) -> (Tree<S::f64s>, Vec<Odds<S::f64s>>) {
    let size = standard.size();
    let family: Vec<Option<usize>> = (0..padded)
        .map(|d| standard.order.get(d).map(|&column| prior.family_of(column)))
        .collect();
    let mut levels = Vec::new();
    let mut odds = Vec::new();
    for d in 0..padded {
        let seen = (0..d).rev().take_while(|&e| family[e] == family[d]).count();
        let from = d - seen;
        let factor = |lane: usize, count: usize| -> (f64, f64) {
            if d >= size {
                return (0.0, 1.0);
            }
            let in_lane = (from..d.min(lane_columns))
                .filter(|e| lane >> e & 1 == 1)
                .count();
            let (inside, outside) =
                prior.next(family[d].unwrap_or(0), (in_lane + count).min(seen), seen);
            (inside * standard.precision[d].sqrt(), outside)
        };
        let counts = 0..=d.saturating_sub(from.max(lane_columns));
        let include: Vec<S::f64s> = counts
            .clone()
            .map(|count| from_lanes(|lane| factor(lane, count).0))
            .collect();
        let exclude: Vec<S::f64s> = counts
            .map(|count| from_lanes(|lane| factor(lane, count).1))
            .collect();
        if d < lane_columns {
            odds.push((include[0], exclude[0]));
        }
        let real = |values: &[f64], filler: f64| values.get(d).copied().unwrap_or(filler);
        levels.push(Level {
            center: from_lanes(|_| real(&standard.center, 0.0)),
            precision: real(&standard.precision, 1.0),
            include,
            exclude,
            carries: d + 1 < padded && family[d + 1] == family[d],
            bit: 1 << d,
            certain: d < size && certain[standard.order[d]],
        });
    }
    levels.reverse();
    let noise = Some(standard.noise_factor())
        .filter(|x| x.is_finite())
        .unwrap_or(0.0);
    (
        Tree {
            levels,
            shape: standard.shape,
            noise,
            heavy: Threshold::new(),
        },
        odds,
    )
}

/// Nodes near the root: their two branches may run on two threads.
fn branch<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: Node<S::f64s>,
) -> (Vec<S::f64s>, Heaviest) {
    if m <= TASK_COLUMNS {
        let zero = simd.splat_f64s(0.0);
        let mut out = vec![zero; Layout::new(m).len()];
        let mut scratch = vec![zero; scratch_len(m)];
        let mut heavy = Heaviest::new(&tree.heavy);
        descend(
            simd,
            tree,
            m,
            node.view(),
            &mut out,
            &mut scratch,
            &mut heavy,
        );
        return (out, heavy);
    }
    let level = &tree.levels[m - 1];
    let odds = (level.include[node.count], level.exclude[node.count]);
    let (inside, outside) = split(simd, tree, m, &node, odds);
    if level.certain {
        let (inside, heavy) = branch(simd, tree, m - 1, inside);
        let nothing = vec![simd.splat_f64s(0.0); Layout::new(m - 1).len()];
        return (join(simd, tree, m, &node, &inside, &nothing), heavy);
    }
    let ((inside, first), (outside, second)) = rayon::join(
        || branch(simd, tree, m - 1, inside),
        || branch(simd, tree, m - 1, outside),
    );
    (
        join(simd, tree, m, &node, &inside, &outside),
        first.merge(second),
    )
}

/// Both children of a node.
fn split<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: &Node<S::f64s>,
    odds: Odds<S::f64s>,
) -> (Node<S::f64s>, Node<S::f64s>) {
    simd.vectorize(Split {
        simd,
        level: &tree.levels[m - 1],
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
        (inside.count, outside.count) = level.counts(node.count);
        (inside.set, outside.set) = (node.set | level.bit, node.set);
        (inside, outside)
    }
}

/// Sums of a node from those of its children.
fn join<S: Simd>(
    simd: S,
    tree: &Tree<S::f64s>,
    m: usize,
    node: &Node<S::f64s>,
    inside: &[S::f64s],
    outside: &[S::f64s],
) -> Vec<S::f64s> {
    simd.vectorize(Join {
        simd,
        level: &tree.levels[m - 1],
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
