//! Flags over config: every flag has a key and overrides it.

use crate::args::{Allow, AllowModel, Fit, LogFlags};
use crate::failure::Outcome;
use crate::terminal::Terminal;
use std::path::Path;
use std::path::PathBuf;
use twincal_io::config::{self, Config};

/// Name of a config that is found but not asked for.
const USUAL: &str = "twincal.toml";

/// The config of the flags that every command with logs has; a usual one that is not read is told.
fn of_logs(flags: &LogFlags, terminal: &mut Terminal) -> Outcome<Config> {
    if flags.config.is_none() && Path::new(USUAL).exists() {
        terminal.note(&format!(
            "note: ./{USUAL} is not read; give --config {USUAL} to use it"
        ));
    }
    beside_twin(flags)
}

/// The config of a command with a twin, which has its own settings.
pub(super) fn beside_twin(flags: &LogFlags) -> Outcome<Config> {
    let mut config = match &flags.config {
        Some(path) => Config::read(path)?,
        None => Config::default(),
    };
    let file = &mut config.file;
    over(&mut file.log.rate_hz, flags.rate);
    over(&mut file.log.lenient, flags.lenient.then_some(true));
    over(&mut file.log.strict, flags.strict.then_some(true));
    over(&mut file.inference.threads, flags.threads);
    over(&mut file.output.json, flags.json.then_some(true));
    Ok(config)
}

pub(super) fn of_fit(flags: &Fit, terminal: &mut Terminal) -> Outcome<Config> {
    let mut config = of_logs(&flags.log, terminal)?;
    let file = &mut config.file;
    over(&mut file.model.file, flags.model.clone());
    over(&mut file.model.allow, allowed(&flags.allow));
    over(
        &mut file.log.heldout,
        Some(flags.heldout.clone()).filter(|logs| !logs.is_empty()),
    );
    over(&mut file.inference.seed, flags.seed);
    over(&mut file.output.directory, flags.output.clone());
    over(&mut file.output.force, flags.force.then_some(true));
    Ok(config)
}

/// The config of a command that looks at logs beside a model.
pub(super) fn of_look(
    model: &Option<PathBuf>,
    allow: &[AllowModel],
    flags: &LogFlags,
    terminal: &mut Terminal,
) -> Outcome<Config> {
    let mut config = of_logs(flags, terminal)?;
    over(&mut config.file.model.file, model.clone());
    let allow: Vec<Allow> = (allow.iter())
        .map(|AllowModel::UnphysicalInertia| Allow::UnphysicalInertia)
        .collect();
    over(&mut config.file.model.allow, allowed(&allow));
    Ok(config)
}

fn over<T>(key: &mut Option<T>, flag: Option<T>) {
    if flag.is_some() {
        *key = flag;
    }
}

fn allowed(flags: &[Allow]) -> Option<Vec<config::Allow>> {
    let word = |flag: &Allow| match flag {
        Allow::UnphysicalInertia => config::Allow::UnphysicalInertia,
        Allow::DisagreeingChains => config::Allow::DisagreeingChains,
    };
    (!flags.is_empty()).then(|| flags.iter().map(word).collect())
}
