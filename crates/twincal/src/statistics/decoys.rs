//! Decoys: functions of one joint's own state that no candidate is made of. What the candidates leave along them says
//! how much of the residual comes again with the motion.

use crate::linear_algebra::{dot, product_transposed};
use crate::observations::Part;
use crate::term::Recipes;
use std::ops::AddAssign;

/// Harmonics of the joint's position.
const HARMONICS: usize = 8;
/// 1, cos kq and sin kq, each alone and times the direction of motion.
pub(crate) const DECOYS: usize = 2 * (1 + 2 * HARMONICS);
/// Rows that are multiplied at a time.
const BLOCK: usize = 512;
/// Speed within which the direction of motion changes, rad/s or m/s.
const REVERSAL: f64 = 0.02;

/// Sums over the moving rows of one joint; those of several parts add.
///
/// ```text
/// φ = {1, cos k q, sin k q; k = 1…8} × {1, tanh(q̇/v)}        φᵀ[X | y],   φ_kᵀφ_k
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct JointDecoys {
    /// Columns of the joint, or signals that they are made of.
    columns: usize,
    /// φ_kᵀ[X | y], `k * (columns + 1) + column`.
    cross: Vec<f64>,
    /// φ_kᵀφ_k; empty without rows.
    square: Vec<f64>,
}

impl JointDecoys {
    /// Adds the rows of a part as the fit weighs them, over signals.
    ///
    /// # Panics
    /// If the joint has other signals there.
    pub(super) fn add_rows(&mut self, part: &Part<'_>, joint: usize) {
        let (all, rows) = (part.observations, &part.observations.joints[joint]);
        let signals = rows.signals();
        let width = signals + 1;
        if self.square.is_empty() {
            self.columns = signals;
            self.cross = vec![0.0; DECOYS * width];
            self.square = vec![0.0; DECOYS];
        }
        assert_eq!(self.columns, signals, "the same signals in all parts");
        rows.visit_signals(all.len(), part.rows.clone(), &mut |range, columns| {
            let motion = [&all.q[joint], &all.qd[joint]];
            let [q, qd] = motion.map(|values| values.some(range.clone()));
            for from in (0..range.len()).step_by(BLOCK) {
                let count = BLOCK.min(range.len() - from);
                let (mut phi, mut weighted) =
                    (vec![0.0; DECOYS * count], vec![0.0; DECOYS * count]);
                for i in 0..count {
                    let row = range.start + from + i;
                    if rows.standstill[row] {
                        continue;
                    }
                    let weight = rows.weight.get(row).copied().unwrap_or(1.0);
                    let decoys = decoys(q[from + i], qd[from + i]);
                    for (k, decoy) in decoys.iter().enumerate() {
                        phi[k * count + i] = *decoy;
                        weighted[k * count + i] = weight * decoy;
                    }
                }
                let own = phi.chunks_exact(count).zip(weighted.chunks_exact(count));
                for (square, (phi, weighted)) in self.square.iter_mut().zip(own) {
                    *square += dot(phi, weighted);
                }
                let mut x: Vec<f64> = (0..signals)
                    .flat_map(|signal| columns.of(signal, from, count))
                    .copied()
                    .collect();
                x.extend_from_slice(&rows.y[range.start + from..][..count]);
                let products = product_transposed(&weighted, &x, [DECOYS, count, width]);
                (self.cross.iter_mut().zip(products)).for_each(|(sum, product)| *sum += product);
            }
        });
    }

    /// Sums over rows of decoys that somebody else has made; φ, X and y are row after row of one column after the other.
    pub(crate) fn of_rows(phi: &[&[f64]], x: &[&[f64]], y: &[f64]) -> Self {
        let all = || x.iter().copied().chain([y]);
        let cross = |phi: &&[f64]| -> Vec<f64> { all().map(|x| dot(phi, x)).collect() };
        Self {
            columns: x.len(),
            cross: phi.iter().flat_map(cross).collect(),
            square: phi.iter().map(|phi| dot(phi, phi)).collect(),
        }
    }

    /// Number of decoys; 0 without rows.
    pub(crate) fn count(&self) -> usize {
        self.square.len()
    }

    /// φ_kᵀ[X | y] and φ_kᵀφ_k; `None` where there are none.
    pub(crate) fn numbers(&self) -> Option<(&[f64], &[f64])> {
        (!self.cross.is_empty()).then_some((&self.cross, &self.square))
    }

    /// Sums over so many signals from [`Self::numbers`]; `None` for another number of them.
    pub(crate) fn of_numbers(columns: usize, cross: Vec<f64>, square: Vec<f64>) -> Option<Self> {
        let fits = square.len() == DECOYS && cross.len() == DECOYS * (columns + 1);
        fits.then_some(Self {
            columns,
            cross,
            square,
        })
    }

    /// Of some of the columns.
    pub(super) fn keep(&self, columns: &[usize]) -> Self {
        let own = (self.cross.chunks_exact(self.columns + 1)).flat_map(|sums| {
            let kept = columns.iter().map(|&column| sums[column]);
            kept.chain([sums[self.columns]])
        });
        Self {
            columns: columns.len(),
            cross: own.collect(),
            square: self.square.clone(),
        }
    }

    /// The same over columns that follow from the signals.
    pub(crate) fn of_columns(&self, recipes: Option<&Recipes>) -> Self {
        let Some(recipes) = recipes else {
            return self.clone();
        };
        let signals = self.columns;
        let cross = (self.cross.chunks_exact(signals + 1)).flat_map(|sums| {
            let mut columns = recipes.row(&sums[..signals]);
            columns.push(sums[signals]);
            columns
        });
        Self {
            columns: recipes.columns(),
            cross: cross.collect(),
            square: self.square.clone(),
        }
    }

    /// φ_kᵀφ_k.
    pub(crate) fn square(&self, decoy: usize) -> f64 {
        self.square[decoy]
    }

    /// φ_kᵀX, one number per column of the joint; empty without rows.
    pub(crate) fn columns(&self, decoy: usize) -> &[f64] {
        let first = decoy * (self.columns + 1);
        self.cross
            .get(first..first + self.columns)
            .unwrap_or_default()
    }

    /// φ_kᵀ(y − Xβ); `beta` belongs to the columns of the joint.
    pub(crate) fn residual(&self, decoy: usize, beta: &[f64]) -> f64 {
        let products = self.columns(decoy).iter().zip(beta);
        let explained: f64 = products.map(|(x, beta)| x * beta).sum();
        let torque = self.cross.get(decoy * (self.columns + 1) + self.columns);
        torque.copied().unwrap_or(0.0) - explained
    }
}

impl AddAssign<&JointDecoys> for JointDecoys {
    /// # Panics
    /// If the two belong to other columns (an empty default adopts the other's).
    fn add_assign(&mut self, other: &JointDecoys) {
        if other.cross.is_empty() {
            return;
        }
        if self.cross.is_empty() {
            *self = other.clone();
            return;
        }
        assert_eq!(
            self.columns, other.columns,
            "sums over other columns do not add"
        );
        let sums = self.cross.iter_mut().zip(&other.cross);
        sums.for_each(|(sum, other)| *sum += other);
        let squares = self.square.iter_mut().zip(&other.square);
        squares.for_each(|(sum, other)| *sum += other);
    }
}

/// All decoys at one state.
pub(crate) fn decoys(q: f64, qd: f64) -> [f64; DECOYS] {
    let (direction, (sin, cos)) = ((qd / REVERSAL).tanh(), q.sin_cos());
    let mut all = [0.0; DECOYS];
    let (mut c, mut s) = (1.0, 0.0);
    all[0] = 1.0;
    for k in 1..=HARMONICS {
        (c, s) = (c * cos - s * sin, s * cos + c * sin);
        (all[2 * k - 1], all[2 * k]) = (c, s);
    }
    let (alone, directed) = all.split_at_mut(DECOYS / 2);
    for (to, from) in directed.iter_mut().zip(alone) {
        *to = direction * *from;
    }
    all
}
