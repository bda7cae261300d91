//! What a motion maximises where nothing is asked: a number of M, the information of a row on K columns of size 1 and 10⁻⁶ before the motion.
//!
//! ```text
//! determinant    ln det M                             the volume of the region that holds the coefficients
//! condition      ln det M − K ln(‖M‖ ‖M⁻¹‖ / K)       with Frobenius norms; their product is K for M = 1, and never less
//! ```
//! The second one does not change with the size of M but for ln det, has a gradient everywhere, and bounds the condition number κ of the rows:
//! κ² ≤ ‖M‖ ‖M⁻¹‖.
//!
//! # Source
//! D-optimality: Swevers et al. 1997. The condition number in Frobenius norms: Demmel 1987; as an aim of motions: Gautier and Khalil 1992.

use crate::linear_algebra::{Cholesky, product};

/// What a motion maximises where nothing is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Criterion {
    /// ln det of the information: the narrowest intervals.
    #[default]
    Determinant,
    /// ln det less the logarithm of a condition number for each column: no combination of parameters is shown much less than another, and
    /// intervals are wider than with the other criterion.
    Condition,
}

impl Criterion {
    /// Value for a matrix, symmetric and positive; −∞ where it is not.
    pub(super) fn value(self, matrix: &[f64], size: usize) -> f64 {
        let Ok(factor) = Cholesky::new(matrix, size) else {
            return f64::NEG_INFINITY;
        };
        let determinant = factor.log_determinant();
        match self {
            Self::Determinant => determinant,
            Self::Condition => {
                let condition = (squares(matrix) * squares(&factor.inverse())).sqrt();
                determinant - size as f64 * (condition / size as f64).ln()
            }
        }
    }

    /// ∂value/∂M; `None` where M is not positive.
    ///
    /// ```text
    /// M⁻¹ + K (M⁻³/‖M⁻¹‖² − M/‖M‖²)      the bracket for the condition number alone
    /// ```
    pub(super) fn gradient(self, matrix: &[f64], size: usize) -> Option<Vec<f64>> {
        let mut gradient = Cholesky::new(matrix, size).ok()?.inverse();
        if self == Self::Condition {
            let square = product(&gradient, &gradient, [size; 3]);
            let cube = product(&square, &gradient, [size; 3]);
            let of_inverse = size as f64 / squares(&gradient);
            let of_matrix = size as f64 / squares(matrix);
            for ((own, cube), matrix) in gradient.iter_mut().zip(&cube).zip(matrix) {
                *own += of_inverse * cube - of_matrix * matrix;
            }
        }
        Some(gradient)
    }
}

fn squares(matrix: &[f64]) -> f64 {
    matrix.iter().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of diag(1, 4): ln 4, and ln 4 − 2 ln(√17 √(1 + 1/16) / 2) = 2 ln 2 − 2 ln(17/8).
    #[test]
    fn values_of_a_diagonal_matrix() {
        let matrix = [1.0, 0.0, 0.0, 4.0];
        let wanted = [
            (Criterion::Determinant, 4.0_f64.ln()),
            (
                Criterion::Condition,
                4.0_f64.ln() - 2.0 * (17.0_f64 / 8.0).ln(),
            ),
        ];
        for (criterion, wanted) in wanted {
            let value = criterion.value(&matrix, 2);
            assert!(
                (value - wanted).abs() < 1e-12,
                "{criterion:?}: {value} {wanted}"
            );
        }
        for criterion in [Criterion::Determinant, Criterion::Condition] {
            let identity = criterion.value(&[1.0, 0.0, 0.0, 1.0], 2);
            assert!(identity.abs() < 1e-12, "{criterion:?}: {identity}");
            assert_eq!(criterion.value(&[1.0, 2.0, 2.0, 1.0], 2), f64::NEG_INFINITY);
            assert!(criterion.gradient(&[1.0, 2.0, 2.0, 1.0], 2).is_none());
        }
    }

    /// By central differences along each symmetric direction.
    #[test]
    fn gradients_are_those_of_the_values() {
        let size = 3;
        let matrix = [2.0, 0.3, -0.4, 0.3, 1.0, 0.2, -0.4, 0.2, 0.7];
        for criterion in [Criterion::Determinant, Criterion::Condition] {
            let gradient = criterion.gradient(&matrix, size).expect("positive");
            for (i, j) in (0..size).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                let at = |step: f64| {
                    let mut moved = matrix;
                    moved[i * size + j] += step;
                    if i != j {
                        moved[j * size + i] += step;
                    }
                    criterion.value(&moved, size)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                let both = if i == j { 1.0 } else { 2.0 };
                let wanted = both * gradient[i * size + j];
                assert!(
                    (slope - wanted).abs() < 1e-7,
                    "{criterion:?} {i} {j}: {slope} {wanted}"
                );
            }
        }
    }
}
