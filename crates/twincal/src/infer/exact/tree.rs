//! The elimination tree: from the root over the lanes and the thread pool's tasks down to the leaves.

use super::heaviest::{Heaviest, Threshold};
use super::lanes::{mul, mul_add, neg, reciprocal, splat, sqrt};
use super::sums::{Layout, combine, triangle};
use crate::infer::standard::Standard;
use crate::lanes::{LANES, Lane, exp, ln};
use crate::prior::Prior;
use pulp::{Simd, WithSimd};

/// ln of the factor on all weights: puts the misfit of the full model at e^600, so that both far better priors and far
/// worse misfits stay within the range of a double.
pub(super) const LOG_REFERENCE: f64 = 600.0;
/// Columns that the lanes decide.
const LANE_COLUMNS: usize = 3;
/// Subtrees of up to this many columns (2^13 · 8 models) are one task.
const TASK_COLUMNS: usize = 13;

/// One column in the tree.
struct Level {
    /// β̂.
    center: Lane,
    /// Least pivot 1/v.
    precision: f64,
    /// P(z = 1 | members of the family so far) · √(1/v), by members decided below the lanes.
    include: Vec<Lane>,
    /// P(z = 0 | …).
    exclude: Vec<Lane>,
    /// The next column is of the same family: go on counting.
    carries: bool,
    /// Bit of this column in a set.
    bit: u32,
    /// Leaving it out is not worth a visit.
    certain: bool,
}

/// Everything that is the same in the whole tree.
struct Tree {
    /// By number of columns yet to decide, minus one.
    levels: Vec<Level>,
    /// a_n.
    shape: f64,
    /// E[φ] per (1 + c), or 0 where φ has no mean.
    noise: f64,
    heavy: Threshold,
}

/// What is known at a node: `c + 2 hᵀδ + δᵀS δ` over the m columns yet to decide, the weight so far, members of the
/// family so far, and the set of included positions below the lanes.
struct Node {
    s: Vec<Lane>,
    h: Vec<Lane>,
    c: Lane,
    weight: Lane,
    count: usize,
    set: u32,
}

/// The same, borrowed.
#[derive(Clone, Copy)]
struct View<'a> {
    s: &'a [Lane],
    h: &'a [Lane],
    c: &'a Lane,
    weight: &'a Lane,
    count: usize,
    set: u32,
}

impl Node {
    fn blank(m: usize) -> Self {
        Self {
            s: vec![[0.0; LANES]; triangle(m)],
            h: vec![[0.0; LANES]; m],
            c: [0.0; LANES],
            weight: [0.0; LANES],
            count: 0,
            set: 0,
        }
    }

    fn view(&self) -> View<'_> {
        View {
            s: &self.s,
            h: &self.h,
            c: &self.c,
            weight: &self.weight,
            count: self.count,
            set: self.set,
        }
    }
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

struct Root<'a> {
    standard: &'a Standard,
    prior: &'a Prior,
    certain: &'a [bool],
}

impl WithSimd for Root<'_> {
    type Output = (Vec<f64>, Heaviest);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if S::IS_SCALAR {
            root::<S, false>(simd, self)
        } else {
            root::<S, true>(simd, self)
        }
    }
}

/// The first three columns: lane l includes column d where bit d of l is set.
fn root<S: Simd, const FUSED: bool>(
    simd: S,
    Root {
        standard,
        prior,
        certain,
    }: Root<'_>,
) -> (Vec<f64>, Heaviest) {
    let size = standard.size();
    let padded = size.max(LANE_COLUMNS);
    let (tree, odds) = plan(standard, prior, certain, padded);
    let mut node = Node::blank(padded);
    let mut entry = 0;
    for i in 0..padded {
        for j in i..padded {
            node.s[entry] = splat(if j < size {
                standard.matrix[i * size + j]
            } else {
                f64::from(i == j)
            });
            entry += 1;
        }
        node.h[i] = splat(if i < size { standard.offset[i] } else { 0.0 });
    }
    node.weight = splat(1.0);
    let mut above = Vec::new();
    for (d, odds) in odds.iter().enumerate() {
        let m = padded - d;
        let (mut inside, mut outside) = (Node::blank(m - 1), Node::blank(m - 1));
        simd.vectorize(Split::<FUSED> {
            tree: &tree,
            m,
            node: node.view(),
            odds,
            inside: &mut inside,
            outside: &mut outside,
        });
        for lane in 0..LANES {
            if lane >> d & 1 == 0 {
                inside
                    .s
                    .iter_mut()
                    .zip(&node.s[m..])
                    .for_each(|(a, b)| a[lane] = b[lane]);
                inside
                    .h
                    .iter_mut()
                    .zip(&outside.h)
                    .for_each(|(a, b)| a[lane] = b[lane]);
                inside.c[lane] = outside.c[lane];
                inside.weight[lane] = outside.weight[lane];
            }
        }
        inside.count = 0;
        inside.set = 0;
        above.push(std::mem::replace(&mut node, inside));
    }
    let (mut sums, heavy) = branch::<S, FUSED>(simd, &tree, padded - LANE_COLUMNS, node);
    for (d, node) in above.iter().enumerate().rev() {
        let m = padded - d;
        let pick = |bit: usize| -> Vec<Lane> {
            let from = |lane: usize| (lane & !(1 << d)) | bit << d;
            sums.iter()
                .map(|x| std::array::from_fn(|lane| x[from(lane)]))
                .collect()
        };
        let (inside, outside) = (pick(1), pick(0));
        sums = vec![[0.0; LANES]; Layout::new(m).len()];
        simd.vectorize(Join::<FUSED> {
            tree: &tree,
            m,
            node: node.view(),
            inside: &inside,
            outside: &outside,
            out: &mut sums,
        });
    }
    // Columns that only filled the lanes are dropped.
    let (wide, own) = (Layout::new(padded), Layout::new(size));
    let mut out = vec![0.0; own.len()];
    out[own.weight()] = sums[wide.weight()][0];
    out[own.noise()] = sums[wide.noise()][0];
    for j in 0..size {
        out[own.inclusion(j)] = sums[wide.inclusion(j)][0];
        out[own.shift(j)] = sums[wide.shift(j)][0];
        for l in j..size {
            out[own.moment(j, l)] = sums[wide.moment(j, l)][0];
        }
    }
    (out, heavy)
}

/// Tables of the tree, and prior factors (included, excluded) of the first three columns by lane.
fn plan(
    standard: &Standard,
    prior: &Prior,
    certain: &[bool],
    padded: usize,
) -> (Tree, Vec<(Lane, Lane)>) {
    let size = standard.size();
    let family: Vec<usize> = (0..padded)
        .map(|d| {
            if d < size {
                prior.family[standard.order[d]]
            } else {
                usize::MAX
            }
        })
        .collect();
    let start = |d: usize| {
        (0..d)
            .rev()
            .take_while(|&e| family[e] == family[d])
            .last()
            .unwrap_or(d)
    };
    let mut levels = Vec::new();
    let mut odds = Vec::new();
    for d in 0..padded {
        let from = start(d);
        // A padding column is never included.
        let factor = |lane: usize, count: usize| -> (f64, f64) {
            if d >= size {
                return (0.0, 1.0);
            }
            let in_lane = (from..d.min(LANE_COLUMNS))
                .filter(|e| lane >> e & 1 == 1)
                .count();
            let (inside, outside) = prior.next((in_lane + count).min(d - from), d - from);
            (inside * standard.precision[d].sqrt(), outside)
        };
        let counts = 0..=d.saturating_sub(from.max(LANE_COLUMNS));
        let table = |included: bool| -> Vec<Lane> {
            counts
                .clone()
                .map(|count| {
                    std::array::from_fn(|lane| {
                        let (inside, outside) = factor(lane, count);
                        if included { inside } else { outside }
                    })
                })
                .collect()
        };
        let (include, exclude) = (table(true), table(false));
        if d < LANE_COLUMNS {
            odds.push((include[0], exclude[0]));
        }
        levels.push(Level {
            center: splat(if d < size { standard.center[d] } else { 0.0 }),
            precision: if d < size { standard.precision[d] } else { 1.0 },
            include,
            exclude,
            carries: d + 1 < padded && family[d + 1] == family[d],
            bit: 1 << d,
            certain: d < size && certain[standard.order[d]],
        });
    }
    levels.reverse();
    let noise = if standard.noise_factor().is_finite() {
        standard.noise_factor()
    } else {
        0.0
    };
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
fn branch<S: Simd, const FUSED: bool>(
    simd: S,
    tree: &Tree,
    m: usize,
    node: Node,
) -> (Vec<Lane>, Heaviest) {
    let mut out = vec![[0.0; LANES]; Layout::new(m).len()];
    if m <= TASK_COLUMNS {
        let mut heavy = Heaviest::new(&tree.heavy);
        let mut scratch = vec![[0.0; LANES]; (BOTTOM..=m).map(scratch_of).sum()];
        descend::<S, FUSED>(
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
    let (mut inside, mut outside) = (Node::blank(m - 1), Node::blank(m - 1));
    simd.vectorize(Split::<FUSED> {
        tree,
        m,
        node: node.view(),
        odds: &odds,
        inside: &mut inside,
        outside: &mut outside,
    });
    outside.s.copy_from_slice(&node.s[m..]);
    let ((inside, first), (outside, second)) = if level.certain {
        let nothing = vec![[0.0; LANES]; Layout::new(m - 1).len()];
        (
            branch::<S, FUSED>(simd, tree, m - 1, inside),
            (nothing, Heaviest::new(&tree.heavy)),
        )
    } else {
        rayon::join(
            || branch::<S, FUSED>(simd, tree, m - 1, inside),
            || branch::<S, FUSED>(simd, tree, m - 1, outside),
        )
    };
    simd.vectorize(Join::<FUSED> {
        tree,
        m,
        node: node.view(),
        inside: &inside,
        outside: &outside,
        out: &mut out,
    });
    (out, first.merge(second))
}

/// Both children of a node, except the excluding child's S: that is the node's own from row 1 on.
struct Split<'a, const FUSED: bool> {
    tree: &'a Tree,
    m: usize,
    node: View<'a>,
    odds: &'a (Lane, Lane),
    inside: &'a mut Node,
    outside: &'a mut Node,
}

impl<const FUSED: bool> WithSimd for Split<'_, FUSED> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            tree,
            m,
            node,
            odds,
            inside,
            outside,
        } = self;
        let level = &tree.levels[m - 1];
        let r = reciprocal(&node.s[0], level.precision);
        inside.c = include::<FUSED>(m, node, &r, &mut inside.s, &mut inside.h);
        inside.weight = mul(&mul(node.weight, &odds.0), &sqrt(&r));
        outside.c = exclude::<FUSED>(m, node, &level.center, &mut outside.h);
        outside.weight = mul(node.weight, &odds.1);
        (inside.count, outside.count) = counts(level, node.count);
        (inside.set, outside.set) = (node.set | level.bit, node.set);
    }
}

/// Members of the family for the two children.
#[inline(always)]
fn counts(level: &Level, count: usize) -> (usize, usize) {
    if level.carries {
        (count + 1, count)
    } else {
        (0, 0)
    }
}

/// Sums of a node from those of its children.
struct Join<'a, const FUSED: bool> {
    tree: &'a Tree,
    m: usize,
    node: View<'a>,
    inside: &'a [Lane],
    outside: &'a [Lane],
    out: &'a mut [Lane],
}

impl<const FUSED: bool> WithSimd for Join<'_, FUSED> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            tree,
            m,
            node,
            inside,
            outside,
            out,
        } = self;
        let level = &tree.levels[m - 1];
        let r = reciprocal(&node.s[0], level.precision);
        combine::<FUSED>(
            m,
            (&node.s[..m], &node.h[0], &r, &level.center),
            inside,
            outside,
            out,
        );
    }
}

/// Minimises over δ_0: `S' = S − s sᵀ/p`, `h' = h − s h_0/p`, `c' = c − h_0²/p`.
#[inline(always)]
fn include<const FUSED: bool>(
    m: usize,
    node: View<'_>,
    r: &Lane,
    s: &mut [Lane],
    h: &mut [Lane],
) -> Lane {
    let mut entry = 0;
    for j in 1..m {
        let factor = neg(&mul(&node.s[j], r));
        for l in j..m {
            s[entry] = mul_add::<FUSED>(&factor, &node.s[l], &node.s[m + entry]);
            entry += 1;
        }
        h[j - 1] = mul_add::<FUSED>(&factor, &node.h[0], &node.h[j]);
    }
    mul_add::<FUSED>(&neg(&mul(&node.h[0], r)), &node.h[0], node.c)
}

/// Fixes δ_0 = −β̂_0: `h' = h − s β̂_0`, `c' = c + β̂_0 (p β̂_0 − 2 h_0)`; S' is S without its row 0.
#[inline(always)]
fn exclude<const FUSED: bool>(m: usize, node: View<'_>, center: &Lane, h: &mut [Lane]) -> Lane {
    let minus = neg(center);
    for j in 1..m {
        h[j - 1] = mul_add::<FUSED>(&minus, &node.s[j], &node.h[j]);
    }
    let twice = mul(&splat(-2.0), &node.h[0]);
    mul_add::<FUSED>(
        center,
        &mul_add::<FUSED>(center, &node.s[0], &twice),
        node.c,
    )
}

/// Largest m whose whole subtree is written out.
const BOTTOM: usize = 4;

/// Scratch of one node of m columns: the including child's S, a child's h, and the sums of both children.
const fn scratch_of(m: usize) -> usize {
    if m <= BOTTOM {
        0
    } else {
        triangle(m - 1) + (m - 1) + 2 * Layout::new(m - 1).len()
    }
}

/// A subtree of one task.
fn descend<S: Simd, const FUSED: bool>(
    simd: S,
    tree: &Tree,
    m: usize,
    node: View<'_>,
    out: &mut [Lane],
    scratch: &mut [Lane],
    heavy: &mut Heaviest,
) {
    simd.vectorize(Descend::<FUSED> {
        tree,
        m,
        node,
        out,
        scratch,
        heavy,
    });
}

struct Descend<'a, const FUSED: bool> {
    tree: &'a Tree,
    m: usize,
    node: View<'a>,
    out: &'a mut [Lane],
    scratch: &'a mut [Lane],
    heavy: &'a mut Heaviest,
}

impl<const FUSED: bool> WithSimd for Descend<'_, FUSED> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            tree,
            m,
            node,
            out,
            scratch,
            heavy,
        } = self;
        match m {
            0 => level_0::<FUSED>(tree, node, out, heavy),
            1 => level_1::<FUSED>(tree, node, out, heavy),
            2 => level_2::<FUSED>(tree, node, out, heavy),
            3 => level_3::<FUSED>(tree, node, out, heavy),
            BOTTOM => level_4::<FUSED>(tree, node, out, heavy),
            _ => {
                let level = &tree.levels[m - 1];
                let r = reciprocal(&node.s[0], level.precision);
                let (own, scratch) = scratch.split_at_mut(scratch_of(m));
                let (s, own) = own.split_at_mut(triangle(m - 1));
                let (h, own) = own.split_at_mut(m - 1);
                let (inside, outside) = own.split_at_mut(Layout::new(m - 1).len());
                let (more, same) = counts(level, node.count);

                let c = include::<FUSED>(m, node, &r, s, h);
                let weight = mul(&mul(node.weight, &level.include[node.count]), &sqrt(&r));
                let child = View {
                    s,
                    h,
                    c: &c,
                    weight: &weight,
                    count: more,
                    set: node.set | level.bit,
                };
                descend::<S, FUSED>(simd, tree, m - 1, child, inside, scratch, heavy);

                if level.certain {
                    outside.fill([0.0; LANES]);
                } else {
                    let c = exclude::<FUSED>(m, node, &level.center, h);
                    let weight = mul(node.weight, &level.exclude[node.count]);
                    let child = View {
                        s: &node.s[m..],
                        h,
                        c: &c,
                        weight: &weight,
                        count: same,
                        set: node.set,
                    };
                    descend::<S, FUSED>(simd, tree, m - 1, child, outside, scratch, heavy);
                }

                combine::<FUSED>(
                    m,
                    (&node.s[..m], &node.h[0], &r, &level.center),
                    inside,
                    outside,
                    out,
                );
            }
        }
    }
}

/// A leaf: `w = weight · e^600 (1 + c)^−a_n`.
#[inline(always)]
fn level_0<const FUSED: bool>(tree: &Tree, node: View<'_>, out: &mut [Lane], heavy: &mut Heaviest) {
    let mut ratio = [1.0; LANES];
    for lane in 0..LANES {
        // c ≥ 0 but for rounding.
        ratio[lane] = if node.c[lane] > 0.0 {
            1.0 + node.c[lane]
        } else {
            1.0
        };
    }
    let power = mul_add::<FUSED>(&splat(-tree.shape), &ln(&ratio), &splat(LOG_REFERENCE));
    let weight = mul(node.weight, &exp(&power));
    heavy.offer(&weight, node.set, &tree.heavy);
    out[0] = weight;
    out[1] = mul(&mul(&weight, &ratio), &splat(tree.noise));
}

/// Writes out the subtree of `$m` columns with all sizes constant.
macro_rules! level {
    ($name:ident, $m:literal, $child:ident) => {
        #[inline(always)]
        fn $name<const FUSED: bool>(
            tree: &Tree,
            node: View<'_>,
            out: &mut [Lane],
            heavy: &mut Heaviest,
        ) {
            let level = &tree.levels[$m - 1];
            let (Some(s), Some(h)) = (
                node.s.first_chunk::<{ triangle($m) }>(),
                node.h.first_chunk::<$m>(),
            ) else {
                return;
            };
            let Some(out) = out.first_chunk_mut::<{ Layout::new($m).len() }>() else {
                return;
            };
            let node = View { s, h, ..node };
            let r = reciprocal(&s[0], level.precision);
            let mut child_s = [[0.0; LANES]; triangle($m - 1)];
            let mut child_h = [[0.0; LANES]; $m - 1];
            let mut inside = [[0.0; LANES]; Layout::new($m - 1).len()];
            let mut outside = [[0.0; LANES]; Layout::new($m - 1).len()];
            let (more, same) = counts(level, node.count);

            let c = include::<FUSED>($m, node, &r, &mut child_s, &mut child_h);
            let weight = mul(&mul(node.weight, &level.include[node.count]), &sqrt(&r));
            let child = View {
                s: &child_s,
                h: &child_h,
                c: &c,
                weight: &weight,
                count: more,
                set: node.set | level.bit,
            };
            $child::<FUSED>(tree, child, &mut inside, heavy);

            let c = exclude::<FUSED>($m, node, &level.center, &mut child_h);
            let weight = mul(node.weight, &level.exclude[node.count]);
            let child = View {
                s: &s[$m..],
                h: &child_h,
                c: &c,
                weight: &weight,
                count: same,
                set: node.set,
            };
            $child::<FUSED>(tree, child, &mut outside, heavy);

            combine::<FUSED>(
                $m,
                (&s[..$m], &h[0], &r, &level.center),
                &inside,
                &outside,
                out,
            );
        }
    };
}

level!(level_1, 1, level_0);
level!(level_2, 2, level_1);
level!(level_3, 3, level_2);
level!(level_4, 4, level_3);
