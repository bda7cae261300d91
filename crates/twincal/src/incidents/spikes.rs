//! Torque that neither model nor friction explains, far beyond what they leave otherwise, for a short time.
//!
//! What is left of a real arm's torque is heavy-tailed (friction that turns round), so it is measured by its own 95 %
//! quantile, not by its standard deviation: on five real robots nothing exceeds four times that quantile.

use super::{Incident, IncidentKind};
use crate::linear_algebra::Cholesky;
use crate::robot::{Motion, Robot, nominal_torque};
use crate::signal::{Pipeline, Segment, Trajectory};
use rayon::prelude::*;

/// How many times the 95 % quantile of what is left a spike reaches, and where it begins and ends.
const PEAK: f64 = 5.0;
const FOOT: f64 = 2.0;
/// Share of the torque's standard deviation that a spike reaches at least.
const MATTERS: f64 = 0.2;
/// Longest time that a spike is joined over, in periods of the cut-off; and without filter, samples.
const JOINED: f64 = 1.0;
const JOINED_SAMPLES: f64 = 5.0;
/// Width of the bins that are averaged over, in periods of the cut-off; one sample without filter.
const BIN: f64 = 0.25;
/// What is left beyond this many quantiles does not count in the regression.
const CLIPPED: f64 = 3.0;
/// Spikes that are always rare enough, and bins per spike beyond those: what happens more often is no contact but noise with heavy
/// tails, which has its own finding.
const FEW: usize = 3;
const RARE: usize = 200;
/// Fewest bins in which a joint moves.
const FEWEST: usize = 60;
/// Velocities of the friction's shapes, rad/s or m/s.
const DRY: [f64; 2] = [0.02, 0.2];
/// Added to the diagonal of the columns' correlations.
const RIDGE: f64 = 1e-9;
/// Columns: nominal torque, velocity, two shapes of dry friction, velocity squared, acceleration, one.
const COLUMNS: usize = 7;

/// A trajectory in bins; `stopped`: spans in which the drives were off, s.
pub(super) fn bins(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    stopped: &[[f64; 2]],
) -> Vec<Bins> {
    let width = |interval: f64| {
        if pipeline.is_off() {
            1
        } else {
            ((BIN / pipeline.cutoff_hz / interval) as usize).max(1)
        }
    };
    let first = trajectory.segments.first();
    let width = first.map_or(1, |segment| width(segment.interval));
    let segments = trajectory.segments.iter();
    segments
        .map(|segment| Bins::new(robot, segment, width, stopped))
        .collect()
}

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

/// A segment, averaged over bins.
#[derive(Debug)]
pub(super) struct Bins {
    /// Sampling intervals of the segment and of the log, s.
    intervals: [f64; 2],
    /// First and last stamp of each bin, s.
    spans: Vec<[f64; 2]>,
    /// Samples of each bin.
    width: u64,
    /// Velocity, acceleration, torque and nominal torque, `joint * bins + bin`.
    qd: Vec<f64>,
    qdd: Vec<f64>,
    tau: Vec<f64>,
    nominal: Vec<f64>,
    /// The shapes of dry friction: means of the shapes, since where a joint turns round that is not the shape of the mean.
    dry: [Vec<f64>; 2],
    /// Whether the joint moves in the whole bin, alike.
    moves: Vec<bool>,
}

impl Bins {
    fn new(robot: &Robot, segment: &Segment, width: usize, stopped: &[[f64; 2]]) -> Self {
        let (dof, len) = (robot.dof(), segment.time.len());
        let count = len / width;
        let mean = |values: &[f64]| -> Vec<f64> {
            let joints = values.chunks_exact(len.max(1));
            joints
                .flat_map(|joint| joint.chunks_exact(width))
                .map(|bin| bin.iter().sum::<f64>() / width as f64)
                .collect()
        };
        let [q, qd, qdd, tau] =
            [&segment.q, &segment.qd, &segment.qdd, &segment.tau].map(|values| mean(values));
        let shape = |velocity: f64| -> Vec<f64> {
            let of_bin = |bin: &[f64]| {
                bin.iter().map(|qd| (qd / velocity).tanh()).sum::<f64>() / width as f64
            };
            let joints = segment.qd.par_chunks_exact(len.max(1));
            let bins = joints.flat_map_iter(|joint| joint.chunks_exact(width).map(of_bin));
            bins.collect()
        };
        let mut nominal = vec![0.0; dof * count];
        let motion = Motion {
            len: count,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        nominal_torque(robot, motion, &mut nominal);
        let spans: Vec<[f64; 2]> = segment
            .time
            .chunks_exact(width)
            .map(|bin| [bin[0], bin[width - 1]])
            .collect();
        let stops = |span: &[f64; 2]| {
            let overlaps = |[from, to]: &[f64; 2]| span[1] >= *from && span[0] <= *to;
            stopped.iter().any(overlaps)
        };
        let still = segment.standstill.chunks_exact(len.max(1));
        let moves = still
            .flat_map(|joint| joint.chunks_exact(width).zip(&spans))
            .map(|(bin, span)| !stops(span) && bin.iter().all(|still| !still))
            .collect();
        Self {
            intervals: [segment.interval, segment.logged_interval],
            spans,
            width: (width * segment.thinning()) as u64,
            qd,
            qdd,
            tau,
            nominal,
            dry: DRY.map(shape),
            moves,
        }
    }

    /// The columns of one joint in one bin.
    fn columns(&self, joint: usize, bin: usize) -> [f64; COLUMNS] {
        let at = joint * self.spans.len() + bin;
        let (v, a) = (self.qd[at], self.qdd[at]);
        let [slow, fast] = self.dry.each_ref().map(|dry| dry[at]);
        [self.nominal[at], v, slow, fast, v.abs() * v, a, 1.0]
    }
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
        let measured = |bins: &Bins| {
            let count = bins.spans.len();
            bins.tau[joint * count..(joint + 1) * count].to_vec()
        };
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

    fn moves(&self, bins: &Bins, bin: usize) -> bool {
        bins.moves[self.joint * bins.spans.len() + bin]
    }

    /// Values where the joint moves.
    fn moving(&self, bins: &[Bins]) -> Vec<f64> {
        let mut values = Vec::new();
        for (bins, torque) in bins.iter().zip(&self.torque) {
            let own = torque.iter().enumerate();
            values.extend(own.filter(|(i, _)| self.moves(bins, *i)).map(|(_, t)| *t));
        }
        values
    }

    /// Least squares of the bins that are not far out.
    fn regress(&mut self, all: &[Bins]) -> Option<()> {
        let (mut matrix, mut right) = (vec![0.0; COLUMNS * COLUMNS], vec![0.0; COLUMNS]);
        let far = CLIPPED * self.quantile;
        for (bins, torque) in all.iter().zip(&self.torque) {
            let count = bins.spans.len();
            for (i, left) in torque.iter().enumerate() {
                if !self.moves(bins, i) || left.abs() > far {
                    continue;
                }
                let columns = bins.columns(self.joint, i);
                let tau = bins.tau[self.joint * count + i];
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
            let count = bins.spans.len();
            for (i, left) in torque.iter_mut().enumerate() {
                let columns = bins.columns(self.joint, i);
                let explained: f64 = columns.iter().zip(&beta).map(|(x, b)| x * b).sum();
                *left = bins.tau[self.joint * count + i] - explained;
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
            let mut start = None;
            for i in 0..=torque.len() {
                let outside = i < torque.len() && self.moves(bins, i) && torque[i].abs() > foot;
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
