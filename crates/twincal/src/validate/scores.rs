//! Scores as running sums: rows come in any blocks, joints in any order, nothing is kept but the sums.

use super::{JointScore, Scores};
use crate::twin::JointTorque;
use std::ops::AddAssign;

/// Sums of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Sums {
    rows: u64,
    square_nominal: f64,
    square_calibrated: f64,
    error: f64,
    inside: u64,
    width: f64,
    interval_score: f64,
    epistemic: f64,
    noise: f64,
    measured: f64,
    square_measured: f64,
    /// Rows that friction alone predicted too.
    friction_rows: u64,
    square_friction: f64,
}

impl AddAssign for Sums {
    fn add_assign(&mut self, other: Self) {
        self.rows += other.rows;
        self.square_nominal += other.square_nominal;
        self.square_calibrated += other.square_calibrated;
        self.error += other.error;
        self.inside += other.inside;
        self.width += other.width;
        self.interval_score += other.interval_score;
        self.epistemic += other.epistemic;
        self.noise += other.noise;
        self.measured += other.measured;
        self.square_measured += other.square_measured;
        self.friction_rows += other.friction_rows;
        self.square_friction += other.square_friction;
    }
}

impl Sums {
    /// `sum / rows`; NaN without rows.
    fn mean(&self, sum: f64) -> f64 {
        sum / self.rows as f64
    }

    fn score(&self, joint: &str) -> JointScore {
        JointScore {
            joint: joint.into(),
            rows: self.rows,
            rmse_nominal: self.mean(self.square_nominal).sqrt(),
            rmse_calibrated: self.mean(self.square_calibrated).sqrt(),
            bias: self.mean(self.error),
            coverage95: self.mean(self.inside as f64),
            mean_width95: self.mean(self.width),
            interval_score95: self.mean(self.interval_score),
            epistemic_sd: self.mean(self.epistemic).sqrt(),
            noise_sd: self.mean(self.noise).sqrt(),
            epistemic_share: self.epistemic / (self.epistemic + self.noise),
            torque_sd: (self.mean(self.square_measured) - self.mean(self.measured).powi(2))
                .max(0.0)
                .sqrt(),
            rmse_friction: (self.friction_rows == self.rows && self.rows > 0)
                .then(|| self.mean(self.square_friction).sqrt()),
        }
    }
}

/// Collects predictions and measurements, gives [`Scores`]. Adding two keepers equals pushing all their rows.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreKeeper {
    names: Vec<String>,
    joints: Vec<Sums>,
}

impl ScoreKeeper {
    /// No rows yet, for joints of these names.
    pub fn new(joints: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let names: Vec<String> = joints.into_iter().map(Into::into).collect();
        let joints = vec![Sums::default(); names.len()];
        Self { names, joints }
    }

    /// Adds the rows of a block of `joint`; `measured` in N·m, as long as the torque's slices.
    pub fn push(&mut self, joint: usize, measured: &[f64], torque: &JointTorque) {
        self.push_where(joint, measured, torque, |_| true);
    }

    /// Adds those rows of the block for which `keep(row)` holds, e.g. the moving ones.
    ///
    /// # Panics
    /// If there is no such joint or the slices differ in length.
    pub fn push_where(
        &mut self,
        joint: usize,
        measured: &[f64],
        torque: &JointTorque,
        keep: impl Fn(usize) -> bool,
    ) {
        assert_eq!(
            measured.len(),
            torque.nominal.len(),
            "one measured torque per predicted one"
        );
        let sums = &mut self.joints[joint];
        for (row, &measured) in measured.iter().enumerate().filter(|(row, _)| keep(*row)) {
            let (low, high) = (torque.low[row], torque.high[row]);
            *sums += Sums {
                rows: 1,
                square_nominal: (measured - torque.nominal[row]).powi(2),
                square_calibrated: (measured - torque.calibrated[row]).powi(2),
                error: measured - torque.calibrated[row],
                inside: u64::from(measured >= low && measured <= high),
                width: high - low,
                interval_score: interval_score(low, high, measured),
                epistemic: torque.epistemic[row].powi(2),
                noise: torque.noise[row].powi(2),
                measured,
                square_measured: measured * measured,
                ..Sums::default()
            };
        }
    }

    /// Adds what friction alone predicts of rows that were pushed.
    pub(super) fn push_friction(
        &mut self,
        joint: usize,
        measured: &[f64],
        friction: &JointTorque,
        keep: impl Fn(usize) -> bool,
    ) {
        for (row, &measured) in measured.iter().enumerate().filter(|(row, _)| keep(*row)) {
            self.joints[joint] += Sums {
                friction_rows: 1,
                square_friction: (measured - friction.calibrated[row]).powi(2),
                ..Sums::default()
            };
        }
    }

    /// The scores of everything pushed so far.
    #[must_use]
    pub fn scores(&self) -> Scores {
        let mut pooled = Sums::default();
        for sums in &self.joints {
            pooled += *sums;
        }
        let JointScore {
            rmse_nominal,
            rmse_calibrated,
            coverage95,
            interval_score95,
            epistemic_share,
            ..
        } = pooled.score("");
        let joints = self
            .names
            .iter()
            .zip(&self.joints)
            .map(|(name, sums)| sums.score(name))
            .collect();
        Scores {
            rmse_nominal,
            rmse_calibrated,
            coverage95,
            interval_score95,
            epistemic_share,
            joints,
        }
    }
}

/// Gneiting & Raftery's interval score of a central 95 % interval, N·m: its width, plus 40 times the distance of a
/// measurement outside (2/α, α = 0.05). Proper: on average no interval scores lower than the true quantiles.
fn interval_score(low: f64, high: f64, measured: f64) -> f64 {
    let outside = (low - measured).max(0.0) + (measured - high).max(0.0);
    (high - low) + 2.0 / 0.05 * outside
}

impl AddAssign<&ScoreKeeper> for ScoreKeeper {
    /// # Panics
    /// If the joints differ.
    fn add_assign(&mut self, other: &ScoreKeeper) {
        assert_eq!(self.names, other.names, "scores of different robots");
        for (own, more) in self.joints.iter_mut().zip(&other.joints) {
            *own += *more;
        }
    }
}

/// How often measurements lie inside central intervals of several levels, from their PIT.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CoverageKeeper {
    rows: u64,
    inside: [u64; CoverageKeeper::LEVELS.len()],
}

impl CoverageKeeper {
    /// Levels of the central intervals.
    pub const LEVELS: [f64; 4] = [0.5, 0.8, 0.9, 0.95];

    /// Adds predictive probabilities of measured torques ([`JointTorque::pit`]). A central interval of level L holds a
    /// measurement when `|pit − ½| ≤ L/2`.
    pub fn push(&mut self, pit: &[f64]) {
        self.rows += pit.len() as u64;
        for (inside, level) in self.inside.iter_mut().zip(Self::LEVELS) {
            *inside += pit
                .iter()
                .filter(|&&p| (p - 0.5).abs() <= 0.5 * level)
                .count() as u64;
        }
    }

    /// `(level, share of rows inside)`; empty without rows.
    #[must_use]
    pub fn levels(&self) -> Vec<(f64, f64)> {
        if self.rows == 0 {
            return Vec::new();
        }
        Self::LEVELS
            .iter()
            .zip(self.inside)
            .map(|(&level, inside)| (level, inside as f64 / self.rows as f64))
            .collect()
    }
}

impl AddAssign<&CoverageKeeper> for CoverageKeeper {
    fn add_assign(&mut self, other: &CoverageKeeper) {
        self.rows += other.rows;
        for (own, more) in self.inside.iter_mut().zip(other.inside) {
            *own += more;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nominal 0, calibrated 1, interval 0 … 2.
    fn torque(rows: usize) -> JointTorque {
        JointTorque {
            nominal: vec![0.0; rows],
            calibrated: vec![1.0; rows],
            low: vec![0.0; rows],
            high: vec![2.0; rows],
            epistemic: vec![0.3; rows],
            noise: vec![0.4; rows],
            ..JointTorque::default()
        }
    }

    #[test]
    fn scores_are_those_of_the_definition() {
        let mut keeper = ScoreKeeper::new(["shoulder", "elbow"]);
        keeper.push(0, &[3.0, 4.0], &torque(2));
        keeper.push(1, &[1.0, 2.0, 0.0], &torque(3));
        let scores = keeper.scores();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        close(scores.joints[0].rmse_nominal, (25.0_f64 / 2.0).sqrt());
        close(scores.joints[0].rmse_calibrated, (13.0_f64 / 2.0).sqrt());
        close(scores.joints[0].bias, 2.5);
        close(scores.joints[1].bias, 0.0);
        close(scores.joints[0].coverage95, 0.0);
        close(scores.joints[1].rmse_nominal, (5.0_f64 / 3.0).sqrt());
        // Both ends belong to the interval.
        close(scores.joints[1].coverage95, 1.0);
        close(scores.joints[1].mean_width95, 2.0);
        // Pooled over rows, not over joints.
        close(scores.rmse_nominal, (30.0_f64 / 5.0).sqrt());
        close(scores.rmse_calibrated, (15.0_f64 / 5.0).sqrt());
        close(scores.coverage95, 0.6);
        assert_eq!((scores.joints[0].rows, scores.joints[1].rows), (2, 3));
        // Width 2, and 40 times 1 and 2 outside.
        close(scores.joints[0].interval_score95, 62.0);
        close(scores.joints[1].interval_score95, 2.0);
        close(scores.interval_score95, 26.0);
        close(interval_score(0.0, 2.0, -0.5), 22.0);
        let elbow = &scores.joints[1];
        close(elbow.epistemic_sd, 0.3);
        close(elbow.noise_sd, 0.4);
        assert!((elbow.epistemic_share - 0.36).abs() < 1e-12);
        assert!((scores.epistemic_share - 0.36).abs() < 1e-12);
    }

    #[test]
    fn friction_alone_has_a_score_where_it_predicted_every_row() {
        let mut keeper = ScoreKeeper::new(["a", "b"]);
        keeper.push(0, &[3.0, 4.0], &torque(2));
        keeper.push(1, &[3.0, 4.0], &torque(2));
        let friction = JointTorque {
            calibrated: vec![0.0, 1.0],
            ..torque(2)
        };
        keeper.push_friction(0, &[3.0, 4.0], &friction, |_| true);
        keeper.push_friction(1, &[3.0, 4.0], &friction, |row| row > 0);
        let joints = keeper.scores().joints;
        assert_eq!(joints[0].rmse_friction, Some(3.0));
        assert_eq!(joints[1].rmse_friction, None);
        assert!(
            ScoreKeeper::new(["a"]).scores().joints[0]
                .rmse_friction
                .is_none()
        );
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let measured = [0.5, 1.5, 2.5, -1.0];
        let mut whole = ScoreKeeper::new(["a"]);
        whole.push(0, &measured, &torque(4));
        let mut first = ScoreKeeper::new(["a"]);
        first.push_where(0, &measured, &torque(4), |row| row % 2 == 0);
        let mut second = ScoreKeeper::new(["a"]);
        second.push_where(0, &measured, &torque(4), |row| row % 2 == 1);
        first += &second;
        assert_eq!(first, whole);
    }

    #[test]
    fn a_joint_without_rows_is_null_in_json_and_comes_back() {
        let mut keeper = ScoreKeeper::new(["shoulder", "elbow"]);
        keeper.push(0, &[3.0], &torque(1));
        let scores = keeper.scores();
        assert!(scores.joints[1].rmse_nominal.is_nan() && scores.joints[1].rows == 0);
        assert!(scores.rmse_nominal == 3.0);
        let text = serde_json::to_string(&scores).unwrap();
        assert!(
            text.contains(r#""joint":"elbow","rows":0,"rmse_nominal":null"#),
            "{text}"
        );
        let again: Scores = serde_json::from_str(&text).unwrap();
        assert!(again.joints[1].coverage95.is_nan());
        assert_eq!(again.joints[0], scores.joints[0]);
    }

    #[test]
    fn levels_count_both_ends_of_the_pit() {
        let mut keeper = CoverageKeeper::default();
        assert!(keeper.levels().is_empty());
        keeper.push(&[0.5, 0.74, 0.76, 0.24, 0.91]);
        keeper.push(&[0.04, 0.024, 0.976, 0.03, 1.0]);
        assert_eq!(
            keeper.levels(),
            [(0.5, 0.2), (0.8, 0.4), (0.9, 0.5), (0.95, 0.7)]
        );
    }
}
