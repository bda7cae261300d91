//! Flags over config: every flag has a key and overrides it.

use crate::args::{Allow, AllowModel, Fit, LogFlags};
use crate::failure::Outcome;
use crate::terminal::Terminal;
use std::path::Path;
use std::path::PathBuf;
use twincal_io::config::{self, Config};

/// Name of the config in the current folder that is read without being asked for.
const USUAL: &str = "twincal.toml";

/// What becomes of a config in the current folder where `--config` names none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Usual {
    /// It is read, and that is said.
    Read,
    /// It is left out: `--no-config`.
    LeftOut,
    /// It is left out, and that is said: the command may be about to write it.
    Named,
}

impl Usual {
    /// As `--no-config` says.
    pub(super) fn unless(no_config: bool) -> Self {
        if no_config { Self::LeftOut } else { Self::Read }
    }
}

/// The config of a command that fits or looks at logs.
fn of_logs(flags: &LogFlags, usual: Usual, terminal: &mut Terminal) -> Outcome<Config> {
    let there = || std::fs::symlink_metadata(USUAL).is_ok();
    if flags.config.is_some() || usual == Usual::LeftOut || !there() {
        return beside_twin(flags);
    }
    if usual == Usual::Named {
        terminal.note(&format!(
            "note: ./{USUAL} is not read; give --config {USUAL} to use it"
        ));
        return beside_twin(flags);
    }
    terminal.note(&format!(
        "settings are read from ./{USUAL}; --no-config leaves it out"
    ));
    Ok(over_config(Config::read(Path::new(USUAL))?, flags))
}

/// The config of a command with a twin, which has its own settings.
pub(super) fn beside_twin(flags: &LogFlags) -> Outcome<Config> {
    let config = match &flags.config {
        Some(path) => Config::read(path)?,
        None => Config::default(),
    };
    Ok(over_config(config, flags))
}

/// The config with the flags of logs.
fn over_config(mut config: Config, flags: &LogFlags) -> Config {
    let file = &mut config.file;
    if let Some(rate_hz) = flags.rate {
        file.log.set_rate(rate_hz);
    }
    if flags.lenient {
        file.log.set_lenient();
    }
    over(&mut file.log.strict, flags.strict.then_some(true));
    over(&mut file.inference.threads, flags.threads);
    over(&mut file.output.json, flags.json.then_some(true));
    config
}

pub(super) fn of_fit(flags: &Fit, terminal: &mut Terminal) -> Outcome<Config> {
    let mut config = of_logs(&flags.log, Usual::unless(flags.no_config), terminal)?;
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

/// Flags of a command that looks at logs beside a model.
pub(super) struct Look<'a> {
    pub(super) model: &'a Option<PathBuf>,
    pub(super) allow: &'a [AllowModel],
    pub(super) log: &'a LogFlags,
    pub(super) usual: Usual,
}

pub(super) fn of_look(look: &Look<'_>, terminal: &mut Terminal) -> Outcome<Config> {
    let mut config = of_logs(look.log, look.usual, terminal)?;
    over(&mut config.file.model.file, look.model.clone());
    let allow: Vec<Allow> = (look.allow.iter())
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
