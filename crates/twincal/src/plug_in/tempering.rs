//! The tempered likelihood: rows count by the autocorrelation time of the residual, or by what no candidate describes of it where that is
//! more.
//!
//! The residual of a real robot is mostly model error: slow, repeatable on one trajectory, different on the next. An
//! in-sample noise level cannot see that. Decoys see it: functions of the state that nobody proposes as a cause.

use super::decoys::JointDecoys;
use super::left_out::{folds, interval_factors};
use super::misfit::{Fold, misfit};
use super::usual::at_least_usual;
use super::{
    Fit, FitSettings, Moving, fit_gram, is_rounding, residual_correlation_time, start, total,
    weights,
};
use crate::error::Result;
use crate::likelihood::Columns;
use crate::observations::Part;
use rayon::prelude::*;

/// Times that misfit and noise are measured and the fit is made anew.
const ROUNDS: usize = 3;
/// Degrees of freedom of the t likelihood that robust rows have.
const FREEDOM: f64 = 4.0;

/// Measures noise and autocorrelation with independent rows, then what no candidate describes, in turn with the fit under it.
///
/// τ comes from the residual of the fit with independent rows and stays: iterated under tempering it feeds on itself (fewer effective
/// rows → fewer effects → a longer correlated residual → fewer effective rows) until nothing is left. Misfit and weights
/// follow the fit for three rounds.
///
/// With the fit comes the factor per joint on the noise sd of an interval so that left-out residuals have the stated variance.
///
/// # Errors
/// Those of [`super::fit`].
pub fn fit_tempered(
    training: &[Part<'_>],
    columns: &Columns,
    settings: FitSettings<'_>,
) -> Result<(Fit, Vec<f64>)> {
    let gram = total(training);
    let white = start(training, columns, settings.prior);
    let (all, known) = (Moving::All, None);
    let mut fitted = fit_gram(training, &gram, columns, settings, &white, all, known)?;
    let joints = 0..gram.joints.len();
    let time = |joint: usize| {
        residual_correlation_time(training, joint, &fitted.posterior.mean)
            * weighing(training, joint, settings.noise.robust)
    };
    let times: Vec<f64> = joints.clone().map(time).collect();
    let folds = folds(training);
    let pieces: Vec<Fold<'_>> = (folds.iter())
        .map(|fold| Fold {
            kept: &fold.kept,
            out: decoys(&fold.out, joints.len()),
        })
        .collect();
    // The pieces are all of the rows.
    let mut decoys = vec![JointDecoys::default(); joints.len()];
    for piece in &pieces {
        let sums = decoys.iter_mut().zip(&piece.out);
        sums.for_each(|(sum, own)| *sum += own);
    }
    for round in 1..=ROUNDS {
        let measured = (&gram, &decoys[..], &pieces[..]);
        let found = misfit(measured, (columns, settings.prior), &fitted)?;
        let mut plug_in = fitted.plug_in.clone();
        plug_in.autocorrelation_time.clone_from(&times);
        let own = found.largest().into_iter().enumerate();
        let own: Vec<Option<f64>> = own
            .map(|(joint, largest)| {
                let squares = found.variance[joint] * gram.joints[joint].n;
                (squares > 0.0 && !is_rounding(training, joint, squares)).then_some(largest)
            })
            .collect();
        plug_in.misfit = at_least_usual(&own);
        if settings.noise.per_joint && found.variance.iter().any(|variance| *variance > 0.0) {
            plug_in.weight = weights(&gram, &found.variance);
        }
        let moving = match round {
            ROUNDS => Moving::SlabScale,
            _ => Moving::SlabScaleRoughly,
        };
        let known = Some(&fitted.posterior);
        fitted = fit_gram(training, &gram, columns, settings, &plug_in, moving, known)?;
    }
    let factors = interval_factors(&folds, columns, settings, &fitted)?;
    Ok((fitted, factors))
}

/// Sums over the rows of some parts, joint by joint.
fn decoys(parts: &[Part<'_>], joints: usize) -> Vec<JointDecoys> {
    let of_joint = |joint: usize| {
        let mut sum = JointDecoys::default();
        parts
            .iter()
            .for_each(|part| sum += &JointDecoys::of(part, joint));
        sum
    };
    (0..joints).into_par_iter().map(of_joint).collect()
}

/// What weighing rows costs: the variance of the t likelihood's estimate over the one that known weights would give, from
/// the weights alone (t² = (ν+1)/u − ν); 1 without weights. With ψ = u t (Huber 1981, eq. 4.6.11)
///
/// ```text
/// κ = E[ψ²]/E[ψ']² · E[u]/E[u t²],     ψ' = u² (ν − t²)/(ν + 1)
/// ```
fn weighing(training: &[Part<'_>], joint: usize, robust: bool) -> f64 {
    if !robust {
        return 1.0;
    }
    let (mut score, mut slope, mut known, mut square) = (0.0, 0.0, 0.0, 0.0);
    let mut count = 0.0;
    for part in training {
        let rows = &part.observations.joints[joint];
        let Some(weights) = rows.weight.get(part.rows.clone()) else {
            continue;
        };
        for (row, weight) in part.rows.clone().zip(weights) {
            if !rows.standstill[row] {
                let u = weight * rows.spread.get(row).copied().unwrap_or(1.0);
                let t2 = (FREEDOM + 1.0) / u - FREEDOM;
                score += u * u * t2;
                slope += u * u * (FREEDOM - t2) / (FREEDOM + 1.0);
                known += u;
                square += u * t2;
                count += 1.0;
            }
        }
    }
    let cost = score * count / (slope * slope) * known / square;
    if cost.is_finite() { cost.max(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observations::{JointObservations, Observations};
    use statrs::distribution::{ContinuousCDF, StudentsT};

    /// t rows: the Fisher information is (ν+1)/(ν+3) of what known weights would give, κ = 7/5.
    #[test]
    fn weighing_costs_what_the_information_says() {
        let t = StudentsT::new(0.0, 1.0, FREEDOM).unwrap();
        let count = 40_000;
        let weight = (0..count)
            .map(|i| t.inverse_cdf((i as f64 + 0.5) / count as f64))
            .map(|r| (FREEDOM + 1.0) / (FREEDOM + r * r))
            .collect();
        let mut observations = Observations {
            joints: vec![JointObservations {
                standstill: vec![false; count],
                weight,
                ..JointObservations::default()
            }],
            time: vec![0.0; count],
            ..Observations::default()
        };
        let kappa = weighing(&[observations.whole()], 0, true);
        assert!((kappa - 1.4).abs() < 2e-3, "{kappa}");
        observations.joints[0].weight.clear();
        assert_eq!(weighing(&[observations.whole()], 0, true), 1.0);
    }
}
