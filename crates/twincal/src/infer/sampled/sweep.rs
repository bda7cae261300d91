//! The sweep operator (Goodnight 1979) on precision and right-hand side: a set of columns solved for, the others' Schur
//! complement beside it.

/// `A` and `b` with some positions swept: with M the swept ones and E the others
///
/// ```text
/// T_MM = −A_MM⁻¹    T_ME = A_MM⁻¹ A_ME    T_EE = A_EE − A_EM A_MM⁻¹ A_ME
/// g_M = A_MM⁻¹ b_M                        g_E = b_E − A_EM A_MM⁻¹ b_M
/// ```
#[derive(Debug, Clone)]
pub(super) struct Sweep {
    size: usize,
    matrix: Vec<f64>,
    /// g.
    pub(super) rhs: Vec<f64>,
    row: Vec<f64>,
}

impl Sweep {
    /// Nothing swept. `matrix` is at least the identity.
    pub(super) fn new(matrix: Vec<f64>, rhs: Vec<f64>) -> Self {
        Self {
            size: rhs.len(),
            row: vec![0.0; rhs.len()],
            matrix,
            rhs,
        }
    }

    /// T_ij.
    pub(super) fn at(&self, i: usize, j: usize) -> f64 {
        self.matrix[i * self.size + j]
    }

    /// Sweeps position k, or unsweeps it if it is swept.
    pub(super) fn flip(&mut self, k: usize, swept: bool) {
        let size = self.size;
        self.row
            .copy_from_slice(&self.matrix[k * size..(k + 1) * size]);
        // A ≥ I: pivots on the way in are at least 1, on the way out within [−1, 0).
        let pivot = if swept {
            self.row[k].min(-f64::MIN_POSITIVE)
        } else {
            self.row[k].max(1.0)
        };
        let inverse = 1.0 / pivot;
        let own = self.rhs[k];
        for i in 0..size {
            let factor = self.row[i] * inverse;
            if i == k || factor == 0.0 {
                continue;
            }
            let target = &mut self.matrix[i * size..(i + 1) * size];
            for (t, r) in target.iter_mut().zip(&self.row) {
                *t -= factor * r;
            }
            self.rhs[i] -= factor * own;
        }
        let sign = if swept { -inverse } else { inverse };
        for i in 0..size {
            let value = self.row[i] * sign;
            self.matrix[i * size + k] = value;
            self.matrix[k * size + i] = value;
        }
        self.matrix[k * size + k] = -inverse;
        self.rhs[k] = own * sign;
    }

    /// `b −= A_·k value`: the torque of a coefficient that is held at a value leaves the data. k is never swept.
    pub(super) fn hold(&mut self, k: usize, value: f64) {
        let column = &self.matrix[k * self.size..(k + 1) * self.size];
        for (g, t) in self.rhs.iter_mut().zip(column) {
            *g -= value * t;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::Cholesky;
    use crate::random::Random;

    /// Against plain solves of the blocks; and the way back leads to where it began.
    #[test]
    fn swept_positions_are_solved_for() {
        let (size, mut random) = (6, Random::new(3, 0));
        let x: Vec<f64> = (0..9 * size).map(|_| random.normal()).collect();
        let mut matrix = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..size {
                matrix[i * size + j] = (0..9).map(|t| x[t * size + i] * x[t * size + j]).sum();
            }
            matrix[i * size + i] += 1.0;
        }
        let rhs: Vec<f64> = (0..size).map(|_| random.normal()).collect();
        let mut sweep = Sweep::new(matrix.clone(), rhs.clone());
        let members = [4, 1, 3];
        for k in members {
            sweep.flip(k, false);
        }
        sweep.flip(1, true);
        let inside = [3, 4];
        let block: Vec<f64> = inside
            .iter()
            .flat_map(|&i| inside.iter().map(move |&j| (i, j)))
            .map(|(i, j)| matrix[i * size + j])
            .collect();
        let factor = Cholesky::new(&block, 2).unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        let inverse = factor.inverse();
        let mut solution: Vec<f64> = inside.iter().map(|&i| rhs[i]).collect();
        factor.solve(&mut solution);
        for (a, &i) in inside.iter().enumerate() {
            near(sweep.rhs[i], solution[a]);
            (0..2).for_each(|b| near(sweep.at(i, inside[b]), -inverse[a * 2 + b]));
        }
        for k in [0, 1, 2, 5] {
            let mut row: Vec<f64> = inside.iter().map(|&i| matrix[i * size + k]).collect();
            near(
                sweep.rhs[k],
                rhs[k] - row[0] * solution[0] - row[1] * solution[1],
            );
            factor.solve(&mut row);
            (0..2).for_each(|a| near(sweep.at(inside[a], k), row[a]));
            let schur = matrix[k * size]
                - (0..2)
                    .map(|a| matrix[inside[a] * size] * row[a])
                    .sum::<f64>();
            near(sweep.at(k, 0), schur);
        }
        sweep.hold(0, 0.7);
        [3, 4].into_iter().for_each(|k| sweep.flip(k, true));
        for i in 0..size {
            near(sweep.rhs[i], rhs[i] - 0.7 * matrix[i * size]);
            (0..size).for_each(|j| near(sweep.at(i, j), matrix[i * size + j]));
        }
    }
}
