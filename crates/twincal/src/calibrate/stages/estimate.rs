//! Stage 3: sparse regression with everything that is plugged in at its fixed point (eq. (5)), or what the fit asks for instead.

use super::prepare::Prepared;
use super::rows::Rows;
use crate::calibrate::checks::held_out::{self, Plan};
use crate::calibrate::checks::independent_rows::{self, Counted};
use crate::calibrate::exit::{Exit, Pass};
use crate::calibrate::fit::fitted::{self, Fitted};
use crate::calibrate::fit::lower_band::{self, Band};
use crate::calibrate::fit::relinearise::{self, Linear};
use crate::calibrate::fit::ripples::{self, Seen};
use crate::calibrate::fit::wider_band::wider;
use crate::calibrate::request::Goal;
use crate::calibrate::settings::UnaskedRipple;
use crate::error::{Error, Finding, Result};
use crate::infer::infer_near;

/// The fit to all logs, and those that do not know what is held out.
pub(in crate::calibrate) struct Estimated<'d> {
    pub(in crate::calibrate) fitted: Fitted,
    pub(in crate::calibrate) plan: Plan<'d>,
    /// Of each fold of the plan.
    pub(in crate::calibrate) fits_of_folds: Vec<Fitted>,
}

/// Fits all logs and every fold.
///
/// # Errors
/// Every [`Exit`], as the fit asks for it.
pub(in crate::calibrate) fn estimate<'d>(
    rows: &'d Rows<'_, '_>,
    findings: &mut Vec<Finding>,
) -> Pass<Estimated<'d>> {
    let Prepared {
        pipeline, settings, ..
    } = &rows.prepared;
    let training = rows.data.training();
    let plan = held_out::plan(&rows.data, &rows.trajectories, pipeline);
    let (fitted, fits_of_folds) = rayon::join(
        || fitted::estimate(&rows.sums, &training, &rows.columns, settings),
        || plan.fits(&rows.columns, settings),
    );
    let (mut fitted, fits_of_folds) = (fitted?, fits_of_folds?);
    let counted = independent(rows, &fitted);
    let seen = reconsider(rows, &fitted, findings)?;
    match counted {
        Ok(counted) => findings.extend(counted.findings),
        Err(error) => return Err(rows.too_few(error)),
    }
    let Prepared { request, .. } = rows.prepared;
    if request.goal == Goal::Result
        && let Some(masked) =
            lower_band::masked(request.robot, findings, rows.misfit, pipeline.cutoff_hz)
    {
        return Err(Exit::Masked(masked));
    }
    findings.extend(seen.iter().map(Seen::told));
    let fit = &fitted.fit;
    let inferred = infer_near(
        &fit.problem,
        &fit.posterior,
        &settings.inference,
        settings.most_bytes,
    );
    fitted.fit.posterior = inferred.map_err(|error| match error {
        Error::Refused { .. } => Exit::Disagreeing(error),
        other => Exit::Failed(other),
    })?;
    Ok(Estimated {
        fitted,
        plan,
        fits_of_folds,
    })
}

/// What a fit says of this band: how many independent rows it leaves, and how far the model is off.
///
/// # Errors
/// [`Exit::Failed`] with too few independent rows, and those of the fit.
pub(in crate::calibrate) fn count(rows: &Rows<'_, '_>) -> Pass<Band> {
    let settings = &rows.prepared.settings;
    let (sums, training) = (&rows.sums, rows.data.training());
    let fitted = fitted::estimate(sums, &training, &rows.columns, settings)?;
    let counted = independent(rows, &fitted)?;
    let cutoff_hz = rows.prepared.pipeline.cutoff_hz;
    Ok(Band::new(cutoff_hz, counted.most, rows.misfit))
}

fn independent(rows: &Rows<'_, '_>, fitted: &Fitted) -> Result<Counted> {
    let robot = rows.prepared.request.robot;
    independent_rows::require(robot, &fitted.fit, &rows.data.training())
}

/// Whether the fit asks for other columns, other candidates or another band; gear ripple that it shows and that is no candidate.
fn reconsider(
    rows: &Rows<'_, '_>,
    fitted: &Fitted,
    findings: &mut Vec<Finding>,
) -> Pass<Vec<Seen>> {
    let Prepared {
        request,
        ready,
        pipeline,
        wider_hz,
        settings,
        library_settings,
        usual,
        unknown,
        ..
    } = &rows.prepared;
    let (robot, fit) = (request.robot, &fitted.fit);
    let model = (robot, &rows.library, library_settings);
    let open = match relinearise::elsewhere(model, &rows.data, fit, settings)? {
        Linear::Elsewhere(point) => return Err(Exit::Elsewhere(point)),
        Linear::Open(moves) => Some(moves),
        Linear::Enough => None,
    };
    let about = relinearise::components(&rows.library, &library_settings.linearised_at);
    findings.extend(relinearise::finding(&about, open));
    let training = rows.data.training();
    let seen = match settings.unasked_ripple {
        UnaskedRipple::Ignored => Vec::new(),
        _ => ripples::seen(robot, &training, fit, library_settings, pipeline),
    };
    if !seen.is_empty() && *usual && settings.unasked_ripple == UnaskedRipple::Candidate {
        return Err(Exit::Ripple(seen));
    }
    let (ready, band) = ((&ready[..], *unknown), (pipeline, *wider_hz));
    match wider(robot, &rows.library, ready, band, fit, settings)? {
        Some(wider) => Err(Exit::Wider(Box::new(wider))),
        None => Ok(seen),
    }
}
