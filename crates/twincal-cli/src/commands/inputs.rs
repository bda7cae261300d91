//! Model and logs as the commands need them: read, named, hashed, and small enough for the memory there is.

use super::as_fitted::AsFitted;
use crate::failure::Outcome;
use crate::interrupts::require_caller;
use crate::names::display_names;
use crate::progress::Progress;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use twincal::Finding;
use twincal::robot::Robot;
use twincal::signal::{Auto, Log, Pipeline, Recording};
use twincal_io::artifact::{MODEL_MJCF, MODEL_URDF, sha256, sha256_unless};
use twincal_io::config::{LogSettings, Settings};
use twincal_io::context::FileHash;
use twincal_io::log::{LogOptions, files_of, open_log, parse_log, read_log};
use twincal_io::model::{Model, ModelFormat, read_model};
use twincal_io::statistics::{ModelFile, StatisticsFile};
use twincal_io::twin_json::StoredTwin;
use twincal_io::{Error, memory};

/// Doubles per sample and joint that alignment and filtering hold at once beside the recordings themselves: pieces on even clocks (4),
/// smooth motion with torques (5), what passes by. What rows take is asked when it is known how many there are.
const DOUBLES_PER_SAMPLE: u64 = 12;
/// Bytes of logs from one question for memory to the next.
const ASK_EVERY: u64 = 4 << 20;
/// Logs that are named while they are read; of more every so many is.
const MOST_SAID: usize = 20;

/// The robot and what its file says.
#[derive(Debug, Clone)]
pub(super) struct RobotInput {
    pub(super) robot: Robot,
    /// What its file calls it; may be empty.
    pub(super) name: String,
    pub(super) file: FileHash,
    /// Name in the artefact and bytes of the file.
    pub(super) source: (&'static str, Vec<u8>),
    pub(super) findings: Vec<Finding>,
}

impl RobotInput {
    /// Reads and checks the model file.
    pub(super) fn read(path: &Path, settings: &Settings) -> Outcome<Self> {
        let model = read_model(path, &settings.model)?;
        let name = display_names(&[path]).remove(0);
        Ok(Self::new(model, name, settings)?)
    }

    /// Checks a model.
    pub(super) fn new(model: Model, name: String, settings: &Settings) -> Result<Self, Error> {
        let (robot, findings) = model.robot(&settings.locked)?;
        let sha256 = sha256(&model.bytes);
        let stored = match model.format() {
            ModelFormat::Urdf => MODEL_URDF,
            ModelFormat::Mjcf => MODEL_MJCF,
        };
        Ok(Self {
            robot,
            name: model.robot_name().to_owned(),
            file: FileHash { name, sha256 },
            source: (stored, model.bytes),
            findings,
        })
    }
}

impl RobotInput {
    /// The robot of statistics, and its model file as it was.
    pub(super) fn of_statistics(file: &StatisticsFile) -> Self {
        let model = &file.model;
        let stored = match model.stored_as == MODEL_MJCF {
            true => MODEL_MJCF,
            false => MODEL_URDF,
        };
        Self {
            robot: file.statistics.robot.clone(),
            name: model.robot.clone(),
            file: FileHash {
                name: model.name.clone(),
                sha256: sha256(model.text.as_bytes()),
            },
            source: (stored, model.text.clone().into_bytes()),
            findings: model.findings.clone(),
        }
    }

    /// The model file as statistics keep it.
    pub(super) fn model_file(&self) -> ModelFile {
        ModelFile {
            name: self.file.name.clone(),
            stored_as: self.source.0.to_owned(),
            robot: self.name.clone(),
            text: String::from_utf8_lossy(&self.source.1).into_owned(),
            findings: self.findings.clone(),
        }
    }
}

/// Logs as read, with what was dropped or assumed.
pub(super) struct LogInput {
    pub(super) logs: Vec<Log<'static>>,
    pub(super) files: Vec<FileHash>,
    pub(super) findings: Vec<Finding>,
    given: Vec<PathBuf>,
}

/// A log with what was dropped or assumed, or why it cannot be read.
type ReadLog = Result<(Log<'static>, Vec<Finding>), Error>;

/// What becomes of long logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Long {
    /// They come in chapters.
    InChapters,
    /// They stay in memory.
    InMemory,
}

impl Long {
    /// Without a filter every sample is a row, and all are in memory whatever the reader does.
    fn with_filter(filter: bool) -> Self {
        if filter {
            Self::InChapters
        } else {
            Self::InMemory
        }
    }

    /// As behind these filters.
    pub(super) fn of_pipeline(pipeline: &Pipeline) -> Self {
        Self::with_filter(!pipeline.is_off())
    }

    /// As a fit with these settings reads them.
    pub(super) fn of_settings(settings: &Settings) -> Self {
        Self::with_filter(settings.calibration.signal.cutoff_hz != Auto::Value(0.0))
    }

    pub(super) fn read(
        self,
        path: &Path,
        robot: &Robot,
        options: &LogOptions,
    ) -> Result<(Log<'static>, Vec<Finding>), Error> {
        match self {
            Self::InChapters => open_log(path, robot, options),
            Self::InMemory => {
                let (recording, findings) = read_log(path, robot, options)?;
                Ok((recording.into(), findings))
            }
        }
    }
}

impl LogInput {
    /// Reads logs.
    pub(super) fn read(
        paths: &[PathBuf],
        robot: &Robot,
        settings: &LogSettings,
        long: Long,
        progress: &Progress,
    ) -> Outcome<Self> {
        let read = |path: &Path| long.read(path, robot, &settings.options(path));
        let names = display_names(paths);
        Self::read_each(paths, names, robot, progress, &read)
    }

    /// Reads one log under the name that it has in results.
    pub(super) fn read_one(
        (path, name): (&Path, &str),
        robot: &Robot,
        settings: &LogSettings,
        long: Long,
        progress: &Progress,
    ) -> Outcome<Self> {
        let read = |path: &Path| long.read(path, robot, &settings.options(path));
        let (paths, names) = ([path.to_owned()], vec![name.to_owned()]);
        Self::read_each(&paths, names, robot, progress, &read)
    }

    /// Files that stand for logs.
    pub(super) fn of_files(given: &[PathBuf], files: Vec<FileHash>) -> Self {
        Self {
            files,
            ..Self::new(given.to_vec())
        }
    }

    /// A log that is in memory, with what was found when it was matched to the robot.
    pub(super) fn of_recording(
        (recording, findings): (Recording, Vec<Finding>),
        sha256: &str,
    ) -> Self {
        let name = recording.name.clone();
        let given = vec![PathBuf::from(&name)];
        let sha256 = sha256.to_owned();
        Self {
            logs: vec![recording.into()],
            findings,
            ..Self::of_files(&given, vec![FileHash { name, sha256 }])
        }
    }

    /// Takes the logs of another one behind its own.
    pub(super) fn append(&mut self, other: Self) {
        self.logs.extend(other.logs);
        self.files.extend(other.files);
        self.findings.extend(other.findings);
        self.given.extend(other.given);
    }

    /// Reads logs, each as `read_one` does.
    fn read_each(
        paths: &[PathBuf],
        names: Vec<String>,
        robot: &Robot,
        progress: &Progress,
        read_one: &(dyn Fn(&Path) -> ReadLog + Sync),
    ) -> Outcome<Self> {
        let (mut samples, mut asked) = (0, 0);
        let mut input = Self::new(paths.to_vec());
        let said = paths.len().div_ceil(MOST_SAID).max(1);
        for (number, (path, name)) in paths.iter().zip(names).enumerate() {
            require_caller()?;
            if number % said == 0 {
                let of = match said {
                    1 => String::new(),
                    _ => format!(" ({} of {})", number + 1, paths.len()),
                };
                progress.step(&format!("reading {}{of}", path.to_string_lossy()));
            }
            // The checksum of a log that is refused is of no use, and may take long.
            let refused = AtomicBool::new(false);
            let read = || read_one(path).inspect_err(|_| refused.store(true, Ordering::Relaxed));
            let (log, checksum) = rayon::join(read, || sha256_of_log(path, &refused));
            let (log, findings) = log?;
            samples += in_memory(&log);
            let bytes = samples.saturating_mul(robot.dof() as u64 * 8 * DOUBLES_PER_SAMPLE);
            if bytes >= asked + ASK_EVERY {
                memory::require(
                    &path.to_string_lossy(),
                    bytes,
                    "give fewer or shorter logs, or raise the limit",
                )?;
                asked = bytes;
            }
            input.push(log, findings, &name);
            input.files.push(FileHash {
                name,
                sha256: checksum?,
            });
        }
        Ok(input)
    }

    /// Reads logs as a twin sees them: columns, factors and torque as those of its fit where the config says nothing of them.
    pub(super) fn for_twin(
        paths: &[PathBuf],
        stored: &StoredTwin,
        settings: LogSettings,
        progress: &Progress,
    ) -> Outcome<Self> {
        let (as_fitted, findings) = AsFitted::new(stored, settings, paths);
        let twin = &stored.calibration.twin;
        let long = Long::of_pipeline(&twin.pipeline);
        let read = |path: &Path| as_fitted.read(path, long);
        let names = display_names(paths);
        let mut input = Self::read_each(paths, names, &twin.robot, progress, &read)?;
        input.findings.splice(0..0, findings);
        Ok(input)
    }

    /// The logs as they were given.
    pub(super) fn given(&self) -> &[PathBuf] {
        &self.given
    }

    fn new(given: Vec<PathBuf>) -> Self {
        Self {
            logs: Vec::new(),
            files: Vec::new(),
            findings: Vec::new(),
            given,
        }
    }

    /// Takes a log under the name that it has in results.
    fn push(&mut self, mut log: Log<'static>, findings: Vec<Finding>, name: &str) {
        let given = log.rename(name);
        self.logs.push(log);
        self.findings
            .extend(findings.into_iter().map(|finding| Finding {
                subject: match finding.subject.strip_prefix(&given) {
                    Some(part) => name.to_owned() + part,
                    None => finding.subject,
                },
                ..finding
            }));
    }

    /// Logs that the program carries.
    pub(super) fn carried(
        logs: &[(&str, &'static [u8])],
        robot: &Robot,
        settings: &LogSettings,
    ) -> Outcome<Self> {
        let mut input = Self::new(Vec::new());
        for (name, bytes) in logs {
            let (recording, findings) =
                parse_log(name, bytes, robot, &settings.options(Path::new(name)))?;
            input.push(recording.into(), findings, name);
            input.files.push(FileHash {
                name: (*name).into(),
                sha256: sha256(bytes),
            });
            input.given.push(name.into());
        }
        Ok(input)
    }

    /// The error with the log named as it was given instead of as it stands in results.
    pub(super) fn as_given(&self, error: twincal::Error) -> twincal::Error {
        error.with_log_name(|log| {
            let at = self.files.iter().position(|file| file.name == log);
            at.map_or(log.to_owned(), |at| {
                self.given[at].to_string_lossy().into_owned()
            })
        })
    }
}

/// Samples of a log that are in memory at once.
fn in_memory(log: &Log<'_>) -> u64 {
    match log {
        Log::Whole(_) => log.samples(),
        Log::Long(long) => long.samples().iter().copied().max().unwrap_or(0) as u64,
    }
}

/// Checksum of a log.
pub(super) fn checksum_of_log(path: &Path) -> Result<String, Error> {
    sha256_of_log(path, &AtomicBool::new(false))
}

/// Checksum of a log, given up once the log is `refused`; of a folder that of the lines `sha256sum` prints for its files, in the order of their recording.
fn sha256_of_log(path: &Path, refused: &AtomicBool) -> Result<String, Error> {
    if !path.is_dir() {
        return sha256_unless(path, refused);
    }
    let mut lines = String::new();
    for file in files_of(path)? {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        lines += &format!("{}  {name}\n", sha256_unless(&file, refused)?);
    }
    Ok(sha256(lines.as_bytes()))
}
