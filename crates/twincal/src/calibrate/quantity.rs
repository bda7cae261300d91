//! What the numbers in a file of statistics are.

use serde::{Deserialize, Serialize};

/// What the numbers of a [`Record`](super::Record) are; x is the signals of the joint and its residual torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Σ x xᵀ of a stretch.
    Products,
    /// The same of the differences of consecutive rows.
    Differences,
    /// Σ x xᵀ of the first rows of runs.
    First,
    /// The same of their last rows.
    Last,
    /// Σ φ_k xᵀ over decoys φ_k.
    Decoys,
    /// Σ φ_k².
    DecoySquares,
    /// Σ τ² of the measured torque, stretch by stretch.
    Torque,
    /// Power of x in a band of frequencies.
    Power,
    /// Σ x xᵀ of torque as logged, at some of the samples.
    Logged,
    /// Σ x xᵀ of the filtered rows at the same times.
    Filtered,
    /// Positions of the joint in some rows, evenly taken; rad, m.
    Positions,
    /// Its velocities there.
    Velocities,
    /// Its accelerations there.
    Accelerations,
    /// 1 where the joint stands still there, else 0.
    Still,
    /// Hashes of patterns in the noise of its torque, ascending: copies of a log have the same.
    Noise,
    /// Some smoothed rows: position, velocity, acceleration, torque, and what the joint's friction can be; of the first joint, their stamps
    /// too.
    Excerpt,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 16] = [
        Self::Products,
        Self::Differences,
        Self::First,
        Self::Last,
        Self::Decoys,
        Self::DecoySquares,
        Self::Torque,
        Self::Power,
        Self::Logged,
        Self::Filtered,
        Self::Positions,
        Self::Velocities,
        Self::Accelerations,
        Self::Still,
        Self::Noise,
        Self::Excerpt,
    ];

    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Products => "products",
            Self::Differences => "differences",
            Self::First => "first",
            Self::Last => "last",
            Self::Decoys => "decoys",
            Self::DecoySquares => "decoy_squares",
            Self::Torque => "torque",
            Self::Power => "power",
            Self::Logged => "logged",
            Self::Filtered => "filtered",
            Self::Positions => "positions",
            Self::Velocities => "velocities",
            Self::Accelerations => "accelerations",
            Self::Still => "still",
            Self::Noise => "noise",
            Self::Excerpt => "excerpt",
        }
    }

    /// The quantity of this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|own| own.name() == name)
    }
}
