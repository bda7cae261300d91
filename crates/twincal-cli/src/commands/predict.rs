//! `twincal predict`: torque with intervals, one row per input row.

use super::inputs::{LogInput, refuse_input_as_output};
use super::summary::{Notes, paragraph};
use super::{code_of, print_json, require_strict, settings, start_threads};
use crate::args::Predict;
use crate::failure::{Failure, Outcome};
use crate::progress::Progress;
use crate::terminal::Terminal;
use serde::Serialize;
use std::io::{self, BufWriter, Write};
use twincal::rows::{RowSignal, visit_rows};
use twincal::signal::{Recording, missing_torque};
use twincal::term::Library;
use twincal::twin::{Predictor, TorqueSignal, Twin};
use twincal::{Finding, Result, Severity};
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
    rows: usize,
    input_rows: usize,
    extrapolating: usize,
    signal: &'static str,
    findings: Vec<Finding>,
}

pub(super) fn run(flags: &Predict, terminal: &mut Terminal) -> Outcome<u8> {
    let config = settings::of_logs(&flags.log, terminal)?;
    let settings = config.settings()?;
    if settings.json && flags.output.is_none() {
        return Err(Failure::usage(
            "--json needs a file for the rows",
            "give -o FILE.csv, FILE.parquet or FILE.mcap",
        ));
    }
    let output = match &flags.output {
        Some(path) => {
            let mut inputs = vec![&flags.twin];
            inputs.extend(&flags.logs);
            inputs.extend(&flags.log.config);
            inputs.extend(&settings.model_file);
            refuse_input_as_output(path, &inputs)?;
            let format = TableFormat::of_path(path)?;
            Some((format, path, OutputFile::create(path, flags.force)?))
        }
        None => None,
    };
    start_threads(settings.threads)?;
    let progress = Progress::new();
    progress.step(&format!("reading {}", flags.twin.to_string_lossy()));
    let stored = StoredTwin::read(&Artifact::open(&flags.twin)?, false)?;
    let twin = &stored.calibration.twin;
    let mut logs = LogInput::read(&flags.logs, &twin.robot, &settings.log, &progress)?;
    progress.step("predicting the logs");
    let mut prediction = Prediction {
        findings: std::mem::take(&mut logs.findings),
        ..Prediction::default()
    };
    let missing = logs.logs.iter();
    let missing = missing.filter_map(|recording| missing_torque(&twin.robot, recording));
    prediction.findings.extend(missing);
    // A prediction needs motion alone: measured torque stands beside it, row by row.
    prediction.measured = (logs.logs.iter_mut()).map(Recording::take_torque).collect();
    match output {
        Some((format, place, mut output)) => {
            let written = match output.file() {
                Some(file) => prediction.write(twin, &logs, format, BufWriter::new(file))?,
                None => Ok(()),
            };
            require_strict(settings.log.strict, &prediction.findings)?;
            output.commit(written)?;
            terminal.complete(place);
        }
        None => {
            let written = prediction.write(twin, &logs, TableFormat::Csv, terminal.rows())?;
            terminal.wrote(written);
        }
    }
    drop(progress);
    let code = code_of(&prediction.findings);
    let Prediction {
        rows,
        extrapolating,
        findings,
        ..
    } = prediction;
    let input_rows = logs.logs.iter().map(|recording| recording.time.len()).sum();
    let output = flags
        .output
        .as_ref()
        .map(|path| path.to_string_lossy().into_owned());
    if settings.json {
        print_json(
            terminal,
            &Predicted {
                schema: 1,
                output,
                rows,
                input_rows,
                extrapolating,
                signal: "raw",
                findings,
            },
        )?;
    } else if let Some(output) = output {
        paragraph(
            &format!(
                "{rows} of {input_rows} rows predicted, {extrapolating} of them extrapolating"
            ),
            terminal,
        );
        super::summary::findings(&findings, Notes::In("the output of --json"), terminal);
        terminal.say(&output);
    } else {
        notes(&findings, terminal);
    }
    Ok(code)
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
    rows: usize,
    extrapolating: usize,
    findings: Vec<Finding>,
    /// Measured torque by log and joint, at the rows of the log.
    measured: Vec<Vec<Option<Vec<f64>>>>,
}

impl Prediction {
    /// Writes the rows of all logs; the inner result is what became of the writing.
    fn write(
        &mut self,
        twin: &Twin,
        logs: &LogInput,
        format: TableFormat,
        writer: impl Write + Send,
    ) -> Outcome<io::Result<()>> {
        let library = twin.library()?;
        let predictor = twin.predictor(&library)?;
        let mut table = match TableWriter::new(writer, format, &columns(twin)) {
            Ok(table) => table,
            Err(e) => return Ok(Err(e)),
        };
        let all_measured = std::mem::take(&mut self.measured);
        for (recording, measured) in logs.logs.iter().zip(&all_measured) {
            let log = (recording, measured.as_slice());
            let written = self.write_log(twin, &library, &predictor, log, &mut table);
            if let Err(e) = written.map_err(|error| logs.as_given(error))? {
                return Ok(Err(e));
            }
        }
        Ok(table.finish().and_then(|mut writer| writer.flush()))
    }

    fn write_log<W: Write + Send>(
        &mut self,
        twin: &Twin,
        library: &Library,
        predictor: &Predictor,
        (recording, logged): (&Recording, &[Option<Vec<f64>>]),
        table: &mut TableWriter<W>,
    ) -> Result<io::Result<()>> {
        let (trajectory, more) = twin.align(recording)?;
        self.findings.extend(more);
        let mut written = Ok(());
        visit_rows(
            &twin.robot,
            library,
            &twin.pipeline,
            &trajectory,
            RowSignal::Raw,
            &mut |block| {
                if written.is_err() {
                    return Ok(());
                }
                let torques = predictor.block(block, TorqueSignal::Raw);
                let of_rows = |values: &[f64]| {
                    block
                        .input_rows
                        .iter()
                        .map(|&row| values[row])
                        .collect::<Vec<_>>()
                };
                let time = of_rows(&recording.time);
                let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
                let measured: Vec<Vec<f64>> = (logged.iter())
                    .map(|tau| match tau {
                        Some(tau) => of_rows(tau).into_iter().map(finite).collect(),
                        None => vec![f64::NAN; block.len],
                    })
                    .collect();
                let outside: Vec<bool> = (0..block.len)
                    .map(|row| torques.iter().any(|torque| torque.extrapolating[row]))
                    .collect();
                let mut values = vec![Values::Numbers(&time)];
                for (measured, torque) in measured.iter().zip(&torques) {
                    let of_joint = [
                        measured,
                        &torque.nominal,
                        &torque.calibrated,
                        &torque.low,
                        &torque.high,
                    ];
                    values.extend(of_joint.map(|numbers| Values::Numbers(numbers)));
                }
                values.push(Values::Flags(&outside));
                self.rows += block.len;
                self.extrapolating += outside.iter().filter(|outside| **outside).count();
                written = table.push(&values);
                Ok(())
            },
        )?;
        Ok(written)
    }
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
