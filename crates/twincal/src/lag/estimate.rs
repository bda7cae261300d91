//! Lags by Gauss–Newton: joint by joint with all parameters free, log by log beside them.

use super::rows::{FEWEST, REACH, Rows};
use crate::rigid_fit::{Fit, about_lean, leaning};
use crate::robot::Robot;
use crate::signal::{Pipeline, Trajectory};

/// Steps before lags are looked at, and with them; longest step, s.
const FITS: usize = 4;
const STEPS: usize = 8;
const LONGEST_STEP: f64 = 0.03;
/// Pieces of each log by which standard deviations are measured and rows are left out in turn.
const PIECES: usize = 8;
/// Standard deviations of few pieces are made longer by this number of pieces over theirs: four Gaussian ones (6e-5) are 8.7 of Student's t with the
/// seven degrees of freedom of one log, 4.9 with the 23 of three.
const STUDENT: f64 = 8.0;
/// What is left of a row counts with this many spreads at most where left-out rows are scored.
const CAPPED: f64 = 6.0;

/// Lags of some logs, s.
pub(super) struct Estimate<'a> {
    rows: Rows<'a>,
    weights: Vec<Vec<f64>>,
    spread: Vec<f64>,
    theta: Vec<f64>,
    /// By log and joint, s.
    lags: Vec<Vec<f64>>,
    /// Lag and standard deviation by joint, of all logs; `None` of a joint that hardly slides.
    pub(super) joints: Vec<Option<[f64; 2]>>,
    /// Lag and standard deviation by log, of all joints.
    pub(super) logs: Vec<Option<[f64; 2]>>,
}

/// Estimates the lags of logs together; `None` without torque or with too little sliding motion.
pub(super) fn estimate<'a>(
    robot: &Robot,
    pipeline: &Pipeline,
    logs: &[&'a Trajectory],
) -> Option<Estimate<'a>> {
    let (rows, theta) = settled(robot, pipeline, logs)?;
    let dof = robot.dof();
    let slides = |joint: usize| rows.used[joint].iter().filter(|used| **used).count() >= FEWEST;
    let speaks: Vec<bool> = (0..dof).map(slides).collect();
    if !speaks.contains(&true) {
        return None;
    }
    let mut found = walk(rows, theta, dof)?;
    found.rows.fill_rates(&found.theta);
    let sds = sandwich(&found.rows, &found.weights, dof)?;
    let counts = log_rows(&found.rows);
    let all: f64 = counts.iter().sum();
    let of_joint = |joint: usize| {
        let own = found.lags.iter().zip(&counts);
        let mean = own.map(|(lags, n)| lags[joint] * n).sum::<f64>() / all;
        (speaks[joint] && mean.abs() < 0.999 * REACH).then_some([mean, sds[joint]])
    };
    found.joints = (0..dof).map(of_joint).collect();
    let residual = found.rows.design.residual(&found.theta);
    let own = by_log(&found.rows, &found.weights, &residual);
    let middle = |lags: &[f64]| -> f64 {
        let known = lags
            .iter()
            .zip(&found.joints)
            .filter(|(_, own)| own.is_some());
        let mut known: Vec<f64> = known.map(|(lag, _)| *lag).collect();
        known.sort_by(f64::total_cmp);
        known.get(known.len() / 2).copied().unwrap_or(0.0)
    };
    let of_log = |(lags, own): (&Vec<f64>, Option<[f64; 2]>)| own.map(|[_, sd]| [middle(lags), sd]);
    found.logs = found.lags.iter().zip(own).map(of_log).collect();
    found.rows.clear_rates();
    Some(found)
}

/// Rows and parameters before any lag, about the lean of the base that they found.
fn settled<'a>(
    robot: &Robot,
    pipeline: &Pipeline,
    logs: &[&'a Trajectory],
) -> Option<(Rows<'a>, Vec<f64>)> {
    about_lean(robot, |robot| {
        let rows = Rows::new(robot, pipeline, logs)?;
        let theta = without_lag(&rows)?;
        let (gravity, inertia) = rows.design.gravity_and_inertia(&theta);
        Some(Fit {
            size: rows.size(&rows.design.residual(&theta)),
            leaning: leaning(robot, gravity, inertia),
            value: (rows, theta),
        })
    })
}

/// Parameters without lags, in a few steps of weights.
fn without_lag(rows: &Rows<'_>) -> Option<Vec<f64>> {
    let mut theta = vec![0.0; rows.design.parameters];
    for _ in 0..FITS {
        let (weights, _) = rows.weights(&rows.design.residual(&theta));
        theta = rows.fit(&weights)?.solution();
    }
    Some(theta)
}

/// Steps from no lag to that of every log and joint.
fn walk(mut rows: Rows<'_>, mut theta: Vec<f64>, dof: usize) -> Option<Estimate<'_>> {
    let (mut weights, mut spread) = rows.weights(&rows.design.residual(&theta));
    let mut lags = vec![vec![0.0; dof]; rows.logs()];
    let free = rows.design.parameters - dof;
    for _ in 0..STEPS {
        rows.fill_rates(&theta);
        theta = rows.fit(&weights)?.solution();
        let of_joints: Vec<f64> = theta[free..].to_vec();
        let of_logs = by_log(&rows, &weights, &rows.design.residual(&theta));
        for (lags, own) in lags.iter_mut().zip(&of_logs) {
            for (lag, joint) in lags.iter_mut().zip(&of_joints) {
                let step = joint + own.map_or(0.0, |[lag, _]| lag);
                let moved = *lag + step.clamp(-LONGEST_STEP, LONGEST_STEP);
                *lag = moved.clamp(-REACH, REACH);
            }
        }
        rows.move_torque(&lags);
        theta[free..].fill(0.0);
        rows.clear_rates();
        (weights, spread) = rows.weights(&rows.design.residual(&theta));
    }
    Some(Estimate {
        rows,
        weights,
        spread,
        theta,
        lags,
        joints: Vec::new(),
        logs: Vec::new(),
    })
}

impl Estimate<'_> {
    /// Share of what is left of left-out rows that goes where torque moves by these lags of the joints instead of none: of all joints, and
    /// joint by joint. Every other piece of each log is left out in turn.
    pub(super) fn gain(&mut self, lags: &[f64]) -> Option<(f64, Vec<f64>)> {
        let logs = self.rows.logs();
        let mut score = |lags: &[f64]| -> Option<Vec<[f64; 2]>> {
            self.rows.move_torque(&vec![lags.to_vec(); logs]);
            let mut sums = vec![[0.0; 2]; lags.len()];
            for parity in 0..2 {
                let kept = |row: usize| piece(&self.rows, row) % 2 == parity;
                let weights: Vec<Vec<f64>> = (self.weights.iter())
                    .map(|own| {
                        let rows = own.iter().enumerate();
                        rows.map(|(row, w)| if kept(row) { *w } else { 0.0 })
                            .collect()
                    })
                    .collect();
                let theta = self.rows.fit(&weights)?.solution();
                let residual = self.rows.design.residual(&theta);
                for (joint, sum) in sums.iter_mut().enumerate() {
                    for (row, used) in self.rows.used[joint].iter().enumerate() {
                        if *used && !kept(row) && self.spread[joint].is_finite() {
                            let left = (residual[joint][row] / self.spread[joint]).abs();
                            sum[0] += left.min(CAPPED).powi(2);
                            sum[1] += 1.0;
                        }
                    }
                }
            }
            Some(sums)
        };
        let before = score(&vec![0.0; lags.len()])?;
        let after = score(lags)?;
        let total = |sums: &[[f64; 2]]| sums.iter().map(|sum| sum[0]).sum::<f64>();
        let share = |after: f64, before: f64| {
            if before > 0.0 {
                1.0 - (after / before).sqrt()
            } else {
                0.0
            }
        };
        let joints = after
            .iter()
            .zip(&before)
            .map(|(a, b)| share(a[0], b[0]))
            .collect();
        Some((share(total(&after), total(&before)), joints))
    }
}

impl Estimate<'_> {
    /// Share of what is left of each log's rows that goes where its torque moves by its own lag instead of this one.
    pub(super) fn gain_of_logs(&mut self, common: f64) -> Vec<f64> {
        let logs = self.rows.logs();
        let mut squares = |lags: &[Vec<f64>]| -> Vec<f64> {
            self.rows.move_torque(lags);
            let residual = self.rows.design.residual(&self.theta);
            let mut sums = vec![0.0; logs];
            for ((left, used), spread) in residual.iter().zip(&self.rows.used).zip(&self.spread) {
                let rows = left.iter().zip(used).enumerate();
                for (row, (left, _)) in rows.filter(|(_, (_, used))| **used) {
                    sums[self.rows.group[row]] += (left / spread).abs().min(CAPPED).powi(2);
                }
            }
            sums
        };
        let own = squares(&self.lags);
        let shared = squares(&vec![vec![common; self.spread.len()]; logs]);
        let share = |(own, shared): (&f64, &f64)| {
            if *shared > 0.0 {
                1.0 - (own / shared).sqrt()
            } else {
                0.0
            }
        };
        own.iter().zip(&shared).map(share).collect()
    }
}

/// Piece of its log that a row is in.
fn piece(rows: &Rows<'_>, row: usize) -> usize {
    let group = rows.group[row];
    let first = rows.group.partition_point(|g| *g < group);
    let end = rows.group.partition_point(|g| *g <= group);
    (row - first) * PIECES / (end - first)
}

/// Factor at a standard deviation that comes from so many pieces.
fn student(pieces: usize) -> f64 {
    1.0 + STUDENT / pieces as f64
}

/// Used rows of each log.
fn log_rows(rows: &Rows<'_>) -> Vec<f64> {
    let mut counts = vec![0.0; rows.logs()];
    for used in &rows.used {
        for (row, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            counts[rows.group[row]] += 1.0;
        }
    }
    counts
}

/// What the lag of each log adds to that of its joints, with its standard deviation from its pieces.
fn by_log(rows: &Rows<'_>, weights: &[Vec<f64>], residual: &[Vec<f64>]) -> Vec<Option<[f64; 2]>> {
    let logs = rows.logs();
    // Rate with what is left, and with itself, by piece.
    let mut sums = vec![[[0.0; 2]; PIECES]; logs];
    let mut counts = vec![0; logs];
    for (joint, (weights, left)) in weights.iter().zip(residual).enumerate() {
        for (row, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let rate = rows.rate(joint, row);
            let sum = &mut sums[rows.group[row]][piece(rows, row)];
            sum[0] += weight * rate * left[row];
            sum[1] += weight * rate * rate;
            counts[rows.group[row]] += 1;
        }
    }
    let of_log = |(pieces, count): (&[[f64; 2]; PIECES], &usize)| {
        let squares: f64 = pieces.iter().map(|sum| sum[1]).sum();
        if *count < FEWEST || squares <= 0.0 {
            return None;
        }
        let lag = pieces.iter().map(|sum| sum[0]).sum::<f64>() / squares;
        let score = |sum: &[f64; 2]| (sum[0] - lag * sum[1]).powi(2);
        let scores = pieces.iter().map(score).sum::<f64>() * PIECES as f64 / (PIECES - 1) as f64;
        Some([lag, student(PIECES) * scores.sqrt() / squares])
    };
    sums.iter().zip(&counts).map(of_log).collect()
}

/// Standard deviation of each joint's lag, all parameters free: from sums of its influence over pieces of the logs.
///
/// # Source
/// Cluster-robust covariance (Liang & Zeger 1986), as residuals of one piece are alike.
fn sandwich(rows: &Rows<'_>, weights: &[Vec<f64>], dof: usize) -> Option<Vec<f64>> {
    let normal = rows.fit(weights)?;
    let residual = rows.design.residual(&normal.solution());
    let free = rows.design.parameters - dof;
    let pieces = rows.logs() * PIECES;
    let cluster: Vec<usize> = (0..rows.group.len())
        .map(|row| rows.group[row] * PIECES + piece(rows, row))
        .collect();
    let of_joint = |lag: usize| {
        let column = normal.inverse_column(free + lag);
        let mut sums = vec![0.0; pieces];
        for (joint, (weights, left)) in weights.iter().zip(&residual).enumerate() {
            for (row, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                let influence = rows.design.joints[joint].explained(row, &column);
                sums[cluster[row]] += weight * left[row] * influence;
            }
        }
        let squares: f64 = sums.iter().map(|sum| sum * sum).sum();
        student(pieces) * (squares * pieces as f64 / (pieces - 1) as f64).sqrt()
    };
    Some((0..dof).map(of_joint).collect())
}
