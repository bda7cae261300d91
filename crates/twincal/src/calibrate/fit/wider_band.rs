//! More of the log where its noise allows it: a wider band, fitted with `ar1`, unless somebody chose band or likelihood.
//!
//! Noise with a memory is largest where the motion is. Where it is an autoregression of first order it falls above as 1/f², and what lies
//! there tells effects apart that look alike below. But what a model lacks (friction that turns round sharply, flexible joints) and what encoders add to
//! accelerations is largest there, too. So the band becomes four times as wide only where
//!
//! 1. the residual of the fit has a memory of more than [`MEMORY`] rows on some joint: else nothing is to be gained,
//! 2. accelerations are known as well there ([`crate::signal::Chosen::wider_hz`]),
//! 3. the residual that the fit leaves in the wider band is such an autoregression on every joint that moves, and as large at reversals as
//!    elsewhere ([`super::whiteness`]); a few stretches of the training logs say so,
//! 4. its time T is such that on some joint it falls from within the band of the fit on: `2π f_c T ≥ 1`. White noise may have a long memory
//!    by chance on one of many joints, but not that.
//!
//! The motion of the stretches is that of the fit, whose own filter ends at four times the cut-off: what it lacks stays in the residual.

use super::whiteness::{CUMULATED, Judged, Run, VARIANCES, judge};
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::likelihood::NoiseModel;
use crate::observations::{Observations, observe};
use crate::plug_in::Fit;
use crate::robot::Robot;
use crate::signal::{Auto, Payload, Pipeline, ReadyLog, stretches};
use crate::term::Library;
use std::f64::consts::TAU;

/// Autocorrelation time of a residual with a memory, rows; that of white noise behind the filter is 1.35.
const MEMORY: f64 = 2.0;
/// Samples of all training logs together that are looked at, about.
const SAMPLES: usize = 1 << 15;

/// A wider band than that of the fit.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::calibrate) struct Wider {
    cutoff_hz: f64,
    /// What was chosen.
    pub(in crate::calibrate) finding: Finding,
}

impl Wider {
    /// The settings of the same calibration in the wider band.
    pub(in crate::calibrate) fn settings(
        &self,
        settings: &CalibrationSettings,
    ) -> CalibrationSettings {
        let mut wider = settings.clone();
        wider.signal.cutoff_hz = Auto::Value(self.cutoff_hz);
        wider.noise.model = NoiseModel::Ar1;
        wider.may_widen = false;
        wider
    }
}

/// The wider band, if nobody chose another and the residual of `fit` asks for it; `unknown`: see [`crate::calibrate::data::all_logs::carry_something`].
///
/// # Errors
/// Those of rows, and of chapters that cannot be read.
pub(in crate::calibrate) fn wider(
    robot: &Robot,
    library: &Library,
    (prepared, unknown): (&[ReadyLog<'_>], bool),
    (pipeline, wider_hz): (&Pipeline, Option<f64>),
    fit: &Fit,
    settings: &CalibrationSettings,
) -> Result<Option<Wider>> {
    let Some(cutoff_hz) = wider_hz.filter(|_| may_widen(settings)) else {
        return Ok(None);
    };
    let memory = fit.plug_in.autocorrelation_time.iter().copied();
    if memory.fold(0.0, f64::max) <= MEMORY {
        return Ok(None);
    }
    let wide = Pipeline {
        cutoff_hz,
        rate_hz: pipeline.rate_hz * cutoff_hz / pipeline.cutoff_hz,
        ..pipeline.clone()
    };
    let mut rows = Vec::new();
    for mut trajectory in stretches(prepared, SAMPLES, pipeline)? {
        trajectory.payload_acts = !unknown || trajectory.payload == Payload::Unknown;
        rows.push(observe(robot, library, &wide, &trajectory)?);
    }
    let mut told: Vec<(&str, Judged)> = Vec::new();
    for (joint, name) in robot.joint_names().into_iter().enumerate() {
        let runs: Vec<Run> = (rows.iter())
            .flat_map(|rows| runs(rows, joint, &fit.posterior.mean))
            .collect();
        if runs.is_empty() {
            continue; // stands still
        }
        match judge(&runs).filter(Judged::passes) {
            Some(judged) => told.push((name, judged)),
            None => return Ok(None),
        }
    }
    let periods = told.iter().map(|(_, judged)| judged.time);
    let time = periods.fold(0.0, f64::max) / cutoff_hz;
    if TAU * pipeline.cutoff_hz * time < 1.0 {
        return Ok(None);
    }
    Ok(finding(&told, pipeline, cutoff_hz).map(|finding| Wider { cutoff_hz, finding }))
}

/// Whether band and likelihood are what they are where nobody says anything.
fn may_widen(settings: &CalibrationSettings) -> bool {
    let (signal, noise) = (&settings.signal, settings.noise);
    settings.may_widen
        && signal.cutoff_hz == Auto::Auto
        && signal.rate_hz == Auto::Auto
        && noise.model == NoiseModel::Tempered
        && !noise.weighs_rows()
}

/// Consecutive moving rows of a joint.
fn runs(rows: &Observations, joint: usize, beta: &[f64]) -> Vec<Run> {
    let residual = rows.whole().residual(joint, beta, 0..rows.len());
    let velocity = rows.qd[joint].get();
    let mut runs: Vec<Run> = Vec::new();
    let mut moved = false;
    for (row, still) in rows.joints[joint].standstill.iter().enumerate() {
        if !still && (!moved || rows.starts.contains(&row)) {
            runs.push(Run {
                residual: Vec::new(),
                velocity: Vec::new(),
                cutoff: rows.cutoff,
            });
        }
        moved = !still;
        if let Some(run) = runs.last_mut().filter(|_| moved) {
            run.residual.push(residual[row]);
            run.velocity.push(velocity[row]);
        }
    }
    runs
}

/// Where the fit in the wider band ended early: it is done in the usual one.
pub(in crate::calibrate) fn not_wider(error: &Error) -> Finding {
    Finding::new(
        Severity::Note,
        Code::NotWider,
        "",
        format!(
            "what is left is an autoregression, but a fit in a wider band with \"ar1\" ends early ({error}): fitted in the usual one; \
             [signal] wider_band = false does not try it"
        ),
        0,
    )
}

/// `None` without a joint that moves.
fn finding(told: &[(&str, Judged)], pipeline: &Pipeline, cutoff_hz: f64) -> Option<Finding> {
    let longest = told.iter().max_by(|a, b| a.1.time.total_cmp(&b.1.time))?;
    let largest = |of: fn(&Judged) -> f64| {
        told.iter()
            .map(|(_, judged)| of(judged))
            .fold(0.0, f64::max)
    };
    let narrow = pipeline.cutoff_hz;
    Some(Finding::new(
        Severity::Note,
        Code::WiderBand,
        "",
        format!(
            "below {cutoff_hz} Hz what is left is noise of one memory on every joint, {:.3} s at most (joint `{}`): cumulated periodogram \
             within {:.2} of white (limit {CUMULATED:.2}), variances over speeds {:.1} (limit {VARIANCES:.1}). Fitted up to there as \
             such noise instead of below {narrow} Hz",
            longest.1.time / cutoff_hz,
            longest.0,
            largest(|judged| judged.cumulated),
            largest(|judged| judged.variances),
        ),
        0,
    )
    .with([
        ("cutoff", cutoff_hz), ("usual_cutoff", narrow), ("memory", longest.1.time / cutoff_hz),
        ("periodogram_distance", largest(|judged| judged.cumulated)),
        ("periodogram_limit", CUMULATED), ("variance_ratio", largest(|judged| judged.variances)),
        ("variance_ratio_limit", VARIANCES),
    ]))
}
