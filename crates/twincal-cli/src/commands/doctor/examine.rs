//! Everything that can be said of logs and a model before a fit, also of logs that `fit` refuses.

use super::super::calibration::show;
use super::super::checkup::{Checkup, checkup};
use super::super::inputs::{LogInput, Long, RobotInput};
use super::units::{Degrees, converted};
use crate::failure::{Failure, Outcome};
use crate::progress::Progress;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use twincal::calibrate::{
    Calibration, CalibrationSettings, ComponentSummary, Outlook, Status, calibrate, outlook,
};
use twincal::robot::Robot;
use twincal::signal::{
    Auto, Chosen, Log, LogOverview, Pipeline, Steps, choose_and_prepare, constant_torque, describe,
    hardly_driven, steps,
};
use twincal::words::{listed, quoted};
use twincal::{Code, Finding};
use twincal_io::config::{Settings, TimeUnit};
use twincal_io::log::{
    LogOptions, Preset, TorqueSource, joints_without_column, match_columns, read_header,
};
use twincal_io::memory;

/// Mistakes in units that are repaired one after the other: of time, of position, of velocity.
const MISTAKES: usize = 3;

/// Why `fit` would stop.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Refusal {
    pub(super) problem: String,
    pub(super) remedy: String,
    /// Exit code of `fit`.
    pub(super) exit_code: u8,
    /// The unit of the log's time with which `fit` would go on.
    #[serde(skip)]
    pub(super) time_unit: Option<TimeUnit>,
    /// What makes radians of the log, for `fit` to go on.
    #[serde(skip)]
    pub(super) degrees: Option<Degrees>,
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        let exit_code = failure.exit_code();
        let (problem, remedy) = failure.words();
        Self {
            problem,
            remedy: remedy.unwrap_or_default(),
            exit_code,
            time_unit: None,
            degrees: None,
        }
    }
}

/// Which column became which channel.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Mapping {
    pub(super) time: Option<String>,
    /// What the torque columns are taken as.
    pub(super) torque: &'static str,
    pub(super) joints: Vec<JointColumns>,
    /// Columns that mean nothing to twincal.
    pub(super) unused: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub(super) struct JointColumns {
    pub(super) joint: String,
    pub(super) position: Option<String>,
    pub(super) velocity: Option<String>,
    pub(super) acceleration: Option<String>,
    pub(super) torque: Option<String>,
}

/// The examination.
pub(super) struct Examination {
    pub(super) robot: RobotInput,
    pub(super) refusals: Vec<Refusal>,
    /// By log; absent for what is no table.
    pub(super) mappings: Vec<(String, Mapping)>,
    /// Joints without a column, taken to stand still.
    pub(super) locked: BTreeMap<String, f64>,
    /// What was converted for the look, in words.
    pub(super) converted: Vec<String>,
    pub(super) overviews: Vec<LogOverview>,
    pub(super) steps: Vec<Vec<Steps>>,
    pub(super) pipeline: Option<Pipeline>,
    /// Where a coarse encoder does less harm and a fit finds no less, Hz.
    pub(super) lower_cutoff: Option<f64>,
    pub(super) checkup: Checkup,
    pub(super) outlook: Option<Outlook>,
    pub(super) findings: Vec<Finding>,
}

/// Whether the fit is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trial {
    /// As far as log and model go together; it takes as long as the fit.
    Fit,
    /// No.
    None,
}

/// Reads and looks; what `fit` would refuse becomes a [`Refusal`], and as much as possible is said all the same.
pub(super) fn examine(
    model: &Path,
    paths: &[PathBuf],
    settings: &Settings,
    progress: &Progress,
    trial: Trial,
) -> Outcome<Examination> {
    progress.step(&format!("reading {}", model.to_string_lossy()));
    let mut settings = settings.clone();
    let robot = RobotInput::read(model, &settings)?;
    let mut all = Examination {
        robot,
        refusals: Vec::new(),
        mappings: Vec::new(),
        locked: BTreeMap::new(),
        converted: Vec::new(),
        overviews: Vec::new(),
        steps: Vec::new(),
        pipeline: None,
        lower_cutoff: None,
        checkup: Checkup::default(),
        outlook: None,
        findings: Vec::new(),
    };
    all.lock_what_is_not_logged(model, paths, &mut settings)?;
    all.map_columns(paths, &settings);
    let robot = &all.robot.robot;
    let long = Long::of_settings(&settings);
    let read = LogInput::read(paths, robot, &settings.log, long, progress);
    all.findings.append(&mut all.robot.findings);
    let mut logs = match read {
        Ok(logs) => logs,
        Err(failure) => {
            all.refusals.push(failure.into());
            return Ok(all);
        }
    };
    all.findings.append(&mut logs.findings);
    progress.step("comparing logs and model");
    all.look(&mut logs, &settings);
    if trial == Trial::Fit && all.refusals.is_empty() {
        all.try_fit(&logs, &settings.calibration, progress);
    }
    let mut said: Vec<Finding> = Vec::with_capacity(all.findings.len());
    for finding in std::mem::take(&mut all.findings) {
        if !said.contains(&finding) {
            said.push(finding);
        }
    }
    all.findings = said;
    Ok(all)
}

impl Examination {
    /// Joints for which no log has a position are locked at 0 for the look, as the config would have to say.
    fn lock_what_is_not_logged(
        &mut self,
        model: &Path,
        paths: &[PathBuf],
        settings: &mut Settings,
    ) -> Outcome<()> {
        let mut missing: Vec<String> = Vec::new();
        for path in paths {
            let Ok(Some(header)) = read_header(path) else {
                continue;
            };
            let (name, options) = (path.to_string_lossy(), settings.log.options(path));
            let lacks = joints_without_column(&name, &header, &self.robot.robot, &options);
            missing.extend(lacks);
        }
        missing.sort_unstable();
        missing.dedup();
        if missing.is_empty() || missing.len() >= self.robot.robot.dof() {
            return Ok(());
        }
        let locked = missing.iter().map(|joint| (joint.clone(), 0.0));
        self.locked = locked.collect();
        settings.locked.extend(self.locked.clone());
        self.robot = RobotInput::read(model, settings)?;
        let entries: Vec<String> = missing
            .iter()
            .map(|joint| format!("{joint} = 0.0"))
            .collect();
        self.refusals.push(Refusal {
            problem: format!(
                "the log has no position for {} moving joints of the model: {}",
                missing.len(),
                quoted(&missing)
            ),
            remedy: format!(
                "where they are at rest, say so: [model] locked = {{ {} }}; here they are taken to be",
                listed(&entries, ", ")
            ),
            exit_code: crate::failure::INPUT,
            time_unit: None,
            degrees: None,
        });
        Ok(())
    }

    fn map_columns(&mut self, paths: &[PathBuf], settings: &Settings) {
        let names = crate::names::display_names(paths);
        for (path, name) in paths.iter().zip(names) {
            let Ok(Some(header)) = read_header(path) else {
                continue;
            };
            let given = path.to_string_lossy();
            let options = settings.log.options(path);
            let Ok(selection) = match_columns(&given, &header, &self.robot.robot, &options) else {
                continue;
            };
            let used = selection.file_columns();
            let joints = self.robot.robot.joint_names();
            let joints = joints.iter().zip(&selection.joints);
            let mapping = Mapping {
                time: selection.time.as_ref().map(|column| column.name.clone()),
                torque: taken_as(&options),
                joints: joints
                    .map(|(joint, channels)| {
                        let [position, velocity, acceleration, torque] = channels
                            .each_ref()
                            .map(|column| column.as_ref().map(|column| column.name.clone()));
                        JointColumns {
                            joint: (*joint).to_owned(),
                            position,
                            velocity,
                            acceleration,
                            torque,
                        }
                    })
                    .collect(),
                unused: (header.iter().enumerate())
                    .filter(|(index, name)| !used.contains(index) && !name.is_empty())
                    .map(|(_, name)| name.clone())
                    .collect(),
            };
            self.mappings.push((name, mapping));
        }
    }

    /// The unit of time that would make `fit` take all of `logs`: of tables whose clock nothing else is said of.
    pub(super) fn time_unit(&self, logs: usize, settings: &Settings) -> Option<TimeUnit> {
        let log = &settings.log;
        let rates = log.entries.iter().map(|entry| entry.rate_hz);
        let presets = log.entries.iter().map(|entry| entry.form.preset);
        if log.columns.time_unit.is_some()
            || rates.chain([log.rate_hz]).any(|rate| rate.is_some())
            || presets
                .chain([log.form.preset])
                .any(|preset| preset.is_some())
            || self.mappings.len() < logs
        {
            return None;
        }
        let units: Vec<TimeUnit> = self.refusals.iter().filter_map(|r| r.time_unit).collect();
        let first = *units.first()?;
        (units.len() == logs && units.iter().all(|unit| *unit == first)).then_some(first)
    }

    /// What makes radians of the numbers of all of `logs`.
    pub(super) fn degrees(&self, logs: usize) -> Option<&Degrees> {
        let all: Vec<&Degrees> = (self.refusals.iter())
            .filter_map(|refusal| refusal.degrees.as_ref())
            .collect();
        let first = *all.first()?;
        (all.len() == logs && all.iter().all(|own| *own == first)).then_some(first)
    }

    /// Overviews, filters, comparison and outlook, as far as each of them goes.
    fn look(&mut self, logs: &mut LogInput, settings: &Settings) {
        let mut together = filtered(&self.robot.robot, &logs.logs, settings);
        if together.is_err() {
            // Which of them it is, and whether other units help.
            let all = logs.logs.iter_mut();
            all.for_each(|log| self.repair(log, settings));
            let robot = &self.robot.robot;
            (logs.logs).retain(|log| describe(robot, log).is_ok());
            together = filtered(robot, &logs.logs, settings);
        }
        let logs = &logs.logs[..];
        self.say_what_was_logged(logs);
        let (pipeline, more, mut checkup) = match together {
            Ok(filtered) => filtered,
            Err(error) => {
                if self.refusals.is_empty() {
                    self.refusals.push(Failure::from(error).into());
                }
                return;
            }
        };
        self.findings.extend(more);
        self.findings.append(&mut checkup.findings);
        let aligned = Some((&pipeline, checkup.looked_at(logs)));
        match outlook(&self.robot.robot, &settings.calibration.library, aligned) {
            Ok(outlook) => {
                self.findings.extend(outlook.findings.iter().cloned());
                self.outlook = Some(outlook);
            }
            Err(error) => self.refusals.push(Failure::from(error).into()),
        }
        let segments = checkup.trajectories.iter().flat_map(|t| &t.segments);
        let kept: Vec<f64> = segments
            .map(|segment| pipeline.kept_rate(segment.interval))
            .collect();
        self.checkup = checkup;
        self.pipeline = Some(Pipeline {
            rate_hz: pipeline.common_rate(kept),
            ..pipeline
        });
    }

    /// Why a log is refused, and the log in other units where those help.
    fn repair(&mut self, log: &mut Log<'static>, settings: &Settings) {
        let robot = &self.robot.robot;
        for _ in 0..MISTAKES {
            let Err(error) = filtered(robot, std::slice::from_ref(log), settings) else {
                break;
            };
            // A log in which nothing moves may still be one of several.
            if matches!(error, twincal::Error::Refused { .. }) {
                break;
            }
            let mut refusal = Refusal::from(Failure::from(error.clone()));
            let Some(repaired) = converted(robot, log, &error, settings) else {
                self.refusals.push(refusal);
                break;
            };
            self.converted.push(repaired.words);
            refusal.time_unit = repaired.time;
            refusal.degrees = repaired.degrees;
            *log = repaired.log;
            self.refusals.push(refusal);
        }
    }

    /// What logs hold, before any filter.
    fn say_what_was_logged(&mut self, logs: &[Log<'_>]) {
        let robot = &self.robot.robot;
        let names = robot.joint_names();
        for log in logs {
            let with_torque = log.any_recording(|recording| recording.require_torque(&names));
            if let Err(error) = with_torque {
                self.refusals.push(Failure::from(error).into());
            }
        }
        for log in logs {
            let seen = describe(robot, log).and_then(|seen| Ok((seen, steps(robot, log)?)));
            if let Ok(((overview, more), steps)) = seen {
                self.overviews.push(overview);
                self.steps.push(steps);
                self.findings.extend(more);
            }
        }
        for said in [hardly_driven(robot, logs), constant_torque(robot, logs)] {
            match said {
                Ok(said) => self.findings.extend(said),
                Err(error) => self.refusals.push(Failure::from(error).into()),
            }
        }
    }

    /// Fits: what only a fit can tell (rows that count as too few) is a reason to stop as well. A lower cut-off is advised if
    /// a fit goes on there and still finds what it does without.
    fn try_fit(&mut self, logs: &LogInput, settings: &CalibrationSettings, progress: &Progress) {
        let robot = &self.robot.robot;
        let fit = |settings: &CalibrationSettings, trial: &str| {
            let told = |stage| show(stage, &format!("{trial}: "), progress);
            let settings = CalibrationSettings {
                most_bytes: memory::spare(),
                ..settings.clone()
            };
            let logs: Vec<Log<'_>> = logs.logs.iter().map(Log::lent).collect();
            calibrate(robot, logs, Vec::<Log<'_>>::new(), &settings, &told)
        };
        match fit(settings, "trying the fit") {
            Err(stopped) => {
                let error = logs.as_given(stopped.error);
                self.refusals.push(Failure::from(error).into());
            }
            Ok(fitted) => {
                let used = &fitted.twin.pipeline;
                if let Some(own) = &mut self.pipeline
                    && own.cutoff_hz != used.cutoff_hz
                {
                    own.clone_from(used);
                    let bands = [Code::LowerBand, Code::WiderBand];
                    let found = fitted.findings.iter();
                    let why = found.filter(|f| bands.contains(&f.code));
                    self.findings.extend(why.cloned());
                }
                let mut lower = settings.clone();
                self.lower_cutoff = self.slower().filter(|&hz| {
                    lower.signal.cutoff_hz = Auto::Value(hz);
                    fit(&lower, "trying a lower cut-off")
                        .is_ok_and(|lower| finds_all(&lower, &fitted))
                });
            }
        }
    }

    /// A cut-off at which a tenth of each joint's velocity can be told from standstill: an encoder of step s resolves `16 f_c s`.
    fn slower(&self) -> Option<f64> {
        if !(self.findings.iter()).any(|finding| finding.code == Code::QuantisedEncoder) {
            return None;
        }
        let now = self.pipeline.as_ref()?.cutoff_hz;
        let logs = self.overviews.iter().zip(&self.steps);
        let joints = logs.flat_map(|(log, steps)| log.joints.iter().zip(steps));
        let wanted = joints
            .filter_map(|(joint, steps)| Some(0.1 * joint.qd_rms / (16.0 * steps.position?)))
            .fold(f64::INFINITY, f64::min);
        let hz = (wanted * 10.0).floor() / 10.0;
        (hz >= 0.5 && hz < now).then_some(hz)
    }
}

/// Whether `lower` still finds what `usual` does: a cut-off below the motion's own band loses effects of acceleration.
fn finds_all(lower: &Calibration, usual: &Calibration) -> bool {
    let is_found = |component: &&ComponentSummary| component.status == Status::Established;
    let found: Vec<&str> = (lower.components.iter().filter(is_found))
        .map(|component| component.name.as_str())
        .collect();
    let mut usual = usual.components.iter().filter(is_found);
    usual.all(|component| found.contains(&component.name.as_str()))
}

/// What `[[log]] torque` makes of the torque columns.
fn taken_as(options: &LogOptions) -> &'static str {
    let unsaid = match options.preset {
        Some(Preset::UrRtde) => TorqueSource::Current,
        _ => TorqueSource::Joint,
    };
    match options.torque.source.unwrap_or(unsaid) {
        TorqueSource::Joint => "N·m (N) at the joint",
        TorqueSource::Motor => "N·m of the motor, times gear_ratio",
        TorqueSource::Current => "current, times drive_constant",
        TorqueSource::None => "no measurement",
    }
}

/// Logs as far as the comparison with the model.
pub(super) fn filtered(
    robot: &Robot,
    logs: &[Log<'_>],
    settings: &Settings,
) -> twincal::Result<(Pipeline, Vec<Finding>, Checkup)> {
    for log in logs {
        describe(robot, log)?;
    }
    let signal = &settings.calibration.signal;
    let Chosen {
        pipeline, findings, ..
    } = choose_and_prepare(robot, logs, signal)?;
    let mut checkup = checkup(robot, logs, &pipeline)?;
    match checkup.refused.pop() {
        Some(error) => Err(error),
        None => Ok((pipeline, findings, checkup)),
    }
}
