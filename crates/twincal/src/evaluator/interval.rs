//! The interval of a program: one t distribution with the mixture's mean and variance, from the columns that count.
//!
//! ```text
//! scale² = (a−1)/a (xᵀ Cov[β | y] x + E[φ] f²/(w_j (1−ρ_j²))) + s_out²,     half width = t_{2a}⁻¹(0.975) · scale
//! ```
//! Exact where the posterior holds one model; how far it is from the mixture over models is measured.

use super::columns::Columns;
use super::states::{STATES, States};
use super::trace::{Id, Trace};
use crate::error::Result;
use crate::posterior::mixture::Level;
use crate::posterior::student::StudentT;
use crate::term::Library;
use crate::twin::{JointInput, TorqueSignal, Twin};

/// Share of the variance that the columns left out may make anywhere in the training range.
const LEFT_OUT: f64 = 0.01;

/// Everything about the interval.
pub(super) struct Interval {
    /// Columns that count, ascending.
    pub(super) kept: Vec<usize>,
    /// Cov[β | y], K × K.
    covariance: Vec<f64>,
    columns: usize,
    /// See [`super::EvaluatorJoint::noise`].
    pub(super) noise: Vec<f64>,
    /// See [`super::EvaluatorJoint::base`].
    pub(super) base: Vec<f64>,
    pub(super) quantile: f64,
    pub(super) ratio: f64,
    pub(super) error: f64,
}

impl Interval {
    pub(super) fn new(twin: &Twin, library: &Library, states: &States) -> Result<Self> {
        let posterior = &twin.posterior;
        let student = StudentT::new(2.0 * posterior.shape);
        let ratio = (posterior.shape - 1.0) / posterior.shape;
        let own: Vec<f64> = (twin.noise.iter())
            .map(|n| {
                posterior.noise * n.interval_factor.powi(2) / (n.weight * (1.0 - n.rho * n.rho))
            })
            .collect();
        let out: Vec<f64> = twin.noise.iter().map(|n| n.out_of_band.powi(2)).collect();
        let mut interval = Self {
            kept: Vec::new(),
            covariance: posterior.covariance(),
            columns: library.columns().len(),
            noise: own.iter().zip(&out).map(|(a, b)| a + b).collect(),
            base: own.iter().zip(&out).map(|(a, b)| ratio * a + b).collect(),
            quantile: Level::new(&student, 0.975).standard,
            ratio,
            error: 0.0,
        };
        interval.kept = interval.columns_that_count(states);
        interval.error = interval.measured_error(twin, library, states)?;
        Ok(interval)
    }

    /// The fewest columns, by their share of the variance, that leave out at most [`LEFT_OUT`] of it.
    fn columns_that_count(&self, states: &States) -> Vec<usize> {
        let mut share = vec![0.0_f64; self.columns];
        for joint in 0..self.noise.len() {
            let (columns, x) = states.columns(joint);
            for (&column, x) in columns.iter().zip(x.chunks_exact(STATES)) {
                let square = x.iter().fold(0.0_f64, |m, x| m.max(x * x));
                let variance = self.covariance[column * (self.columns + 1)] * square;
                share[column] = share[column].max(variance / self.noise[joint]);
            }
        }
        let mut order: Vec<usize> = (0..self.columns).collect();
        order.sort_by(|&a, &b| share[b].total_cmp(&share[a]).then(a.cmp(&b)));
        let full = self.variances(states, &order);
        let enough = |count: usize| {
            let some = self.variances(states, &order[..count]);
            (0..self.noise.len()).all(|joint| {
                let rows = joint * STATES..(joint + 1) * STATES;
                full[rows.clone()]
                    .iter()
                    .zip(&some[rows])
                    .all(|(full, some)| {
                        (full - some).abs() <= LEFT_OUT * (self.noise[joint] + full)
                    })
            })
        };
        // More columns are not always nearer, but nearly: a bisection finds a count that is enough.
        let (mut low, mut high) = (0, self.columns);
        while low < high {
            let middle = low.midpoint(high);
            if enough(middle) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        let mut kept = order[..high].to_vec();
        kept.sort_unstable();
        kept
    }

    /// xᵀ C x per joint and state over some columns, `joint * STATES + state`.
    fn variances(&self, states: &States, columns: &[usize]) -> Vec<f64> {
        let mut place = vec![false; self.columns];
        columns.iter().for_each(|&column| place[column] = true);
        let mut all = Vec::with_capacity(self.noise.len() * STATES);
        for joint in 0..self.noise.len() {
            let (own, x) = states.columns(joint);
            let mut sum = vec![0.0; STATES];
            let own: Vec<(usize, &[f64])> = (own.iter().copied().zip(x.chunks_exact(STATES)))
                .filter(|(column, _)| place[*column])
                .collect();
            let mut along = vec![0.0; STATES];
            for (i, &(a, x)) in own.iter().enumerate() {
                along.fill(0.0);
                for (k, &(b, other)) in own.iter().enumerate().skip(i) {
                    let twice = if k == i { 1.0 } else { 2.0 };
                    let c = twice * self.covariance[a * self.columns + b];
                    for (along, other) in along.iter_mut().zip(other) {
                        *along += c * other;
                    }
                }
                for ((sum, x), along) in sum.iter_mut().zip(x).zip(&along) {
                    *sum += x * along;
                }
            }
            all.extend(sum);
        }
        all
    }

    /// Largest difference of an interval's end from the mixture's, as a share of its width.
    fn measured_error(&self, twin: &Twin, library: &Library, states: &States) -> Result<f64> {
        let predictor = twin.predictor(library)?;
        let variance = self.variances(states, &self.kept);
        let nominal = vec![0.0; STATES];
        let mut worst = 0.0_f64;
        for joint in 0..self.noise.len() {
            let (_, x) = states.columns(joint);
            let input = JointInput {
                x,
                stride: STATES,
                nominal: &nominal,
                measured: &[],
                standstill: &[],
                motion: [&[], &[], &[]],
            };
            let torque = predictor.torque(joint, &input, TorqueSignal::Raw);
            for state in 0..STATES {
                let scale =
                    self.ratio * variance[joint * STATES + state].max(0.0) + self.base[joint];
                let half = self.quantile * scale.sqrt();
                let (low, high) = (torque.low[state], torque.high[state]);
                let centre = torque.calibrated[state];
                let error = (centre - half - low)
                    .abs()
                    .max((centre + half - high).abs());
                worst = worst.max(error / (high - low));
            }
        }
        Ok(worst)
    }

    /// xᵀ C x over the columns that count, as steps.
    pub(super) fn variance(&self, t: &mut Trace, columns: &mut Columns<'_>) -> Vec<Id> {
        let joints = self.noise.len();
        let mut by_joint: Vec<Vec<(usize, Id)>> = vec![Vec::new(); joints];
        for &column in &self.kept {
            for (joint, x) in columns.column(t, column) {
                by_joint[joint].push((column, x));
            }
        }
        by_joint
            .into_iter()
            .map(|own| {
                let mut sum = t.number(0.0);
                for (i, &(a, x)) in own.iter().enumerate() {
                    let mut along = t.number(0.0);
                    for (k, &(b, other)) in own.iter().enumerate().skip(i) {
                        let twice = if k == i { 1.0 } else { 2.0 };
                        let part = t.scale(twice * self.covariance[a * self.columns + b], other);
                        along = t.add(along, part);
                    }
                    let part = t.multiply(x, along);
                    sum = t.add(sum, part);
                }
                sum
            })
            .collect()
    }
}
