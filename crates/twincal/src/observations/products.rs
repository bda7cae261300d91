//! Rows times coefficients, and the quadratic forms of rows: many rows at a time on the CPU's widest vectors.

use pulp::{Arch, Simd, WithSimd};

/// Rows that stay in registers while columns pass by.
const ROWS: usize = 64;

/// Columns of some rows: row r of column i is `x[i * stride + r]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Columns<'a> {
    pub(crate) x: &'a [f64],
    pub(crate) stride: usize,
}

impl<'a> Columns<'a> {
    /// `len` rows of a column from row `from` on.
    #[inline(always)]
    pub(crate) fn of(self, column: usize, from: usize, len: usize) -> &'a [f64] {
        &self.x[column * self.stride + from..][..len]
    }
}

/// `y −= Σ_i x_i beta_i` for every row of `y`.
pub(super) fn subtract(columns: Columns<'_>, beta: &[f64], y: &mut [f64]) {
    Arch::new().dispatch(Subtract { columns, beta, y });
}

struct Subtract<'a> {
    columns: Columns<'a>,
    beta: &'a [f64],
    y: &'a mut [f64],
}

impl WithSimd for Subtract<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (block, y) in self.y.chunks_mut(ROWS).enumerate() {
            let (from, len) = (block * ROWS, y.len());
            for (i, &beta) in self.beta.iter().enumerate() {
                for (y, x) in y.iter_mut().zip(self.columns.of(i, from, len)) {
                    *y -= x * beta;
                }
            }
        }
    }
}

/// `xᵀ C x` of every row of `out`; `matrix` is the symmetric C, row-major.
pub(super) fn quadratic(columns: Columns<'_>, matrix: &[f64], out: &mut [f64]) {
    Arch::new().dispatch(Quadratic {
        columns,
        matrix,
        out,
    });
}

struct Quadratic<'a> {
    columns: Columns<'a>,
    matrix: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Quadratic<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            columns,
            matrix,
            out,
        } = self;
        let width = matrix.len().isqrt();
        for (block, out) in out.chunks_mut(ROWS).enumerate() {
            let (from, len) = (block * ROWS, out.len());
            out.fill(0.0);
            for i in 0..width {
                // (C_ii x_i + 2 Σ_{k<i} C_ik x_k) x_i
                let mut along = [0.0; ROWS];
                for k in 0..=i {
                    let value = matrix[i * width + k] * if k == i { 1.0 } else { 2.0 };
                    if value == 0.0 {
                        continue;
                    }
                    let x = columns.of(k, from, len);
                    match x.first_chunk::<ROWS>() {
                        Some(x) => add(&mut along, value, x),
                        None => add(&mut along, value, x),
                    }
                }
                for ((out, along), x) in out.iter_mut().zip(&along).zip(columns.of(i, from, len)) {
                    *out += along * x;
                }
            }
        }
    }
}

/// `sum += factor x`; with a length that is known sums stay in registers.
#[inline(always)]
fn add(sum: &mut [f64; ROWS], factor: f64, x: &[f64]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += factor * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definitions, term by term, over whole blocks and a rest.
    #[test]
    fn residuals_and_quadratic_forms_are_their_definitions() {
        let (width, stride, rows) = (5, 150, 131);
        let number = |i: usize| (0.37 * i as f64).sin();
        let x: Vec<f64> = (0..width * stride).map(number).collect();
        let beta: Vec<f64> = (0..width).map(|i| number(1000 + i)).collect();
        let mut matrix = vec![0.0; width * width];
        for i in 0..width {
            for k in 0..=i {
                let value = if i == 3 && k == 1 {
                    0.0
                } else {
                    number(2000 + i + 10 * k)
                };
                (matrix[i * width + k], matrix[k * width + i]) = (value, value);
            }
        }
        let columns = Columns { x: &x, stride };
        let mut residual = vec![1.0; rows];
        subtract(columns, &beta, &mut residual);
        let mut forms = vec![f64::NAN; rows];
        quadratic(columns, &matrix, &mut forms);
        for r in 0..rows {
            let row: Vec<f64> = (0..width).map(|i| x[i * stride + r]).collect();
            let product: f64 = row.iter().zip(&beta).map(|(x, b)| x * b).sum();
            assert!((residual[r] - (1.0 - product)).abs() < 1e-14, "row {r}");
            let form: f64 = (0..width * width)
                .map(|at| row[at / width] * matrix[at] * row[at % width])
                .sum();
            assert!(
                (forms[r] - form).abs() < 1e-13,
                "row {r}: {} {form}",
                forms[r]
            );
        }
    }
}
