//! Sufficient statistics: the narrow waist (method section 4). Left of it cost grows with the log, right of it not.

mod accumulate;
mod block;
mod products;
mod tiles;

pub use accumulate::{JointAccumulator, OpenRun};
pub use block::Workspace;

use crate::error::{Error, Result};
use crate::term::Recipes;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// A symmetric matrix of order `size`, stored full and row-major.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Symmetric {
    /// Order.
    pub size: usize,
    /// `values[i * size + j]`.
    pub values: Vec<f64>,
}

impl Symmetric {
    /// All zeros.
    pub fn zeros(size: usize) -> Self {
        Self {
            size,
            values: vec![0.0; size * size],
        }
    }

    /// Entry (i, j).
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.size + j]
    }

    /// Adds `x xᵀ`.
    pub fn add_outer(&mut self, x: &[f64]) {
        for (i, row) in self.values.chunks_exact_mut(self.size.max(1)).enumerate() {
            for (value, xj) in row.iter_mut().zip(x) {
                *value += x[i] * xj;
            }
        }
    }
}

impl Symmetric {
    /// The part of some rows and the same columns.
    pub(crate) fn of(&self, rows: &[usize]) -> Self {
        let entries = rows
            .iter()
            .flat_map(|i| rows.iter().map(|j| self.at(*i, *j)));
        Self {
            size: rows.len(),
            values: entries.collect(),
        }
    }
}

impl AddAssign<&Symmetric> for Symmetric {
    /// # Panics
    /// If the two have different orders.
    fn add_assign(&mut self, other: &Symmetric) {
        assert_eq!(
            self.size, other.size,
            "matrices of different orders do not add"
        );
        for (a, b) in self.values.iter_mut().zip(&other.values) {
            *a += b;
        }
    }
}

/// Statistics of ONE joint over one block of rows, on the augmented row `x = [columns of the joint, y]`.
///
/// ```text
/// S0 = Σ x xᵀ    D = Σ_{t≥2} (x_t − x_{t−1})(x_t − x_{t−1})ᵀ    F, L = Σ over runs of first, last row's x xᵀ
/// ```
///
/// Statistics add: those of a log are the sum of those of its parts, wherever it was cut (a part that goes on from
/// another one's last row carries the difference over the cut, see [`JointAccumulator::cut`]).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointGram {
    /// Library columns that are structurally non-zero on this joint, ascending; y is the last row and column.
    pub columns: Vec<u32>,
    /// Rows.
    pub n: f64,
    /// Runs of consecutive rows (each starts an AR(1) process).
    pub starts: f64,
    /// Σ x xᵀ.
    pub s0: Symmetric,
    /// Gram of first differences.
    pub d: Symmetric,
    /// Σ over runs of the first row's x xᵀ.
    pub first: Symmetric,
    /// Σ over runs of the last row's x xᵀ.
    pub last: Symmetric,
}

impl JointGram {
    /// No rows yet.
    pub fn empty(columns: Vec<u32>) -> Self {
        let zeros = Symmetric::zeros(columns.len() + 1);
        Self {
            columns,
            n: 0.0,
            starts: 0.0,
            s0: zeros.clone(),
            d: zeros.clone(),
            first: zeros.clone(),
            last: zeros,
        }
    }

    /// The quadratic form of the exact stationary AR(1) likelihood with unit innovation variance,
    ///
    /// ```text
    /// G(ρ) = Xᵀ C⁻¹ X = (1−ρ)² S0 + ρ D + ρ(1−ρ)(F + L),      C_st = ρ^|s−t| / (1−ρ²)
    /// ```
    ///
    /// whose log-determinant is `−½ ln|C| = ½ Σ starts ln(1−ρ²)`. ρ = 0 gives `S0`.
    ///
    /// # Source
    /// method section 4; no term is a difference of large numbers as ρ → 1.
    pub fn stationary(&self, rho: f64) -> Symmetric {
        if rho == 0.0 {
            return self.s0.clone();
        }
        let (a, b, c) = ((1.0 - rho) * (1.0 - rho), rho, rho * (1.0 - rho));
        let values = self
            .s0
            .values
            .iter()
            .zip(&self.d.values)
            .zip(self.first.values.iter().zip(&self.last.values))
            .map(|((s0, d), (first, last))| a * s0 + b * d + c * (first + last))
            .collect();
        Symmetric {
            size: self.s0.size,
            values,
        }
    }
}

impl JointGram {
    /// Without what is kept of consecutive rows: then ρ has to be 0.
    pub(crate) fn forget_runs(&mut self) {
        for sum in [&mut self.d, &mut self.first, &mut self.last] {
            *sum = Symmetric::default();
        }
    }

    /// Keeps some of the columns, by their place, which are numbered anew, and y.
    pub(crate) fn keep(&mut self, kept: &[usize]) {
        let rows: Vec<usize> = kept.iter().copied().chain([self.columns.len()]).collect();
        for sum in [&mut self.s0, &mut self.d, &mut self.first, &mut self.last] {
            if sum.size > 0 {
                *sum = sum.of(&rows);
            }
        }
        self.columns = (0..kept.len() as u32).collect();
    }

    /// The statistics of columns that follow from these, y among them.
    pub(crate) fn combined(&self, recipes: &Recipes) -> Self {
        let of = |sums: &Symmetric| match sums.size {
            0 => Symmetric::default(),
            _ => Symmetric {
                size: recipes.columns(),
                values: recipes.to_columns(&sums.values),
            },
        };
        Self {
            columns: Vec::new(),
            n: self.n,
            starts: self.starts,
            s0: of(&self.s0),
            d: of(&self.d),
            first: of(&self.first),
            last: of(&self.last),
        }
    }
}

impl AddAssign<&JointGram> for JointGram {
    /// # Panics
    /// If the two belong to different columns (an empty default adopts the other's).
    fn add_assign(&mut self, other: &JointGram) {
        if other.s0.size == 0 {
            return;
        }
        if self.s0.size == 0 {
            *self = other.clone();
            return;
        }
        assert_eq!(
            self.columns, other.columns,
            "statistics of different columns do not add"
        );
        self.n += other.n;
        self.starts += other.starts;
        self.s0 += &other.s0;
        self.d += &other.d;
        self.first += &other.first;
        self.last += &other.last;
    }
}

/// Statistics of one block of rows, joint by joint. A log is a list of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Gram {
    /// One per moving joint.
    pub joints: Vec<JointGram>,
}

impl Gram {
    /// Adds the statistics of other logs, if they are of the same robot and library: as many joints, each with the same columns.
    ///
    /// # Errors
    /// [`Error::Statistics`] with the joint, from 1 on, and both counts; then nothing was added.
    ///
    /// # Example
    /// ```
    /// use twincal::gram::{Gram, JointGram};
    ///
    /// let of = |columns: &[u32]| Gram { joints: vec![JointGram::empty(columns.to_vec())] };
    /// let mut sum = of(&[0, 2]);
    /// assert!(sum.try_merge(&of(&[0, 2])).is_ok());
    /// let error = sum.try_merge(&of(&[0, 1, 2])).unwrap_err();
    /// assert!(error.to_string().starts_with("statistics: joint 1 has 3 columns, the others 2"));
    /// ```
    pub fn try_merge(&mut self, other: &Gram) -> Result<()> {
        if self.joints.is_empty() || other.joints.is_empty() {
            *self += other;
            return Ok(());
        }
        let refused = |problem: String| Error::Statistics {
            problem,
            remedy: "merge statistics of one robot and one library".into(),
        };
        if self.joints.len() != other.joints.len() {
            let (ours, theirs) = (self.joints.len(), other.joints.len());
            return Err(refused(format!("of {theirs} joints, the others of {ours}")));
        }
        for (joint, (own, more)) in self.joints.iter().zip(&other.joints).enumerate() {
            // A default has no columns yet and adopts the other's.
            if own.s0.size == 0 || more.s0.size == 0 {
                continue;
            }
            let (ours, theirs) = (own.columns.len(), more.columns.len());
            let of = format!(
                "joint {} has {theirs} columns, the others {ours}",
                joint + 1
            );
            let sized = |gram: &JointGram| {
                let order = gram.columns.len() + 1;
                let sums = [&gram.s0, &gram.d, &gram.first, &gram.last];
                sums.iter()
                    .all(|sum| sum.size == order && sum.values.len() == order * order)
            };
            if ours != theirs {
                return Err(refused(of));
            }
            if !sized(own) || !sized(more) {
                let joint = joint + 1;
                return Err(refused(format!(
                    "sums of joint {joint} are not of its columns"
                )));
            }
            if own.columns != more.columns {
                return Err(refused(format!(
                    "joint {} has other columns than the others",
                    joint + 1
                )));
            }
        }
        *self += other;
        Ok(())
    }

    /// Takes columns out, by their numbers, which ascend; those behind move up.
    pub fn drop_columns(&mut self, dropped: &[usize]) {
        if dropped.is_empty() {
            return;
        }
        for joint in &mut self.joints {
            let kept: Vec<usize> = (0..joint.columns.len())
                .filter(|i| !dropped.contains(&(joint.columns[*i] as usize)))
                .collect();
            let moved = |i: &usize| {
                let column = joint.columns[*i];
                column - dropped.partition_point(|d| *d < column as usize) as u32
            };
            let columns = kept.iter().map(moved).collect();
            // The torque stands behind the columns.
            let rows: Vec<usize> = kept.into_iter().chain([joint.columns.len()]).collect();
            for sum in [
                &mut joint.s0,
                &mut joint.d,
                &mut joint.first,
                &mut joint.last,
            ] {
                *sum = sum.of(&rows);
            }
            joint.columns = columns;
        }
    }
}

impl AddAssign<&Gram> for Gram {
    /// # Panics
    /// If the two belong to different robots or libraries (an empty default adopts the other's).
    fn add_assign(&mut self, other: &Gram) {
        if other.joints.is_empty() {
            return;
        }
        if self.joints.is_empty() {
            *self = other.clone();
            return;
        }
        assert_eq!(
            self.joints.len(),
            other.joints.len(),
            "statistics of different robots do not add"
        );
        for (a, b) in self.joints.iter_mut().zip(&other.joints) {
            *a += b;
        }
    }
}

#[cfg(test)]
mod tests;
