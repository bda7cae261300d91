//! The current model of a chain as a sweep tableau: the effect of every flip and swap at hand, a move in O(mK).
//!
//! Diagonal and gradient are kept for all columns, tableau rows only for the m included ones (Goodnight 1979):
//!
//! ```text
//! included j: row_j = [A_zz⁻¹ | A_zz⁻¹ A_zk]_j,  diagonal_j = (A_zz⁻¹)_jj,  gradient_j = β_j
//! excluded j:                                    diagonal_j = A_jj − A_jz A_zz⁻¹ A_zj,  gradient_j = r_j − A_jz β_z
//! ```
//!
//! Flipping j multiplies `1 + c` (see [`Standard`]) by `1 ± gradient²/(diagonal (1 + c))`.

use crate::infer::standard::Standard;
use crate::lanes::LANES;
use pulp::Simd;

/// Moves after which rounding is swept away by starting afresh.
const MOVES_BETWEEN_SWEEPS: usize = 2000;

/// See the module's text. Arrays are padded to whole lanes.
#[derive(Debug)]
pub(super) struct Tableau<'a> {
    pub(super) standard: &'a Standard,
    /// Padded K.
    pub(super) width: usize,
    /// A, rows padded to `width`.
    matrix: Vec<f64>,
    /// Included positions, in the order of their rows.
    pub(super) members: Vec<usize>,
    /// Row of a position; `usize::MAX` if excluded.
    slot: Vec<usize>,
    rows: Vec<f64>,
    pub(super) diagonal: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    /// +1 included (a flip raises c), −1 excluded.
    pub(super) sign: Vec<f64>,
    /// c of `b_z = b̂ (1 + c)`.
    pub(super) excess: f64,
    moves: usize,
    scratch: Vec<f64>,
}

impl<'a> Tableau<'a> {
    /// The empty model.
    pub(super) fn new(standard: &'a Standard) -> Self {
        let size = standard.size();
        let width = size.next_multiple_of(LANES);
        let mut matrix = vec![0.0; size * width];
        for (row, own) in matrix
            .chunks_exact_mut(width.max(1))
            .zip(standard.matrix.chunks_exact(size.max(1)))
        {
            row[..size].copy_from_slice(own);
        }
        let mut tableau = Self {
            standard,
            width,
            matrix,
            members: Vec::new(),
            slot: vec![usize::MAX; size],
            rows: Vec::new(),
            diagonal: vec![1.0; width],
            gradient: vec![0.0; width],
            sign: vec![-1.0; width],
            excess: 0.0,
            moves: 0,
            scratch: vec![0.0; width],
        };
        tableau.clear();
        tableau
    }

    /// Back to the empty model.
    fn clear(&mut self) {
        self.members.clear();
        self.rows.clear();
        self.slot.fill(usize::MAX);
        self.sign.fill(-1.0);
        self.diagonal.fill(1.0);
        self.gradient.fill(0.0);
        self.recenter();
    }

    /// Whether position j is in the model.
    pub(super) fn includes(&self, j: usize) -> bool {
        self.slot[j] != usize::MAX
    }

    /// Row of an included position.
    pub(super) fn row(&self, j: usize) -> &[f64] {
        &self.rows[self.slot[j] * self.width..(self.slot[j] + 1) * self.width]
    }

    /// Moves position j in or out.
    #[inline(always)]
    pub(super) fn flip<S: Simd>(&mut self, simd: S, j: usize) {
        if self.includes(j) {
            self.exclude(simd, j);
        } else {
            self.include(simd, j);
        }
        self.moves += 1;
        if self.moves >= MOVES_BETWEEN_SWEEPS {
            self.sweep(simd);
        }
    }

    /// Starts afresh from the empty model with the same members.
    #[inline(always)]
    fn sweep<S: Simd>(&mut self, simd: S) {
        let members = std::mem::take(&mut self.members);
        self.clear();
        for &j in &members {
            self.include(simd, j);
        }
        self.recenter();
        self.moves = 0;
    }

    #[inline(always)]
    fn include<S: Simd>(&mut self, simd: S, j: usize) {
        let width = self.width;
        // scratch = S_jk = A_jk − Σ_i t_ij A_ik for the excluded k
        self.scratch
            .copy_from_slice(&self.matrix[j * width..(j + 1) * width]);
        for (slot, &i) in self.members.iter().enumerate() {
            let t = self.rows[slot * width + j];
            axpy(
                simd,
                -t,
                &self.matrix[i * width..(i + 1) * width],
                &mut self.scratch,
            );
        }
        let pivot = self.scratch[j].max(self.standard.precision[j]);
        let beta = self.gradient[j] / pivot;
        self.excess = (self.excess - self.gradient[j] * beta).max(0.0);
        // Over the included k the same vector holds −t_kj, so that one formula serves both.
        for (slot, &k) in self.members.iter().enumerate() {
            self.scratch[k] = -self.rows[slot * width + j];
        }
        self.scratch[j] = 0.0;
        let inverse = 1.0 / pivot;
        for k in 0..width {
            let s = self.scratch[k];
            // Excluded: s_k −= S²/p, u_k −= S b. Included: C_k += t²/p, β_k −= t b = β_k + s b.
            self.diagonal[k] += self.sign[k] * s * s * inverse;
            self.gradient[k] += self.sign[k] * s * beta;
        }
        self.scratch.iter_mut().for_each(|s| *s *= inverse);
        self.scratch[j] = inverse;
        for slot in 0..self.members.len() {
            let row = &mut self.rows[slot * width..(slot + 1) * width];
            let t = row[j];
            row[j] = 0.0;
            axpy(simd, -t, &self.scratch, row);
        }
        self.slot[j] = self.members.len();
        self.members.push(j);
        self.rows.extend_from_slice(&self.scratch);
        self.diagonal[j] = inverse;
        self.gradient[j] = beta;
        self.sign[j] = 1.0;
    }

    #[inline(always)]
    fn exclude<S: Simd>(&mut self, simd: S, j: usize) {
        let width = self.width;
        let slot = self.slot[j];
        let last = self.members.len() - 1;
        self.scratch
            .copy_from_slice(&self.rows[slot * width..(slot + 1) * width]);
        if slot != last {
            self.rows.copy_within(last * width.., slot * width);
            self.members.swap(slot, last);
            self.slot[self.members[slot]] = slot;
        }
        self.rows.truncate(last * width);
        self.members.pop();
        self.slot[j] = usize::MAX;

        // A unit-diagonal A has (A⁻¹)_jj ≥ 1.
        let inverse = self.scratch[j].max(1.0);
        let pivot = 1.0 / inverse;
        let step = self.gradient[j] * pivot;
        self.excess += self.gradient[j] * step;
        self.scratch[j] = 0.0;
        for k in 0..width {
            let s = self.scratch[k];
            // Excluded: s_k += t²/C, u_k += t b/C. Included: C_k −= C_kj²/C, β_k −= C_kj b/C.
            self.diagonal[k] -= self.sign[k] * s * s * pivot;
            self.gradient[k] -= self.sign[k] * s * step;
        }
        for row in self.rows.chunks_exact_mut(width) {
            let factor = -row[j] * pivot;
            row[j] = factor;
            axpy(simd, factor, &self.scratch, row);
        }
        self.diagonal[j] = pivot;
        self.gradient[j] = step;
        self.sign[j] = -1.0;
    }

    /// Recomputes c, coefficients and gradients of the present members from A, h and β̂: sums of small numbers.
    fn recenter(&mut self) {
        let (size, width) = (self.standard.size(), self.width);
        let mut delta = vec![0.0; width];
        for k in 0..size {
            delta[k] = if self.includes(k) {
                self.gradient[k] - self.standard.center[k]
            } else {
                -self.standard.center[k]
            };
        }
        let slope = |delta: &[f64], k: usize| -> f64 {
            let row = &self.matrix[k * width..(k + 1) * width];
            self.standard.offset[k] + row.iter().zip(delta).map(|(a, d)| a * d).sum::<f64>()
        };
        // One step of refinement: at the members the slope must vanish.
        let rest: Vec<f64> = self.members.iter().map(|&k| slope(&delta, k)).collect();
        let mut steps = vec![0.0; self.members.len()];
        for (slot, step) in steps.iter_mut().enumerate() {
            let row = &self.rows[slot * width..(slot + 1) * width];
            *step = self
                .members
                .iter()
                .zip(&rest)
                .map(|(&k, rest)| row[k] * rest)
                .sum();
        }
        self.members
            .iter()
            .zip(&steps)
            .for_each(|(&k, step)| delta[k] -= step);
        let slopes: Vec<f64> = (0..size).map(|k| slope(&delta, k)).collect();
        let excess: f64 = (0..size)
            .map(|k| delta[k] * (slopes[k] + self.standard.offset[k]))
            .sum();
        self.excess = excess.max(0.0);
        for k in 0..size {
            self.gradient[k] = if self.includes(k) {
                self.standard.center[k] + delta[k]
            } else {
                -slopes[k]
            };
        }
    }
}

/// y += a x.
#[inline(always)]
fn axpy<S: Simd>(simd: S, a: f64, x: &[f64], y: &mut [f64]) {
    let a = simd.splat_f64s(a);
    // Both are whole lanes: no vector set leaves a tail.
    let ((x, _), (y, _)) = (S::as_simd_f64s(x), S::as_mut_simd_f64s(y));
    for (x, y) in x.iter().zip(y) {
        *y = simd.mul_add_e_f64s(a, *x, *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::testing::problem;
    use crate::linear_algebra::Cholesky;
    use crate::prior::Inclusion;

    /// After any sequence of moves every number equals that of a factorisation of the present model.
    #[test]
    fn moves_keep_the_definition() {
        let problem = problem(2, 11, 60, 0.7, Inclusion::Probability(0.5));
        let standard = Standard::new(&problem).unwrap();
        let mut tableau = Tableau::new(&standard);
        let mut state = 12345u64;
        for step in 0..5000 {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            tableau.flip(pulp::Scalar::new(), (state >> 33) as usize % 11);
            if step % 250 == 0 || step < 20 {
                compare(&tableau, &standard);
            }
        }
    }

    fn compare(tableau: &Tableau<'_>, standard: &Standard) {
        let size = standard.size();
        let members = &tableau.members;
        let count = members.len();
        let at = |i: usize, j: usize| standard.matrix[i * size + j];
        let block: Vec<f64> = members
            .iter()
            .flat_map(|&i| members.iter().map(move |&j| at(i, j)))
            .collect();
        let inverse = Cholesky::new(&block, count).unwrap().inverse();
        // r = A β̂ − h
        let r = |k: usize| {
            (0..size)
                .map(|j| at(k, j) * standard.center[j])
                .sum::<f64>()
                - standard.offset[k]
        };
        let beta: Vec<f64> = (0..count)
            .map(|a| {
                (0..count)
                    .map(|b| inverse[a * count + b] * r(members[b]))
                    .sum()
            })
            .collect();
        let mut excess = (0..size)
            .map(|k| standard.center[k] * (r(k) - standard.offset[k]))
            .sum::<f64>();
        for (a, &k) in members.iter().enumerate() {
            assert!(
                (tableau.diagonal[k] - inverse[a * count + a]).abs()
                    < 1e-9 * inverse[a * count + a]
            );
            assert!((tableau.gradient[k] - beta[a]).abs() < 1e-9 * (1.0 + beta[a].abs()));
            excess -= beta[a] * r(k);
        }
        assert!(
            (tableau.excess - excess).abs() < 1e-9 * (1.0 + excess),
            "{} {excess}",
            tableau.excess
        );
        for k in (0..size).filter(|&k| !tableau.includes(k)) {
            let mut schur = 1.0;
            let mut gradient = r(k);
            for (a, &i) in members.iter().enumerate() {
                let t: f64 = (0..count)
                    .map(|b| inverse[a * count + b] * at(members[b], k))
                    .sum();
                assert!((tableau.row(i)[k] - t).abs() < 1e-9 * (1.0 + t.abs()));
                schur -= t * at(i, k);
                gradient -= at(k, i) * beta[a];
            }
            assert!((tableau.diagonal[k] - schur).abs() < 1e-9);
            assert!((tableau.gradient[k] - gradient).abs() < 1e-9 * (1.0 + gradient.abs()));
        }
    }
}
