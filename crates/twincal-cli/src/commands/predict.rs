//! `twincal predict`: torque with intervals, one row per input row.

use super::inputs::LogInput;
use super::summary::{Notes, paragraph};
use super::verdict::doubt;
use super::{print_json, reads, require_strict, settings, start_threads};
use crate::args::Predict;
use crate::exit;
use crate::failure::{Failure, Outcome};
use crate::interrupts::require_caller;
use crate::progress::Progress;
use crate::terminal::Terminal;
use serde::Serialize;
use std::io::{self, BufWriter, Write};
use std::ops::{Range, RangeInclusive};
use std::path::Path;
use twincal::rows::{RowBlock, RowSignal, visit_rows};
use twincal::signal::{Log, Recording, missing_torque};
use twincal::term::Library;
use twincal::twin::{Predictor, TorqueSignal, Twin};
use twincal::{Code, Finding, Result, Severity};
use twincal_io::artifact::{Artifact, OutputFile};
use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};
use twincal_io::twin_json::StoredTwin;

/// Columns of one joint.
const CHANNELS: [&str; 5] = ["tau_meas", "tau_nom", "tau", "tau_low95", "tau_high95"];

/// What `--json` prints.
#[derive(Serialize)]
struct Predicted {
    schema: u64,
    output: Option<String>,
    rows: u64,
    input_rows: u64,
    extrapolating: u64,
    signal: &'static str,
    findings: Vec<Finding>,
}

pub(super) fn run(flags: &Predict, terminal: &mut Terminal) -> Outcome<u8> {
    let config = settings::beside_twin(&flags.log)?;
    let settings = config.settings()?;
    if settings.json && flags.output.is_none() {
        return Err(Failure::usage(
            "--json needs a file for the rows",
            "give -o FILE.csv, FILE.parquet or FILE.mcap",
        ));
    }
    let progress = Progress::new();
    progress.step(&format!("reading {}", flags.twin.to_string_lossy()));
    let stored = StoredTwin::read(&Artifact::open(&flags.twin)?, false)?;
    let given = reads::Given {
        flags: &flags.log,
        config: &config,
        settings: &settings,
    };
    let output = open(flags, &stored, &given)?;
    start_threads(settings.threads)?;
    let twin = &stored.calibration.twin;
    let mut logs = LogInput::for_twin(&flags.logs, &stored, settings.log.clone(), &progress)?;
    progress.step("predicting the logs");
    let mut prediction = Prediction::of(twin, &mut logs)?;
    match output {
        Some((format, place, mut output)) => {
            let written = match output.file() {
                Some(file) => prediction.write(twin, &mut logs, format, BufWriter::new(file))?,
                None => Ok(()),
            };
            require_strict(settings.log.strict, &prediction.findings)?;
            require_caller()?;
            output.commit(written)?;
            terminal.complete(place);
        }
        None => {
            let written = prediction.write(twin, &mut logs, TableFormat::Csv, terminal.rows())?;
            terminal.wrote(written);
        }
    }
    drop(progress);
    let code = exit::of_findings(&prediction.findings);
    let doubt = doubt(&stored.calibration);
    if let Some(doubt) = &doubt {
        terminal.note(&format!("warning: {}", doubt.message));
    }
    if settings.json {
        prediction.findings.splice(0..0, doubt);
        print_json(terminal, &prediction.summary(flags))?;
    } else {
        prediction.say(flags, terminal);
    }
    Ok(code)
}

/// Format, path and file of the rows; `None`: they go to standard output.
fn open<'a>(
    flags: &'a Predict,
    stored: &StoredTwin,
    given: &reads::Given<'_>,
) -> Outcome<Option<(TableFormat, &'a Path, OutputFile)>> {
    let Some(path) = &flags.output else {
        return Ok(None);
    };
    let mut inputs = reads::of_twin(&flags.twin, stored);
    reads::add_given(&mut inputs, given, &flags.logs);
    let output = OutputFile::create(path, flags.force, &inputs)?;
    Ok(Some((TableFormat::of_path(path)?, path, output)))
}

/// Warnings beside rows on standard output.
fn notes(findings: &[Finding], terminal: &mut Terminal) {
    for finding in findings
        .iter()
        .filter(|finding| finding.severity != Severity::Note)
    {
        terminal.note(&format!("warning: {}", finding.message));
    }
}

/// Rows written so far.
#[derive(Default)]
struct Prediction {
    rows: u64,
    /// Rows of the logs.
    input_rows: u64,
    extrapolating: u64,
    findings: Vec<Finding>,
}

/// What rows are predicted with.
struct Model<'a> {
    twin: &'a Twin,
    library: &'a Library,
    predictor: &'a Predictor,
}

/// The stretch of a log that is predicted.
struct Stretch<'a> {
    /// First stamp of the log, where it is a part of one, s.
    start: Option<f64>,
    /// Motion alone: measured torque stands beside it, row by row, and what it lacks cuts nothing.
    motion: &'a Recording,
    /// Rows of `motion` that are wanted.
    own: Range<usize>,
    /// Torque of these rows as logged, by joint.
    measured: Vec<Option<&'a [f64]>>,
}

impl Prediction {
    /// Nothing written yet; what was found in reading the logs, and where torque is missing.
    fn of(twin: &Twin, logs: &mut LogInput) -> Result<Self> {
        let mut prediction = Self {
            findings: std::mem::take(&mut logs.findings),
            ..Self::default()
        };
        for log in &logs.logs {
            let missing = missing_torque(&twin.robot, log)?;
            prediction.findings.extend(missing);
        }
        prediction.input_rows = logs.logs.iter().map(Log::samples).sum();
        Ok(prediction)
    }

    /// What `--json` prints.
    fn summary(self, flags: &Predict) -> Predicted {
        let path = flags.output.as_ref();
        Predicted {
            schema: 1,
            output: path.map(|path| path.to_string_lossy().into_owned()),
            rows: self.rows,
            input_rows: self.input_rows,
            extrapolating: self.extrapolating,
            signal: "raw",
            findings: self.findings,
        }
    }

    /// Says what was written to a file, or what is to be known beside rows on standard output.
    fn say(&self, flags: &Predict, terminal: &mut Terminal) {
        let Some(output) = &flags.output else {
            return notes(&self.findings, terminal);
        };
        let Self {
            rows,
            input_rows,
            extrapolating,
            ..
        } = self;
        paragraph(
            &format!(
                "{rows} of {input_rows} rows predicted{}, {extrapolating} of them extrapolating on some joint; torque is unfiltered",
                if rows < input_rows {
                    " (the motion filter takes some at either end of each stretch)"
                } else {
                    ""
                }
            ),
            terminal,
        );
        super::summary::findings(&self.findings, Notes::In("the output of --json"), terminal);
        terminal.say(&output.to_string_lossy());
    }

    /// Writes the rows of all logs; the inner result is what became of the writing.
    fn write(
        &mut self,
        twin: &Twin,
        logs: &mut LogInput,
        format: TableFormat,
        writer: impl Write + Send,
    ) -> Outcome<io::Result<()>> {
        let library = twin.library()?;
        let predictor = twin.predictor(&library)?;
        let model = Model {
            twin,
            library: &library,
            predictor: &predictor,
        };
        let mut table = match TableWriter::new(writer, format, &columns(twin)) {
            Ok(table) => table,
            Err(e) => return Ok(Err(e)),
        };
        for log in std::mem::take(&mut logs.logs) {
            let written = self.write_log(&model, log, &mut table);
            if let Err(e) = written.map_err(|error| logs.as_given(error))? {
                return Ok(Err(e));
            }
        }
        Ok(table.finish().and_then(|mut writer| writer.flush()))
    }

    fn write_log<W: Write + Send>(
        &mut self,
        model: &Model<'_>,
        log: Log<'_>,
        table: &mut TableWriter<W>,
    ) -> Result<io::Result<()>> {
        let mut findings = Vec::new();
        let mut written = Ok(());
        let (name, samples, before) = (log.name().to_owned(), log.samples(), self.rows);
        match log {
            Log::Whole(recording) => {
                let mut motion = recording.into_owned();
                let measured = motion.take_torque();
                let stretch = Stretch {
                    start: None,
                    motion: &motion,
                    own: 0..motion.time.len(),
                    measured: measured.iter().map(Option::as_deref).collect(),
                };
                written = self.write_stretch(model, &stretch, table, &mut findings)?;
            }
            Log::Long(long) => {
                findings.push(long.say(false));
                let pipeline = &model.twin.pipeline;
                let visited = long.visit_motion(pipeline, &mut findings, |part, said| {
                    let joints = part.chapter.joints.iter();
                    let stretch = Stretch {
                        start: long.start(),
                        motion: &part.motion,
                        own: part.own.clone(),
                        measured: joints.map(|joint| joint.tau.as_deref()).collect(),
                    };
                    written = self.write_stretch(model, &stretch, table, said)?;
                    // Nobody reads on: the other chapters need not be read either.
                    written
                        .as_ref()
                        .copied()
                        .map_err(|_| twincal::Error::Refused {
                            problem: "the output is closed".into(),
                            remedy: String::new(),
                        })
                });
                if written.is_err() {
                    return Ok(written);
                }
                visited?;
            }
        }
        if written.is_ok() {
            // What is told of borders counts the rows of a fit, which has one filter more.
            findings.retain(|finding| finding.code != Code::Borders);
            let missing = samples - (self.rows - before);
            findings.extend((missing > 0).then(|| unpredicted(&name, missing)));
        }
        self.findings.append(&mut findings);
        Ok(written)
    }

    fn write_stretch<W: Write + Send>(
        &mut self,
        model: &Model<'_>,
        stretch: &Stretch<'_>,
        table: &mut TableWriter<W>,
        findings: &mut Vec<Finding>,
    ) -> Result<io::Result<()>> {
        let twin = model.twin;
        let (trajectory, more) = twin.align_part(stretch.motion, stretch.start)?;
        findings.extend(more);
        let mut written = Ok(());
        visit_rows(
            &twin.robot,
            model.library,
            &twin.pipeline,
            &trajectory,
            RowSignal::Raw,
            &mut |block| {
                if written.is_err() {
                    return Ok(());
                }
                // Rows ascend: those of the stretch are one range of the block's.
                let first = block
                    .input_rows
                    .partition_point(|&row| row < stretch.own.start);
                let end = block
                    .input_rows
                    .partition_point(|&row| row < stretch.own.end);
                let rows = &block.input_rows[first..end];
                let start = stretch.motion.start_ns as f64 / 1e9;
                let times = rows.iter().map(|&row| start + stretch.motion.time[row]);
                refuse_times(&stretch.motion.name, times, &table.times())?;
                if first < end {
                    written = self.write_rows(model, stretch, (block, first..end), table);
                }
                Ok(())
            },
        )?;
        Ok(written)
    }

    fn write_rows<W: Write + Send>(
        &mut self,
        model: &Model<'_>,
        stretch: &Stretch<'_>,
        (block, range): (&RowBlock<'_>, Range<usize>),
        table: &mut TableWriter<W>,
    ) -> io::Result<()> {
        let torques = model.predictor.block(block, TorqueSignal::Raw);
        let rows = &block.input_rows[range.clone()];
        let time: Vec<f64> = rows.iter().map(|&row| stretch.motion.time[row]).collect();
        let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
        let measured: Vec<Vec<f64>> = (stretch.measured.iter())
            .map(|tau| match tau {
                Some(tau) => {
                    let own = rows.iter().map(|&row| tau[row - stretch.own.start]);
                    own.map(finite).collect()
                }
                None => vec![f64::NAN; rows.len()],
            })
            .collect();
        let outside: Vec<bool> = (range.clone())
            .map(|row| torques.iter().any(|torque| torque.extrapolating[row]))
            .collect();
        let mut values = vec![match stretch.motion.start_ns {
            0 => Values::Numbers(&time),
            start => Values::Stamps(start, &time),
        }];
        for (measured, torque) in measured.iter().zip(&torques) {
            values.push(Values::Numbers(measured));
            let of_joint = [
                &torque.nominal,
                &torque.calibrated,
                &torque.low,
                &torque.high,
            ];
            values.extend(of_joint.map(|numbers| Values::Numbers(&numbers[range.clone()])));
        }
        values.push(Values::Flags(&outside));
        self.rows += rows.len() as u64;
        self.extrapolating += outside.iter().filter(|outside| **outside).count() as u64;
        table.push(&values)
    }
}

/// Times of rows that the table cannot hold.
fn refuse_times(
    log: &str,
    mut times: impl Iterator<Item = f64>,
    range: &RangeInclusive<f64>,
) -> Result<()> {
    match times.find(|time| time < range.start() || time > range.end()) {
        None => Ok(()),
        Some(time) => Err(twincal::Error::Log {
            log: log.to_owned(),
            problem: format!(
                "time {time} s cannot stand in an MCAP file, whose stamps count from 0 to {} s",
                range.end()
            ),
            remedy: "write .parquet or .csv, or let the log's time begin at 0".into(),
        }),
    }
}

/// What filters take of the ends of a log's stretches, with what could not be used.
fn unpredicted(log: &str, rows: u64) -> Finding {
    let message = format!(
        "{rows} rows have no prediction: the motion filter needs some samples at either end of each stretch without a cut, and what else is \
         told here was left out"
    );
    Finding::new(Severity::Note, Code::Borders, log, message, rows)
}

fn columns(twin: &Twin) -> Vec<(String, ColumnKind)> {
    let joints = twin.robot.joint_names();
    let channels = joints
        .iter()
        .flat_map(|joint| CHANNELS.map(|channel| format!("{joint}.{channel}")));
    let numbers = std::iter::once("t".into())
        .chain(channels)
        .map(|name| (name, ColumnKind::Number));
    numbers
        .chain([("extrapolating".into(), ColumnKind::Flag)])
        .collect()
}
