//! The interval of a program: one t distribution with the mixture's mean and variance, from what counts for it.
//!
//! ```text
//! scale² = (a−1)/a (xᵀ Cov[β | y] x + E[φ] f²/(w_j (1−ρ_j²))) + s_out²,     half width = t_{2a}⁻¹(0.975) · scale
//! ```
//! Exact where the posterior holds one model; how far it is from the mixture over models is measured.

use super::columns::Columns;
use super::coordinates::{Acting, Coordinates};
use super::states::{STATES, States};
use super::trace::{Id, Trace};
use crate::error::Result;
use crate::posterior::mixture::Level;
use crate::posterior::student::StudentT;
use crate::term::Library;
use crate::twin::{JointInput, TorqueSignal, Twin};

/// Share of the variance (that of the noise included) by which a joint's approximation may be off in the training range:
/// 4.9 % of the interval's width in its worst corner.
const LEFT_OUT: f64 = 0.1;
/// The same at the corners of the range, where no data are but the flag for extrapolation still has to speak.
const LEFT_OUT_AT_CORNERS: f64 = 0.5;

/// Everything about the interval.
pub(super) struct Interval {
    /// Coordinates that count on each joint, ascending.
    kept: Vec<Vec<usize>>,
    /// Mean variance of the others on each joint, (N·m)².
    rest: Vec<f64>,
    coordinates: Coordinates,
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
                let factor = n.interval_factor.powi(2) / (n.weight * (1.0 - n.rho * n.rho));
                posterior.noise * factor
            })
            .collect();
        let out: Vec<f64> = twin.noise.iter().map(|n| n.out_of_band.powi(2)).collect();
        let mut interval = Self {
            kept: Vec::new(),
            rest: Vec::new(),
            coordinates: Coordinates::new(&twin.robot, library, &posterior.covariance()),
            noise: own.iter().zip(&out).map(|(a, b)| a + b).collect(),
            base: own.iter().zip(&out).map(|(a, b)| ratio * a + b).collect(),
            quantile: Level::new(&student, 0.975).standard,
            ratio,
            error: 0.0,
        };
        let mut variances = Vec::new();
        let corners = States::corners(twin, library);
        let acting = (interval.coordinates).on_states(&twin.robot, library, &[states, &corners]);
        for (joint, acting) in acting.iter().enumerate() {
            let (kept, rest, variance) = interval.what_counts(acting, joint);
            interval.kept.push(kept);
            interval.rest.push(rest);
            variances.push(variance);
        }
        interval.error = interval.measured_error(twin, library, states, &variances)?;
        Ok(interval)
    }

    /// How many coordinates count on some joint.
    pub(super) fn count(&self) -> usize {
        let all: std::collections::BTreeSet<usize> = self.kept.iter().flatten().copied().collect();
        all.len()
    }

    /// Coordinates are left out one by one, always the one that is missed least, while the others and a constant stay within
    /// [`LEFT_OUT`] of the variance everywhere: what stays, the constant, and the variance that they give per state.
    fn what_counts(&self, acting: &Acting, joint: usize) -> (Vec<usize>, f64, Vec<f64>) {
        let (columns, x) = (&acting.which, &acting.torque);
        let c = |i: usize, k: usize| self.coordinates.covariance(columns[i], columns[k]);
        // Over the coordinates that are still there.
        let mut along = self.along(acting);
        let mut full = vec![0.0; 2 * STATES];
        for (x, along) in x.iter().zip(&along) {
            for (sum, (x, a)) in full.iter_mut().zip(x.iter().zip(along)) {
                *sum += x * a;
            }
        }
        let allowed = allowed(self.noise[joint], &full);
        let mut kept: Vec<usize> = (0..columns.len()).collect();
        let mut missing = vec![0.0; 2 * STATES];
        let mut rest = 0.0;
        loop {
            let own = |i: usize, s: usize| x[i][s] * (2.0 * along[i][s] - c(i, i) * x[i][s]);
            let least = missed_least(&kept, &allowed, |i, s| missing[s] + own(i, s));
            let Some((mean, at)) = least else {
                break;
            };
            let i = kept.remove(at);
            rest = mean;
            for s in 0..2 * STATES {
                missing[s] += own(i, s);
            }
            for &k in &kept {
                let factor = c(k, i);
                along[k]
                    .iter_mut()
                    .zip(&x[i])
                    .for_each(|(sum, x)| *sum -= factor * x);
            }
        }
        let variance = full
            .iter()
            .zip(&missing)
            .map(|(full, missing)| full - missing + rest)
            .take(STATES);
        (
            kept.iter().map(|&i| columns[i]).collect(),
            rest,
            variance.collect(),
        )
    }

    /// (C x)_i per state.
    fn along(&self, acting: &Acting) -> Vec<Vec<f64>> {
        let (columns, x) = (&acting.which, &acting.torque);
        let along = |&i: &usize| {
            let mut row = vec![0.0; 2 * STATES];
            for (&k, x) in columns.iter().zip(x) {
                let factor = self.coordinates.covariance(i, k);
                for (sum, x) in row.iter_mut().zip(x) {
                    *sum += factor * x;
                }
            }
            row
        };
        columns.iter().map(along).collect()
    }

    /// Largest difference of an interval's end from the mixture's, as a share of its width.
    fn measured_error(
        &self,
        twin: &Twin,
        library: &Library,
        states: &States,
        variances: &[Vec<f64>],
    ) -> Result<f64> {
        let predictor = twin.predictor(library)?;
        let nominal = vec![0.0; STATES];
        let mut worst = 0.0_f64;
        for joint in 0..self.noise.len() {
            let (_, x) = states.columns(joint);
            let input = JointInput {
                x,
                stride: STATES,
                nominal: &nominal,
                products: &[],
                measured: &[],
                standstill: &[],
                motion: [&[], &[], &[]],
            };
            let torque = predictor.torque(joint, &input, TorqueSignal::Raw);
            for state in 0..STATES {
                let scale = self.ratio * variances[joint][state].max(0.0) + self.base[joint];
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

    /// xᵀ C x over what counts and the constant, as steps.
    pub(super) fn variance(&self, t: &mut Trace, columns: &mut Columns<'_>) -> Vec<Id> {
        let mut variance = Vec::with_capacity(self.kept.len());
        for (joint, kept) in self.kept.iter().enumerate() {
            let mut own: Vec<(usize, Id)> = Vec::new();
            for &column in kept {
                let all = self.coordinates.torque(t, columns, column);
                own.extend(
                    all.into_iter()
                        .filter(|(j, _)| *j == joint)
                        .map(|(_, x)| (column, x)),
                );
            }
            let mut sum = t.number(self.rest[joint]);
            for (i, &(a, x)) in own.iter().enumerate() {
                let mut along = t.number(0.0);
                for (k, &(b, other)) in own.iter().enumerate().skip(i) {
                    let twice = if k == i { 1.0 } else { 2.0 };
                    let part = t.scale(twice * self.coordinates.covariance(a, b), other);
                    along = t.add(along, part);
                }
                let part = t.multiply(x, along);
                sum = t.add(sum, part);
            }
            variance.push(sum);
        }
        variance
    }
}

/// What an approximation may be off by, per state, of the variance `full` of the coefficients.
fn allowed(noise: f64, full: &[f64]) -> Vec<f64> {
    (full.iter().enumerate())
        .map(|(state, full)| {
            let share = if state < STATES {
                LEFT_OUT
            } else {
                LEFT_OUT_AT_CORNERS
            };
            share * (noise + full)
        })
        .collect()
}

/// The coordinate that a constant replaces best in every state, if well enough: that constant, and the coordinate's place in `kept`.
/// `missing` is the variance that a state lacks without a coordinate.
fn missed_least(
    kept: &[usize],
    allowed: &[f64],
    missing: impl Fn(usize, usize) -> f64,
) -> Option<(f64, usize)> {
    let mut best: Option<(f64, f64, usize)> = None;
    for (at, &i) in kept.iter().enumerate() {
        let mean = (0..STATES).map(|s| missing(i, s)).sum::<f64>() / STATES as f64;
        let worst = (0..2 * STATES)
            .map(|s| (missing(i, s) - mean).abs() / allowed[s])
            .fold(0.0, f64::max);
        if best.is_none_or(|(least, ..)| worst < least) {
            best = Some((worst, mean, at));
        }
    }
    let (worst, mean, at) = best.filter(|(worst, ..)| *worst <= 1.0)?;
    debug_assert!(worst.is_finite());
    Some((mean, at))
}
