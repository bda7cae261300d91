//! Sufficient statistics: the narrow waist (method section 4). Left of it cost grows with the log, right of it not.

use serde::{Deserialize, Serialize};

/// A symmetric matrix of order `size`, stored full and row-major.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Symmetric {
    /// Order.
    pub size: usize,
    /// `values[i * size + j]`.
    pub values: Vec<f64>,
}

/// Statistics of ONE joint over one block of rows, on the augmented row `x = [columns of the joint, y]`.
///
/// ```text
/// S0 = Σ x xᵀ    D = Σ_{t≥2} (x_t − x_{t−1})(x_t − x_{t−1})ᵀ    F, L = Σ over runs of first, last row's x xᵀ
/// ```
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

/// Statistics of one block of rows, joint by joint. A log is a list of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Gram {
    /// One per moving joint.
    pub joints: Vec<JointGram>,
}
// + AddAssign, accumulate(&RowBlock), stationary form G(ρ) = (1−ρ)² S0 + ρ D + ρ(1−ρ)(F + L)
