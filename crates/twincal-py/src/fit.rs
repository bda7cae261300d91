//! Fits of logs and of statistics, and the settings that they take.

use crate::calibration::Calibration;
use crate::errors::Problem;
use crate::follow::{Following, Step};
use crate::log::Log;
use crate::robot::Robot;
use crate::settings;
use crate::statistics::Statistics;
use pyo3::prelude::*;
use twincal::calibrate::Stage;
use twincal_cli::Failure;
use twincal_cli::session::{Fitted, LogSource, Request};
use twincal_io::config::{Config, LogEntry, LogTable};

/// Settings, with those of the model and of the logs.
pub(crate) fn config_of(robot: &Robot, logs: &[&Log], keywords: &str) -> Result<Config, Problem> {
    let mut config = settings::config(keywords)?;
    let model = &mut config.file.model;
    let allow = model.allow.take();
    if *model != twincal_io::config::ModelTable::default() {
        return Err(Failure::usage(
            "keys of [model] among the settings of a fit",
            "give them to Robot.from_urdf or Robot.from_mjcf, which read the model",
        )
        .into());
    }
    model.clone_from(&robot.config.file.model);
    if let Some(more) = allow {
        model.allow.get_or_insert_default().extend(more);
    }
    for log in logs {
        add_log(&mut config, log)?;
    }
    Ok(config)
}

/// Adds what is known of one log.
fn add_log(config: &mut Config, log: &Log) -> Result<(), Problem> {
    let mut tables = serde_json::Map::new();
    let entry: serde_json::Value = serde_json::from_str(&log.entry).unwrap_or_default();
    if let serde_json::Value::Object(mut entry) = entry
        && !entry.is_empty()
    {
        let file = log.source.given().to_string_lossy().into_owned();
        entry.insert("file".into(), file.into());
        let entries = serde_json::Value::Array(vec![entry.into()]);
        tables.insert("log".into(), entries);
    }
    let columns: serde_json::Value = serde_json::from_str(&log.columns).unwrap_or_default();
    if columns.as_object().is_some_and(|own| !own.is_empty()) {
        tables.insert("columns".into(), columns);
    }
    if tables.is_empty() {
        return Ok(());
    }
    let own = settings::config(&serde_json::Value::Object(tables).to_string())?.file;
    let LogTable { entries, .. } = own.log;
    let known = &mut config.file.log.entries;
    let new = |entry: &LogEntry| known.iter().all(|other| other.file != entry.file);
    let new: Vec<LogEntry> = entries.into_iter().filter(new).collect();
    known.extend(new);
    if own.columns != Default::default() {
        let all = &mut config.file.columns;
        if *all != Default::default() && *all != own.columns {
            return Err(Failure::usage(
                format!(
                    "`{}` names other columns than a log before it",
                    log.source.given().display()
                ),
                "give all logs of a call the same columns=",
            )
            .into());
        }
        *all = own.columns;
    }
    Ok(())
}

/// Sources of logs.
pub(crate) fn sources(logs: &[PyRef<'_, Log>]) -> Vec<LogSource> {
    logs.iter().map(|log| log.source.clone()).collect()
}

/// Fits logs; `progress` is called with the stage and how many of its parts are done.
#[pyfunction]
pub(crate) fn fit(
    py: Python<'_>,
    robot: &Robot,
    logs: Vec<PyRef<'_, Log>>,
    heldout: Vec<PyRef<'_, Log>>,
    keywords: &str,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Calibration> {
    let all: Vec<&Log> = logs.iter().chain(&heldout).map(|log| &**log).collect();
    let config = config_of(robot, &all, keywords).map_err(|problem| problem.raise(py))?;
    let request = Request {
        model: robot.input.clone(),
        config,
        logs: sources(&logs),
        heldout: sources(&heldout),
    };
    let following = Following::of(&request.config, progress.as_ref());
    let following = following.map_err(|problem| problem.raise(py))?;
    let fitted = following.run(py, move |watch| {
        Ok(request.fit(&|stage| watch(step(stage)))?)
    })?;
    Ok(Calibration::new(fitted))
}

/// A stage for Python: its name, and how many of its parts are done of how many.
fn step(stage: Stage) -> Step {
    match stage {
        Stage::Rows => ("filtering the logs", 0, 1),
        Stage::Inference => ("computing probabilities of all candidates", 0, 1),
        Stage::Validation(done, all) => ("predicting held-out data", done, all),
        Stage::Sensitivity => ("varying prior and cut-off", 0, 1),
    }
}

/// Fits statistics of logs.
#[pyfunction]
pub(crate) fn fit_statistics(
    py: Python<'_>,
    statistics: &Statistics,
    heldout: Vec<PyRef<'_, Log>>,
    keywords: &str,
) -> PyResult<Calibration> {
    let held_out = sources(&heldout);
    let config = settings::config(keywords).map_err(|problem| problem.raise(py))?;
    let following = Following::of(&config, None).map_err(|problem| problem.raise(py))?;
    let file = statistics.file.clone();
    let fitted = following.run(py, move |watch| {
        let watch = |stage| watch(step(stage));
        Ok(Fitted::of_statistics(file, &config, &held_out, &watch)?)
    })?;
    Ok(Calibration::new(fitted))
}

/// `[[log]]` and `[columns]` of logs as the text of a `twincal.toml`, for commands of the program.
#[pyfunction]
pub(crate) fn log_settings(py: Python<'_>, logs: Vec<PyRef<'_, Log>>) -> PyResult<String> {
    let mut config = Config::default();
    for log in &logs {
        add_log(&mut config, log).map_err(|problem| problem.raise(py))?;
    }
    let text = toml::to_string(&config.file);
    text.map_err(|e| Problem::Panicked(format!("settings of logs: {e}")).raise(py))
}
