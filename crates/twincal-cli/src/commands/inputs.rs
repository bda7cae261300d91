//! Model and logs as the commands need them: read, named, hashed, and small enough for the memory there is.

use crate::failure::{Failure, Outcome};
use crate::names::display_names;
use crate::progress::Progress;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::robot::Robot;
use twincal::signal::{Log, Recording};
use twincal_io::artifact::{MODEL_MJCF, MODEL_URDF, sha256, sha256_of_file};
use twincal_io::config::{LogSettings, Settings};
use twincal_io::log::{LogOptions, files_of, open_log, parse_log, read_log};
use twincal_io::model::{Model, ModelFormat, read_model};
use twincal_io::report::FileHash;
use twincal_io::{Error, memory};

/// Doubles per sample and joint that alignment and filtering hold at once beside the recordings themselves: pieces on even clocks (4),
/// smooth motion with torques (5), what passes by. What rows take is asked when it is known how many there are.
const DOUBLES_PER_SAMPLE: u64 = 12;

/// The robot and what its file says.
pub(super) struct RobotInput {
    pub(super) robot: Robot,
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
            file: FileHash { name, sha256 },
            source: (stored, model.bytes),
            findings,
        })
    }
}

/// Logs as read, with what was dropped or assumed: recordings, or logs that may be in chapters.
pub(super) struct LogInput<T = Recording> {
    pub(super) logs: Vec<T>,
    pub(super) files: Vec<FileHash>,
    pub(super) findings: Vec<Finding>,
    given: Vec<PathBuf>,
}

/// A log of either kind.
pub(super) trait OneLog: Sized + Send {
    fn read(
        path: &Path,
        robot: &Robot,
        options: &LogOptions,
    ) -> Result<(Self, Vec<Finding>), Error>;
    /// Samples that are in memory at once.
    fn samples(&self) -> usize;
    /// Gives it the name that it has in results; returns that which it had.
    fn rename(&mut self, name: &str) -> String;
}

impl OneLog for Recording {
    fn read(
        path: &Path,
        robot: &Robot,
        options: &LogOptions,
    ) -> Result<(Self, Vec<Finding>), Error> {
        read_log(path, robot, options)
    }

    fn samples(&self) -> usize {
        self.time.len()
    }

    fn rename(&mut self, name: &str) -> String {
        std::mem::replace(&mut self.name, name.into())
    }
}

impl OneLog for Log<'static> {
    fn read(
        path: &Path,
        robot: &Robot,
        options: &LogOptions,
    ) -> Result<(Self, Vec<Finding>), Error> {
        open_log(path, robot, options)
    }

    fn samples(&self) -> usize {
        match self {
            Self::Whole(recording) => recording.time.len(),
            Self::Long(long) => long.samples.iter().copied().max().unwrap_or(0),
        }
    }

    fn rename(&mut self, name: &str) -> String {
        match self {
            Self::Whole(recording) => recording.to_mut().rename(name),
            Self::Long(long) => std::mem::replace(&mut long.name, name.into()),
        }
    }
}

impl<T: OneLog> LogInput<T> {
    /// Reads logs.
    pub(super) fn read(
        paths: &[PathBuf],
        robot: &Robot,
        settings: &LogSettings,
        progress: &Progress,
    ) -> Outcome<Self> {
        let mut samples = 0;
        let mut input = Self::new(paths.to_vec());
        for (path, name) in paths.iter().zip(display_names(paths)) {
            progress.step(&format!("reading {}", path.to_string_lossy()));
            let read = || T::read(path, robot, &settings.options(path));
            let (log, checksum) = if path.is_file() || path.is_dir() {
                let (log, checksum) = rayon::join(read, || sha256_of_log(path));
                (log?, checksum)
            } else {
                // A pipe can be read once, and may have no end.
                (read()?, sha256_of_log(path))
            };
            let (log, findings) = log;
            samples += log.samples() as u64;
            let bytes = samples.saturating_mul(robot.dof() as u64 * 8 * DOUBLES_PER_SAMPLE);
            memory::require(
                &path.to_string_lossy(),
                bytes,
                "give fewer or shorter logs, or raise the limit",
            )?;
            input.push(log, findings, &name);
            input.files.push(FileHash {
                name,
                sha256: checksum?,
            });
        }
        Ok(input)
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
    fn push(&mut self, mut log: T, findings: Vec<Finding>, name: &str) {
        let given = log.rename(name);
        self.logs.push(log);
        self.findings
            .extend(findings.into_iter().map(|finding| Finding {
                subject: finding.subject.replace(&given, name),
                message: finding.message.replace(&given, name),
                ..finding
            }));
    }
}

impl LogInput<Log<'static>> {
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
            input.push(Log::Whole(Cow::Owned(recording)), findings, name);
            input.files.push(FileHash {
                name: (*name).into(),
                sha256: sha256(bytes),
            });
            input.given.push(name.into());
        }
        Ok(input)
    }

    /// The same with every log in memory.
    pub(super) fn in_memory(
        paths: &[PathBuf],
        robot: &Robot,
        settings: &LogSettings,
        progress: &Progress,
    ) -> Outcome<Self> {
        let LogInput {
            logs,
            files,
            findings,
            given,
        } = LogInput::<Recording>::read(paths, robot, settings, progress)?;
        let whole = |recording| Log::Whole(Cow::Owned(recording));
        Ok(Self {
            logs: logs.into_iter().map(whole).collect(),
            files,
            findings,
            given,
        })
    }
}

impl<T> LogInput<T> {
    /// The error with the log named as it was given instead of as it stands in results.
    pub(super) fn as_given(&self, error: twincal::Error) -> twincal::Error {
        match error {
            twincal::Error::Log {
                log,
                problem,
                remedy,
            } => {
                let at = self.files.iter().position(|file| file.name == log);
                let log = at.map_or(log, |at| self.given[at].to_string_lossy().into_owned());
                twincal::Error::Log {
                    log,
                    problem,
                    remedy,
                }
            }
            other => other,
        }
    }
}

/// Refuses an output that is one of the inputs or lies in one of their folders: `--force` means an earlier result.
pub(super) fn refuse_input_as_output(output: &Path, inputs: &[&PathBuf]) -> Outcome<()> {
    // An output that does not exist yet replaces nothing.
    let Ok(real) = output.canonicalize() else {
        return Ok(());
    };
    for input in inputs {
        if input
            .canonicalize()
            .is_ok_and(|input| real.starts_with(input))
        {
            return Err(Failure::usage(
                format!(
                    "{} is read by this command ({}) and would be overwritten",
                    output.to_string_lossy(),
                    input.to_string_lossy()
                ),
                "give another output with -o",
            ));
        }
    }
    Ok(())
}

/// Checksum of a log; of a folder that of the lines `sha256sum` prints for its files, in the order of their recording.
fn sha256_of_log(path: &Path) -> Result<String, Error> {
    if !path.is_dir() {
        return sha256_of_file(path);
    }
    let mut lines = String::new();
    for file in files_of(path)? {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        lines += &format!("{}  {name}\n", sha256_of_file(&file)?);
    }
    Ok(sha256(lines.as_bytes()))
}
