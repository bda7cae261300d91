//! `twincal statistics`: what a fit takes of each log, as a file that stands for it.

use super::calibration::show;
use super::inputs::{LogInput, Long, RobotInput, checksum_of_log};
use super::settings::{Look, Usual};
use super::{
    count_of_logs, merge, print_json, reads, require_strict, settings, start_threads, summary,
};
use crate::args::StatisticsFlags;
use crate::exit;
use crate::failure::{Failure, Outcome};
use crate::interrupts::require_caller;
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use serde::Serialize;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::calibrate::{About, CalibrationSettings, Plan, Statistics, plan_about};
use twincal::robot::Robot;
use twincal_io::artifact::{Inputs, OutputFile};
use twincal_io::config::Settings;
use twincal_io::memory;
use twincal_io::open::InputFile;
use twincal_io::statistics::StatisticsFile;
use twincal_io::{Error, Place};

/// Name of the plan in the folder, and ending of the files.
const PLAN: &str = "plan.json";
const ENDING: &str = "arrow";
/// Logs that a plan is made from at most.
const MOST_FOR_PLAN: usize = 12;
/// Longest plan, bytes.
const MAX_PLAN: u64 = 16 << 20;

/// What `--json` prints.
#[derive(Serialize)]
struct Made {
    directory: String,
    plan: String,
    robot: String,
    files: Vec<Entry>,
    findings: Vec<Finding>,
}

/// A log and its file.
#[derive(Serialize)]
struct Entry {
    log: String,
    file: String,
    /// False if it was there already.
    made: bool,
}

/// What all logs of a run share.
struct Road<'a> {
    flags: &'a StatisticsFlags,
    settings: &'a Settings,
    inputs: &'a Inputs,
    robot: RobotInput,
    robot_name: String,
    progress: Progress,
    findings: Vec<Finding>,
    /// The only log, if the plan was made of it: it is not read again.
    read: Option<LogInput>,
}

pub(super) fn run(flags: &StatisticsFlags, terminal: &mut Terminal) -> Outcome<u8> {
    let look = Look {
        model: &flags.model,
        allow: &flags.allow,
        log: &flags.log,
        usual: Usual::unless(flags.no_config),
    };
    let config = settings::of_look(&look, terminal)?;
    let settings = config.settings()?;
    let Some(model) = &settings.model_file else {
        return Err(super::no_model());
    };
    let mut inputs = Inputs::default();
    let given = reads::Given {
        flags: &flags.log,
        config: &config,
        settings: &settings,
    };
    reads::add_given(&mut inputs, &given, &flags.logs);
    start_threads(settings.threads)?;
    let progress = Progress::new();
    progress.step(&format!("reading {}", model.to_string_lossy()));
    let robot = RobotInput::read(model, &settings)?;
    let named = flags.robot.clone().filter(|name| !name.is_empty());
    let mut road = Road {
        flags,
        settings: &settings,
        inputs: &inputs,
        robot_name: named.unwrap_or_else(|| robot.name.clone()),
        findings: robot.findings.clone(),
        robot,
        progress,
        read: None,
    };
    road.require_folder()?;
    let plan = road.plan()?;
    let files = road.logs(&plan)?;
    let Road {
        robot_name,
        progress,
        findings,
        ..
    } = road;
    drop(progress);
    let code = exit::of_findings(&findings);
    let made = Made {
        directory: flags.output.to_string_lossy().into_owned(),
        plan: flags.output.join(PLAN).to_string_lossy().into_owned(),
        robot: robot_name,
        files,
        findings,
    };
    if settings.json {
        print_json(terminal, &made)?;
    } else {
        made.say(terminal);
    }
    Ok(code)
}

impl Made {
    /// How many files were made, and where.
    fn say(&self, terminal: &mut Terminal) {
        summary::before_the_error(&self.findings, terminal);
        let made = self.files.iter().filter(|file| file.made).count();
        let there = match self.files.len() - made {
            0 => String::new(),
            count => format!(", {count} there already"),
        };
        terminal.say(&format!(
            "statistics of {} of robot `{}` made{there}",
            count_of_logs(made),
            self.robot
        ));
        terminal.say(&self.directory);
    }
}

impl Road<'_> {
    /// A folder to write in, which is made if it is not there.
    fn require_folder(&self) -> Outcome<()> {
        let folder = &self.flags.output;
        std::fs::create_dir_all(folder).map_err(|e| {
            let remedy = "give a folder that you may write in with -o";
            Error::system(folder.to_string_lossy(), "make", &e, remedy).into()
        })
    }

    /// The plan that was given, that of the folder, or a new one.
    fn plan(&mut self) -> Outcome<Plan> {
        let own = self.flags.output.join(PLAN);
        let about = match self.flags.plan.to_str() {
            Some("auto") => Some(About::Model),
            Some("fleet") => Some(About::Found),
            _ => None,
        };
        let given = about.is_none();
        let there = own.symlink_metadata().is_ok();
        let plan = match (given, there) {
            (true, _) => read_plan(&self.flags.plan, &self.robot.robot)?,
            (false, true) => {
                self.progress
                    .step(&format!("using the plan {}", own.to_string_lossy()));
                return read_plan(&own, &self.robot.robot);
            }
            (false, false) => self.new_plan(about.unwrap_or_default())?,
        };
        if given && there {
            if read_plan(&own, &self.robot.robot)? != plan {
                return Err(Failure::usage(
                    format!("{} holds another plan", self.flags.output.to_string_lossy()),
                    "give another folder with -o: statistics of two plans do not add",
                ));
            }
            return Ok(plan);
        }
        self.write_plan(&own, &plan)?;
        Ok(plan)
    }

    fn new_plan(&mut self, about: About) -> Outcome<Plan> {
        let logs = &self.flags.logs;
        let step = logs.len().div_ceil(MOST_FOR_PLAN);
        let some: Vec<PathBuf> = logs.iter().step_by(step).cloned().collect();
        let long = Long::of_settings(self.settings);
        let (robot, log) = (&self.robot.robot, &self.settings.log);
        let mut read = LogInput::read(&some, robot, log, long, &self.progress)?;
        let settings = CalibrationSettings {
            most_bytes: memory::spare(),
            ..self.settings.calibration.clone()
        };
        let step = |stage| show(stage, "", &self.progress);
        let only = self.flags.logs.len() == 1;
        let made = match only {
            true => plan_about(about, robot, &read.logs[..], &settings, &step),
            false => plan_about(
                about,
                robot,
                std::mem::take(&mut read.logs),
                &settings,
                &step,
            ),
        };
        let (plan, findings) =
            made.map_err(|stopped| Failure::from(read.as_given(stopped.error)))?;
        self.findings.extend(findings);
        self.read = only.then_some(read);
        Ok(plan)
    }

    fn write_plan(&self, path: &Path, plan: &Plan) -> Outcome<()> {
        let mut text = serde_json::to_string_pretty(plan).map_err(|e| Error::Internal {
            what: "a plan as JSON".into(),
            problem: e.to_string(),
        })?;
        text.push('\n');
        let mut output = OutputFile::create(path, false, self.inputs)?;
        let written = match output.file() {
            Some(file) => file.write_all(text.as_bytes()),
            None => Ok(()),
        };
        require_caller()?;
        Ok(output.commit(written)?)
    }

    /// The files of all logs, made where they are not there.
    fn logs(&mut self, plan: &Plan) -> Outcome<Vec<Entry>> {
        let flags = self.flags;
        let names = display_names(&flags.logs);
        (flags.logs.iter().zip(&names))
            .map(|(path, name)| self.log(plan, (path, name)))
            .collect()
    }

    /// Makes the file of a log, if it is not there.
    fn log(&mut self, plan: &Plan, (path, name): (&Path, &str)) -> Outcome<Entry> {
        require_caller()?;
        let target = self.flags.output.join(file_name(name));
        let entry = |made| Entry {
            log: name.to_owned(),
            file: target.to_string_lossy().into_owned(),
            made,
        };
        if !self.flags.force && target.symlink_metadata().is_ok() {
            self.require_kept(plan, &target, (path, name))?;
            return Ok(entry(false));
        }
        let long = Long::of_pipeline(&plan.pipeline);
        let (robot, settings) = (&self.robot.robot, &self.settings.log);
        let read = match self.read.take() {
            Some(read) => read,
            None => LogInput::read_one((path, name), robot, settings, long, &self.progress)?,
        };
        self.findings.extend(read.findings.iter().cloned());
        require_strict(settings.strict, &read.findings)?;
        let output = OutputFile::create(&target, self.flags.force, self.inputs)?;
        let (Some(log), Some(file)) = (read.logs.first(), read.files.first()) else {
            return Err(Failure::usage(
                format!("`{name}` holds no log"),
                "leave it out",
            ));
        };
        let model = (self.robot_name.as_str(), robot);
        let statistics = Statistics::of(model, plan, log, &file.sha256);
        let statistics = statistics.map_err(|error| Failure::from(read.as_given(error)))?;
        let file = StatisticsFile {
            statistics: statistics.with_reading(self.reading(path), read.findings),
            model: self.robot.model_file(),
        };
        merge::write(output, |to| file.write_to(to))?;
        Ok(entry(true))
    }

    /// Checksum of how a log is read.
    fn reading(&self, path: &Path) -> String {
        self.settings.log.options(path).checksum()
    }

    /// Refuses a file that another run made of another log, or otherwise.
    fn require_kept(&self, plan: &Plan, target: &Path, (path, name): (&Path, &str)) -> Outcome<()> {
        let known = StatisticsFile::read(target)?.statistics;
        let (robot, source) = (&self.robot.robot, checksum_of_log(path)?);
        let other = if known.plan != *plan {
            "of another plan"
        } else if known.robot != *robot || known.robot_name != self.robot_name {
            "of another robot"
        } else if !known.log_names().eq([name]) || !known.sources().eq([source.as_str()]) {
            "of another log"
        } else if !known.readings().eq([self.reading(path)]) {
            "of the log as other settings read it ([columns], [[log]], --rate, --lenient)"
        } else {
            return Ok(());
        };
        Err(Failure::usage(
            format!("{} is there, {other}", target.to_string_lossy()),
            "make it anew with --force, or give another folder with -o",
        ))
    }
}

/// A plan for this robot that was written before.
fn read_plan(path: &Path, robot: &Robot) -> Outcome<Plan> {
    let name = path.to_string_lossy().into_owned();
    let remedy = "give a plan that this version of `twincal statistics` wrote; of the folder's own one, remove it with its \
                  statistics or give another folder with -o";
    let bytes = InputFile::new(path, MAX_PLAN)
        .read()
        .map_err(|refusal| refusal.into_error(&name, remedy))?;
    let plan: Plan = serde_json::from_slice(&bytes).map_err(|e| {
        let problem = format!("is no plan: {e}");
        Error::content(Place::file(&name), problem, remedy)
    })?;
    plan.require_for(robot).map_err(|error| {
        let problem = format!("{name}: {error}");
        Failure::usage(
            problem,
            "give another folder with -o, or remove the plan and its statistics",
        )
    })?;
    Ok(plan)
}

/// A log's name as that of a file in one folder.
fn file_name(log: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_.=+@".contains(c) {
            c
        } else {
            '_'
        }
    };
    let mut name: String = log.chars().map(plain).collect();
    if name.starts_with('.') {
        name.insert(0, '_');
    }
    format!("{name}.{ENDING}")
}

#[cfg(test)]
mod tests {
    use super::file_name;

    #[test]
    fn names_of_files_stay_in_the_folder() {
        assert_eq!(file_name("run 1.csv"), "run_1.csv.arrow");
        assert_eq!(file_name("../day/run.mcap"), "_.._day_run.mcap.arrow");
    }
}
