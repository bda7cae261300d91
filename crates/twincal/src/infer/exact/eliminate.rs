//! One column of a node, included or excluded: the steps that every walk down the tree is made of.

use super::node::View;
use pulp::Simd;

/// Minimises over δ_0: `S' = S − s sᵀ/p`, `h' = h − s h_0/p`, `c' = c − h_0²/p`, with `r = 1/p`.
#[inline(always)]
pub(super) fn include<S: Simd>(
    simd: S,
    m: usize,
    node: View<'_, S::f64s>,
    r: S::f64s,
    s: &mut [S::f64s],
    h: &mut [S::f64s],
) -> S::f64s {
    let minus_r = simd.neg_f64s(r);
    let mut entry = 0;
    for j in 1..m {
        let factor = simd.mul_f64s(node.s[j], minus_r);
        for l in j..m {
            s[entry] = simd.mul_add_e_f64s(factor, node.s[l], node.s[m + entry]);
            entry += 1;
        }
        h[j - 1] = simd.mul_add_e_f64s(factor, node.h[0], node.h[j]);
    }
    simd.mul_add_e_f64s(simd.mul_f64s(node.h[0], minus_r), node.h[0], node.c)
}

/// Fixes δ_0 = −β̂_0: `h' = h − s β̂_0`, `c' = c + β̂_0 (p β̂_0 − 2 h_0)`; S' is S without its row 0.
#[inline(always)]
pub(super) fn exclude<S: Simd>(
    simd: S,
    m: usize,
    node: View<'_, S::f64s>,
    center: S::f64s,
    h: &mut [S::f64s],
) -> S::f64s {
    let minus = simd.neg_f64s(center);
    for j in 1..m {
        h[j - 1] = simd.mul_add_e_f64s(minus, node.s[j], node.h[j]);
    }
    let twice = simd.mul_f64s(simd.splat_f64s(-2.0), node.h[0]);
    simd.mul_add_e_f64s(
        center,
        simd.mul_add_e_f64s(center, node.s[0], twice),
        node.c,
    )
}

/// 1/max(a, least).
#[inline(always)]
pub(super) fn reciprocal<S: Simd>(simd: S, a: S::f64s, least: f64) -> S::f64s {
    simd.div_f64s(
        simd.splat_f64s(1.0),
        simd.max_f64s(a, simd.splat_f64s(least)),
    )
}
