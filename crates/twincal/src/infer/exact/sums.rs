//! What a subtree returns about the columns it decides: sums over its models, weighted.

use pulp::Simd;

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

/// What eliminating column 0 of a node takes.
#[derive(Clone, Copy)]
pub(super) struct Elimination<'a, V> {
    /// Row 0 of S, m entries.
    pub(super) row: &'a [V],
    /// h_0.
    pub(super) h: V,
    /// 1/p.
    pub(super) r: V,
    /// β̂_0.
    pub(super) center: V,
}

/// Sums over m columns from those of the two branches of the first one: included (pivot `p`, `r = 1/p`), excluded.
///
/// ```text
/// included: δ_0 = −(h_0 + Σ_j S_0j δ_j)/p + noise of variance φ/p        excluded: δ_0 = −β̂_0
/// ```
#[inline(always)]
pub(super) fn combine<S: Simd>(
    simd: S,
    m: usize,
    column: Elimination<'_, S::f64s>,
    inside: &[S::f64s],
    outside: &[S::f64s],
    out: &mut [S::f64s],
) {
    let Elimination { row, h, r, center } = column;
    let (own, child) = (Layout::new(m), Layout::new(m - 1));
    let minus_r = simd.neg_f64s(r);
    let minus_center = simd.neg_f64s(center);
    let (weight, noise) = (inside[child.weight()], inside[child.noise()]);
    out[own.weight()] = simd.add_f64s(weight, outside[child.weight()]);
    out[own.noise()] = simd.add_f64s(noise, outside[child.noise()]);
    out[own.inclusion(0)] = weight;
    // u = Σ_j S_0j shift_j,  q_j = Σ_l S_0l moment_lj (gathered where moment_0j will stand)
    let zero = simd.splat_f64s(0.0);
    let mut u = zero;
    for j in 1..m {
        out[own.moment(0, j)] = zero;
    }
    for j in 1..m {
        out[own.inclusion(j)] = simd.add_f64s(
            inside[child.inclusion(j - 1)],
            outside[child.inclusion(j - 1)],
        );
        let shift = inside[child.shift(j - 1)];
        out[own.shift(j)] = simd.add_f64s(shift, outside[child.shift(j - 1)]);
        u = simd.mul_add_e_f64s(row[j], shift, u);
        let diagonal = inside[child.moment(j - 1, j - 1)];
        out[own.moment(j, j)] = simd.add_f64s(diagonal, outside[child.moment(j - 1, j - 1)]);
        let mut q = simd.mul_add_e_f64s(row[j], diagonal, out[own.moment(0, j)]);
        for l in j + 1..m {
            let moment = inside[child.moment(j - 1, l - 1)];
            out[own.moment(j, l)] = simd.add_f64s(moment, outside[child.moment(j - 1, l - 1)]);
            out[own.moment(0, l)] = simd.mul_add_e_f64s(row[j], moment, out[own.moment(0, l)]);
            q = simd.mul_add_e_f64s(row[l], moment, q);
        }
        out[own.moment(0, j)] = q;
    }
    // shift_0 = −(h W + u)/p − β̂ W_outside
    let hw = simd.mul_add_e_f64s(h, weight, u);
    let center_weight = simd.mul_f64s(minus_center, outside[child.weight()]);
    out[own.shift(0)] = simd.mul_add_e_f64s(minus_r, hw, center_weight);
    // moment_00 = (h (h W + 2u) + Σ_j S_0j q_j)/p² + Σ w φ/p + β̂² W_outside
    let mut square = simd.mul_f64s(h, simd.add_f64s(hw, u));
    for j in 1..m {
        let q = out[own.moment(0, j)];
        square = simd.mul_add_e_f64s(row[j], q, square);
        // moment_0j = −(h shift_j + q_j)/p − β̂ shift_j outside
        let inner = simd.mul_add_e_f64s(h, inside[child.shift(j - 1)], q);
        let outer = simd.mul_f64s(minus_center, outside[child.shift(j - 1)]);
        out[own.moment(0, j)] = simd.mul_add_e_f64s(minus_r, inner, outer);
    }
    let included = simd.mul_f64s(r, simd.mul_add_e_f64s(r, square, noise));
    out[own.moment(0, 0)] = simd.mul_add_e_f64s(minus_center, center_weight, included);
}
