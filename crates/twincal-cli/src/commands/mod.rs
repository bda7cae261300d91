//! The commands, one file each, and what they share.

mod as_fitted;
mod brief;
mod calibration;
mod check;
mod checkup;
mod demo;
mod design;
mod diff;
mod doctor;
mod export;
mod fit;
mod fleet;
mod inputs;
mod inspect;
mod merge;
mod not_kept;
mod open;
mod predict;
mod reads;
mod report;
pub mod session;
mod settings;
mod statistics;
mod summary;
mod table;
mod verdict;

use crate::args::{Command, Described};
use crate::failure::{Failure, Outcome};
use crate::terminal::Terminal;
use serde::Serialize;
use twincal::{Finding, Severity};
use twincal_io::artifact::Replace;

pub(crate) use summary::wrapped;

/// Runs one command; the number is the exit code.
pub(crate) fn run(command: &Command, terminal: &mut Terminal) -> Outcome<u8> {
    match command {
        Command::Demo(flags) => demo::run(flags, terminal),
        Command::Inspect(flags) => inspect::run(flags, terminal),
        Command::Doctor(flags) => doctor::run(flags, terminal),
        Command::Init(flags) => doctor::init(flags, terminal),
        Command::Fit(flags) => fit::run(flags, terminal),
        Command::Statistics(flags) => statistics::run(flags, terminal),
        Command::Merge(flags) => merge::run(flags, terminal),
        Command::Fleet(flags) => fleet::run(flags, terminal),
        Command::Design(flags) => design::run(flags, terminal),
        Command::Check(flags) => check::run(flags, terminal),
        Command::Predict(flags) => predict::run(flags, terminal),
        Command::Diff(flags) => diff::run(flags, terminal),
        Command::Export(flags) => export::run(flags, terminal),
        Command::Report(flags) => report::run(flags, terminal),
        Command::Completions(flags) => {
            let script = crate::args::completions(flags.shell);
            terminal.data(&String::from_utf8_lossy(&script));
            Ok(0)
        }
        Command::Schema(flags) => {
            terminal.data(&match flags.of {
                Described::Config => twincal_io::config::schema(),
                Described::Limits => twincal_io::design::limits_schema(),
                Described::Design => twincal_io::design::design_schema(),
            });
            Ok(0)
        }
    }
}

/// Starts this many threads, or one per core; a program that called the command has its own.
fn start_threads(threads: Option<usize>) -> Outcome<()> {
    if rayon::current_thread_index().is_some() {
        return Ok(()); // those of the program that calls
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build_global()
        .map_err(|e| {
            Failure::usage(
                format!("cannot start the threads: {e}"),
                "give fewer with --threads, or raise the limits of memory (ulimit -v) and processes (ulimit -u)",
            )
        })
}

/// What a result may take the place of: with --force an earlier one.
fn replaced(force: bool) -> Replace {
    match force {
        true => Replace::Artifact,
        false => Replace::Never,
    }
}

/// "1 log", "2 logs".
fn count_of_logs(count: usize) -> String {
    match count {
        1 => "1 log".into(),
        n => format!("{n} logs"),
    }
}

/// Prints a value as JSON.
fn print_json(terminal: &mut Terminal, value: &impl Serialize) -> Outcome<()> {
    let text = serde_json::to_string_pretty(value).map_err(|e| {
        let error = twincal_io::Error::Internal {
            what: "JSON output".into(),
            problem: e.to_string(),
        };
        Failure::Error(error)
    })?;
    terminal.data(&text);
    terminal.data("\n");
    Ok(())
}

/// No model by flag, config or argument.
fn no_model() -> Failure {
    Failure::usage(
        "no robot model",
        "give --model arm.urdf, or `file` in [model] of the config",
    )
}

/// With `--strict`, degraded data is an error.
fn require_strict(strict: bool, findings: &[Finding]) -> Outcome<()> {
    match findings
        .iter()
        .find(|finding| strict && finding.severity == Severity::Degraded)
    {
        Some(finding) => Err(Failure::usage(
            finding.message.clone(),
            "fix the log, or leave out --strict to go on",
        )),
        None => Ok(()),
    }
}
