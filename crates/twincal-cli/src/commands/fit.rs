//! `twincal fit`: from logs and a model to a calibrated twin.

use super::calibration::{Job, command, say_where};
use super::inputs::{LogInput, RobotInput};
use super::{settings, start_threads};
use crate::args::Fit;
use crate::clock::Stopwatch;
use crate::failure::{Failure, Outcome};
use crate::progress::Progress;
use crate::terminal::Terminal;
use twincal_io::artifact::{Claim, Maker, Replace};

pub(super) fn run(flags: &Fit, terminal: &mut Terminal) -> Outcome<u8> {
    let watch = Stopwatch::start();
    let config = settings::of_fit(flags, terminal)?;
    let settings = config.settings()?;
    let named = settings.log.named();
    let given = if flags.logs.is_empty() {
        &named
    } else {
        &flags.logs
    };
    if given.is_empty() {
        return Err(Failure::usage(
            "no log",
            "give logs, as in `twincal fit run.csv --model arm.urdf`, or [[log]] entries in the config",
        ));
    }
    let Some(model) = &settings.model_file else {
        return Err(super::no_model());
    };
    let claim = Claim::new(
        &settings.output,
        if settings.force {
            Replace::Artifact
        } else {
            Replace::Never
        },
    )?;
    start_threads(settings.threads)?;
    let progress = Progress::new();
    progress.step(&format!("reading {}", model.to_string_lossy()));
    let robot = RobotInput::read(model, &settings)?;
    let terms = super::inputs::terms_at_most(&robot.robot, &settings);
    let logs = LogInput::read(given, &robot.robot, &settings.log, terms, &progress)?;
    let heldout = LogInput::read(
        &settings.log.heldout,
        &robot.robot,
        &settings.log,
        terms,
        &progress,
    )?;
    let command = command(model, given, &settings.log.heldout, &config.in_force());
    let job = Job {
        maker: Maker::Fit,
        command,
        config: &config,
        settings: &settings,
        robot,
        logs,
        heldout,
        watch,
    };
    let code = job.run(claim, Vec::new(), progress, terminal)?;
    say_where(&settings.output, settings.json, terminal);
    Ok(code)
}
