//! How the columns of a joint follow from fewer signals, its parts.
//!
//! ```text
//! column_i = Σ_p W_ip part_p      X = P Wᵀ      XᵀX = W (PᵀP) Wᵀ      Xβ = P (Wᵀβ)      xᵀC x = pᵀ(WᵀC W) p
//! ```
//! Whatever is linear or quadratic in columns costs less with parts, and is the same but for rounding.

use crate::linear_algebra::mirror;

/// The weights W of one joint, row by row without their zeros.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recipes {
    parts: usize,
    /// Per column: `(part, weight)`.
    columns: Vec<Vec<(usize, f64)>>,
}

impl Recipes {
    /// `columns`: the `(part, weight)` of each, parts below `parts`.
    pub(crate) fn new(parts: usize, columns: Vec<Vec<(usize, f64)>>) -> Self {
        Self { parts, columns }
    }

    /// Number of parts.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// Number of columns.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns.len()
    }

    /// The columns: `parts[part * stride + row]` to `out[column * rows + row]`; `out` is resized.
    ///
    /// # Panics
    /// If `parts` is too short.
    pub fn combine(&self, parts: &[f64], stride: usize, rows: usize, out: &mut Vec<f64>) {
        out.resize(self.columns.len() * rows, 0.0);
        for (recipe, cells) in self.columns.iter().zip(out.chunks_exact_mut(rows.max(1))) {
            let of = |part: usize| &parts[part * stride..part * stride + rows];
            if let [(part, 1.0)] = recipe[..] {
                cells.copy_from_slice(of(part));
                continue;
            }
            cells.fill(0.0);
            for &(part, weight) in recipe {
                add(cells, weight, of(part));
            }
        }
    }

    /// Columns of one row.
    ///
    /// # Panics
    /// If `parts` is too short.
    #[must_use]
    pub fn row(&self, parts: &[f64]) -> Vec<f64> {
        let column = |recipe: &Vec<(usize, f64)>| recipe.iter().map(|&(p, w)| w * parts[p]).sum();
        self.columns.iter().map(column).collect()
    }

    /// Wᵀβ: what parts are multiplied with where columns are multiplied with β.
    ///
    /// # Panics
    /// If `beta` is too short.
    #[must_use]
    pub fn of_parts(&self, beta: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.parts];
        for (recipe, beta) in self.columns.iter().zip(beta) {
            for &(part, weight) in recipe {
                sums[part] += weight * beta;
            }
        }
        sums
    }

    /// W M Wᵀ of a symmetric matrix of parts, row-major: sums over products of columns from those over products of parts.
    ///
    /// # Panics
    /// If `matrix` is too short.
    #[must_use]
    pub fn to_columns(&self, matrix: &[f64]) -> Vec<f64> {
        let (parts, columns) = (self.parts, self.columns.len());
        // (W M)ᵀ, then W (W M)ᵀ
        let mut half = vec![0.0; parts * columns];
        let mut row = vec![0.0; parts];
        for (i, recipe) in self.columns.iter().enumerate() {
            row.fill(0.0);
            for &(part, weight) in recipe {
                add(&mut row, weight, &matrix[part * parts..][..parts]);
            }
            for (part, value) in row.iter().enumerate() {
                half[part * columns + i] = *value;
            }
        }
        let mut out = vec![0.0; columns * columns];
        for (recipe, out) in self
            .columns
            .iter()
            .zip(out.chunks_exact_mut(columns.max(1)))
        {
            for &(part, weight) in recipe {
                add(out, weight, &half[part * columns..][..columns]);
            }
        }
        mirror(&mut out, columns);
        out
    }

    /// WᵀC W of a symmetric matrix of columns, row-major: the quadratic form of columns as one of parts.
    ///
    /// # Panics
    /// If `matrix` is too short.
    #[must_use]
    pub fn to_parts(&self, matrix: &[f64]) -> Vec<f64> {
        let (parts, columns) = (self.parts, self.columns.len());
        // Wᵀ C, then Wᵀ (Wᵀ C)ᵀ
        let mut half = vec![0.0; parts * columns];
        for (recipe, row) in self.columns.iter().zip(matrix.chunks_exact(columns.max(1))) {
            for &(part, weight) in recipe {
                add(&mut half[part * columns..][..columns], weight, row);
            }
        }
        let mut out = vec![0.0; parts * parts];
        let mut across = vec![0.0; parts];
        for (i, recipe) in self.columns.iter().enumerate() {
            for (part, value) in across.iter_mut().enumerate() {
                *value = half[part * columns + i];
            }
            for &(part, weight) in recipe {
                add(&mut out[part * parts..][..parts], weight, &across);
            }
        }
        mirror(&mut out, parts);
        out
    }

    /// The same with one more part behind the others, and one more column, which is that part.
    #[must_use]
    pub fn and_one(&self) -> Self {
        let mut more = self.clone();
        more.columns.push(vec![(more.parts, 1.0)]);
        more.parts += 1;
        more
    }

    /// The same where some columns are 0.
    #[must_use]
    pub fn without(&self, absent: &[usize]) -> Self {
        let mut rest = self.clone();
        for &column in absent {
            rest.columns[column].clear();
        }
        rest
    }

    /// The same where columns are multiplied by `factors`.
    #[must_use]
    pub(crate) fn scaled(&self, factors: &[f64]) -> Self {
        let mut scaled = self.clone();
        for (column, factor) in scaled.columns.iter_mut().zip(factors) {
            column.iter_mut().for_each(|(_, weight)| *weight *= factor);
        }
        scaled
    }

    /// Some of the columns, which ascend, made from those parts that they need; which of the parts these are, ascending.
    #[must_use]
    pub fn some(&self, kept: &[usize]) -> (Self, Vec<usize>) {
        let mut columns: Vec<Vec<(usize, f64)>> =
            kept.iter().map(|&i| self.columns[i].clone()).collect();
        let mut needed: Vec<usize> = columns.iter().flatten().map(|entry| entry.0).collect();
        needed.sort_unstable();
        needed.dedup();
        for (part, _) in columns.iter_mut().flatten() {
            *part = needed.partition_point(|other| other < part);
        }
        (Self::new(needed.len(), columns), needed)
    }
}

/// `sum += factor x`.
fn add(sum: &mut [f64], factor: f64, x: &[f64]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += factor * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recipes() -> Recipes {
        let columns = vec![
            vec![(0, 1.0)],
            vec![(0, 2.0), (2, -0.5)],
            vec![],
            vec![(1, 0.3), (3, 4.0), (4, -1.0)],
            vec![(2, 1.5)],
            vec![(4, 1.0)],
            vec![(0, -1.0), (1, 0.7), (2, 0.1), (3, 0.2), (4, 0.9)],
        ];
        Recipes::new(5, columns)
    }

    fn weight(recipes: &Recipes, column: usize, part: usize) -> f64 {
        let own = recipes.columns[column].iter();
        own.filter(|entry| entry.0 == part)
            .map(|entry| entry.1)
            .sum()
    }

    /// Every formula of the module's head, term by term.
    #[test]
    fn products_are_their_definitions() {
        let recipes = recipes();
        let (parts, columns) = (recipes.parts(), recipes.columns());
        let w = |i: usize, p: usize| weight(&recipes, i, p);
        let number = |i: usize| (0.7 * i as f64).sin();
        let symmetric = |size: usize| -> Vec<f64> {
            let entry = |at: usize| (at / size + at % size) * 10 + (at / size) * (at % size);
            (0..size * size).map(|at| number(entry(at))).collect()
        };
        let (rows, stride) = (3, 5);
        let cells: Vec<f64> = (0..parts * stride).map(number).collect();
        let mut out = Vec::new();
        recipes.combine(&cells, stride, rows, &mut out);
        for row in 0..rows {
            let own: Vec<f64> = (0..parts).map(|p| cells[p * stride + row]).collect();
            let one = recipes.row(&own);
            for i in 0..columns {
                let expected: f64 = (0..parts).map(|p| w(i, p) * own[p]).sum();
                assert!((out[i * rows + row] - expected).abs() < 1e-15);
                assert!((one[i] - expected).abs() < 1e-15);
            }
        }
        let beta: Vec<f64> = (0..columns).map(number).collect();
        for (p, got) in recipes.of_parts(&beta).into_iter().enumerate() {
            let expected: f64 = (0..columns).map(|i| w(i, p) * beta[i]).sum();
            assert!((got - expected).abs() < 1e-15, "part {p}");
        }
        let (of_parts, of_columns) = (symmetric(parts), symmetric(columns));
        let (up, down) = (recipes.to_columns(&of_parts), recipes.to_parts(&of_columns));
        for i in 0..columns {
            for j in 0..columns {
                let sum = |p: usize| -> f64 {
                    let entry = |q: usize| w(i, p) * of_parts[p * parts + q] * w(j, q);
                    (0..parts).map(entry).sum()
                };
                let expected: f64 = (0..parts).map(sum).sum();
                assert!((up[i * columns + j] - expected).abs() < 1e-14, "{i}, {j}");
            }
        }
        for p in 0..parts {
            for q in 0..parts {
                let sum = |i: usize| -> f64 {
                    let entry = |j: usize| w(i, p) * of_columns[i * columns + j] * w(j, q);
                    (0..columns).map(entry).sum()
                };
                let expected: f64 = (0..columns).map(sum).sum();
                assert!((down[p * parts + q] - expected).abs() < 1e-14, "{p}, {q}");
            }
        }
    }

    /// A joint without columns has no sums of them, whatever its parts.
    #[test]
    fn no_columns_are_made_of_any_parts() {
        let none = Recipes::new(2, Vec::new());
        assert!(none.to_columns(&[1.0; 4]).is_empty());
        assert_eq!(none.to_parts(&[]), [0.0; 4]);
        assert_eq!(none.of_parts(&[]), [0.0; 2]);
    }

    /// Columns that are left out take along the parts that nobody else needs; a column without torque stays, at zero.
    #[test]
    fn some_columns_need_some_parts() {
        let recipes = recipes();
        let parts = [1.0, 2.0, 3.0, 4.0, 5.0];
        let all = recipes.row(&parts);
        let (some, needed) = recipes.some(&[1, 2, 5]);
        assert_eq!(needed, [0, 2, 4]);
        assert_eq!((some.parts(), some.columns()), (3, 3));
        let own: Vec<f64> = needed.iter().map(|&p| parts[p]).collect();
        assert_eq!(some.row(&own), [all[1], all[2], all[5]]);
        let without = recipes.without(&[0, 6]).row(&parts);
        assert_eq!((without[0], without[6], without[3]), (0.0, 0.0, all[3]));
        let one = recipes.and_one();
        assert_eq!((one.parts(), one.columns()), (6, 8));
        assert_eq!(one.row(&[1.0, 2.0, 3.0, 4.0, 5.0, 9.0])[7], 9.0);
    }
}
