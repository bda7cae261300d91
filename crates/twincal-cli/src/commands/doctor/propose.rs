//! The config that logs and model ask for.

use super::Asked;
use super::columns::{Fixed, columns};
use super::examine::{Examination, Refusal};
use super::remedies::lag;
use std::path::{Path, PathBuf};
use twincal::Code;
use twincal::signal::Auto;
use twincal_io::config::{Config, LogEntry, Proposal};

/// How a remark begins that says why a fit with the proposed config is refused.
pub(super) const REFUSES: &str = "fit refuses these logs";

/// What `doctor` prints and `init` writes; paths are seen from `folder`.
pub(super) fn propose(examination: &Examination, asked: &Asked, folder: &Path) -> Proposal {
    let (settings, model, logs) = (&asked.settings, &asked.model, &asked.logs);
    let (cutoff_hz, cutoff_comment) = cutoff(examination, settings.calibration.signal.cutoff_hz);
    let velocity = examination
        .findings
        .iter()
        .filter(|finding| finding.code == Code::VelocityMismatch);
    let velocity: Vec<&str> = velocity.map(|finding| finding.message.as_str()).collect();
    let columns = columns(examination, logs.len(), settings);
    let mut locked = settings.locked.clone();
    locked.extend(examination.locked.clone());
    let shown = |path: &Path| path.to_string_lossy().into_owned();
    let names: Vec<String> = logs.iter().map(|log| shown(log)).collect();
    Proposal {
        command: format!("twincal init {} --model {}", names.join(" "), shown(model)),
        model: seen_from(folder, model),
        locked,
        base: base_line(examination),
        allow_unphysical: settings.model.allow_unphysical,
        logs: log_entries(asked, folder),
        remarks: remarks(examination, asked, &columns.fixed),
        columns: columns.table,
        factor_comment: columns.why,
        cutoff_hz,
        cutoff_comment,
        lag: lag_of_torque(examination),
        velocity_from_position: (!velocity.is_empty()).then(|| velocity.join(" ")),
    }
}

/// A path as it is written in a config that lies in `folder`.
fn seen_from(folder: &Path, path: &Path) -> PathBuf {
    if folder.as_os_str().is_empty() || path.is_absolute() {
        path.to_owned()
    } else {
        std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
    }
}

/// Cut-off in Hz where it is given, and a comment on it.
fn cutoff(examination: &Examination, said: Auto) -> (Option<f64>, String) {
    match (&examination.pipeline, said) {
        (_, Auto::Value(hz)) => (Some(hz), "As given.".to_owned()),
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
    }
}

/// Lag of torque, s, and a comment on it.
fn lag_of_torque(examination: &Examination) -> Option<(f64, String)> {
    lag(examination).map(|lag| {
        let logs = (examination.checkup.lags.iter()).flat_map(|lags| &lags.logs);
        let samples: Vec<String> = logs
            .map(|log| format!("{:.1} in {}", lag / log.interval, log.log))
            .collect();
        let order = if lag > 0.0 { "after" } else { "before" };
        let words = format!(
            "Torque is logged {:.1} ms {order} the motion (samples: {}).",
            1e3 * lag.abs(),
            samples.join(", ")
        );
        (lag, words)
    })
}

/// The line of `[model]` that says how the base stands, and why.
fn base_line(examination: &Examination) -> Option<(String, String)> {
    examination.checkup.base.map(|base| {
        let said = examination
            .findings
            .iter()
            .find(|f| f.code == Code::BaseOrientation);
        let why = said.map_or_else(String::new, |finding| finding.message.clone());
        (base.line(), why)
    })
}

/// What no key of the proposed config fixes, and what of a given config it does not repeat; `fixed`: what its columns fix.
fn remarks(examination: &Examination, asked: &Asked, fixed: &[Fixed]) -> Vec<String> {
    let is_fixed = |what: Fixed| {
        fixed.contains(&what)
            || (what == Fixed::Finding(Code::BaseOrientation) && examination.checkup.base.is_some())
    };
    let fixes_refusal = |refusal: &Refusal| {
        (is_fixed(Fixed::Ticks) && refusal.time_unit.is_some())
            || (is_fixed(Fixed::Degrees) && refusal.degrees.is_some())
    };
    let beside = asked.given.iter().map(|file| {
        let file = file.to_string_lossy();
        format!("Other keys of {file}, such as gravity and candidates, are not repeated here.")
    });
    examination
        .refusals
        .iter()
        .filter(|refusal| examination.locked.is_empty() && !fixes_refusal(refusal))
        .map(|refusal| format!("{REFUSES}: {}; {}", refusal.problem, refusal.remedy))
        .chain(
            examination
                .findings
                .iter()
                .filter(|finding| finding.doubts_the_log())
                .filter(|f| !is_fixed(Fixed::Finding(f.code)))
                .map(|finding| finding.message.clone()),
        )
        .chain(beside)
        .collect()
}

/// The logs and the held-out ones beside them, with what the config says of each.
fn log_entries(asked: &Asked, folder: &Path) -> Vec<LogEntry> {
    let logs = &asked.logs;
    let heldout = asked.settings.log.heldout.iter();
    let heldout = heldout.filter(|file| !logs.iter().any(|log| same_file(log, file)));
    logs.iter()
        .map(|log| LogEntry {
            file: seen_from(folder, log),
            ..entry(&asked.config, log)
        })
        .chain(heldout.map(|file| LogEntry {
            file: seen_from(folder, file),
            heldout: Some(true),
            ..entry(&asked.config, file)
        }))
        .collect()
}

/// Whether two paths lead to one file.
fn same_file(one: &Path, other: &Path) -> bool {
    one == other || matches!((one.canonicalize(), other.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// What the config says of a log: its own entry, else what holds for all.
fn entry(config: &Config, log: &Path) -> LogEntry {
    let table = &config.file.log;
    let own = (table.entries.iter()).find(|entry| same_file(&entry.file, log));
    let own = own.cloned();
    let entry = own.unwrap_or_else(|| LogEntry {
        topic: table.topic.clone(),
        preset: table.preset,
        torque: table.torque,
        gear_ratio: table.gear_ratio.clone(),
        drive_constant: table.drive_constant.clone(),
        accept_model_torque: table.accept_model_torque,
        ..LogEntry::default()
    });
    LogEntry {
        rate_hz: table.rate_hz.or(entry.rate_hz),
        lenient: table.lenient.or(entry.lenient),
        ..entry
    }
}

fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
