//! Does an estimate depend on the cut-off? The same fit at 0.7 and 1.4 times f_c (method section 1).

use crate::calibrate::data::all_logs::{Data, grams_at};
use crate::calibrate::data::other_cutoffs::pipelines;
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Result, Severity};
use crate::gram::Gram;
use crate::infer::approximate;
use crate::likelihood::{Columns, assemble};
use crate::plug_in::Fit;
use crate::posterior::Posterior;
use crate::signal::ReadyLog;
use crate::term::Library;
use crate::twin::Twin;
use crate::words::significant;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How an estimate moves when the cut-off does (method section 1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SweepPoint {
    /// Cut-off, Hz.
    pub cutoff_hz: f64,
    /// E[β | y] of every column at that cut-off.
    pub mean: Vec<f64>,
}

/// Posterior means at 0.7, 1 and 1.4 f_c with the plug-ins of the fit; empty with the filter off, and where rows are weighed
/// (`noise.robust`, `noise.varies_with_speed`, `noise.varies_with_load`): rows of another cut-off have no weights.
///
/// A cut-off at which the logs cannot be used (too short for the kernel) is left out.
pub(in crate::calibrate) fn cutoff(
    twin: &Twin,
    library: &Library,
    logs: &[ReadyLog<'_>],
    data: &Data,
    columns: &Columns,
    settings: &CalibrationSettings,
    fit: &Fit,
) -> Result<Vec<SweepPoint>> {
    let pipeline = &twin.pipeline;
    let scaled = pipelines(pipeline, settings);
    if scaled.is_empty() {
        return Ok(Vec::new());
    }
    let mut points = vec![SweepPoint {
        cutoff_hz: pipeline.cutoff_hz,
        mean: fit.posterior.mean.clone(),
    }];
    let grams = grams_at(twin, library, &scaled, logs, data)?;
    let cutoffs = scaled.iter().map(|scaled| scaled.cutoff_hz);
    let moved: Vec<(f64, Gram)> = cutoffs
        .zip(grams)
        .filter_map(|(cutoff_hz, gram)| Some((cutoff_hz, gram?)))
        .collect();
    let moved: Vec<SweepPoint> = moved
        .into_par_iter()
        .map(|(cutoff_hz, gram)| {
            let problem = assemble(&gram, columns, &fit.plug_in, &settings.prior)?;
            let posterior = approximate(&problem, Some(&fit.posterior))?;
            Ok(SweepPoint {
                cutoff_hz,
                mean: posterior.mean,
            })
        })
        .collect::<Result<_>>()?;
    points.extend(moved);
    points.sort_by(|a, b| a.cutoff_hz.total_cmp(&b.cutoff_hz));
    Ok(points)
}

/// Selected terms whose estimate moves by more than its sd over the sweep, those that move most of their sd first.
pub(in crate::calibrate) fn findings(
    sweep: &[SweepPoint],
    library: &Library,
    posterior: &Posterior,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (k, &index) in library.columns().iter().enumerate() {
        if posterior.inclusion[k] < 0.5 || posterior.sd[k] == 0.0 {
            continue;
        }
        let largest = sweep
            .iter()
            .max_by(|a, b| {
                let far = |p: &SweepPoint| (p.mean[k] - posterior.mean[k]).abs();
                far(a).total_cmp(&far(b))
            })
            .filter(|p| (p.mean[k] - posterior.mean[k]).abs() > posterior.sd[k]);
        if let Some(point) = largest {
            let name = &library.terms()[index].name;
            // What is left of a mean by rounding, or by draws that are next to never in, is none.
            let shown = |mean: f64| match mean.abs() < 1e-3 * posterior.sd[k] {
                true => "0".to_owned(),
                false => significant(mean, 3),
            };
            let moved = (point.mean[k] - posterior.mean[k]).abs() / posterior.sd[k];
            let finding = Finding::new(
                Severity::Warning,
                Code::DependsOnCutoff,
                name.clone(),
                format!(
                    "`{name}` moves by {moved:.1} sd when the cut-off becomes {} Hz (mean over all models, in or out: from {} to {}): \
                     do not read its interval as the whole uncertainty",
                    significant(point.cutoff_hz, 3),
                    shown(posterior.mean[k]),
                    shown(point.mean[k])
                ),
                0,
            )
            .with([
                ("change_in_sd", moved), ("cutoff", point.cutoff_hz), ("mean", posterior.mean[k]),
                ("mean_at_cutoff", point.mean[k]),
            ]);
            findings.push((moved, finding));
        }
    }
    findings.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    findings.into_iter().map(|(_, finding)| finding).collect()
}
