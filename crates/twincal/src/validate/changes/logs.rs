//! Changes of a robot log by log: what a log is that its torque columns are not what they are said to be, and the logs that speak of the robot together.

use super::super::misread::{Limits, Readings};
use super::{ChangeKind, Changes, JointSums, Suspect};
use crate::error::Finding;
use crate::linear_algebra::{Cholesky, dot};

/// Share by which the diagonal is raised: columns that others have all of are left to these.
const RIDGE: f64 = 1e-9;

impl Changes<'_> {
    /// Nothing seen yet, of the same twin: for one log.
    #[must_use]
    pub fn alone(&self) -> Self {
        let without = |suspect: &Suspect| Suspect {
            blocks: Vec::new(),
            subject: suspect.subject.clone(),
            columns: suspect.columns.clone(),
            kind: suspect.kind,
        };
        Self {
            twin: self.twin,
            library: self.library,
            columns: self.columns.clone(),
            suspects: self.suspects.iter().map(without).collect(),
            joints: self.joints.iter().map(|_| JointSums::default()).collect(),
            readings: Readings::new(&self.error),
            error: self.error.clone(),
        }
    }

    /// Adds what another log of the same twin says of changes; [`Changes::misread`] is asked of each log before.
    pub fn join(&mut self, other: Self) {
        for (own, other) in self.suspects.iter_mut().zip(other.suspects) {
            own.blocks.extend(other.blocks);
        }
        for (own, other) in self.joints.iter_mut().zip(&other.joints) {
            own.rows += other.rows;
            own.square += other.square;
            add(&mut own.gram, &other.gram);
            add(&mut own.score, &other.score);
            add(&mut own.cross, &other.cross);
        }
    }

    /// What one log is, by the rows that were taken, where its torque fits the twin with columns that are turned, exchanged or late, clearly better than
    /// as logged and than with any change: [`Code::SignFlip`](crate::Code::SignFlip), [`Code::JointOrder`](crate::Code::JointOrder),
    /// [`Code::LogTorqueLag`](crate::Code::LogTorqueLag). Nothing where no joint's error is more than `ratio` times the twin's. Such a log says nothing of the
    /// robot: do not [`Changes::join`] it.
    #[must_use]
    pub fn misread(&self, log: &str, ratio: f64) -> Vec<Finding> {
        let joints = self.twin.robot.joint_names();
        let memory = self.twin.noise.iter().map(|noise| noise.memory());
        let memory = memory.fold(1.0, f64::max);
        let limits = Limits {
            ratio,
            change: self.best_change(),
            autocorrelation_time: memory,
            joints: &joints,
        };
        self.readings.findings(log, &limits)
    }

    /// Largest part of the squares of the residual, each divided by σ_j², that changes of one kind explain together. A change of a joint that rests in
    /// this log has no torque and counts for nothing.
    fn best_change(&self) -> f64 {
        let explained = |kind: ChangeKind| {
            let own = self.suspects.iter().filter(|own| own.kind == kind);
            let columns: Vec<usize> = own.flat_map(|own| own.columns.clone()).collect();
            let weight = |joint: usize| self.error[joint].powi(-2);
            let mut normal = self.products(&columns, &columns, weight);
            let size = columns.len();
            for diagonal in normal.iter_mut().step_by(size + 1) {
                *diagonal = match *diagonal > 0.0 {
                    true => *diagonal * (1.0 + RIDGE),
                    false => 1.0,
                };
            }
            let score = self.score(&columns);
            let mut value = score.clone();
            Cholesky::new(&normal, size).ok()?.solve(&mut value);
            Some(dot(&value, &score))
        };
        let kinds = [
            ChangeKind::Friction,
            ChangeKind::Payload,
            ChangeKind::JointZero,
        ];
        kinds.into_iter().filter_map(explained).fold(0.0, f64::max)
    }
}

fn add(sum: &mut Vec<f64>, more: &[f64]) {
    sum.resize(sum.len().max(more.len()), 0.0);
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum += more;
    }
}
