//! `twincal fleet`: which robots of a type deviate, and what is wrong with the model of all.

mod twins;

use super::summary::{indented, paragraph};
use super::{replaced, start_threads};
use crate::args::Fleet as Flags;
use crate::failure::{Failure, Outcome};
use crate::interrupts::{Caller, require_caller};
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;
use twincal::fleet::{Fleet, FleetResult, FleetSettings, FleetStage};
use twincal_io::artifact::{Claim, Inputs, Maker};
use twincal_io::fleet::{self, Corrected, FLEET, PAGE, fleet_json, fleet_page, reason};
use twincal_io::statistics::{ModelFile, StatisticsFile};
use twincal_io::words::fleet as words;
use twins::Twins;

/// Files that are read at a time.
const BATCH: usize = 8;
/// Robots that are printed.
const SHOWN: usize = 12;

pub(super) fn run(flags: &Flags, terminal: &mut Terminal) -> Outcome<u8> {
    let settings = settings(flags)?;
    let mut inputs = Inputs::default();
    flags.files.iter().for_each(|path| inputs.add(path));
    let replace = replaced(flags.force);
    let claim = Claim::new(&flags.output, replace, &inputs)?;
    let twins = Twins::claim(flags, replace, &inputs)?;
    start_threads(flags.threads.map(|threads| threads as usize))?;
    let progress = Progress::new();
    let asked = Fleet::with_twins(twins.robots());
    let (fleet, models) = read(asked, &flags.files, &progress)?;
    let progress = Mutex::new(progress);
    let caller = Caller::of_this_thread();
    let watch = |stage: FleetStage| {
        if let Ok(progress) = progress.lock() {
            show(stage, &progress);
        }
        caller.require_waiting()
    };
    let result = fleet
        .fit(&settings, &watch)
        .map_err(twincal_io::Error::from)?;
    let model = models.of(&result)?;
    let of_type = (result.type_twin.as_ref()).map(|twin| twins::model_of_type(twin, model));
    let (file, refused) = match of_type.transpose() {
        Ok(file) => (file, None),
        Err(failure) => (None, Some(failure.in_one_line())),
    };
    let about = fleet::Inputs {
        model: model.name.clone(),
        window_seconds: settings.window,
        false_discovery_rate: settings.false_discovery_rate,
        seed: flags.seed,
        statistics: display_names(&flags.files),
        corrected: Corrected {
            file: file.as_ref().map(|(name, _)| *name),
            refused,
        },
    };
    let json = fleet_json(&result, &about)?;
    let page = fleet_page(&result, &about)?;
    let mut files = vec![(FLEET, json.clone()), (PAGE, page.into_bytes())];
    files.extend(file);
    require_caller()?;
    twins.write(&result, model, terminal)?;
    claim.commit(Maker::Fleet, files)?;
    terminal.complete(&flags.output);
    drop(progress);
    if flags.json {
        terminal.data(&String::from_utf8_lossy(&json));
        return Ok(0);
    }
    print(&result, terminal);
    if let Some(problem) = &about.corrected.refused {
        paragraph(&format!("No corrected model file: {problem}"), terminal);
    }
    terminal.say(&flags.output.to_string_lossy());
    Ok(0)
}

fn show(stage: FleetStage, progress: &Progress) {
    let (what, done, all) = match stage {
        FleetStage::Noise => ("measuring noise", 0, 1),
        FleetStage::Scatter(done, all) => ("learning how robots differ", done, all),
        FleetStage::Posterior(done, all) => ("sampling the posterior", done, all),
        FleetStage::Twins => ("making twins", 0, 1),
    };
    progress.counted(what, done, all);
}

fn settings(flags: &Flags) -> Outcome<FleetSettings> {
    let mut settings = FleetSettings {
        window: seconds(&flags.window)?,
        false_discovery_rate: flags.fdr,
        ..FleetSettings::default()
    };
    settings.calibration.inference.seed = flags.seed;
    Ok(settings)
}

/// `7d`, `12h`, `30min` or `90s` in seconds.
fn seconds(text: &str) -> Outcome<f64> {
    let split = text.find(|c: char| c.is_ascii_alphabetic());
    let (number, unit) = text.split_at(split.unwrap_or(text.len()));
    let factor = match unit {
        "w" => 7.0 * 86_400.0,
        "d" => 86_400.0,
        "h" => 3600.0,
        "min" => 60.0,
        "s" => 1.0,
        _ => f64::NAN,
    };
    let seconds = number.trim().parse().map_or(f64::NAN, |n: f64| n * factor);
    if seconds > 0.0 && seconds.is_finite() {
        return Ok(seconds);
    }
    Err(Failure::usage(
        format!("--window {text}: no length of time"),
        "give a number with w, d, h, min or s, such as 7d",
    ))
}

/// Every model file once, and which of them a robot has.
#[derive(Default)]
struct Models {
    files: Vec<ModelFile>,
    of_robot: BTreeMap<String, usize>,
}

impl Models {
    fn add(&mut self, robot: &str, model: ModelFile) {
        let at = self.files.iter().position(|file| *file == model);
        let at = at.unwrap_or_else(|| {
            self.files.push(model);
            self.files.len() - 1
        });
        self.of_robot.insert(robot.to_owned(), at);
    }

    /// That of the robots that count.
    fn of(&self, result: &FleetResult) -> Outcome<&ModelFile> {
        let first = result.units.first();
        let at = first.and_then(|unit| self.of_robot.get(&unit.robot));
        at.map(|at| &self.files[*at])
            .ok_or_else(|| Failure::usage("no robot counts", "give statistics of three robots"))
    }
}

/// All files, added to the fleet, and the model of each robot.
fn read(mut fleet: Fleet, files: &[PathBuf], progress: &Progress) -> Outcome<(Fleet, Models)> {
    let mut models = Models::default();
    for (batch, paths) in files.chunks(BATCH).enumerate() {
        progress.counted("reading statistics", batch * BATCH, files.len());
        let read: Vec<twincal_io::Result<StatisticsFile>> = (paths.par_iter())
            .map(|path| StatisticsFile::read(path))
            .collect();
        for file in read {
            let file = file?;
            models.add(&file.statistics.robot_name, file.model);
            fleet.add(&file.statistics);
        }
    }
    Ok((fleet, models))
}

/// Which robots deviate, then what is wrong for all, then what is left out.
fn print(result: &FleetResult, terminal: &mut Terminal) {
    terminal.heading(&words::headline(result));
    for unit in result.units.iter().filter(|unit| unit.deviates).take(SHOWN) {
        terminal.say(&format!(
            "  {}, probability {}",
            unit.robot,
            words::chance(unit.probability)
        ));
        if unit.deviations.is_empty() {
            terminal.say("    several effects, none likely alone");
        }
        for own in &unit.deviations {
            let value = words::main_value(&own.parameters);
            let value = value.map_or_else(|| "–".into(), words::difference);
            let (since, pip) = (words::since(own), words::chance(own.pip));
            let text = format!("{}: {value}, {since}, PIP {pip}", own.story);
            indented(&text, ["    ", "      "], terminal);
        }
    }
    let named = result.units.iter().filter(|unit| unit.deviates).count();
    more(named, terminal);
    terminal.say("");
    terminal.heading(&words::of_type(result));
    let sure = || result.type_effects.iter().filter(|own| own.pip >= 0.5);
    for effect in sure().take(SHOWN) {
        let value = words::main_value(&effect.parameters);
        let value = value.map_or_else(|| "–".into(), words::value);
        let pip = words::chance(effect.pip);
        paragraph(&format!("{}: {value}, PIP {pip}", effect.story), terminal);
    }
    more(sure().count(), terminal);
    if let Some(doubt) = words::doubt(result) {
        paragraph(&doubt, terminal);
    }
    if !result.left_out.is_empty() {
        terminal.say("");
        terminal.heading("Left out");
        for own in result.left_out.iter().take(SHOWN) {
            paragraph(
                &format!("{}, log {}: {}", own.robot, own.log, reason(&own.reason)),
                terminal,
            );
        }
    }
    more(result.left_out.len(), terminal);
    terminal.say("");
}

/// Says how many are not printed.
fn more(all: usize, terminal: &mut Terminal) {
    if all > SHOWN {
        terminal.say(&format!("  and {} more: see {PAGE}", all - SHOWN));
    }
}
