//! The steps of the program as functions, for programs that have arrays instead of files and want values instead of text.
//!
//! A fit from here and `twincal fit` run the same code (`Job` in `calibration`), so that the same files give the same result.

use super::calibration::{Job, command};
use super::inputs::{LogInput, Long, RobotInput};
use super::{fit, merge, replaced, run};
use crate::args::Arguments;
use crate::clock::Stopwatch;
use crate::failure::{Failure, Outcome};
use crate::interrupts;
use crate::names::display_names;
use crate::progress::{Progress, silently};
use crate::terminal::Terminal;
use clap::Parser as _;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use twincal::Finding;
use twincal::calibrate::{Plan, Stage, Statistics, plan};
use twincal::robot::Robot;
use twincal_io::artifact::{
    Artifact, Claim, Inputs, MODEL_MJCF, MODEL_URDF, Maker, RUN_LOG, sha256,
};
use twincal_io::config::{Config, Settings};
use twincal_io::log::{Column, read_columns};
use twincal_io::memory;
use twincal_io::model::parse_model;
use twincal_io::statistics::StatisticsFile;
use twincal_io::twin_json::StoredTwin;

/// A model as it was read, with what it was read from.
#[derive(Debug, Clone)]
pub struct ModelInput {
    input: RobotInput,
    path: PathBuf,
}

impl ModelInput {
    /// Reads a URDF or MJCF file as `[model]` of the config says.
    ///
    /// # Errors
    /// Those of the reader and of the settings.
    pub fn read(path: &Path, config: &Config) -> Outcome<Self> {
        Ok(Self {
            input: RobotInput::read(path, &config.settings()?)?,
            path: path.to_owned(),
        })
    }

    /// A model from its text; `name` stands in messages and results.
    ///
    /// # Errors
    /// Those of [`parse_model`] and of the settings.
    pub fn parse(name: &str, text: &str, config: &Config) -> Outcome<Self> {
        let settings = config.settings()?;
        let model = parse_model(name, text.as_bytes(), &settings.model)?;
        Ok(Self {
            input: RobotInput::new(model, name.to_owned(), &settings)?,
            path: name.into(),
        })
    }

    /// The robot.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.input.robot
    }

    /// What had to be assumed of the model.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.input.findings
    }

    /// What the file calls the robot; may be empty.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.input.name
    }
}

/// Where a log comes from.
#[derive(Debug, Clone)]
pub enum LogSource {
    /// A file or a folder of a bag, read as `[[log]]` and `[columns]` of the config say.
    File(PathBuf),
    /// Columns in memory, read as those of a table.
    Columns(Arc<Columns>),
}

/// Named columns.
#[derive(Debug)]
pub struct Columns {
    /// What results and messages call the log.
    pub name: String,
    /// Names, as a table has them in its first line.
    pub header: Vec<String>,
    /// What each of them holds.
    pub columns: Vec<Column>,
    /// SHA-256 of names and numbers, hexadecimal: logs with one checksum are copies.
    pub sha256: String,
}

impl Columns {
    /// With the checksum of what they hold.
    #[must_use]
    pub fn new(name: String, header: Vec<String>, columns: Vec<Column>) -> Self {
        let mut lines = header.join("\n");
        for column in columns.iter().filter_map(Column::numbers) {
            let bytes: Vec<u8> = column.iter().flat_map(|x| x.to_le_bytes()).collect();
            lines += &sha256(&bytes);
        }
        Self {
            sha256: sha256(lines.as_bytes()),
            name,
            header,
            columns,
        }
    }
}

impl LogSource {
    /// The log as it was given.
    #[must_use]
    pub fn given(&self) -> PathBuf {
        match self {
            Self::File(path) => path.clone(),
            Self::Columns(own) => own.name.clone().into(),
        }
    }
}

/// Robot, logs and settings of a fit.
#[derive(Debug)]
pub struct Request {
    /// The model.
    pub model: ModelInput,
    /// Settings; those of `[model]` are those that the model was read with.
    pub config: Config,
    /// Logs that are fitted.
    pub logs: Vec<LogSource>,
    /// Logs that are predicted and never fitted.
    pub heldout: Vec<LogSource>,
}

impl Request {
    /// Fits, as `twincal fit` does; `watch` hears of each stage and may end it with an error.
    ///
    /// # Errors
    /// Those of the program.
    pub fn fit(self, watch: &dyn Fn(Stage) -> twincal::Result<()>) -> Outcome<Fitted> {
        let stopwatch = Stopwatch::start();
        let settings = self.config.settings()?;
        if self.logs.is_empty() {
            return Err(Failure::usage("no log to fit", "give one log or more"));
        }
        let long = Long::of_settings(&settings);
        let robot = &self.model.input.robot;
        let logs = read(&self.logs, robot, &settings, long)?;
        let heldout = read(&self.heldout, robot, &settings, long)?;
        fit::every_log_once(&logs, &heldout)?;
        let given: Vec<PathBuf> = self.logs.iter().map(LogSource::given).collect();
        let held_out: Vec<PathBuf> = self.heldout.iter().map(LogSource::given).collect();
        let said = self.config.in_force();
        let mut job = Job {
            maker: Maker::Fit,
            command: command(&self.model.path, &given, &held_out, &said),
            config: &self.config,
            settings: &settings,
            robot: self.model.input.clone(),
            logs,
            statistics: None,
            heldout,
            output: Path::new(""),
            watch: stopwatch,
        };
        Fitted::of(&mut job, watch)
    }

    /// How these logs become statistics.
    ///
    /// # Errors
    /// Those of the program.
    pub fn plan(self) -> Outcome<Plan> {
        let settings = self.config.settings()?;
        let long = Long::of_settings(&settings);
        let robot = &self.model.input.robot;
        let mut logs = read(&self.logs, robot, &settings, long)?;
        let calibration = twincal::calibrate::CalibrationSettings {
            most_bytes: memory::spare(),
            ..settings.calibration
        };
        let own = std::mem::take(&mut logs.logs);
        let made = plan(robot, own, &calibration, &|_| {});
        let (plan, _) = made.map_err(|stopped| Failure::from(logs.as_given(stopped.error)))?;
        Ok(plan)
    }
}

/// Reads logs under the names that they have in results.
fn read(
    sources: &[LogSource],
    robot: &Robot,
    settings: &Settings,
    long: Long,
) -> Outcome<LogInput> {
    let progress = Progress::silent();
    let given: Vec<PathBuf> = sources.iter().map(LogSource::given).collect();
    let files = |source: &LogSource| matches!(source, LogSource::File(_));
    if sources.iter().all(files) {
        return LogInput::read(&given, robot, &settings.log, long, &progress);
    }
    let mut all = LogInput::of_files(&[], Vec::new());
    for (source, name) in sources.iter().zip(display_names(&given)) {
        match source {
            LogSource::File(path) => {
                let path = (path.as_path(), name.as_str());
                all.append(LogInput::read_one(
                    path,
                    robot,
                    &settings.log,
                    long,
                    &progress,
                )?);
            }
            LogSource::Columns(own) => {
                let options = settings.log.options(Path::new(&own.name));
                let (header, columns) = (&own.header, &own.columns);
                let log = read_columns(&own.name, header, columns, robot, &options)?;
                all.append(LogInput::of_recording(log, &own.sha256));
            }
        }
    }
    Ok(all)
}

/// A result as it lies in a folder, and the model file beside it.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The result.
    pub stored: StoredTwin,
    /// Name in the folder and bytes of the model file; none in folders without it.
    model: Option<(&'static str, Vec<u8>)>,
    run_log: String,
}

impl Fitted {
    fn of(job: &mut Job<'_>, watch: &dyn Fn(Stage) -> twincal::Result<()>) -> Outcome<Self> {
        let stored = job.result(watch).map_err(|ended| ended.failure)?;
        Ok(Self {
            run_log: job.run_log(&stored),
            model: Some(job.robot.source.clone()),
            stored,
        })
    }

    /// Fits statistics, as `twincal fit --statistics` does; `watch` as for [`Request::fit`].
    ///
    /// # Errors
    /// Those of the program.
    pub fn of_statistics(
        file: StatisticsFile,
        config: &Config,
        heldout: &[LogSource],
        watch: &dyn Fn(Stage) -> twincal::Result<()>,
    ) -> Outcome<Self> {
        let settings = config.settings()?;
        let robot = RobotInput::of_statistics(&file);
        let long = Long::of_pipeline(&file.statistics.plan.pipeline);
        let heldout = read(heldout, &robot.robot, &settings, long)?;
        for held_out in &heldout.files {
            let mut sources = file.statistics.sources();
            if sources.any(|source| source == held_out.sha256) {
                return Err(fit::fitted_and_held_out(&held_out.name));
            }
        }
        let mut job = Job {
            maker: Maker::Fit,
            command: "twincal fit --statistics".into(),
            config,
            settings: &settings,
            robot,
            logs: LogInput::of_files(&[], Vec::new()),
            statistics: Some(file.statistics),
            heldout,
            output: Path::new(""),
            watch: Stopwatch::start(),
        };
        Self::of(&mut job, watch)
    }

    /// Reads the folder of a result.
    ///
    /// # Errors
    /// A folder that holds none, a file that is damaged or of another version.
    pub fn load(folder: &Path) -> Outcome<Self> {
        let artifact = Artifact::open(folder)?;
        let stored = StoredTwin::read(&artifact, false)?;
        let kept = |name: &str| artifact.names().any(|own| own == name);
        let model = [MODEL_URDF, MODEL_MJCF].into_iter().find(|name| kept(name));
        let model = match model {
            Some(name) => Some((name, artifact.read(name)?)),
            None => None,
        };
        let run_log = match kept(RUN_LOG) {
            true => String::from_utf8_lossy(&artifact.read(RUN_LOG)?).into_owned(),
            false => String::new(),
        };
        Ok(Self {
            stored,
            model,
            run_log,
        })
    }

    /// Writes the folder, complete or not at all; with `force` an earlier result there is replaced.
    ///
    /// # Errors
    /// A folder that is there already, the system's refusal.
    pub fn save(&self, folder: &Path, force: bool) -> Outcome<()> {
        let claim = Claim::new(folder, replaced(force), &Inputs::default())?;
        let model = self.model.iter().cloned().collect();
        Ok((self.stored).write(claim, Maker::Fit, self.run_log.clone(), model)?)
    }
}

/// Statistics of one log under a plan.
///
/// # Errors
/// Those of `twincal statistics`.
pub fn statistics(
    model: &ModelInput,
    plan: &Plan,
    log: &LogSource,
    config: &Config,
) -> Outcome<StatisticsFile> {
    let settings = config.settings()?;
    let robot = &model.input.robot;
    let long = Long::of_pipeline(&plan.pipeline);
    let read = read(std::slice::from_ref(log), robot, &settings, long)?;
    let (Some(own), Some(file)) = (read.logs.first(), read.files.first()) else {
        return Err(Failure::usage("a log without samples", "leave it out"));
    };
    let named = (model.input.name.as_str(), robot);
    let statistics = Statistics::of(named, plan, own, &file.sha256);
    let statistics = statistics.map_err(|error| Failure::from(read.as_given(error)))?;
    let reading = settings.log.options(&log.given()).checksum();
    Ok(StatisticsFile {
        statistics: statistics.with_reading(reading, read.findings),
        model: model.input.model_file(),
    })
}

/// Sum of statistics of two sets of logs.
///
/// # Errors
/// Those of `twincal merge`.
pub fn merged(sum: &StatisticsFile, other: &StatisticsFile) -> Outcome<StatisticsFile> {
    let mut sum = sum.clone();
    merge::add(&mut sum, other, Path::new("statistics"))?;
    Ok(sum)
}

/// Runs work of one caller: it is not given up with what the same threads do for another one.
pub fn apart<T>(work: impl FnOnce() -> T) -> T {
    interrupts::called(None, work)
}

/// Runs a command of the program with these arguments, without its name, and returns exit code and what it would have
/// printed on standard output. It uses the threads of the pool that it is called in. Once `given_up` is true the command ends at
/// its next log or stage and writes nothing.
///
/// # Errors
/// Why the command could not do what it was asked; [`twincal::Error::Cancelled`] of one that was given up.
pub fn call(
    arguments: impl IntoIterator<Item = OsString>,
    given_up: &Arc<AtomicBool>,
) -> Outcome<(u8, String)> {
    let name = std::iter::once(OsString::from("twincal"));
    let arguments = Arguments::try_parse_from(name.chain(arguments)).map_err(|error| {
        Failure::usage(error.to_string(), "see `twincal help` for the arguments")
    })?;
    let mut terminal = Terminal::kept();
    let code = interrupts::called(Some(Arc::clone(given_up)), || {
        silently(|| run(&arguments.command, &mut terminal))
    })?;
    Ok((code, terminal.into_kept()))
}
