//! A fit on threads of its own, so that Python hears of its stages and of Ctrl-C while it runs.

use crate::calibration::Calibration;
use crate::errors::Problem;
use crate::log::Log;
use crate::pool;
use crate::robot::Robot;
use crate::settings;
use crate::statistics::Statistics;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use twincal::calibrate::Stage;
use twincal_cli::Failure;
use twincal_cli::session::{Fitted, LogSource, Request};
use twincal_io::config::{Config, LogEntry, LogTable};

/// Between two looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// What the thread that fits says.
enum Message {
    Stage(Stage),
    Done(Box<Result<Fitted, Problem>>),
}

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
                "give all logs of a fit the same columns=",
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
    let stop = Arc::new(AtomicBool::new(false));
    let messages = start(request, &stop).map_err(|problem| problem.raise(py))?;
    let outcome = follow(py, &messages, progress.as_ref());
    if outcome.is_err() {
        stop.store(true, Ordering::Relaxed);
    }
    match outcome? {
        Ok(fitted) => Ok(Calibration::new(fitted)),
        Err(problem) => Err(problem.raise(py)),
    }
}

/// Starts the fit; its thread ends at the next stage after `stop`.
fn start(request: Request, stop: &Arc<AtomicBool>) -> Result<Mutex<Receiver<Message>>, Problem> {
    let (send, receive): (Sender<Message>, _) = channel();
    let stop = Arc::clone(stop);
    let threads = request.config.file.inference.threads;
    let threads = threads.and_then(|count| usize::try_from(count).ok());
    let run = move || {
        let stages = Mutex::new(send.clone());
        let watch = |stage: Stage| {
            if stop.load(Ordering::Relaxed) {
                return Err(twincal::Error::Cancelled);
            }
            let send = stages.lock().unwrap_or_else(PoisonError::into_inner);
            // Nobody listens to a fit that was given up.
            send.send(Message::Stage(stage))
                .map_err(|_| twincal::Error::Cancelled)
        };
        let done = pool::work(threads, || request.fit(&watch));
        // Nobody listens to a fit that was given up.
        let _ = send.send(Message::Done(Box::new(done)));
    };
    let thread = std::thread::Builder::new()
        .name("twincal fit".into())
        .spawn(run);
    thread.map_err(|e| {
        let failure = Failure::usage(
            format!("cannot start a thread: {e}"),
            "raise the limit of processes (ulimit -u)",
        );
        Problem::from(failure)
    })?;
    Ok(Mutex::new(receive))
}

/// Hears what the fit says until it is done; Ctrl-C and exceptions of `progress` end it.
fn follow(
    py: Python<'_>,
    messages: &Mutex<Receiver<Message>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Result<Fitted, Problem>> {
    loop {
        let next = py.detach(|| {
            let messages = messages.lock().unwrap_or_else(PoisonError::into_inner);
            messages.recv_timeout(LOOK)
        });
        match next {
            Ok(Message::Done(result)) => return Ok(*result),
            Ok(Message::Stage(stage)) => {
                if let Some(progress) = progress {
                    progress.call1(words(stage))?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Ok(Err(Problem::Panicked("the thread of the fit ended".into())));
            }
        }
        py.check_signals()?;
    }
}

/// A stage for Python: its name, and how many of its parts are done of how many.
fn words(stage: Stage) -> (&'static str, usize, usize) {
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
    let fitted = pool::detached(py, None, || {
        let config = settings::config(keywords)?;
        let file = statistics.file.clone();
        Ok::<_, Problem>(Fitted::of_statistics(file, &config, &held_out)?)
    })?;
    Ok(Calibration::new(fitted))
}
