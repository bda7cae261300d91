//! Second moments of held-out rows: the error of any torque that is linear in the columns, without the rows.

use crate::gram::JointGram;
use serde::{Deserialize, Serialize};

/// Second moments of one joint's moving held-out rows `x = [columns of the joint, y]`, y the measured less the nominal torque.
///
/// ```text
/// Σ (y − Σ_k β_k x_k)² = b' M b,      b = [−β, 1],      M = Σ x x'
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Moments {
    /// Library columns that act on this joint, ascending.
    pub columns: Vec<u32>,
    /// Rows.
    pub rows: f64,
    /// Upper triangle of M, row by row: with k columns (k + 1)(k + 2)/2 numbers.
    pub upper: Vec<f64>,
}

impl Moments {
    /// Those of the rows that these statistics are of.
    #[must_use]
    pub fn of(gram: &JointGram) -> Self {
        let size = gram.columns.len() + 1;
        let entries = (0..size).flat_map(|i| (i..size).map(move |j| gram.s0.at(i, j)));
        Self {
            columns: gram.columns.clone(),
            rows: gram.n,
            upper: entries.collect(),
        }
    }

    /// Root mean square of what is left of the torque beside the nominal one and `Σ β x`, N·m (N); `beta`: one coefficient for every column
    /// of the library. `None` without rows.
    #[must_use]
    pub fn rms(&self, beta: &[f64]) -> Option<f64> {
        let factors = self.columns.iter().map(|column| -beta[*column as usize]);
        let factors: Vec<f64> = factors.chain([1.0]).collect();
        let size = factors.len();
        let pairs = (0..size).flat_map(|i| (i..size).map(move |j| (i, j)));
        let sum: f64 = (pairs.zip(&self.upper))
            .map(|((i, j), entry)| {
                let twice = if i == j { 1.0 } else { 2.0 };
                twice * factors[i] * factors[j] * entry
            })
            .sum();
        (self.rows > 0.0).then(|| (sum.max(0.0) / self.rows).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gram::Symmetric;

    /// Truth: the residual of every row.
    #[test]
    fn the_error_of_a_torque_is_that_of_its_rows() {
        let rows = [
            [1.0, 0.5, 2.0],
            [-0.3, 0.8, 0.1],
            [0.7, -1.2, 1.5],
            [0.2, 0.1, -0.9],
        ];
        let mut gram = JointGram::empty(vec![1, 4]);
        let mut s0 = Symmetric::zeros(3);
        rows.iter().for_each(|row| s0.add_outer(row));
        (gram.n, gram.s0) = (rows.len() as f64, s0);
        let moments = Moments::of(&gram);
        let beta = [9.0, 0.4, 9.0, 9.0, -0.6];
        let square = |row: &[f64; 3]| (row[2] - 0.4 * row[0] + 0.6 * row[1]).powi(2);
        let truth = (rows.iter().map(square).sum::<f64>() / 4.0).sqrt();
        let found = moments.rms(&beta).unwrap();
        assert!((found - truth).abs() < 1e-14, "{found} {truth}");
        assert_eq!(Moments::default().rms(&beta), None);
    }
}
