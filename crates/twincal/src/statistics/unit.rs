//! Sums over rows that are left out together, as columns of a fit, and what follows from them.

use super::decoys::JointDecoys;
use super::log_sums::JointBlock;
use super::weighing::Weighing;
use crate::gram::{Gram, JointGram, Symmetric};
use std::ops::AddAssign;

/// Sums over some rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Unit {
    /// Columns and torque.
    pub(crate) gram: Gram,
    /// What else is asked of each joint.
    pub(crate) joints: Vec<JointUnit>,
}

/// Sums over some rows of one joint, beside its [`JointGram`].
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct JointUnit {
    pub(crate) decoys: JointDecoys,
    /// Squares of the measured torque at all rows, (N·m)².
    pub(crate) torque: f64,
    pub(crate) weighing: Weighing,
}

impl AddAssign<&Unit> for Unit {
    /// # Panics
    /// If the two belong to different robots or libraries (an empty default adopts the other's).
    fn add_assign(&mut self, other: &Unit) {
        self.gram += &other.gram;
        if self.joints.is_empty() {
            self.joints.clone_from(&other.joints);
            return;
        }
        for (sum, own) in self.joints.iter_mut().zip(&other.joints) {
            sum.decoys += &own.decoys;
            sum.torque += own.torque;
            sum.weighing += &own.weighing;
        }
    }
}

impl JointUnit {
    pub(super) fn split(sums: JointBlock) -> (JointGram, Self) {
        let JointBlock {
            gram,
            decoys,
            torque,
            weighing,
        } = sums;
        let rest = Self {
            decoys,
            torque,
            weighing,
        };
        (gram, rest)
    }
}

/// Coefficients of the columns of a joint.
pub(crate) fn of_joint(joint: &JointGram, beta: &[f64]) -> Vec<f64> {
    let columns = joint.columns.iter();
    columns.map(|&column| beta[column as usize]).collect()
}

/// `[−β, 1]ᵀ S [−β, 1]`: of Σ x xᵀ the squares of y − Xβ; `beta` belongs to the columns of the joint.
pub(crate) fn residual_form(sums: &Symmetric, beta: &[f64]) -> f64 {
    let last = beta.len();
    let with = |i: usize| -> f64 {
        let products = beta.iter().enumerate();
        products.map(|(k, b)| sums.at(i, k) * b).sum()
    };
    let terms = beta.iter().enumerate();
    let explained: f64 = terms
        .map(|(i, b)| b * (2.0 * sums.at(i, last) - with(i)))
        .sum();
    sums.at(last, last) - explained
}
