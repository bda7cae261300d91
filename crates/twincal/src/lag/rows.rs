//! Sliding rows of some logs, their torque moved by a lag, and how fast their torque changes.

use crate::rigid_fit::{Bins, Design, JointRows, Normal, Zone, bins, mad, prior, sample};
use crate::robot::Robot;
use crate::signal::{Pipeline, Segment, Trajectory};

/// Fewest rows of a joint, and of a log.
pub(super) const FEWEST: usize = 40;
/// Longest lag that is looked for, s.
pub(super) const REACH: f64 = 0.1;
/// Residuals beyond this many robust standard deviations do not count.
const CLIPPED: f64 = 4.0;
/// Precision of a lag before the data, 1/s².
const LAG_PRECISION: f64 = 1.0;

/// Rows of all logs. The last column of each joint is what a lag of one second adds to first order.
pub(super) struct Rows<'a> {
    pub(super) design: Design,
    pub(super) prior: Vec<f64>,
    /// Log of each row.
    pub(super) group: Vec<usize>,
    /// Whether a row of a joint is used: it slides, and its neighbours and its moved torque are there. By joint.
    pub(super) used: Vec<Vec<bool>>,
    /// By number in the design.
    segments: Vec<(&'a Segment, usize)>,
    /// Sums of torque, by segment and joint: entry i is of the samples before i.
    sums: Vec<Vec<Vec<f64>>>,
}

impl<'a> Rows<'a> {
    /// Of these logs; `None` without torque.
    pub(super) fn new(robot: &Robot, pipeline: &Pipeline, logs: &[&'a Trajectory]) -> Option<Self> {
        let segments = || logs.iter().flat_map(|log| &log.segments);
        if segments().any(|segment| segment.tau.is_empty()) {
            return None;
        }
        let mut all: Vec<Bins> = Vec::new();
        let (mut own_segments, mut groups) = (Vec::new(), Vec::new());
        for (group, log) in logs.iter().enumerate() {
            for (bins, segment) in bins(robot, pipeline, log, &[])
                .into_iter()
                .zip(&log.segments)
            {
                let width = (bins.width as usize / segment.thinning()).max(1);
                own_segments.push((segment, width));
                groups.push(group);
                all.push(bins);
            }
        }
        let parts = sample(robot, &all);
        let mut design = Design::new(robot, &all, &parts);
        let dof = robot.dof();
        with_lag_column(&mut design, dof);
        let group = design.places.iter().map(|(segment, _)| groups[*segment]);
        let mut rows = Self {
            group: group.collect(),
            used: Vec::new(),
            sums: own_segments.iter().map(|(s, _)| sums(s, dof)).collect(),
            segments: own_segments,
            prior: prior(robot)
                .into_iter()
                .chain(vec![LAG_PRECISION; dof])
                .collect(),
            design,
        };
        rows.used = rows
            .design
            .joints
            .iter()
            .map(|own| rows.usable(own))
            .collect();
        Some(rows)
    }

    fn usable(&self, joint: &JointRows) -> Vec<bool> {
        let places = &self.design.places;
        let one = |row: usize| {
            let (segment, bin) = places[row];
            let (own, width) = self.segments[segment];
            let margin = REACH / own.interval;
            let inside = (bin * width) as f64 >= margin
                && ((bin + 1) * width) as f64 + margin <= own.time.len() as f64;
            let beside = row > 0
                && row + 1 < places.len()
                && places[row - 1] == (segment, bin.wrapping_sub(1))
                && places[row + 1] == (segment, bin + 1);
            joint.zones[row] == Zone::Slides && inside && beside
        };
        (0..places.len()).map(one).collect()
    }

    /// How many logs there are.
    pub(super) fn logs(&self) -> usize {
        self.group.last().map_or(0, |last| last + 1)
    }

    /// Moves torque back: `lags[log][joint]`, s.
    pub(super) fn move_torque(&mut self, lags: &[Vec<f64>]) {
        let Self {
            design,
            segments,
            sums,
            group,
            ..
        } = self;
        let Design { joints, places, .. } = design;
        for (joint, rows) in joints.iter_mut().enumerate() {
            for (row, &(segment, bin)) in places.iter().enumerate() {
                let (own, width) = segments[segment];
                let shift = lags[group[row]][joint] / own.interval;
                let sums = &sums[segment][joint];
                let [from, to] = [bin, bin + 1].map(|bin| at(sums, (bin * width) as f64 + shift));
                rows.torque[row] = (to - from) / width as f64;
            }
        }
    }

    /// Fills the lags' columns: minus the rate of the torque that these parameters explain.
    pub(super) fn fill_rates(&mut self, theta: &[f64]) {
        let Self {
            design, segments, ..
        } = self;
        let Design { joints, places, .. } = design;
        for rows in joints {
            let width = rows.columns.len();
            let without: Vec<f64> = (0..rows.torque.len())
                .map(|row| {
                    let columns = rows.columns[..width - 1].iter().zip(rows.row(row));
                    rows.nominal[row] + columns.map(|(&c, x)| x * theta[c]).sum::<f64>()
                })
                .collect();
            for row in 0..places.len() {
                let near = [row.saturating_sub(1), (row + 1).min(places.len() - 1)];
                let (own, samples) = segments[places[row].0];
                let step = 2.0 * samples as f64 * own.interval;
                rows.values[row * width + width - 1] =
                    -(without[near[1]] - without[near[0]]) / step;
            }
        }
    }

    /// The rate that is in a lag's column.
    pub(super) fn rate(&self, joint: usize, row: usize) -> f64 {
        let columns = self.design.joints[joint].row(row);
        columns[columns.len() - 1]
    }

    /// Forgets the lags' columns.
    pub(super) fn clear_rates(&mut self) {
        for rows in &mut self.design.joints {
            let width = rows.columns.len();
            rows.values
                .chunks_exact_mut(width)
                .for_each(|row| row[width - 1] = 0.0);
        }
    }

    /// The fit with these weights.
    pub(super) fn fit(&self, weights: &[Vec<f64>]) -> Option<Normal> {
        let measured = |joint: usize, row: usize| {
            let rows = &self.design.joints[joint];
            rows.torque[row] - rows.nominal[row]
        };
        Normal::new(&self.design, weights, &self.prior, &measured)
    }

    /// Weight of each row by what is left of it, with the spread of each joint.
    pub(super) fn weights(&self, residual: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<f64>) {
        let joints = residual.iter().zip(&self.used);
        let of_joint = |(left, used): (&Vec<f64>, &Vec<bool>)| {
            let own = left.iter().zip(used).filter(|(_, used)| **used);
            let spread = mad(own.map(|(left, _)| *left).collect());
            let spread = if spread > 0.0 { spread } else { f64::INFINITY };
            let weight = |(left, used): (&f64, &bool)| {
                let counts = *used && left.abs() < CLIPPED * spread;
                f64::from(u8::from(counts)) / (spread * spread)
            };
            (left.iter().zip(used).map(weight).collect(), spread)
        };
        joints.map(of_joint).unzip()
    }

    /// Mean over the joints with enough rows of ln of the spread of what is left; not a number without such a joint.
    pub(super) fn size(&self, residual: &[Vec<f64>]) -> f64 {
        size(residual, &self.used)
    }
}

fn size(residual: &[Vec<f64>], used: &[Vec<bool>]) -> f64 {
    let of_joint = |(left, used): (&Vec<f64>, &Vec<bool>)| {
        let own = left.iter().zip(used).filter(|(_, used)| **used);
        let own: Vec<f64> = own.map(|(left, _)| *left).collect();
        (own.len() >= FEWEST).then(|| mad(own).max(f64::MIN_POSITIVE).ln())
    };
    let sizes: Vec<f64> = residual.iter().zip(used).filter_map(of_joint).collect();
    sizes.iter().sum::<f64>() / sizes.len() as f64
}

/// Gives every joint a parameter and a column for its lag, behind all others.
fn with_lag_column(design: &mut Design, dof: usize) {
    for (joint, rows) in design.joints.iter_mut().enumerate() {
        let width = rows.columns.len();
        let mut values = Vec::with_capacity(rows.values.len() + rows.torque.len());
        for row in rows.values.chunks_exact(width) {
            values.extend_from_slice(row);
            values.push(0.0);
        }
        rows.values = values;
        rows.columns.push(design.parameters + joint);
    }
    design.parameters += dof;
}

/// Sums of a segment's torque by joint.
fn sums(segment: &Segment, dof: usize) -> Vec<Vec<f64>> {
    let len = segment.time.len();
    let of_joint = |joint: usize| {
        let mut sum = 0.0;
        let torque = segment.tau[joint * len..(joint + 1) * len].iter();
        let sums = torque.map(|tau| {
            sum += tau;
            sum
        });
        std::iter::once(0.0).chain(sums).collect()
    };
    (0..dof).map(of_joint).collect()
}

/// A sum between samples; beyond the ends that of the end.
fn at(sums: &[f64], place: f64) -> f64 {
    let place = place.clamp(0.0, (sums.len() - 1) as f64);
    let before = (place as usize).min(sums.len() - 2);
    sums[before] + (place - before as f64) * (sums[before + 1] - sums[before])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::slice;

    /// A few rows that a joint's own parameters reach exactly say nothing of a lean; without any joint there is nothing to compare.
    #[test]
    fn joints_with_few_rows_do_not_count() {
        let left: Vec<f64> = (0..80)
            .map(|i| if i % 2 == 0 { 2.0 } else { -2.0 })
            .collect();
        let (many, few) = (vec![true; 80], [vec![true; 5], vec![false; 75]].concat());
        let alone = size(slice::from_ref(&left), slice::from_ref(&many));
        let beside = size(&[left.clone(), vec![1e-12; 80]], &[many, few.clone()]);
        assert!(alone.is_finite() && alone == beside, "{alone} {beside}");
        assert!(size(&[left], &[few]).is_nan());
        assert!(size(&[vec![0.0; 80]], &[vec![true; 80]]).is_finite());
    }
}
