//! Stage 4: the twin, what its residual says of the fit, and its prediction of data that it has not seen.

use super::estimate::Estimated;
use super::prepare::Prepared;
use super::rows::Rows;
use crate::calibrate::checks::drift;
use crate::calibrate::checks::heavy_tails;
use crate::calibrate::checks::held_out;
use crate::calibrate::checks::misfit;
use crate::calibrate::checks::uneven_noise;
use crate::calibrate::checks::unsettled;
use crate::calibrate::checks::worse;
use crate::calibrate::fit::compact;
use crate::calibrate::fit::fitted::Fitted;
use crate::calibrate::fit::noise_of::noise_of;
use crate::calibrate::progress::Watch;
use crate::error::{Finding, Result};
use crate::posterior::Posterior;
use crate::twin::Twin;
use crate::validate::Validation;

/// `τ_calib = τ_nom + Φβ̂` with intervals and held-out truth.
pub(in crate::calibrate) struct Validated {
    pub(in crate::calibrate) twin: Twin,
    pub(in crate::calibrate) fitted: Fitted,
    /// Of the compact twin.
    pub(in crate::calibrate) compact: Posterior,
    pub(in crate::calibrate) validation: Validation,
}

/// Scores the twin on held-out data.
///
/// # Errors
/// Those of rows and predictors, and of the watch.
pub(in crate::calibrate) fn validate(
    rows: &Rows<'_, '_>,
    estimated: Estimated<'_>,
    progress: &Watch<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Validated> {
    let Estimated {
        fitted,
        plan,
        fits_of_folds,
    } = estimated;
    let robot = rows.prepared.request.robot;
    findings.extend(of_residual(rows, &fitted));
    let fit = &fitted.fit;
    let inside = compact::members(&fit.problem, &fit.posterior);
    let compact = compact::refit(&fit.problem, &inside, &fit.posterior)?;
    let twin = twin(rows, &fitted)?;
    let own = held_out::Own {
        twin: &twin,
        compact: &compact,
        fit,
    };
    let library = &rows.library;
    let (validation, more) = held_out::validate(own, library, plan, fits_of_folds, progress)?;
    findings.extend(more);
    findings.extend(worse::of_validation(robot, &validation));
    Ok(Validated {
        twin,
        fitted,
        compact,
        validation,
    })
}

/// What chains, plug-ins and the residual say of the fit.
fn of_residual(rows: &Rows<'_, '_>, fitted: &Fitted) -> Vec<Finding> {
    let (robot, settings) = (rows.prepared.request.robot, &rows.prepared.settings);
    let training = rows.data.training();
    let mut findings = unsettled::findings(robot, fitted, settings, &rows.sums);
    let mean = &fitted.fit.posterior.mean;
    let robust = settings.noise.robust;
    let (tails, (drifts, uneven)) = rayon::join(
        || heavy_tails::findings(robot, &training, mean, robust),
        || {
            let uneven = uneven_noise::findings(robot, &fitted.fit, &training, settings.noise);
            (drift::findings(robot, &training, mean), uneven)
        },
    );
    findings.extend(misfit::findings(robot, &fitted.fit.plug_in));
    findings.extend(tails.into_iter().chain(drifts).chain(uneven));
    findings
}

fn twin(rows: &Rows<'_, '_>, fitted: &Fitted) -> Result<Twin> {
    let Prepared {
        request,
        pipeline,
        library_settings,
        unknown,
        ..
    } = &rows.prepared;
    let (robot, data, posterior) = (request.robot, &rows.data, &fitted.fit.posterior);
    let (library, trajectories) = (&rows.library, &rows.trajectories);
    let out_of_band = data.out_of_band(robot, library, pipeline, trajectories, &posterior.mean)?;
    Ok(Twin {
        robot: robot.clone(),
        library: library_settings.clone(),
        zero_columns: rows.zero_columns.clone(),
        pipeline: pipeline.clone(),
        posterior: posterior.clone(),
        noise: noise_of(robot, fitted, &out_of_band, &rows.spreads),
        hull: rows.facts.hull.clone(),
        payload_where_unknown: *unknown,
    })
}
