//! Torque that neither model nor friction explains, far beyond what they leave otherwise, for a short time.
//!
//! What is left of a real arm's torque is heavy-tailed (friction that turns round), so it is measured by its own 95 %
//! quantile, not by its standard deviation: on five real robots nothing exceeds four times that quantile.

use super::bins::Bins;
use super::{Incident, IncidentKind};
use crate::linear_algebra::Cholesky;
use crate::robot::Robot;
use crate::signal::Pipeline;
use rayon::prelude::*;

/// How many times the 95 % quantile of what is left a spike reaches, and where it begins and ends.
const PEAK: f64 = 5.0;
const FOOT: f64 = 2.0;
/// Share of the torque's standard deviation that a spike reaches at least.
const MATTERS: f64 = 0.2;
/// Longest time that a spike is joined over, in periods of the cut-off; and without filter, samples.
const JOINED: f64 = 1.0;
const JOINED_SAMPLES: f64 = 5.0;
/// What is left beyond this many quantiles does not count in the regression.
const CLIPPED: f64 = 3.0;
/// Spikes that are always rare enough, and bins per spike beyond those: what happens more often is no contact but noise with heavy
/// tails, which has its own finding.
const FEW: usize = 3;
const RARE: usize = 200;
/// Fewest bins in which a joint moves.
const FEWEST: usize = 60;
/// Added to the diagonal of the columns' correlations.
const RIDGE: f64 = 1e-9;
/// Columns: nominal torque, velocity, two shapes of dry friction, velocity squared, acceleration, one.
pub(super) const COLUMNS: usize = 7;

/// Spikes of all joints; those that overlap are one, of the joint in which it is largest.
pub(super) fn spikes(robot: &Robot, pipeline: &Pipeline, bins: &[Bins]) -> Vec<Incident> {
    let names = robot.joint_names();
    let [interval, logged] = bins.first().map_or([1.0; 2], |bins| bins.intervals);
    let joined = if pipeline.is_off() {
        JOINED_SAMPLES * interval
    } else {
        JOINED / pipeline.cutoff_hz
    };
    // with how many times the quantile it reaches
    let of_joint = |(joint, name)| {
        let left = Left::new(bins, joint)?;
        Some(left.spikes(bins, name))
    };
    let of_joints: Vec<_> = names.into_par_iter().enumerate().map(of_joint).collect();
    let mut found: Vec<(f64, Incident)> = of_joints.into_iter().flatten().flatten().collect();
    found.sort_by(|a, b| a.1.span[0].total_cmp(&b.1.span[0]));
    let mut merged: Vec<(f64, Incident)> = Vec::new();
    for (times, incident) in found {
        match merged.last_mut() {
            Some((most, last)) if incident.span[0] - last.span[1] <= joined => {
                let span = [last.span[0], last.span[1].max(incident.span[1])];
                if times > *most {
                    (*most, *last) = (times, incident);
                }
                last.span = span;
                last.samples = ((span[1] - span[0]) / logged).round() as u64 + 1;
            }
            _ => merged.push((times, incident)),
        }
    }
    let all: usize = bins.iter().map(|bins| bins.spans.len()).sum();
    if merged.len() > FEW && merged.len() * RARE > all {
        return Vec::new();
    }
    merged.into_iter().map(|(_, incident)| incident).collect()
}

/// What model and friction leave of one joint's torque.
struct Left {
    joint: usize,
    /// Per segment, then per bin.
    torque: Vec<Vec<f64>>,
    /// 95 % quantile of its size where the joint moves.
    quantile: f64,
    /// Standard deviation of the torque itself.
    sd: f64,
}

impl Left {
    fn new(bins: &[Bins], joint: usize) -> Option<Self> {
        let measured = |bins: &Bins| bins.joint(joint).torque().to_vec();
        let mut left = Self {
            joint,
            torque: bins.iter().map(measured).collect(),
            quantile: f64::INFINITY,
            sd: 0.0,
        };
        let moving = left.moving(bins);
        if moving.len() < FEWEST {
            return None;
        }
        let mean = moving.iter().sum::<f64>() / moving.len() as f64;
        let squares: f64 = moving.iter().map(|t| (t - mean).powi(2)).sum();
        left.sd = (squares / moving.len() as f64).sqrt();
        // Spikes must not pull the regression: what is far out does not count the second and third time.
        for _ in 0..3 {
            left.regress(bins)?;
        }
        (left.quantile > 0.0).then_some(left)
    }

    /// Values where the joint moves.
    fn moving(&self, bins: &[Bins]) -> Vec<f64> {
        let mut values = Vec::new();
        for (bins, torque) in bins.iter().zip(&self.torque) {
            let own = torque.iter().zip(bins.moves(self.joint));
            values.extend(own.filter(|(_, moves)| **moves).map(|(t, _)| *t));
        }
        values
    }

    /// Least squares of the bins that are not far out.
    fn regress(&mut self, all: &[Bins]) -> Option<()> {
        let (mut matrix, mut right) = (vec![0.0; COLUMNS * COLUMNS], vec![0.0; COLUMNS]);
        let far = CLIPPED * self.quantile;
        for (bins, torque) in all.iter().zip(&self.torque) {
            let bins = bins.joint(self.joint);
            for (i, left) in torque.iter().enumerate() {
                if !bins.moves(i) || left.abs() > far {
                    continue;
                }
                let (columns, tau) = (bins.columns(i), bins.torque()[i]);
                for (a, x) in columns.iter().enumerate() {
                    right[a] += x * tau;
                    for (b, other) in columns.iter().enumerate() {
                        matrix[a * COLUMNS + b] += x * other;
                    }
                }
            }
        }
        let size: Vec<f64> = (0..COLUMNS)
            .map(|a| matrix[a * COLUMNS + a].sqrt())
            .map(|size| if size > 0.0 { size } else { 1.0 })
            .collect();
        for a in 0..COLUMNS {
            for b in 0..COLUMNS {
                matrix[a * COLUMNS + b] /= size[a] * size[b];
            }
            matrix[a * COLUMNS + a] += RIDGE;
            right[a] /= size[a];
        }
        Cholesky::new(&matrix, COLUMNS).ok()?.solve(&mut right);
        let beta: Vec<f64> = right.iter().zip(&size).map(|(b, s)| b / s).collect();
        for (bins, torque) in all.iter().zip(&mut self.torque) {
            let bins = bins.joint(self.joint);
            for (i, left) in torque.iter_mut().enumerate() {
                let columns = bins.columns(i);
                let explained: f64 = columns.iter().zip(&beta).map(|(x, b)| x * b).sum();
                *left = bins.torque()[i] - explained;
            }
        }
        let mut sizes: Vec<f64> = self.moving(all).into_iter().map(f64::abs).collect();
        let rank = (sizes.len() - 1) * 95 / 100;
        let (_, quantile, _) = sizes.select_nth_unstable_by(rank, f64::total_cmp);
        self.quantile = *quantile;
        Some(())
    }

    /// Runs beyond the foot that reach the peak, with how many times the quantile they reach.
    fn spikes(&self, bins: &[Bins], name: &str) -> Vec<(f64, Incident)> {
        let peak = (PEAK * self.quantile).max(MATTERS * self.sd);
        let foot = FOOT * self.quantile;
        let mut found = Vec::new();
        for (bins, torque) in bins.iter().zip(&self.torque) {
            let (mut start, moves) = (None, bins.moves(self.joint));
            for i in 0..=torque.len() {
                let outside = i < torque.len() && moves[i] && torque[i].abs() > foot;
                match (outside, start) {
                    (true, None) => start = Some(i),
                    (false, Some(from)) => {
                        start = None;
                        let most = torque[from..i].iter().fold(0.0_f64, |m, t| m.max(t.abs()));
                        if most > peak {
                            let incident = Incident {
                                kind: IncidentKind::Spike,
                                joint: name.to_owned(),
                                span: [bins.spans[from][0], bins.spans[i - 1][1]],
                                torque: most,
                                samples: (i - from) as u64 * bins.width,
                            };
                            found.push((most / self.quantile, incident));
                        }
                    }
                    _ => {}
                }
            }
        }
        found
    }
}
