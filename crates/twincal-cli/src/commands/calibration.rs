//! What `fit` and `demo` share: calibrate, write the artefact, print what was found.

use super::brief::Around;
use super::inputs::{LogInput, RobotInput};
use super::{brief, print_json, require_strict, summary};
use crate::args::PrintFlags;
use crate::clock::{Stopwatch, now};
use crate::exit;
use crate::failure::{Failure, Outcome};
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::assess::assess;
use twincal::calibrate::{
    Calibration, CalibrationSettings, Stage, Statistics, Stopped, calibrate_statistics,
    calibrate_watched,
};
use twincal_io::artifact::{Claim, MODEL_MJCF, Maker, REPORT};
use twincal_io::config::{Config, ReadAs, Settings};
use twincal_io::context::{FileHash, ReportContext};
use twincal_io::memory;
use twincal_io::open::system_text;
use twincal_io::twin_json::StoredTwin;

/// One calibration, ready to run.
pub(super) struct Job<'a> {
    pub(super) maker: Maker,
    pub(super) command: String,
    pub(super) config: &'a Config,
    pub(super) settings: &'a Settings,
    pub(super) robot: RobotInput,
    pub(super) logs: LogInput,
    /// Of the logs, where a fit takes these and not the logs.
    pub(super) statistics: Option<Statistics>,
    pub(super) heldout: LogInput,
    /// Folder of the result.
    pub(super) output: &'a Path,
    pub(super) watch: Stopwatch,
}

/// What was calibrated and written.
pub(super) struct Done {
    /// Exit code.
    pub(super) code: u8,
    pub(super) stored: StoredTwin,
    /// Format of the model file, as `twincal export --to` names it.
    format: &'static str,
}

impl Done {
    /// What stands around the result in the terminal.
    pub(super) fn around<'a>(&self, output: &'a Path) -> Around<'a> {
        Around {
            output,
            format: self.format,
            instead: &[],
            behind: 0,
            typed: None,
        }
    }

    /// Prints the result.
    pub(super) fn print(
        &self,
        print: Print,
        around: Around<'_>,
        terminal: &mut Terminal,
    ) -> Outcome<()> {
        let calibration = &self.stored.calibration;
        match print {
            Print::Json => terminal.data(&self.stored.result_json()?),
            Print::All => summary::print(calibration, around.output, terminal),
            Print::Brief => brief::print(calibration, around, terminal),
            Print::Answer => {
                terminal.answer(&twincal_io::words::answer(calibration).headline);
            }
        }
        Ok(())
    }
}

/// How much of a result is printed for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Print {
    /// The answer and what matters most.
    Brief,
    /// Everything.
    All,
    /// The answer alone.
    Answer,
    /// The result as JSON, for programs.
    Json,
}

impl Print {
    /// As the flags say; `-q` is stronger than JSON that the config asks for.
    pub(super) fn of(flags: PrintFlags, json: bool) -> Self {
        match flags {
            PrintFlags { quiet: true, .. } => Self::Answer,
            _ if json => Self::Json,
            PrintFlags { verbose: true, .. } => Self::All,
            _ => Self::Brief,
        }
    }

    pub(super) fn progress(self) -> Progress {
        match self {
            Self::Answer => Progress::silent(),
            Self::Brief | Self::All | Self::Json => Progress::new(),
        }
    }
}

/// A fit that ended without a result.
pub(super) struct Ended {
    /// Why.
    pub(super) failure: Failure,
    /// What was found before.
    findings: Vec<Finding>,
}

impl Job<'_> {
    /// Calibrates and writes.
    pub(super) fn run(
        mut self,
        claim: Claim,
        mut inputs: Vec<(&str, Vec<u8>)>,
        progress: Progress,
        terminal: &mut Terminal,
    ) -> Outcome<Done> {
        let watch = |stage| {
            show(stage, "", &progress);
            Ok(())
        };
        let stored = match self.result(&watch) {
            Ok(stored) => stored,
            Err(ended) => {
                drop(progress);
                summary::before_the_error(&ended.findings, terminal);
                return Err(ended.failure);
            }
        };
        let code = exit::of_fit(
            assess(&stored.calibration).answer,
            &stored.calibration.findings,
        );
        progress.step("writing the result");
        let run_log = self.run_log(&stored);
        let stored_as = self.robot.source.0;
        inputs.push(self.robot.source);
        stored.write(claim, self.maker, run_log, inputs)?;
        terminal.complete(self.output);
        drop(progress);
        Ok(Done {
            code,
            stored,
            format: match stored_as {
                MODEL_MJCF => "mjcf",
                _ => "urdf",
            },
        })
    }

    /// Calibrates: the result as it will lie in its folder.
    pub(super) fn result(
        &mut self,
        watch: &dyn Fn(Stage) -> twincal::Result<()>,
    ) -> Result<StoredTwin, Box<Ended>> {
        let ended = |failure, findings| Box::new(Ended { failure, findings });
        let calibration = self.calibrate(watch).map_err(|stopped| {
            let as_given = self.logs.as_given(stopped.error);
            let error = self.config.locate(self.heldout.as_given(as_given));
            ended(error.into(), stopped.findings)
        })?;
        require_strict(self.settings.log.strict, &calibration.findings)
            .map_err(|failure| ended(failure, Vec::new()))?;
        Ok(StoredTwin {
            gates: self.settings.gates,
            read_as: Some(ReadAs::of(&self.settings.log, self.logs.given())),
            context: self.context(),
            calibration,
        })
    }

    /// With what reading the inputs found before everything else.
    fn calibrate(
        &mut self,
        watch: &dyn Fn(Stage) -> twincal::Result<()>,
    ) -> Result<Calibration, Stopped> {
        let (logs, heldout) = (&mut self.logs, &mut self.heldout);
        // Without logs there is nothing long to end.
        let step = |stage| drop(watch(stage));
        let settings = CalibrationSettings {
            most_bytes: memory::spare(),
            ..self.settings.calibration.clone()
        };
        let held_out = std::mem::take(&mut heldout.logs);
        let mut calibration = match &self.statistics {
            Some(statistics) => calibrate_statistics(statistics, held_out, &settings, &step),
            None => {
                let logs = std::mem::take(&mut logs.logs);
                let recordings = (logs.into(), held_out.into());
                calibrate_watched(&self.robot.robot, recordings, &settings, watch)
            }
        };
        let read = [&self.robot.findings, &logs.findings, &heldout.findings];
        let findings = match &mut calibration {
            Ok(calibration) => &mut calibration.findings,
            Err(stopped) => &mut stopped.findings,
        };
        findings.splice(0..0, read.into_iter().flatten().cloned());
        calibration
    }

    fn context(&self) -> ReportContext {
        let logs = self.logs.files.iter().chain(&self.heldout.files);
        ReportContext {
            version: env!("CARGO_PKG_VERSION").into(),
            robot: self.robot.name.clone(),
            model: self.robot.file.name.clone(),
            command: self.command.clone(),
            settings: self.config.in_force(),
            seed: self.settings.calibration.inference.seed,
            config: self.config.read_from().map(|(path, sha256)| FileHash {
                name: display_names(&[path]).remove(0),
                sha256,
            }),
            files: std::iter::once(&self.robot.file)
                .chain(logs)
                .cloned()
                .collect(),
        }
    }

    /// When, where and how long: what may differ between two runs with the same result.
    pub(super) fn run_log(&self, stored: &StoredTwin) -> String {
        let words: Vec<_> = std::env::args_os()
            .map(|word| quoted(&word.to_string_lossy()))
            .collect();
        let folder = std::env::current_dir()
            .map_or_else(|e| e.to_string(), |d| d.to_string_lossy().into_owned());
        let host = system_text("/proc/sys/kernel/hostname").unwrap_or_default();
        let mut text = format!(
            "twincal {}\nfinished {}\nseconds {:.3}\nthreads {}\nhost {}\nfolder {folder}\ncommand {}\n",
            env!("CARGO_PKG_VERSION"),
            now(),
            self.watch.seconds(),
            rayon::current_num_threads(),
            host.trim(),
            words.join(" "),
        );
        for file in &stored.context.files {
            // Writing to a string cannot fail.
            let checksum = if file.sha256.is_empty() {
                "-"
            } else {
                &file.sha256
            };
            let _ = writeln!(text, "input {checksum} {}", file.name);
        }
        for finding in &stored.calibration.findings {
            let _ = writeln!(
                text,
                "{:?} {}: {}",
                finding.severity, finding.code, finding.message
            );
        }
        text
    }
}

/// Shows how far a calibration has come, behind the name of what it is part of.
pub(super) fn show(stage: Stage, of: &str, progress: &Progress) {
    match stage {
        Stage::Rows => progress.step(&format!("{of}filtering the logs")),
        Stage::Inference => {
            progress.step(&format!("{of}computing probabilities of all candidates"))
        }
        Stage::Validation(_, 0 | 1) => progress.step(&format!("{of}predicting held-out data")),
        Stage::Validation(done, all) => {
            progress.counted(&format!("{of}predicting held-out data"), done, all);
        }
        Stage::Sensitivity => progress.step(&format!("{of}varying prior and cut-off")),
    }
}

/// The command that repeats a fit from these files: without what does not change the result.
pub(super) fn command(model: &Path, logs: &[PathBuf], heldout: &[PathBuf], config: &str) -> String {
    let mut text = "twincal fit".to_owned();
    let mut add = |word: &str| {
        text.push(' ');
        text.push_str(&quoted(word));
    };
    display_names(logs).iter().for_each(|name| add(name));
    add("--model");
    add(&display_names(&[model]).remove(0));
    with_heldout(text, heldout, config)
}

/// The end of such a command.
pub(super) fn with_heldout(mut text: String, heldout: &[PathBuf], config: &str) -> String {
    let mut add = |word: &str| {
        text.push(' ');
        text.push_str(&quoted(word));
    };
    if !heldout.is_empty() {
        add("--heldout");
        display_names(heldout).iter().for_each(|name| add(name));
    }
    if !config.is_empty() {
        add("--config");
        add("twincal.toml");
    }
    text
}

/// A word as a POSIX shell reads it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=+:,@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Says where the report is; the last line of the output.
pub(super) fn say_where(output: &Path, print: Print, terminal: &mut Terminal) {
    match print {
        Print::Json => terminal.note(&format!("report: {}", report_of(output))),
        Print::Brief | Print::All => terminal.say(&report_of(output)),
        Print::Answer => {}
    }
}

/// Path of a result's report.
pub(super) fn report_of(output: &Path) -> String {
    output.join(REPORT).to_string_lossy().into_owned()
}

/// What `--json` prints of a command that wrote files.
#[derive(serde::Serialize)]
struct Written {
    report: String,
}

/// The path of a report as JSON.
pub(super) fn say_where_in_json(output: &Path, terminal: &mut Terminal) -> Outcome<()> {
    print_json(
        terminal,
        &Written {
            report: output.join(REPORT).to_string_lossy().into_owned(),
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_is_the_same_wherever_the_files_lie() {
        let logs = [PathBuf::from("/data/a b.csv"), PathBuf::from("-rf.csv")];
        let text = command(Path::new("/models/arm.urdf"), &logs, &[], "[prior]\n");
        assert_eq!(
            text,
            "twincal fit 'a b.csv' -rf.csv --model arm.urdf --config twincal.toml"
        );
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
