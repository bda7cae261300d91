//! `twincal export`: the calibrated model as a file of the user's own kind, as a generated one of the other kind, or as code.

mod effects_csv;
mod file;
mod said;
mod torque_error;

use super::summary::paragraph;
use super::verdict::doubt;
use super::{print_json, reads, replaced};
use crate::args::{Beyond as BeyondFormat, Export, ExportFormat};
use crate::failure::{Failure, Outcome};
use crate::progress::Progress;
use crate::terminal::Terminal;
use file::FileMaker;
use serde::Serialize;
use serde_json::{Map, Value};
use std::io::Write as _;
use std::path::Path;
use torque_error::TorqueErrors;
use twincal::Finding;
use twincal::evaluator::{Beyond, Evaluator, forgotten};
use twincal::posterior::draws::draw;
use twincal::write_back::{Holds, WriteBack, Writer};
use twincal_io::artifact::{Artifact, Claim, Maker, OutputFile};
use twincal_io::export::code::{Language, source};
use twincal_io::model::ModelFormat;
use twincal_io::twin_json::StoredTwin;

/// Random stream of the draws that are written.
const STREAM: u64 = (1 << 32) + 2;
/// Most models of one call.
const MOST: usize = 100_000;

/// Said of twins whose payload acts in some logs only.
const CARRIED: &str = "With the payload of the logs that carried something unknown.";

/// What `--json` prints.
#[derive(Serialize)]
struct Exported<'a> {
    schema: u64,
    output: String,
    /// Names of q1…qn; `joints` of the change are those that change.
    joint_names: Vec<&'a str>,
    #[serde(flatten)]
    change: Map<String, Value>,
    /// Of a generated file: what its format cannot hold or asks for. `None`: the user's own file.
    generated: Option<Vec<String>>,
    torque_error: TorqueErrors<'a>,
    findings: Vec<Finding>,
}

/// What `--json` prints of the table of effects.
#[derive(Serialize)]
struct Tabled {
    schema: u64,
    output: String,
    rows: usize,
    findings: Vec<Finding>,
}

/// What `--json` prints of draws.
#[derive(Serialize)]
struct Drawn {
    schema: u64,
    output: String,
    models: usize,
    seed: u64,
    /// How many of them had an inertia that had to be made physical.
    projected: usize,
    findings: Vec<Finding>,
}

/// What `--json` prints of code.
#[derive(Serialize)]
struct Coded<'a> {
    schema: u64,
    output: String,
    joints: Vec<&'a str>,
    /// Steps of the calculation.
    steps: usize,
    /// Columns of the interval.
    kept: usize,
    /// Largest error of an end of the interval, as a share of its width.
    interval_error: f64,
    findings: Vec<Finding>,
}

pub(super) fn run(flags: &Export, terminal: &mut Terminal) -> Outcome<u8> {
    if flags.output.is_none() && (flags.json || flags.draws.is_some()) {
        return Err(Failure::usage(
            "no place for what is exported",
            "give -o FILE, or -o FOLDER with --draws",
        ));
    }
    match (target(flags.to), flags.draws, &flags.output) {
        (Target::Code(_) | Target::Effects, Some(_), _) => Err(Failure::usage(
            "--draws writes model files, nothing else",
            "give --to urdf, or leave out --draws",
        )),
        (Target::Code(language), None, _) => code(flags, language, terminal),
        (Target::Model(_) | Target::Effects, ..) if flags.beyond.is_some() => Err(Failure::usage(
            "--beyond is for code: it says what a model file cannot",
            "give --to c, rust, python or json",
        )),
        (Target::Effects, ..) => effects(flags, terminal),
        (Target::Model(kind), Some(count), Some(folder)) => {
            draws(flags, kind, count, folder, terminal)
        }
        (Target::Model(kind), ..) => one(flags, kind, terminal),
    }
}

/// A kind of model file.
#[derive(Clone, Copy)]
struct Kind {
    holds: Holds,
    extension: &'static str,
    format: ModelFormat,
}

const URDF: Kind = Kind {
    holds: Holds::URDF,
    extension: "urdf",
    format: ModelFormat::Urdf,
};

const MJCF: Kind = Kind {
    holds: Holds::MJCF,
    extension: "xml",
    format: ModelFormat::Mjcf,
};

enum Target {
    Model(Kind),
    Code(Language),
    /// The table of effects.
    Effects,
}

fn target(format: ExportFormat) -> Target {
    match format {
        ExportFormat::Urdf => Target::Model(URDF),
        ExportFormat::Mjcf => Target::Model(MJCF),
        ExportFormat::C => Target::Code(Language::C),
        ExportFormat::Rust => Target::Code(Language::Rust),
        ExportFormat::Python => Target::Code(Language::Python),
        ExportFormat::Json => Target::Code(Language::Json),
        ExportFormat::Csv => Target::Effects,
    }
}

/// The file that takes the result; standard output where there is none.
fn open(flags: &Export, stored: &StoredTwin) -> Outcome<Option<OutputFile>> {
    match &flags.output {
        Some(path) => {
            let inputs = reads::of_twin(&flags.twin, stored);
            Ok(Some(OutputFile::create(path, flags.force, &inputs)?))
        }
        None => Ok(None),
    }
}

/// Writes to the file, or to standard output; true if it was a file.
fn write(
    flags: &Export,
    output: Option<OutputFile>,
    bytes: &[u8],
    terminal: &mut Terminal,
) -> Outcome<bool> {
    let (Some(mut output), Some(place)) = (output, &flags.output) else {
        let written = terminal.rows().write_all(bytes);
        terminal.wrote(written);
        return Ok(false);
    };
    let written = output.file().map_or(Ok(()), |file| file.write_all(bytes));
    output.commit(written)?;
    terminal.complete(place);
    Ok(true)
}

fn shown(flags: &Export) -> String {
    let path = flags.output.as_deref().unwrap_or(Path::new(""));
    path.to_string_lossy().into_owned()
}

/// The table of effects.
fn effects(flags: &Export, terminal: &mut Terminal) -> Outcome<u8> {
    let stored = StoredTwin::read(&Artifact::open(&flags.twin)?, true)?;
    let output = open(flags, &stored)?;
    let (bytes, rows) = effects_csv::table(&stored.calibration)?;
    let findings = doubts(&stored, terminal);
    if !write(flags, output, &bytes, terminal)? {
        return Ok(0);
    }
    if flags.json {
        let tabled = Tabled {
            schema: 1,
            output: shown(flags),
            rows,
            findings,
        };
        print_json(terminal, &tabled)?;
    } else {
        terminal.say(&shown(flags));
    }
    Ok(0)
}

/// Code that computes torque and interval.
fn code(flags: &Export, language: Language, terminal: &mut Terminal) -> Outcome<u8> {
    let stored = StoredTwin::read(&Artifact::open(&flags.twin)?, true)?;
    let output = open(flags, &stored)?;
    let twin = &stored.calibration.twin;
    let mut about = about(&stored);
    let forgets = forgotten(twin)?;
    about.extend(forgets.iter().map(|finding| finding.message.clone()));
    let evaluator = match flags.beyond {
        None => Evaluator::new(twin, None)?,
        Some(format) => {
            let holds = match format {
                BeyondFormat::Urdf => URDF.holds,
                BeyondFormat::Mjcf => MJCF.holds,
            };
            about.push(format!(
                "ONLY what the exported {} lacks: add it to that model's torque.",
                holds.format
            ));
            evaluator_beyond(&stored, holds)?
        }
    };
    let text = source(&evaluator, language, &about)?;
    let mut findings = doubts(&stored, terminal);
    if let Some(finding) = &forgets {
        paragraph(&finding.message, terminal);
    }
    findings.extend(forgets);
    if !write(flags, output, text.as_bytes(), terminal)? {
        return Ok(0);
    }
    if flags.json {
        let coded = Coded {
            schema: 1,
            output: shown(flags),
            joints: twin.robot.joint_names(),
            steps: evaluator.steps.len(),
            kept: evaluator.kept,
            interval_error: evaluator.interval_error,
            findings,
        };
        print_json(terminal, &coded)?;
    } else {
        let text = format!(
            "{} joints, {} steps; the ends of the interval are within {} % of its width of those of `twincal predict` \
             (one distribution for the mixture, from {} parameters)",
            evaluator.joints.len(),
            evaluator.steps.len(),
            short(100.0 * evaluator.interval_error),
            evaluator.kept
        );
        paragraph(&text, terminal);
        terminal.say(&shown(flags));
    }
    Ok(0)
}

/// What stands at the top of the code.
fn about(stored: &StoredTwin) -> Vec<String> {
    let twin = &stored.calibration.twin;
    let mut about = vec![
        format!(
            "Calibrated torque of {}, by twincal {}.",
            twin.robot.description().name,
            stored.context.version
        ),
        format!("Nominal model {}.", stored.context.model),
    ];
    if twin.payload_where_unknown {
        about.push(CARRIED.into());
    }
    about
}

/// The calculation of what an exported model lacks.
fn evaluator_beyond(stored: &StoredTwin, holds: Holds) -> Outcome<Evaluator> {
    let twin = &stored.calibration.twin;
    let change = Writer::new(&stored.calibration, holds)?.mean()?;
    let robot = change.robot(&twin.robot)?;
    let friction: Vec<f64> = (twin.robot.joint_names().iter())
        .map(|name| {
            let mut joints = change.joints.iter();
            let own = joints.find(|joint| joint.joint == *name);
            own.and_then(|joint| joint.friction).unwrap_or(0.0)
        })
        .collect();
    let beyond = Beyond {
        robot: &robot,
        friction: &friction,
    };
    Ok(Evaluator::new(twin, Some(beyond))?)
}

/// The model average.
fn one(flags: &Export, kind: Kind, terminal: &mut Terminal) -> Outcome<u8> {
    let (stored, maker) = FileMaker::read(flags, kind)?;
    let output = open(flags, &stored)?;
    let change = Writer::new(&stored.calibration, kind.holds)?.mean()?;
    let format = kind.holds.format;
    torque_error::require_no_worse(&change, &stored.calibration, format, &flags.allow)?;
    let file = maker.file(&change)?;
    let findings = doubts(&stored, terminal);
    if !write(flags, output, &file.bytes, terminal)? {
        return Ok(0);
    }
    if flags.json {
        let exported = Exported {
            schema: 1,
            output: shown(flags),
            joint_names: stored.calibration.twin.robot.joint_names(),
            change: as_map(&change)?,
            generated: file.notes,
            torque_error: TorqueErrors::of(&change, &stored.calibration),
            findings,
        };
        print_json(terminal, &exported)?;
    } else {
        said::generated(&file, kind.holds, terminal);
        said::change(&change, kind.holds, terminal);
        torque_error::print(&change, &stored.calibration, kind.holds, terminal);
        if stored.calibration.twin.payload_where_unknown {
            paragraph(CARRIED, terminal);
            terminal.say("");
        }
        terminal.say(&shown(flags));
    }
    Ok(0)
}

/// What is written as JSON, without the errors, which stand beside those of the twin.
fn as_map(change: &WriteBack) -> Outcome<Map<String, Value>> {
    let value = serde_json::to_value(change).map_err(|e| twincal_io::Error::Internal {
        what: "JSON output".into(),
        problem: e.to_string(),
    })?;
    let mut map = match value {
        Value::Object(map) => map,
        _ => Map::new(),
    };
    map.remove("torque_error");
    Ok(map)
}

/// Many models from the posterior.
fn draws(
    flags: &Export,
    kind: Kind,
    count: usize,
    folder: &Path,
    terminal: &mut Terminal,
) -> Outcome<u8> {
    if count == 0 || count > MOST {
        return Err(Failure::usage(
            format!("--draws {count}"),
            format!("give 1 to {MOST}"),
        ));
    }
    let (stored, maker) = FileMaker::read(flags, kind)?;
    let claim = Claim::new(
        folder,
        replaced(flags.force),
        &reads::of_twin(&flags.twin, &stored),
    )?;
    let findings = doubts(&stored, terminal);
    let writer = Writer::new(&stored.calibration, kind.holds)?;
    let seed = flags.seed.unwrap_or(stored.context.seed);
    let drawn = draw(&stored.calibration.twin.posterior, count, seed, STREAM);
    let progress = Progress::new();
    let width = (count - 1).to_string().len();
    let mut files = Vec::with_capacity(count);
    let mut projected = 0;
    for (number, beta) in drawn.beta.chunks_exact(drawn.columns).enumerate() {
        progress.counted("drawing models", number, count);
        let change = writer.draw(beta)?;
        projected += usize::from(change.projection.is_some());
        let name = format!("draw{number:0width$}.{}", kind.extension);
        files.push((name, maker.file(&change)?.bytes));
    }
    let files = files
        .iter()
        .map(|(name, bytes)| (name.as_str(), bytes.clone()));
    claim.commit(Maker::Export, files.collect())?;
    terminal.complete(folder);
    drop(progress);
    let output = folder.to_string_lossy().into_owned();
    if flags.json {
        let drawn = Drawn {
            schema: 1,
            output,
            models: count,
            seed,
            projected,
            findings,
        };
        print_json(terminal, &drawn)?;
    } else {
        let text = format!(
            "{count} models from the posterior, seed {seed}; in {projected} of them inertias were made physical"
        );
        paragraph(&text, terminal);
        terminal.say(&output);
    }
    Ok(0)
}

/// What the twin's own verdict says against it, at once on standard error.
fn doubts(stored: &StoredTwin, terminal: &mut Terminal) -> Vec<Finding> {
    let doubts: Vec<Finding> = doubt(&stored.calibration).into_iter().collect();
    for finding in &doubts {
        terminal.note(&format!("warning: {}", finding.message));
    }
    doubts
}

/// Three digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        "0".into()
    } else if (1e-3..1e4).contains(&value.abs()) {
        let decimals = (2.0 - value.abs().max(1e-3).log10().floor()).clamp(0.0, 5.0);
        format!("{value:.*}", decimals as usize)
    } else {
        format!("{value:.1e}")
    }
}
