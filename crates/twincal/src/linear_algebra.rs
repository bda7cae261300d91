//! Dense linear algebra: the one module that knows the linear-algebra crate (faer). Slices in, slices out, row-major.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as matmul_triangular};
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::{Accum, MatMut, MatRef, Par, Side};
use std::ops::Range;

/// Order from which on a triangle is inverted by blocks; smaller ones are done before the blocks are set up.
const BLOCKED: usize = 64;

/// aᵀb in eight running sums, which the compiler keeps in vectors.
#[must_use]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a8, a) = a.as_chunks::<8>();
    let (b8, b) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (x, y) in a8.iter().zip(b8) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>()
}

/// `A B`, row-major: A has `rows × inner` numbers, B `inner × columns`.
pub(crate) fn product(a: &[f64], b: &[f64], [rows, inner, columns]: [usize; 3]) -> Vec<f64> {
    multiplied(a, MatRef::from_row_major_slice(b, inner, columns), rows)
}

/// `A Bᵀ`, row-major: A has `rows × inner` numbers, B `columns × inner`.
pub(crate) fn product_transposed(
    a: &[f64],
    b: &[f64],
    [rows, inner, columns]: [usize; 3],
) -> Vec<f64> {
    let right = MatRef::from_row_major_slice(b, columns, inner);
    multiplied(a, right.transpose(), rows)
}

fn multiplied(a: &[f64], right: MatRef<'_, f64>, rows: usize) -> Vec<f64> {
    let (inner, columns) = (right.nrows(), right.ncols());
    let mut out = vec![0.0; rows * columns];
    if inner > 0 && !out.is_empty() {
        let to = MatMut::from_row_major_slice_mut(&mut out, rows, columns);
        let left = MatRef::from_row_major_slice(a, rows, inner);
        matmul(to, Accum::Replace, left, right, 1.0, Par::Seq);
    }
    out
}

/// The upper triangle of a row-major matrix as the lower one: symmetric to the last bit.
pub(crate) fn mirror(matrix: &mut [f64], size: usize) {
    for i in 0..size {
        for j in 0..i {
            matrix[j * size + i] = matrix[i * size + j];
        }
    }
}

/// Adds `Rᵀ diag(weights) R` to the lower triangle of `sums` (size × size, row-major); R has `weights.len()` rows.
pub(crate) fn add_weighted_squares(sums: &mut [f64], rows: &[f64], weights: &[f64], size: usize) {
    if weights.is_empty() || size == 0 {
        return;
    }
    let scaled: Vec<f64> = (rows.chunks_exact(size).zip(weights))
        .flat_map(|(row, weight)| row.iter().map(move |x| weight * x))
        .collect();
    let count = weights.len();
    matmul_triangular(
        MatMut::from_row_major_slice_mut(sums, size, size),
        BlockStructure::TriangularLower,
        Accum::Add,
        MatRef::from_row_major_slice(rows, count, size).transpose(),
        BlockStructure::Rectangular,
        MatRef::from_row_major_slice(&scaled, count, size),
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

/// Adds `Z Zᵀ` to the lower triangle of `sums`, Z some columns of a matrix whose rows are `width` long.
pub(crate) fn add_squares_of_columns(
    sums: &mut [f64],
    matrix: &[f64],
    width: usize,
    columns: Range<usize>,
) {
    let size = matrix.len() / width.max(1);
    if columns.is_empty() || size == 0 {
        return;
    }
    let some =
        MatRef::from_row_major_slice(matrix, size, width).subcols(columns.start, columns.len());
    matmul_triangular(
        MatMut::from_row_major_slice_mut(sums, size, size),
        BlockStructure::TriangularLower,
        Accum::Add,
        some,
        BlockStructure::Rectangular,
        some.transpose(),
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

/// A symmetric matrix has no Cholesky factor: the first pivot that is not a positive number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("pivot {pivot} is not positive")]
pub struct NotPositiveDefinite {
    /// 0-based row of the pivot; the caller knows which column of the regression this is.
    pub pivot: usize,
}

/// `A = L Lᵀ` of a symmetric positive definite matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Cholesky {
    size: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factors `matrix` (size × size, row-major; only its lower triangle is read).
    ///
    /// # Errors
    /// [`NotPositiveDefinite`] with the first pivot that is zero, negative or not a number.
    ///
    /// # Panics
    /// If `matrix` does not hold size × size numbers.
    pub fn new(matrix: &[f64], size: usize) -> Result<Self, NotPositiveDefinite> {
        assert_eq!(matrix.len(), size * size, "a square matrix of order {size}");
        if size == 0 {
            return Ok(Self {
                size,
                lower: Vec::new(),
            });
        }
        let factored = MatRef::from_row_major_slice(matrix, size, size)
            .llt(Side::Lower)
            .map_err(|error| {
                let faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index } =
                    error;
                NotPositiveDefinite { pivot: index }
            })?;
        let factor = factored.L();
        let mut lower = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..=i {
                lower[i * size + j] = factor[(i, j)];
            }
        }
        match (0..size).find(|&i| !(lower[i * size + i] > 0.0 && lower[i * size + i].is_finite())) {
            Some(pivot) => Err(NotPositiveDefinite { pivot }),
            None => Ok(Self { size, lower }),
        }
    }

    /// Takes a lower factor that is already there (row-major, positive diagonal), e.g. of a stored model.
    pub fn from_lower(lower: Vec<f64>, size: usize) -> Self {
        assert_eq!(lower.len(), size * size, "a square factor of order {size}");
        Self { size, lower }
    }

    /// L, row-major, zeros above the diagonal.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// L, row-major, given away.
    pub fn into_lower(self) -> Vec<f64> {
        self.lower
    }

    /// `ln |A|`.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..self.size)
            .map(|i| self.lower[i * self.size + i].ln())
            .sum::<f64>()
    }

    /// Replaces `x` by `L⁻¹ x`. `|L⁻¹x|² = xᵀA⁻¹x`.
    pub fn solve_lower(&self, x: &mut [f64]) {
        let n = self.size;
        for i in 0..n {
            let row = &self.lower[i * n..i * n + i];
            let sum: f64 = row.iter().zip(&*x).map(|(l, x)| l * x).sum();
            x[i] = (x[i] - sum) / self.lower[i * n + i];
        }
    }

    /// Replaces `x` by `L⁻ᵀ x`; a standard normal `x` becomes a draw from `N(0, A⁻¹)`.
    pub fn solve_upper(&self, x: &mut [f64]) {
        let n = self.size;
        for i in (0..n).rev() {
            x[i] /= self.lower[i * n + i];
            let xi = x[i];
            for j in 0..i {
                x[j] -= self.lower[i * n + j] * xi;
            }
        }
    }

    /// Replaces `x` by `A⁻¹ x`.
    pub fn solve(&self, x: &mut [f64]) {
        self.solve_lower(x);
        self.solve_upper(x);
    }

    /// `L⁻¹`, row-major, zeros above the diagonal.
    fn inverse_lower(&self) -> Vec<f64> {
        let n = self.size;
        let mut inverse = vec![0.0; n * n];
        if n >= BLOCKED {
            invert_lower_triangular(
                MatMut::from_row_major_slice_mut(&mut inverse, n, n),
                MatRef::from_row_major_slice(&self.lower, n, n),
                Par::Seq,
            );
            return inverse;
        }
        for i in 0..n {
            let (above, row) = inverse.split_at_mut(i * n);
            let row = &mut row[..=i];
            // Row i of L⁻¹ is (e_i − Σ_j L_ij row_j)/L_ii.
            for (j, other) in above.chunks_exact(n).enumerate() {
                let factor = self.lower[i * n + j];
                for (x, y) in row.iter_mut().zip(&other[..=j]) {
                    *x -= factor * y;
                }
            }
            row[i] = 1.0;
            let pivot = 1.0 / self.lower[i * n + i];
            row.iter_mut().for_each(|x| *x *= pivot);
        }
        inverse
    }

    /// `A⁻¹ = L⁻ᵀ L⁻¹`, row-major, exactly symmetric.
    pub fn inverse(&self) -> Vec<f64> {
        let n = self.size;
        let lower = self.inverse_lower();
        let mut inverse = vec![0.0; n * n];
        if n >= BLOCKED {
            let lower = MatRef::from_row_major_slice(&lower, n, n);
            matmul_triangular(
                MatMut::from_row_major_slice_mut(&mut inverse, n, n),
                BlockStructure::TriangularLower,
                Accum::Replace,
                lower.transpose(),
                BlockStructure::TriangularUpper,
                lower,
                BlockStructure::TriangularLower,
                1.0,
                Par::Seq,
            );
        } else {
            let rows = lower.chunks_exact(n.max(1)).enumerate();
            for row in rows.map(|(k, row)| &row[..=k]) {
                for (i, x) in row.iter().enumerate() {
                    let target = &mut inverse[i * n..i * n + i + 1];
                    target.iter_mut().zip(row).for_each(|(t, y)| *t += x * y);
                }
            }
        }
        mirror(&mut inverse, n);
        inverse
    }

    /// Diagonal of `A⁻¹`.
    pub fn inverse_diagonal(&self) -> Vec<f64> {
        let mut diagonal = vec![0.0; self.size];
        for row in self.inverse_lower().chunks_exact(self.size.max(1)) {
            diagonal.iter_mut().zip(row).for_each(|(d, x)| *d += x * x);
        }
        diagonal
    }
}

/// Eigenvalues (ascending) and eigenvectors of a symmetric matrix: `vectors[k * size + i]` is component i of vector k.
/// `None` if the iteration does not converge (only for numbers that are not finite).
pub fn symmetric_eigen(matrix: &[f64], size: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    assert_eq!(matrix.len(), size * size, "a square matrix of order {size}");
    if matrix.iter().any(|x| !x.is_finite()) {
        return None;
    }
    if size == 0 {
        return Some((Vec::new(), Vec::new()));
    }
    let eigen = MatRef::from_row_major_slice(matrix, size, size)
        .self_adjoint_eigen(Side::Lower)
        .ok()?;
    let values = (0..size).map(|k| eigen.S()[k]).collect();
    let vectors = (0..size)
        .flat_map(|k| (0..size).map(move |i| (i, k)))
        .map(|(i, k)| eigen.U()[(i, k)])
        .collect();
    Some((values, vectors))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 × 3 with a known factor: L = [[2,0,0],[1,3,0],[-1,0.5,1]].
    const A: [f64; 9] = [4.0, 2.0, -2.0, 2.0, 10.0, 0.5, -2.0, 0.5, 2.25];

    #[test]
    fn factor_solve_and_determinant_match_the_closed_form() {
        let factor = Cholesky::new(&A, 3).unwrap();
        let expected = [2.0, 0.0, 0.0, 1.0, 3.0, 0.0, -1.0, 0.5, 1.0];
        for (x, y) in factor.lower().iter().zip(expected) {
            assert!((x - y).abs() < 1e-14);
        }
        assert!((factor.log_determinant() - 36f64.ln()).abs() < 1e-14);
        let mut x = [4.0 + 4.0 - 6.0, 2.0 + 20.0 + 1.5, -2.0 + 1.0 + 6.75];
        factor.solve(&mut x);
        for (x, y) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((x - y).abs() < 1e-14);
        }
        let inverse = factor.inverse();
        for i in 0..3 {
            for j in 0..3 {
                let product: f64 = (0..3).map(|k| A[3 * i + k] * inverse[3 * k + j]).sum();
                assert!((product - f64::from(i == j)).abs() < 1e-14);
            }
        }
    }

    /// Orders on both sides of [`BLOCKED`], a matrix whose entries fall with their distance: A A⁻¹ = 1, and the diagonal alone.
    #[test]
    fn inverses_are_inverses_however_large() {
        for n in [1, 7, BLOCKED - 1, BLOCKED, 2 * BLOCKED + 13] {
            let entry = |i: usize, j: usize| 0.8_f64.powi(i.abs_diff(j) as i32) + f64::from(i == j);
            let matrix: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
            let factor = Cholesky::new(&matrix, n).expect("0.8^|i − j| is positive definite");
            let (inverse, diagonal) = (factor.inverse(), factor.inverse_diagonal());
            let unit = product(&matrix, &inverse, [n, n, n]);
            for (k, value) in unit.iter().enumerate() {
                assert!(
                    (value - f64::from(k / n == k % n)).abs() < 1e-13,
                    "{n}: {k}"
                );
                assert_eq!(inverse[k].to_bits(), inverse[k % n * n + k / n].to_bits());
            }
            for (i, value) in diagonal.iter().enumerate() {
                assert!((value - inverse[i * n + i]).abs() < 1e-13, "{n}: {i}");
            }
        }
    }

    #[test]
    fn weighted_squares_are_their_definition() {
        let (rows, weights) = ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [2.0, -1.0]);
        let mut sums = [1.0; 9];
        add_weighted_squares(&mut sums, &rows, &weights, 3);
        // 1 + 2·(1,2,3)ᵀ(1,2,3) − (4,5,6)ᵀ(4,5,6), below and on the diagonal
        assert_eq!(
            sums,
            [-13.0, 1.0, 1.0, -15.0, -16.0, 1.0, -17.0, -17.0, -17.0]
        );
    }

    #[test]
    fn squares_of_columns_are_their_definition() {
        let mut sums = [1.0; 4];
        add_squares_of_columns(&mut sums, &[9.0, 1.0, 2.0, 9.0, 3.0, 4.0], 3, 1..3);
        assert_eq!(sums, [6.0, 1.0, 12.0, 26.0]);
        add_squares_of_columns(&mut sums, &[9.0, 1.0, 2.0, 9.0, 3.0, 4.0], 3, 2..2);
        assert_eq!(sums, [6.0, 1.0, 12.0, 26.0]);
    }

    #[test]
    fn a_failing_pivot_is_named() {
        let mut bad = A;
        bad[8] = 1.25; // the last Schur complement becomes 0
        assert_eq!(Cholesky::new(&bad, 3).unwrap_err().pivot, 2);
        bad[4] = -1.0;
        assert_eq!(Cholesky::new(&bad, 3).unwrap_err().pivot, 1);
        bad[0] = f64::NAN;
        assert_eq!(Cholesky::new(&bad, 3).unwrap_err().pivot, 0);
        assert!(Cholesky::new(&[], 0).unwrap().lower().is_empty());
    }

    #[test]
    fn products_are_their_definitions() {
        let (a, b) = (
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            [7.0, 8.0, 9.0, 10.0, 11.0, 12.0],
        );
        assert_eq!(product(&a, &b, [2, 3, 2]), [58.0, 64.0, 139.0, 154.0]);
        assert_eq!(
            product_transposed(&a, &b, [2, 3, 2]),
            [50.0, 68.0, 122.0, 167.0]
        );
        assert!(product(&[], &b, [0, 3, 2]).is_empty());
        assert_eq!(product(&[], &[], [1, 0, 2]), [0.0; 2]);
    }

    #[test]
    fn eigenvalues_of_a_two_by_two() {
        let (values, vectors) = symmetric_eigen(&[2.0, 1.0, 1.0, 2.0], 2).unwrap();
        assert!((values[0] - 1.0).abs() < 1e-14 && (values[1] - 3.0).abs() < 1e-14);
        assert!(
            (vectors[2] - vectors[3]).abs() < 1e-14
                && (vectors[2].abs() - 0.5f64.sqrt()).abs() < 1e-14
        );
        assert!(symmetric_eigen(&[f64::NAN], 1).is_none());
    }
}
