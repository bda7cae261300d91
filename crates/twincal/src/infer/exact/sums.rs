//! What a subtree returns about the columns it decides: sums over its models, weighted.

use super::lanes::{add, mul, mul_add, neg};
use crate::lanes::Lane;

/// Entries of the packed upper triangle of order m, row after row.
#[inline(always)]
pub(super) const fn triangle(m: usize) -> usize {
    m * (m + 1) / 2
}

/// Where the sums of a subtree over m columns lie.
///
/// ```text
/// weight = Σ w    noise = Σ w E[φ]    inclusion_j = Σ w z_j    shift_j = Σ w E[δ_j]    moment_jl = Σ w E[δ_j δ_l]
/// ```
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    m: usize,
}

impl Layout {
    #[inline(always)]
    pub(super) const fn new(m: usize) -> Self {
        Self { m }
    }

    /// Numbers in all.
    #[inline(always)]
    pub(super) const fn len(self) -> usize {
        2 + 2 * self.m + triangle(self.m)
    }

    #[inline(always)]
    pub(super) const fn weight(self) -> usize {
        0
    }

    #[inline(always)]
    pub(super) const fn noise(self) -> usize {
        1
    }

    #[inline(always)]
    pub(super) const fn inclusion(self, j: usize) -> usize {
        2 + j
    }

    #[inline(always)]
    pub(super) const fn shift(self, j: usize) -> usize {
        2 + self.m + j
    }

    /// j ≤ l.
    #[inline(always)]
    pub(super) const fn moment(self, j: usize, l: usize) -> usize {
        2 + 2 * self.m + j * self.m - j * (j + 1) / 2 + l
    }
}

/// Sums over m columns from those of the two branches of the first one: included (pivot `p`, `r = 1/p`), excluded.
///
/// ```text
/// included: δ_0 = −(h_0 + Σ_j S_0j δ_j)/p + noise of variance φ/p        excluded: δ_0 = −β̂_0
/// ```
///
/// `row` is the packed row 0 of S (m entries), `h` is h_0, `center` is β̂_0.
#[inline(always)]
pub(super) fn combine<const FUSED: bool>(
    m: usize,
    (row, h, r, center): (&[Lane], &Lane, &Lane, &Lane),
    inside: &[Lane],
    outside: &[Lane],
    out: &mut [Lane],
) {
    let (own, child) = (Layout::new(m), Layout::new(m - 1));
    let minus_r = neg(r);
    let minus_center = neg(center);
    let (weight, noise) = (inside[child.weight()], inside[child.noise()]);
    out[own.weight()] = add(&weight, &outside[child.weight()]);
    out[own.noise()] = add(&noise, &outside[child.noise()]);
    out[own.inclusion(0)] = weight;
    // u = Σ_j S_0j shift_j,  q_j = Σ_l S_0l moment_lj (gathered where moment_0j will stand)
    let mut u = [0.0; 8];
    for j in 1..m {
        out[own.moment(0, j)] = [0.0; 8];
    }
    for j in 1..m {
        let (a, b) = (
            &inside[child.inclusion(j - 1)],
            &outside[child.inclusion(j - 1)],
        );
        out[own.inclusion(j)] = add(a, b);
        let (a, b) = (&inside[child.shift(j - 1)], &outside[child.shift(j - 1)]);
        out[own.shift(j)] = add(a, b);
        u = mul_add::<FUSED>(&row[j], a, &u);
        for l in j..m {
            let (a, b) = (
                &inside[child.moment(j - 1, l - 1)],
                &outside[child.moment(j - 1, l - 1)],
            );
            out[own.moment(j, l)] = add(a, b);
            out[own.moment(0, l)] = mul_add::<FUSED>(&row[j], a, &out[own.moment(0, l)]);
            if l > j {
                out[own.moment(0, j)] = mul_add::<FUSED>(&row[l], a, &out[own.moment(0, j)]);
            }
        }
    }
    // shift_0 = −(h W + u)/p − β̂ W_outside
    let hw = mul_add::<FUSED>(h, &weight, &u);
    let center_weight = mul(&minus_center, &outside[child.weight()]);
    out[own.shift(0)] = mul_add::<FUSED>(&minus_r, &hw, &center_weight);
    // moment_00 = (h (h W + 2u) + Σ_j S_0j q_j)/p² + Σ w φ/p + β̂² W_outside
    let mut square = mul(h, &add(&hw, &u));
    for j in 1..m {
        let q = out[own.moment(0, j)];
        square = mul_add::<FUSED>(&row[j], &q, &square);
        // moment_0j = −(h shift_j + q_j)/p − β̂ shift_j outside
        let inner = mul_add::<FUSED>(h, &inside[child.shift(j - 1)], &q);
        let outer = mul(&minus_center, &outside[child.shift(j - 1)]);
        out[own.moment(0, j)] = mul_add::<FUSED>(&minus_r, &inner, &outer);
    }
    let included = mul(r, &mul_add::<FUSED>(r, &square, &noise));
    out[own.moment(0, 0)] = mul_add::<FUSED>(&minus_center, &center_weight, &included);
}
