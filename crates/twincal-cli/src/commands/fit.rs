//! `twincal fit`: from logs and a model to a calibrated twin.

use super::brief::{Around, Typed};
use super::calibration::{Job, Print, command, quoted, say_where, with_heldout};
use super::inputs::{LogInput, Long, RobotInput};
use super::open::open;
use super::{merge, reads, replaced, settings, start_threads};
use crate::args::{Fit, PrintFlags};
use crate::clock::Stopwatch;
use crate::failure::{Failure, Outcome};
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use std::collections::BTreeSet;
use std::path::PathBuf;
use twincal_io::artifact::{Claim, Inputs, Maker, REPORT};
use twincal_io::config::{Config, Settings};

pub(super) fn run(flags: &Fit, terminal: &mut Terminal) -> Outcome<u8> {
    let watch = Stopwatch::start();
    let config = settings::of_fit(flags, terminal)?;
    let settings = config.settings()?;
    if !flags.statistics.is_empty() {
        return of_statistics(flags, &config, &settings, watch, terminal);
    }
    let named = settings.log.named();
    let given = logs_to_fit(flags, &named)?;
    let Some(model) = &settings.model_file else {
        return Err(super::no_model());
    };
    let claim = claimed(flags, &config, &settings, given)?;
    start_threads(settings.threads)?;
    let progress = Print::of(flags.print, settings.json).progress();
    progress.step(&format!("reading {}", model.to_string_lossy()));
    let robot = RobotInput::read(model, &settings)?;
    let long = Long::of_settings(&settings);
    let read =
        |paths: &[PathBuf]| LogInput::read(paths, &robot.robot, &settings.log, long, &progress);
    let (logs, heldout) = (read(given)?, read(&settings.log.heldout)?);
    every_log_once(&logs, &heldout)?;
    let command = command(model, given, &settings.log.heldout, &config.in_force());
    let typed = Typed {
        model,
        logs: given,
        heldout: &settings.log.heldout,
    };
    let job = Job {
        maker: Maker::Fit,
        command,
        config: &config,
        settings: &settings,
        robot,
        logs,
        statistics: None,
        heldout,
        output: &settings.output,
        watch,
    };
    let progress = (flags.print, progress);
    // With a config or a flag beside the paths another command says something else.
    let plain = flags.log.config.is_none() && flags.log.rate.is_none() && !flags.log.lenient;
    let typed = (plain && !flags.logs.is_empty()).then_some(typed);
    finish((job, typed), claim, progress, terminal)
}

/// The logs of the command, or those of the config.
fn logs_to_fit<'a>(flags: &'a Fit, named: &'a [PathBuf]) -> Outcome<&'a [PathBuf]> {
    let given = if flags.logs.is_empty() {
        named
    } else {
        &flags.logs
    };
    if given.is_empty() {
        let remedy = if flags.heldout.is_empty() {
            "give logs, as in `twincal fit run.csv --model arm.urdf`, or [[log]] entries in the config"
        } else {
            "--heldout takes every path behind it: put the logs to fit before it"
        };
        return Err(Failure::usage("no log to fit", remedy));
    }
    Ok(given)
}

/// The folder of the result, which none of the inputs is in; `files` are logs, or statistics of logs.
fn claimed(flags: &Fit, config: &Config, settings: &Settings, files: &[PathBuf]) -> Outcome<Claim> {
    let mut inputs = Inputs::default();
    let given = reads::Given {
        flags: &flags.log,
        config,
        settings,
    };
    reads::add_given(&mut inputs, &given, files);
    let replace = replaced(settings.force);
    Ok(Claim::new(&settings.output, replace, &inputs)?)
}

/// Runs the calibration, prints it and opens its report.
fn finish(
    (job, typed): (Job<'_>, Option<Typed<'_>>),
    claim: Claim,
    (flags, progress): (PrintFlags, Progress),
    terminal: &mut Terminal,
) -> Outcome<u8> {
    let (output, print) = (job.output, Print::of(flags, job.settings.json));
    let done = job.run(claim, Vec::new(), progress, terminal)?;
    let around = Around {
        typed,
        ..done.around(output)
    };
    done.print(print, around, terminal)?;
    say_where(output, print, terminal);
    if flags.open {
        open(&output.join(REPORT), terminal);
    }
    Ok(done.code)
}

/// From statistics of logs to a calibrated twin.
fn of_statistics(
    flags: &Fit,
    config: &Config,
    settings: &Settings,
    watch: Stopwatch,
    terminal: &mut Terminal,
) -> Outcome<u8> {
    let claim = claimed(flags, config, settings, &flags.statistics)?;
    start_threads(settings.threads)?;
    let progress = Print::of(flags.print, settings.json).progress();
    let (file, hashes) = merge::read(&flags.statistics, &progress)?;
    let robot = RobotInput::of_statistics(&file);
    let long = Long::of_pipeline(&file.statistics.plan.pipeline);
    let paths = &settings.log.heldout;
    let heldout = LogInput::read(paths, &robot.robot, &settings.log, long, &progress)?;
    for held_out in &heldout.files {
        let mut sources = file.statistics.sources();
        if sources.any(|source| source == held_out.sha256) {
            return Err(fitted_and_held_out(&held_out.name));
        }
    }
    let mut command = "twincal fit --statistics".to_owned();
    for name in display_names(&flags.statistics) {
        command.push(' ');
        command.push_str(&quoted(&name));
    }
    let job = Job {
        maker: Maker::Fit,
        command: with_heldout(command, paths, &config.in_force()),
        config,
        settings,
        robot,
        logs: LogInput::of_files(&flags.statistics, hashes),
        statistics: Some(file.statistics),
        heldout,
        output: &settings.output,
        watch,
    };
    let progress = (flags.print, progress);
    finish((job, None), claim, progress, terminal)
}

pub(super) fn fitted_and_held_out(name: &str) -> Failure {
    Failure::usage(
        format!("`{name}` is fitted and held out"),
        "hold out a log that the fit does not see, or leave --heldout away",
    )
}

/// A log that is fitted says nothing of what was not, and counts for one experiment only.
pub(super) fn every_log_once(logs: &LogInput, heldout: &LogInput) -> Outcome<()> {
    let fitted: BTreeSet<&str> = logs.files.iter().map(|file| file.sha256.as_str()).collect();
    for files in [&heldout.files, &logs.files] {
        let mut seen = BTreeSet::new();
        for file in files {
            if std::ptr::eq(files, &heldout.files) && fitted.contains(file.sha256.as_str()) {
                return Err(fitted_and_held_out(&file.name));
            }
            if !seen.insert(&file.sha256) {
                return Err(twice(&file.name));
            }
        }
    }
    Ok(())
}

fn twice(name: &str) -> Failure {
    Failure::usage(
        format!("`{name}` has the same bytes as another log"),
        "give every log once: copies would count as experiments of their own",
    )
}
