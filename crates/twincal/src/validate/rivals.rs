//! Two predictors on the same rows: the model average and the compact twin.

use crate::twin::JointTorque;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// What one predictor loses on moving filtered rows, pooled over joints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Loss {
    /// Rows.
    pub rows: u64,
    /// RMSE of its torque, N·m.
    #[serde(deserialize_with = "super::nan_if_null")]
    pub rmse: f64,
    /// Mean ln of its predictive density at the measured torque, nats per row. Larger is better.
    #[serde(deserialize_with = "super::nan_if_null")]
    pub log_score: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Sums {
    rows: u64,
    square: f64,
    log_density: f64,
}

impl Sums {
    fn push(&mut self, measured: &[f64], torque: &JointTorque, keep: impl Fn(usize) -> bool) {
        for (row, measured) in measured.iter().enumerate().filter(|(row, _)| keep(*row)) {
            self.rows += 1;
            self.square += (measured - torque.calibrated[row]).powi(2);
            self.log_density += torque.log_density[row];
        }
    }

    fn loss(&self) -> Loss {
        let rows = self.rows as f64;
        Loss {
            rows: self.rows,
            rmse: (self.square / rows).sqrt(),
            log_score: self.log_density / rows,
        }
    }
}

/// Sums of both; keepers of several folds add up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RivalKeeper {
    average: Sums,
    compact: Sums,
}

impl RivalKeeper {
    /// Adds the rows of a block for which `keep(row)` holds: the moving ones.
    pub fn push(
        &mut self,
        measured: &[f64],
        average: &JointTorque,
        compact: &JointTorque,
        keep: impl Fn(usize) -> bool,
    ) {
        self.average.push(measured, average, &keep);
        self.compact.push(measured, compact, &keep);
    }

    /// Losses of the average and of the compact twin; `None` without rows.
    #[must_use]
    pub fn losses(&self) -> Option<[Loss; 2]> {
        (self.average.rows > 0).then(|| [self.average.loss(), self.compact.loss()])
    }
}

impl AddAssign for RivalKeeper {
    fn add_assign(&mut self, other: Self) {
        for (own, more) in [
            (&mut self.average, other.average),
            (&mut self.compact, other.compact),
        ] {
            own.rows += more.rows;
            own.square += more.square;
            own.log_density += more.log_density;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_means_over_the_kept_rows() {
        let torque = |calibrated: [f64; 3], log_density: [f64; 3]| JointTorque {
            calibrated: calibrated.to_vec(),
            log_density: log_density.to_vec(),
            ..JointTorque::default()
        };
        let average = torque([0.0, 0.0, 9.0], [-1.0, -2.0, f64::NAN]);
        let compact = torque([1.0, 1.0, 9.0], [-3.0, -4.0, f64::NAN]);
        let mut keeper = RivalKeeper::default();
        assert_eq!(keeper.losses(), None);
        keeper.push(&[3.0, 4.0, 0.0], &average, &compact, |row| row < 2);
        keeper += RivalKeeper::default();
        let [a, b] = keeper.losses().unwrap();
        assert_eq!((a.rows, a.rmse, a.log_score), (2, 12.5_f64.sqrt(), -1.5));
        assert_eq!((b.rmse, b.log_score), (6.5_f64.sqrt(), -3.5));
    }
}
