//! The tempered likelihood: rows count by the autocorrelation time of the residual, or by what no candidate describes of it where that is
//! more.
//!
//! The residual of a real robot is mostly model error: slow, repeatable on one trajectory, different on the next. An
//! in-sample noise level cannot see that. Decoys see it: functions of the state that nobody proposes as a cause.

use super::left_out::interval_factors;
use super::misfit::misfit;
use super::usual::at_least_usual;
use super::{
    Fit, FitSettings, Moving, ROUNDING_OF_SUMS, correlation_time, fit_sums, start, weights,
};
use crate::error::Result;
use crate::likelihood::{Columns, NoiseSettings};
use crate::observations::Part;
use crate::statistics::{Sums, Training, Unit};

/// Times that misfit and noise are measured and the fit is made anew.
const ROUNDS: usize = 3;

/// Measures noise and autocorrelation with independent rows, then what no candidate describes, in turn with the fit under it.
///
/// τ comes from the residual of the fit with independent rows and stays: iterated under tempering it feeds on itself (fewer effective
/// rows → fewer effects → a longer correlated residual → fewer effective rows) until nothing is left. Misfit and weights
/// follow the fit for three rounds.
///
/// `rows` are those behind the sums; only robust noise asks for them. With the fit comes the factor per joint on the noise sd of an interval so that left-out residuals have the stated variance.
///
/// # Errors
/// Those of [`super::fit`].
pub(crate) fn fit_tempered(
    sums: &Sums,
    rows: &[Part<'_>],
    columns: &Columns,
    settings: FitSettings<'_>,
) -> Result<(Fit, Vec<f64>)> {
    let training = Training::new(sums);
    let total = training.total();
    let data = (&total, sums.cutoff);
    let white = start(sums, columns, settings.prior);
    let (all, known) = (Moving::All, None);
    let mut fitted = fit_sums(data, columns, settings, &white, all, known)?;
    let times = correlation_times(sums, &total, (settings.noise, &fitted));
    let measured = (&training, &total, sums.cutoff);
    fitted = count_misfit(measured, times, columns, settings, fitted)?;
    let kept = training.all_but_each();
    let factors = interval_factors((&training, &kept, rows), columns, settings, &fitted)?;
    Ok((fitted, factors))
}

/// Lets misfit count as noise beside the autocorrelation times τ, in turn with the fit under both; `fitted` is that with independent rows.
///
/// # Errors
/// Those of [`super::fit`].
pub(crate) fn count_misfit(
    (training, total, cutoff): (&Training, &Unit, f64),
    times: Vec<f64>,
    columns: &Columns,
    settings: FitSettings<'_>,
    mut fitted: Fit,
) -> Result<Fit> {
    let (units, kept) = (&training.units, training.all_but_each());
    for round in 1..=ROUNDS {
        let measured = (total, &units[..], &kept[..]);
        let found = misfit(measured, (columns, settings.prior), &fitted)?;
        let mut plug_in = fitted.plug_in.clone();
        plug_in.autocorrelation_time.clone_from(&times);
        let own = found.largest().into_iter().enumerate();
        let own: Vec<Option<f64>> = own
            .map(|(joint, largest)| {
                let squares = found.variance[joint] * total.gram.joints[joint].n;
                (squares > ROUNDING_OF_SUMS * total.joints[joint].torque).then_some(largest)
            })
            .collect();
        plug_in.misfit = at_least_usual(&own);
        if settings.noise.per_joint && found.variance.iter().any(|variance| *variance > 0.0) {
            plug_in.weight = weights(&total.gram, &found.variance);
        }
        let moving = match round {
            ROUNDS => Moving::SlabScale,
            _ => Moving::SlabScaleRoughly,
        };
        let (data, known) = ((total, cutoff), Some(&fitted.posterior));
        fitted = fit_sums(data, columns, settings, &plug_in, moving, known)?;
    }
    Ok(fitted)
}

/// τ of each joint, in rows: the autocorrelation time of its residual, and what weighing the rows costs.
fn correlation_times(
    sums: &Sums,
    total: &Unit,
    (noise, fitted): (NoiseSettings, &Fit),
) -> Vec<f64> {
    let mean = &fitted.posterior.mean;
    let joints = total.joints.iter().enumerate();
    joints
        .map(|(joint, own)| {
            let cost = if noise.robust {
                own.weighing.cost()
            } else {
                1.0
            };
            correlation_time((sums, &total.gram), joint, mean) * cost
        })
        .collect()
}
