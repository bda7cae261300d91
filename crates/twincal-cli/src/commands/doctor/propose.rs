//! The config that logs and model ask for.

use super::examine::Examination;
use super::mends::lag;
use std::path::{Path, PathBuf};
use twincal_io::config::{Proposal, Settings};

/// What `doctor` prints and `init` writes; paths are seen from `folder`.
pub(super) fn propose(
    examination: &Examination,
    settings: &Settings,
    model: &Path,
    logs: &[PathBuf],
    folder: &Path,
) -> Proposal {
    let seen_from = |path: &Path| -> PathBuf {
        if folder.as_os_str().is_empty() || path.is_absolute() {
            path.to_owned()
        } else {
            std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
        }
    };
    let said = settings.calibration.signal.cutoff_hz;
    let (cutoff_hz, cutoff_comment) = match (&examination.pipeline, said) {
        (_, twincal::signal::Auto::Value(hz)) => (Some(hz), "As given.".to_owned()),
        (Some(pipeline), _) => (
            None,
            format!(
                "\"auto\" gives {} Hz on these logs (torque and columns pass it), {} Hz for motion, rows at {} Hz.",
                rounded(pipeline.cutoff_hz),
                rounded(pipeline.motion_cutoff_hz),
                rounded(pipeline.rate_hz)
            ),
        ),
        (None, _) => (
            None,
            "\"auto\" could not be found on these logs as they are.".to_owned(),
        ),
    };
    let velocity = examination
        .findings
        .iter()
        .filter(|finding| finding.code == "velocity_mismatch");
    let velocity: Vec<&str> = velocity.map(|finding| finding.message.as_str()).collect();
    let lag = lag(examination).map(|lag| {
        let samples: Vec<String> = examination
            .checkup
            .lags
            .values()
            .filter_map(|log| Some(format!("{:.1} in {}", log.clear()? / log.interval, log.log)))
            .collect();
        let order = if lag > 0.0 { "after" } else { "before" };
        let words = format!(
            "Torque is logged {:.1} ms {order} the motion (samples: {}).",
            1e3 * lag.abs(),
            samples.join(", ")
        );
        (lag, words)
    });
    let mut locked = settings.locked.clone();
    locked.extend(examination.locked.clone());
    let remarks = examination
        .refusals
        .iter()
        .filter(|_| examination.locked.is_empty())
        .map(|refusal| {
            format!(
                "fit refuses these logs: {}; {}",
                refusal.problem, refusal.remedy
            )
        })
        .chain(
            examination
                .findings
                .iter()
                .filter(|f| ["sign_flip", "joint_order", "torque_scale"].contains(&f.code.as_str()))
                .map(|finding| finding.message.clone()),
        )
        .collect();
    let shown = |path: &Path| path.to_string_lossy().into_owned();
    let names: Vec<String> = logs.iter().map(|log| shown(log)).collect();
    Proposal {
        command: format!("twincal init {} --model {}", names.join(" "), shown(model)),
        model: seen_from(model),
        locked,
        allow_unphysical: settings.model.allow_unphysical,
        logs: logs
            .iter()
            .map(|log| (seen_from(log), settings.log.options(log).rate_hz))
            .collect(),
        columns: settings.log.columns.clone(),
        cutoff_hz,
        cutoff_comment,
        lag,
        velocity_from_position: (!velocity.is_empty()).then(|| velocity.join(" ")),
        remarks,
    }
}

fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
