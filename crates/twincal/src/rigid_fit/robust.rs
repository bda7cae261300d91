//! Least squares that stretches of foreign torque do not pull.
//!
//! Residuals of each joint are measured by their median size, apart where it slides, reverses and rests; what is beyond four times
//! that counts no more. A push of seconds can still pull a fit that starts from all rows, so fits start without one stretch
//! of the log after the other as well; one of them is taken where it leaves clearly less of most rows.

use super::bins::Zone;
use super::design::{Design, JointRows};
use crate::linear_algebra::{Cholesky, product};
use rayon::prelude::*;
use std::ops::Range;

/// Standard deviations per median of the size, of Gaussian numbers.
const PER_MEDIAN: f64 = 1.4826;
/// Residuals beyond this many standard deviations do not count.
const CLIPPED: f64 = 4.0;
/// Weight of rows at reversals and at rest before their spread is known.
const AT_FIRST: f64 = 0.1;
/// Stretches that are left out in turn, and the share of the log that each is.
const STRETCHES: usize = 8;
const SHARE: f64 = 0.4;
/// Parameters beyond which nothing is left out in turn: such a fit costs too much.
const MOST_PARAMETERS: usize = 400;
/// Share of the sliding rows by which fits are compared, and what the better one must leave of the other's.
const MOST: f64 = 0.7;
pub(super) const BETTER: f64 = 0.8;
/// Rows below which a spread is not measured.
const FEWEST: usize = 10;
/// Added to the diagonal of the columns' correlations.
const RIDGE: f64 = 1e-9;

/// Parameters with what they leave.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    /// See [`Design`].
    pub(crate) theta: Vec<f64>,
    /// Robust standard deviation of what is left of each joint: where it slides, where it reverses, at rest.
    pub(crate) spread: Vec<[f64; 3]>,
    residual: Vec<Vec<f64>>,
}

/// Standard deviation by the median of the size.
pub(crate) fn mad(mut sizes: Vec<f64>) -> f64 {
    if sizes.is_empty() {
        return f64::NAN;
    }
    sizes.iter_mut().for_each(|x| *x = x.abs());
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    PER_MEDIAN * *median
}

/// Weighted least squares, factored.
pub(crate) struct Normal {
    factor: Cholesky,
    /// Size of each column.
    size: Vec<f64>,
    /// Columns with torque, by size.
    right: Vec<f64>,
}

impl Normal {
    /// With these weights by joint and row, for what `torque` gives instead of the measured torque less the nominal one.
    pub(crate) fn new(
        design: &Design,
        weights: &[Vec<f64>],
        prior: &[f64],
        torque: &(dyn Fn(usize, usize) -> f64 + Sync),
    ) -> Option<Self> {
        let n = design.parameters;
        let joints = design.joints.par_iter().zip(weights).enumerate();
        let sums: Vec<(Vec<f64>, Vec<f64>)> = joints
            .map(|(joint, (rows, weights))| sums(rows, weights, &|row| torque(joint, row)))
            .collect();
        let (mut matrix, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for (rows, (own, y)) in design.joints.iter().zip(sums) {
            let width = rows.columns.len();
            for (a, &i) in rows.columns.iter().enumerate() {
                right[i] += y[a];
                for (b, &j) in rows.columns[..=a].iter().enumerate() {
                    matrix[i.max(j) * n + i.min(j)] += own[a * width + b];
                }
            }
        }
        for (i, precision) in prior.iter().enumerate() {
            matrix[i * n + i] += precision;
        }
        let size: Vec<f64> = (0..n)
            .map(|i| matrix[i * n + i].sqrt())
            .map(|size| if size > 0.0 { size } else { 1.0 })
            .collect();
        for i in 0..n {
            for j in 0..=i {
                matrix[i * n + j] /= size[i] * size[j];
            }
            matrix[i * n + i] += RIDGE;
            right[i] /= size[i];
        }
        let factor = Cholesky::new(&matrix, n).ok()?;
        Some(Self {
            factor,
            size,
            right,
        })
    }

    /// The parameters.
    pub(crate) fn solution(&self) -> Vec<f64> {
        let mut theta = self.right.clone();
        self.factor.solve(&mut theta);
        theta
            .iter_mut()
            .zip(&self.size)
            .for_each(|(x, size)| *x /= size);
        theta
    }

    /// A column of the inverse.
    pub(crate) fn inverse_column(&self, parameter: usize) -> Vec<f64> {
        let mut column = vec![0.0; self.size.len()];
        column[parameter] = 1.0 / self.size[parameter];
        self.factor.solve(&mut column);
        column
            .iter_mut()
            .zip(&self.size)
            .for_each(|(x, size)| *x /= size);
        column
    }
}

/// Sums of products of a joint: columns with columns (lower triangle), columns with torque. Rows without weight are left out, whatever their
/// numbers are.
fn sums(rows: &JointRows, weights: &[f64], torque: &dyn Fn(usize) -> f64) -> (Vec<f64>, Vec<f64>) {
    let width = rows.columns.len();
    let weighed = || (weights.iter().enumerate()).filter(|(_, weight)| **weight != 0.0);
    let count = weighed().count();
    let (mut columns, mut scaled) = (Vec::with_capacity(count * width), vec![0.0; count * width]);
    let mut y = Vec::with_capacity(count);
    for (at, (row, weight)) in weighed().enumerate() {
        let x = rows.row(row);
        columns.extend_from_slice(x);
        (x.iter().enumerate()).for_each(|(a, x)| scaled[a * count + at] = weight * x);
        y.push(torque(row));
    }
    let matrix = product(&scaled, &columns, [width, count, width]);
    (matrix, product(&scaled, &y, [width, count, 1]))
}

/// The fit of these rows that most of them agree on; `None` where nothing can be fitted.
pub(crate) fn robust(design: &Design, prior: &[f64]) -> Option<Solution> {
    let rows = design.len();
    let whole = Search {
        design,
        prior,
        without: 0..0,
    };
    let all = whole.run([5, 5], true)?;
    if design.parameters > MOST_PARAMETERS {
        return Some(all);
    }
    let long = (SHARE * rows as f64) as usize;
    let starts = (0..STRETCHES).map(|k| {
        let middle = (2 * k + 1) * rows / (2 * STRETCHES);
        middle.saturating_sub(long / 2).min(rows - long)
    });
    let mut starts: Vec<usize> = starts.collect();
    starts.dedup();
    let others: Vec<Option<Solution>> = starts
        .into_par_iter()
        .map(|from| {
            let without = from..from + long;
            Search {
                without,
                ..whole.clone()
            }
            .run([4, 3], false)
        })
        .collect();
    let best = others
        .into_iter()
        .flatten()
        .map(|solution| (solution.size(design), solution))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((size, solution)) if size < all.size(design) + BETTER.ln() => Some(solution),
        _ => Some(all),
    }
}

/// A fit that starts without some rows.
#[derive(Clone)]
struct Search<'a> {
    design: &'a Design,
    prior: &'a [f64],
    without: Range<usize>,
}

impl Search<'_> {
    /// Steps without the stretch, then with it; `gentle`: the first ones weigh residuals by their size instead of leaving out large ones.
    fn run(&self, [inner, outer]: [usize; 2], gentle: bool) -> Option<Solution> {
        let Self { design, prior, .. } = *self;
        let measured = |joint: usize, row: usize| {
            let rows = &design.joints[joint];
            rows.torque[row] - rows.nominal[row]
        };
        let floors: Vec<f64> = design.joints.iter().map(typical).collect();
        let at_first = |(rows, size): (&JointRows, &f64)| {
            let weight = |row: usize| match rows.zones[row] {
                Zone::Unknown => 0.0,
                _ if self.without.contains(&row) => 0.0,
                Zone::Slides => size.powi(-2),
                _ => AT_FIRST * size.powi(-2),
            };
            (0..rows.zones.len()).map(weight).collect::<Vec<f64>>()
        };
        let mut weights: Vec<Vec<f64>> = design.joints.iter().zip(&floors).map(at_first).collect();
        let mut last = None;
        for step in 0..inner + outer {
            let theta = Normal::new(design, &weights, prior, &measured)?.solution();
            let residual = design.residual(&theta);
            let within = |row: usize| step >= inner || !self.without.contains(&row);
            let joints = design.joints.iter().zip(&residual).zip(&floors);
            let spread: Vec<[f64; 3]> = joints
                .map(|((rows, left), size)| {
                    spreads(rows, left, &within).map(|s| s.max(1e-4 * size))
                })
                .collect();
            let next = |row: usize| step + 1 >= inner || !self.without.contains(&row);
            let reweighed = |((rows, left), spread): ((&JointRows, &Vec<f64>), &[f64; 3])| {
                let weight = |row: usize| {
                    let sd = match rows.zones[row] {
                        Zone::Slides => spread[0],
                        Zone::Reverses => spread[1],
                        Zone::Rests => spread[2],
                        Zone::Unknown => return 0.0,
                    };
                    let far = left[row].abs() / sd;
                    let share = match (next(row), gentle && step < inner) {
                        (false, _) => 0.0,
                        (true, true) => far.max(1.0).recip(),
                        (true, false) => f64::from(u8::from(far < CLIPPED)),
                    };
                    share / (sd * sd)
                };
                (0..left.len()).map(weight).collect::<Vec<f64>>()
            };
            let joints = design.joints.iter().zip(&residual).zip(&spread);
            weights = joints.map(reweighed).collect();
            last = Some((theta, spread, residual));
        }
        let (theta, spread, residual) = last?;
        Some(Solution {
            theta,
            spread,
            residual,
        })
    }
}

impl Solution {
    /// Mean over the joints of ln of what is left of most sliding rows.
    pub(super) fn size(&self, design: &Design) -> f64 {
        let (mut sum, mut joints) = (0.0, 0.0);
        for (rows, left) in design.joints.iter().zip(&self.residual) {
            let own = left.iter().zip(&rows.zones);
            let sliding = own.filter(|(_, zone)| **zone == Zone::Slides);
            let mut sizes: Vec<f64> = sliding.map(|(left, _)| left.abs()).collect();
            if sizes.len() < 2 * FEWEST {
                continue;
            }
            sizes.sort_by(f64::total_cmp);
            sizes.truncate((MOST * sizes.len() as f64) as usize);
            let square = sizes.iter().map(|x| x * x).sum::<f64>() / sizes.len() as f64;
            sum += 0.5 * (square + f64::MIN_POSITIVE).ln();
            joints += 1.0;
        }
        if joints > 0.0 { sum / joints } else { 0.0 }
    }
}

/// Spread of a joint's torque about the nominal one.
fn typical(rows: &JointRows) -> f64 {
    let known = rows.zones.iter().zip(rows.torque.iter().zip(&rows.nominal));
    let known = known.filter(|(zone, _)| **zone != Zone::Unknown);
    let mut apart: Vec<f64> = known.map(|(_, (tau, nominal))| tau - nominal).collect();
    if apart.is_empty() {
        return 1.0;
    }
    apart.sort_by(f64::total_cmp);
    let median = apart[apart.len() / 2];
    mad(apart.into_iter().map(|x| x - median).collect()).max(1e-9)
}

/// Robust standard deviations of what is left of a joint, by zone; of few rows that of all.
fn spreads(rows: &JointRows, left: &[f64], within: &dyn Fn(usize) -> bool) -> [f64; 3] {
    let some = |wanted: &dyn Fn(Zone) -> bool| -> Vec<f64> {
        let rows = left.iter().zip(&rows.zones).enumerate();
        rows.filter(|(row, (_, zone))| within(*row) && wanted(**zone))
            .map(|(_, (left, _))| *left)
            .collect()
    };
    let all = mad(some(&|zone| zone != Zone::Unknown));
    let of = |wanted: Zone| {
        let own = some(&|zone| zone == wanted);
        if own.len() < FEWEST { all } else { mad(own) }
    };
    let slides = of(Zone::Slides);
    let [reverses, rests] = [Zone::Reverses, Zone::Rests].map(|zone| of(zone).max(slides));
    let known = |sd: f64| if sd.is_nan() { 0.0 } else { sd };
    [slides, reverses, rests].map(known)
}
