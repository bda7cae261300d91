//! `twincal doctor`: what is wrong with logs or model, what to fix first, and a config to begin with; `twincal init`
//! writes that config.

mod columns;
mod examine;
mod remedies;
mod print;
mod propose;
mod units;

use super::checkup::Checkup;
use super::inspect::library::{ComponentRow, component_rows};
use super::settings::{Look, Usual};
use super::{print_json, reads, require_strict, settings, start_threads};
use crate::args;
use crate::exit;
use crate::failure::{Failure, Outcome};
use crate::progress::Progress;
use crate::terminal::Terminal;
use examine::{Examination, Mapping, Refusal, Trial, examine};
use propose::propose;
use remedies::{Advice, remedies};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::incidents::Incident;
use twincal::lag::{Lags, LogLag};
use twincal::self_check::JointCheck;
use twincal::signal::{Agreement, LogOverview, Pipeline, Steps};
use twincal_io::artifact::{Inputs, OutputFile};
use twincal_io::config::{Config, Settings};
use twincal_io::words::When;

/// Where `init` writes.
const USUAL: &str = "twincal.toml";

/// What `--json` prints.
#[derive(Serialize)]
struct Diagnosis {
    schema: u64,
    model: String,
    verdict: String,
    /// Exit code of this command: what `fit` would end with for the same reason.
    exit_code: u8,
    refusals: Vec<Refusal>,
    /// Units that were converted for the look alone.
    converted: Vec<String>,
    logs: Vec<LogRow>,
    /// How much later than the motion torque was logged, over all logs.
    lags: Option<Lags>,
    /// Log against model, over all logs.
    joints: Vec<JointCheck>,
    /// Filters as `fit` would choose them; null where it could not.
    pipeline: Option<Pipeline>,
    components: Vec<ComponentRow>,
    /// Independent directions: over all motions of the robot, and in these logs.
    directions: Option<[usize; 2]>,
    unseen: Vec<String>,
    /// Most important first.
    remedies: Vec<Advice>,
    findings: Vec<Finding>,
    /// The proposed twincal.toml.
    config: String,
}

#[derive(Serialize)]
struct LogRow {
    #[serde(flatten)]
    overview: LogOverview,
    columns: Option<Mapping>,
    steps: Vec<Steps>,
    velocity: Vec<Option<Agreement>>,
    lag: Option<LogLag>,
    incidents: Vec<Incident>,
}

/// What the flags ask to look at.
struct Asked {
    config: Config,
    /// The file it came from.
    given: Option<PathBuf>,
    settings: Settings,
    model: PathBuf,
    logs: Vec<PathBuf>,
}

impl Asked {
    /// `verb` is the command; `init` leaves out the file that it may be about to write.
    fn of(flags: &args::Look, verb: &str, terminal: &mut Terminal) -> Outcome<Self> {
        let usual = match (verb, flags.no_config) {
            ("init", false) => Usual::Named,
            (_, no_config) => Usual::unless(no_config),
        };
        let look = Look {
            model: &flags.model,
            allow: &flags.allow,
            log: &flags.log,
            usual,
        };
        let config = settings::of_look(&look, terminal)?;
        let settings = config.settings()?;
        let logs = if flags.logs.is_empty() {
            settings.log.named()
        } else {
            flags.logs.clone()
        };
        let Some(model) = settings.model_file.clone() else {
            return Err(super::no_model());
        };
        if logs.is_empty() {
            return Err(Failure::usage(
                "no log",
                format!("give logs, as in `twincal {verb} run.csv --model arm.urdf`"),
            ));
        }
        Ok(Self {
            given: config.read_from().map(|(file, _)| file.to_owned()),
            config,
            settings,
            model,
            logs,
        })
    }
}

pub(super) fn run(flags: &args::Doctor, terminal: &mut Terminal) -> Outcome<u8> {
    let asked = Asked::of(&flags.look, "doctor", terminal)?;
    start_threads(asked.settings.threads)?;
    let progress = Progress::new();
    let trial = match flags.trial {
        true => Trial::Fit,
        false => Trial::None,
    };
    let examination = examine(&asked.model, &asked.logs, &asked.settings, &progress, trial)?;
    drop(progress);
    let diagnosis = diagnosis(examination, &asked);
    if asked.settings.json {
        print_json(terminal, &diagnosis)?;
    } else {
        print::print(&diagnosis, terminal);
    }
    require_strict(asked.settings.log.strict, &diagnosis.findings)?;
    Ok(diagnosis.exit_code)
}

/// What `init --json` prints.
#[derive(Serialize)]
struct Written<'a> {
    schema: u64,
    output: &'a str,
    config: &'a str,
}

pub(super) fn init(flags: &args::Init, terminal: &mut Terminal) -> Outcome<u8> {
    let asked = Asked::of(&flags.look, "init", terminal)?;
    let target = flags.output.clone().unwrap_or_else(|| USUAL.into());
    let mut inputs = Inputs::default();
    let given = reads::Given {
        flags: &flags.look.log,
        config: &asked.config,
        settings: &asked.settings,
    };
    reads::add_given(&mut inputs, &given, &asked.logs);
    let mut output = OutputFile::create(&target, flags.force, &inputs)?;
    start_threads(asked.settings.threads)?;
    let progress = Progress::new();
    let examination = examine(
        &asked.model,
        &asked.logs,
        &asked.settings,
        &progress,
        Trial::None,
    )?;
    drop(progress);
    let nothing_read = examination.overviews.is_empty();
    if let Some(refusal) = examination.refusals.last().filter(|_| nothing_read) {
        return Err(Failure::usage(&refusal.problem, &refusal.remedy));
    }
    let folder = target.parent().unwrap_or(Path::new(""));
    let proposal = propose(&examination, &asked, folder);
    let text = proposal.text();
    let written = match output.file() {
        Some(file) => std::io::Write::write_all(file, text.as_bytes()),
        None => Ok(()),
    };
    output.commit(written)?;
    terminal.complete(&target);
    let shown = target.to_string_lossy();
    if asked.settings.json {
        let written = Written {
            schema: 1,
            output: &shown,
            config: &text,
        };
        print_json(terminal, &written)?;
    } else {
        terminal.data(&text);
        let refused = proposal
            .remarks
            .iter()
            .any(|r| r.starts_with(propose::REFUSES));
        let next = match refused {
            true => "fit still refuses these logs: its first lines say why".to_owned(),
            false => format!("next: twincal fit --config {shown}"),
        };
        terminal.note(&format!("{shown} is written; {next}"));
    }
    Ok(exit::of_findings(&examination.findings))
}

/// What stands behind the verdict: how much there is to fix. Refusals are remedies of now.
fn to_fix(remedies: &[Advice]) -> String {
    let count = |when: When| {
        let of = |remedy: &&Advice| remedy.wrong && remedy.when == when;
        remedies.iter().filter(of).count()
    };
    match (count(When::Now), count(When::NextLog)) {
        (0, 0) => String::new(),
        (now, 0) => format!("; {now} to fix"),
        (0, next) => format!("; {next} to do better in the next log"),
        (now, next) => format!("; {now} to fix, {next} to do better in the next log"),
    }
}

/// What was seen of each log.
fn log_rows(
    overviews: impl Iterator<Item = (LogOverview, Vec<Steps>)>,
    mappings: Vec<(String, Mapping)>,
    checkup: &mut Checkup,
) -> Vec<LogRow> {
    let mut mappings: BTreeMap<String, Mapping> = mappings.into_iter().collect();
    let row = |(overview, steps): (LogOverview, Vec<Steps>)| LogRow {
        columns: mappings.remove(&overview.name),
        velocity: checkup.agreement.remove(&overview.name).unwrap_or_default(),
        lag: (checkup.lags.iter().flat_map(|lags| &lags.logs))
            .find(|log| log.log == overview.name)
            .cloned(),
        incidents: checkup.incidents.remove(&overview.name).unwrap_or_default(),
        overview,
        steps,
    };
    overviews.map(row).collect()
}

fn diagnosis(examination: Examination, asked: &Asked) -> Diagnosis {
    let remedies = remedies(&examination);
    let folder = Path::new("");
    let proposal = propose(&examination, asked, folder);
    let refused = examination.refusals.iter().map(|refusal| refusal.exit_code);
    let degraded = exit::of_findings(&examination.findings);
    let exit_code = refused.clone().min().unwrap_or(degraded);
    let to_fix = to_fix(&remedies);
    let verdict = match (refused.count(), degraded) {
        (0, 0) => format!("fit would go ahead{to_fix}"),
        (0, _) => format!("fit would go ahead, but call the data degraded{to_fix}"),
        _ => format!("fit would refuse{to_fix}"),
    };
    let excitation = examination
        .outlook
        .as_ref()
        .and_then(|o| o.excitation.as_ref());
    let components = examination
        .outlook
        .as_ref()
        .map_or_else(Vec::new, |o| component_rows(&o.library, excitation));
    let (directions, unseen) = (
        excitation.map(|e| e.directions),
        excitation.map_or_else(Vec::new, twincal::excitation::sentences),
    );
    let Examination {
        robot,
        refusals,
        mappings,
        converted,
        overviews,
        steps,
        pipeline,
        mut checkup,
        findings,
        ..
    } = examination;
    let overviews = overviews.into_iter().zip(steps);
    Diagnosis {
        schema: 1,
        model: robot.file.name,
        verdict,
        exit_code,
        refusals,
        converted,
        logs: log_rows(overviews, mappings, &mut checkup),
        lags: checkup.lags,
        joints: checkup.joints,
        pipeline,
        components,
        directions,
        unseen,
        remedies,
        findings,
        config: proposal.text(),
    }
}
