//! A model as a sweep tableau: the effect of every flip and swap at hand, a move in O(mK).
//!
//! Diagonal and gradient are kept for all columns, tableau rows only for the m included ones, and the square block of
//! every component of several columns (Goodnight 1979):
//!
//! ```text
//! included j: row_j = [A_zz⁻¹ | A_zz⁻¹ A_zk]_j,  diagonal_j = (A_zz⁻¹)_jj,  gradient_j = β_j
//! excluded j:                                    diagonal_j = A_jj − A_jz A_zz⁻¹ A_zj,  gradient_j = r_j − A_jz β_z
//! ```
//!
//! A component B of the model has `block = (A_zz⁻¹)_BB`, one that is out the Schur complement `A_BB − A_Bz A_zz⁻¹ A_zB`.
//! Flipping it adds `± gradientᵀ block⁻¹ gradient` to c (see [`Standard`]) and its determinant decides what that costs.

use super::standard::Standard;
use crate::lanes::LANES;
use pulp::{Simd, WithSimd};

/// Moves after which rounding is swept away by starting afresh.
const MOVES_BETWEEN_SWEEPS: usize = 2000;
/// What rounding may do to the log weight of a model before everything starts afresh as well, worst case.
const MOST_WRONG: f64 = 0.1;

/// Components of up to this many columns are eliminated on the stack.
const SMALL: usize = 10;

/// See the module's text. Rows are padded to whole lanes, the vectors by one more, so that any eight can be read.
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
    /// Square blocks of the components with several columns, one after the other.
    squares: Vec<f64>,
    /// (first position, columns, where its square starts) of those.
    wide: Vec<(usize, usize, usize)>,
    /// Where the square of a component starts, by its place in `standard.blocks`; unused for single columns.
    square_of: Vec<usize>,
    moves: usize,
    /// Estimate of the rounding in the rows: Σ of ε (A⁻¹)_jj over columns that left since the last sweep. Leaving a nearly
    /// singular model takes that many digits from all that stays.
    rounding: f64,
    /// How large it may become: a gradient that is wrong by `rounding · max |β̂|` changes a_n c by `MOST_WRONG` where the
    /// pivot is the smallest possible, the slab's part.
    most_rounding: f64,
    scratch: Vec<f64>,
    /// `−t_ij` of the members towards a position that enters.
    towards: Vec<f64>,
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
            diagonal: vec![1.0; width + LANES],
            gradient: vec![0.0; width + LANES],
            sign: vec![-1.0; width + LANES],
            excess: 0.0,
            squares: Vec::new(),
            wide: Vec::new(),
            square_of: Vec::new(),
            moves: 0,
            rounding: 0.0,
            most_rounding: most_rounding(standard),
            scratch: vec![0.0; width],
            towards: Vec::new(),
        };
        let mut end = 0;
        for block in &standard.blocks {
            tableau.square_of.push(end);
            if block.len > 1 {
                tableau.wide.push((block.start, block.len, end));
                end += block.len * block.len;
            }
        }
        tableau.squares = vec![0.0; end];
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
        for &(start, len, at) in &self.wide {
            for i in 0..len {
                let row = &self.matrix[(start + i) * self.width + start..][..len];
                self.squares[at + i * len..][..len].copy_from_slice(row);
            }
        }
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

    /// Whether a component is in the model.
    pub(super) fn holds(&self, block: usize) -> bool {
        self.includes(self.standard.blocks[block].start)
    }

    /// Moves a component in or out. Where that made it start afresh: `ln |A_zz| Π v` of the model, free of rounding.
    pub(super) fn flip_block(&mut self, block: usize) -> Option<f64> {
        pulp::Arch::new().dispatch(FlipBlock {
            tableau: self,
            block,
        })
    }

    /// `(d, gradientᵀ block⁻¹ gradient)` of a component that is wholly in or out: moving it multiplies the weight by
    /// `d^−½` beside the prior and the misfit, `d = |block| Π v_k` if it is out and `|block| / Π v_k` if it is in.
    ///
    /// Pivots of an included block are at least 1 (A has a unit diagonal), of an excluded one at least the slab's part.
    #[inline(always)]
    pub(super) fn block(&self, block: usize) -> (f64, f64) {
        let own = &self.standard.blocks[block];
        let inside = self.includes(own.start);
        if own.len == 1 {
            let (least, unit) = self.least(own.start, inside);
            let d = self.diagonal[own.start].max(least);
            return (
                d * unit,
                self.gradient[own.start] * self.gradient[own.start] / d,
            );
        }
        let square = self.square(block);
        let least = |i: usize| self.least(own.start + i, inside);
        let gradient = &self.gradient[own.range()];
        if own.len > SMALL {
            return eliminate(&mut square.to_vec(), &mut gradient.to_vec(), least);
        }
        let mut factor = [0.0; SMALL * SMALL];
        let mut rest = [0.0; SMALL];
        factor[..square.len()].copy_from_slice(square);
        rest[..own.len].copy_from_slice(gradient);
        eliminate(&mut factor[..square.len()], &mut rest[..own.len], least)
    }

    /// The smallest pivot that a position can have, and the factor that takes a pivot's units away.
    #[inline(always)]
    pub(super) fn least(&self, j: usize, inside: bool) -> (f64, f64) {
        let precision = self.standard.precision[j];
        if inside {
            (1.0, precision)
        } else {
            (precision, 1.0 / precision)
        }
    }

    /// Schur complement of two excluded positions.
    pub(super) fn schur(&self, j: usize, k: usize) -> f64 {
        if j == k {
            return self.diagonal[j];
        }
        let row = &self.matrix[k * self.width..(k + 1) * self.width];
        let own = row[j];
        let inner = |(slot, &i): (usize, &usize)| self.rows[slot * self.width + j] * row[i];
        own - self.members.iter().enumerate().map(inner).sum::<f64>()
    }

    /// The square of a component of several columns, row-major.
    pub(super) fn square(&self, block: usize) -> &[f64] {
        let len = self.standard.blocks[block].len;
        &self.squares[self.square_of[block]..][..len * len]
    }

    /// Moves position j in or out.
    #[inline(always)]
    fn flip<S: Simd>(&mut self, simd: S, j: usize) {
        if self.includes(j) {
            self.exclude(simd, j);
        } else {
            self.include(simd, j);
        }
        self.moves += 1;
    }

    /// Starts afresh from the empty model with the same members; their `ln |A_zz| Π v`.
    #[inline(always)]
    fn sweep<S: Simd>(&mut self, simd: S) -> f64 {
        let members = std::mem::take(&mut self.members);
        self.clear();
        let mut log_determinant = 0.0;
        for &j in &members {
            self.include(simd, j);
            // ln of pivot times v, `diagonal` being 1/pivot now
            log_determinant -= (self.diagonal[j] * self.standard.precision[j]).ln();
        }
        self.recenter();
        self.moves = 0;
        self.rounding = 0.0;
        log_determinant
    }

    #[inline(always)]
    fn include<S: Simd>(&mut self, simd: S, j: usize) {
        let width = self.width;
        // scratch = S_jk = A_jk − Σ_i t_ij A_ik for the excluded k
        self.towards.clear();
        let towards = |slot: usize| -self.rows[slot * width + j];
        self.towards.extend((0..self.members.len()).map(towards));
        schur_row(
            simd,
            &self.matrix,
            j,
            self.members.iter().zip(&self.towards),
            &mut self.scratch,
        );
        let pivot = self.scratch[j].max(self.standard.precision[j]);
        let beta = self.gradient[j] / pivot;
        self.excess = (self.excess - self.gradient[j] * beta).max(0.0);
        // Over the included k the same vector holds −t_kj, so that one formula serves both.
        for (&k, &t) in self.members.iter().zip(&self.towards) {
            self.scratch[k] = t;
        }
        self.scratch[j] = 0.0;
        let inverse = 1.0 / pivot;
        // Excluded: s_k −= S²/p, u_k −= S b. Included: C_k += t²/p, β_k −= t b = β_k + s b.
        self.shift(inverse, beta);
        self.update_squares(j, inverse, inverse);
        self.scratch.iter_mut().for_each(|s| *s *= inverse);
        self.scratch[j] = inverse;
        for (row, &t) in self.rows.chunks_exact_mut(width).zip(&self.towards) {
            row[j] = 0.0;
            axpy(simd, t, &self.scratch, row);
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
        self.rounding += f64::EPSILON * inverse;
        let pivot = 1.0 / inverse;
        let step = self.gradient[j] * pivot;
        self.excess += self.gradient[j] * step;
        self.scratch[j] = 0.0;
        // Excluded: s_k += t²/C, u_k += t b/C. Included: C_k −= C_kj²/C, β_k −= C_kj b/C.
        self.shift(-pivot, -step);
        self.update_squares(j, pivot, -pivot);
        for row in self.rows.chunks_exact_mut(width) {
            let factor = -row[j] * pivot;
            row[j] = factor;
            axpy(simd, factor, &self.scratch, row);
        }
        self.diagonal[j] = pivot;
        self.gradient[j] = step;
        self.sign[j] = -1.0;
    }

    /// `diagonal_k += sign_k s_k² a`, `gradient_k += sign_k s_k b` with s in `scratch`.
    #[inline(always)]
    fn shift(&mut self, a: f64, b: f64) {
        let (scratch, _) = self.scratch.as_chunks::<LANES>();
        let (sign, _) = self.sign.as_chunks::<LANES>();
        let (diagonal, _) = self.diagonal.as_chunks_mut::<LANES>();
        let (gradient, _) = self.gradient.as_chunks_mut::<LANES>();
        for (((s, sign), diagonal), gradient) in
            scratch.iter().zip(sign).zip(diagonal).zip(gradient)
        {
            for lane in 0..LANES {
                let signed = sign[lane] * s[lane];
                diagonal[lane] += signed * s[lane] * a;
                gradient[lane] += signed * b;
            }
        }
    }

    /// Squares after a move of position j, `scratch` its row and `step` ± 1/pivot, j's own entry `diagonal`; `sign[j]` is
    /// still that before the move.
    ///
    /// ```text
    /// both out: −step s sᵀ     otherwise: +step s sᵀ     row of j: s/|pivot|, negative towards members that j leaves
    /// ```
    #[inline(always)]
    fn update_squares(&mut self, j: usize, diagonal: f64, step: f64) {
        for &(start, len, at) in &self.wide {
            let row = &self.scratch[start..start + len];
            let sign = &self.sign[start..start + len];
            let square = &mut self.squares[at..at + len * len];
            for ((values, own), inside) in square.chunks_exact_mut(len).zip(row).zip(sign) {
                let factor = step * own;
                if *inside > 0.0 {
                    for (value, other) in values.iter_mut().zip(row) {
                        *value += factor * other;
                    }
                } else {
                    // both out: −, otherwise +
                    for ((value, other), sign) in values.iter_mut().zip(row).zip(sign) {
                        *value += factor * sign * other;
                    }
                }
            }
            if (start..start + len).contains(&j) {
                let own = j - start;
                for i in 0..len {
                    let leaves = step < 0.0 && sign[i] > 0.0;
                    let value = if leaves { -row[i] } else { row[i] } * diagonal;
                    square[i * len + own] = value;
                    square[own * len + i] = value;
                }
                square[own * len + own] = diagonal;
            }
        }
    }

    /// Sweeps rounding out of c, coefficients and gradients.
    pub(super) fn refine(&mut self) {
        self.recenter();
    }

    /// Recomputes c, coefficients and gradients of the present members from A, h and β̂: sums of small numbers.
    #[inline(always)]
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
            self.standard.offset[k] + dot(row, delta)
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

/// [`Tableau::flip_block`]. Who walks is compiled once, and this once for every set of instructions.
struct FlipBlock<'b, 'a> {
    tableau: &'b mut Tableau<'a>,
    block: usize,
}

impl WithSimd for FlipBlock<'_, '_> {
    type Output = Option<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { tableau, block } = self;
        for j in tableau.standard.blocks[block].range() {
            tableau.flip(simd, j);
        }
        (tableau.moves >= MOVES_BETWEEN_SWEEPS || tableau.rounding > tableau.most_rounding)
            .then(|| tableau.sweep(simd))
    }
}

/// See [`Tableau`]: `max |β̂| δ = √(MOST_WRONG · min pivot / a_n)`.
fn most_rounding(standard: &Standard) -> f64 {
    let largest = standard.center.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    let pivot = standard.precision.iter().copied().fold(1.0, f64::min);
    (MOST_WRONG * pivot / standard.shape.max(1.0)).sqrt() / largest
}

/// Determinant of a symmetric matrix in units and `rhsᵀ matrix⁻¹ rhs`, both destroyed; `least(i)` is the least pivot and
/// its unit.
#[inline(always)]
fn eliminate(
    matrix: &mut [f64],
    rhs: &mut [f64],
    least: impl Fn(usize) -> (f64, f64),
) -> (f64, f64) {
    let size = rhs.len();
    let (mut determinant, mut square) = (1.0, 0.0);
    for i in 0..size {
        let (least, unit) = least(i);
        let pivot = matrix[i * size + i].max(least);
        let inverse = 1.0 / pivot;
        determinant *= pivot * unit;
        square += rhs[i] * rhs[i] * inverse;
        let (top, below) = matrix.split_at_mut((i + 1) * size);
        let row = &top[i * size..];
        for (offset, other) in below.chunks_exact_mut(size).enumerate() {
            let l = i + 1 + offset;
            let factor = row[l] * inverse;
            // Only what lies right of the diagonal is read later.
            for k in l..size {
                other[k] -= factor * row[k];
            }
            rhs[l] -= factor * rhs[i];
        }
    }
    (determinant, square)
}

/// xᵀy of whole lanes, in one fixed order.
#[inline(always)]
fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let ((x, _), (y, _)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum()
}

/// Vectors whose sums stay in registers.
const HELD: usize = 4;

/// `out = A_j + Σ a_i A_i`, some vectors of columns at a time.
#[inline(always)]
fn schur_row<'a, S: Simd>(
    simd: S,
    matrix: &[f64],
    j: usize,
    others: impl Iterator<Item = (&'a usize, &'a f64)> + Clone,
    out: &mut [f64],
) {
    let width = out.len();
    let row = |i: usize| S::as_simd_f64s(&matrix[i * width..(i + 1) * width]).0;
    let (out, _) = S::as_mut_simd_f64s(out);
    let (whole, rest) = out.as_chunks_mut::<HELD>();
    let first = whole.len() * HELD;
    for (place, out) in whole.iter_mut().enumerate() {
        let part = |i: usize| &row(i)[place * HELD..][..HELD];
        let mut sums = [part(j)[0]; HELD];
        sums.copy_from_slice(part(j));
        for (&i, &a) in others.clone() {
            let a = simd.splat_f64s(a);
            for (sum, x) in sums.iter_mut().zip(part(i)) {
                *sum = simd.mul_add_e_f64s(a, *x, *sum);
            }
        }
        *out = sums;
    }
    for (place, out) in rest.iter_mut().enumerate() {
        let mut sum = row(j)[first + place];
        for (&i, &a) in others.clone() {
            sum = simd.mul_add_e_f64s(simd.splat_f64s(a), row(i)[first + place], sum);
        }
        *out = sum;
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
mod tests;
