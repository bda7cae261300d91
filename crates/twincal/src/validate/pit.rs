//! Shape of the predictive distribution: where in it the measured torque falls (probability integral transform).

use super::CoverageKeeper;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// Bins of the counts; the histogram joins ten of them.
const FINE: usize = 200;
/// Bins of the histogram.
const BINS: usize = 20;
/// 95 % quantile of Kolmogorov's distribution: √n · sup |F̂ − F| of n independent values stays below it.
const KOLMOGOROV: f64 = 1.358_1;

/// PIT of a set of rows. Uniform when predictive distributions are right; empty without rows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Pit {
    /// Shares of the rows in 20 equal bins of [0, 1].
    pub histogram: Vec<f64>,
    /// Largest |share of rows below u − u| over u in steps of 0.005: 0 when uniform.
    pub distance: f64,
    /// Distance that uniform values stay below in 95 of 100 cases, each row counted as 1/τ of an independent one.
    pub chance: f64,
}

/// How well the intervals of one joint hold what they promise, on filtered rows in which it moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reliability {
    /// Joint name.
    pub joint: String,
    /// Rows.
    pub rows: u64,
    /// Coverage at 50, 80, 90 and 95 %.
    pub coverage_levels: Vec<(f64, f64)>,
    /// PIT.
    pub pit: Pit,
}

/// Counts PIT values of one joint, or of several; keepers add up.
#[derive(Debug, Clone, PartialEq)]
pub struct PitKeeper {
    coverage: CoverageKeeper,
    counts: Vec<u64>,
    /// Rows, each divided by the residual's memory.
    independent: f64,
}

impl Default for PitKeeper {
    fn default() -> Self {
        Self {
            coverage: CoverageKeeper::default(),
            counts: vec![0; FINE],
            independent: 0.0,
        }
    }
}

impl PitKeeper {
    /// Adds predictive probabilities of measured torques; `memory` rows count as one independent one.
    pub fn push(&mut self, pit: &[f64], memory: f64) {
        self.coverage.push(pit);
        for p in pit.iter().filter(|p| p.is_finite()) {
            let bin = (p.clamp(0.0, 1.0) * FINE as f64) as usize;
            self.counts[bin.min(FINE - 1)] += 1;
        }
        self.independent += pit.len() as f64 / memory.max(1.0);
    }

    /// Rows so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// `(level, share of rows inside)` at 50, 80, 90 and 95 %; empty without rows.
    #[must_use]
    pub fn levels(&self) -> Vec<(f64, f64)> {
        self.coverage.levels()
    }

    /// Histogram and distance from uniform.
    #[must_use]
    pub fn pit(&self) -> Pit {
        let rows = self.rows() as f64;
        if rows == 0.0 {
            return Pit::default();
        }
        let shares = self.counts.chunks(FINE / BINS);
        let (mut below, mut distance) = (0, 0.0_f64);
        for (bin, count) in self.counts.iter().enumerate() {
            below += count;
            let edge = (bin + 1) as f64 / FINE as f64;
            distance = distance.max((below as f64 / rows - edge).abs());
        }
        Pit {
            histogram: shares
                .map(|bin| bin.iter().sum::<u64>() as f64 / rows)
                .collect(),
            distance,
            chance: (KOLMOGOROV / self.independent.sqrt()).min(1.0),
        }
    }
}

impl AddAssign<&PitKeeper> for PitKeeper {
    fn add_assign(&mut self, other: &PitKeeper) {
        self.coverage += &other.coverage;
        for (own, more) in self.counts.iter_mut().zip(&other.counts) {
            *own += more;
        }
        self.independent += other.independent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evenly spread values are uniform; squared ones have F(u) = √u, farthest from u at u = ¼, by ¼.
    #[test]
    fn distance_is_that_of_the_distribution() {
        let even: Vec<f64> = (0..4000).map(|i| (f64::from(i) + 0.5) / 4000.0).collect();
        let mut keeper = PitKeeper::default();
        keeper.push(&even, 4.0);
        let pit = keeper.pit();
        assert!(pit.distance < 1e-12, "{}", pit.distance);
        assert!(
            pit.histogram
                .iter()
                .all(|share| (share - 0.05).abs() < 1e-12)
        );
        // 1000 independent values: 1.3581 / √1000.
        assert!((pit.chance - 0.042_947).abs() < 1e-5, "{}", pit.chance);
        assert_eq!(keeper.levels()[3], (0.95, 0.95));
        let squares: Vec<f64> = even.iter().map(|u| u * u).collect();
        let mut bent = PitKeeper::default();
        bent.push(&squares, 1.0);
        assert!((bent.pit().distance - 0.25).abs() < 1e-3);
        assert!((bent.pit().histogram[0] - 0.05_f64.sqrt()).abs() < 1e-3);
        bent += &keeper;
        assert_eq!(bent.rows(), 8000);
        assert!((bent.pit().distance - 0.125).abs() < 1e-3);
    }

    #[test]
    fn without_rows_there_is_no_histogram() {
        let mut keeper = PitKeeper::default();
        keeper.push(&[], 1.0);
        assert_eq!(
            (keeper.pit(), keeper.levels()),
            (Pit::default(), Vec::new())
        );
    }
}
