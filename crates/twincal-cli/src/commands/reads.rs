//! What a command reads: the one list of it, which every output is compared with before it is opened.

use crate::args::LogFlags;
use std::path::{Path, PathBuf};
use twincal_io::artifact::Inputs;
use twincal_io::config::{Config, Settings};
use twincal_io::twin_json::StoredTwin;
use twincal_io::{log, model};

/// The config that a command was given, and the settings that follow from it.
pub(super) struct Given<'a> {
    pub(super) flags: &'a LogFlags,
    pub(super) config: &'a Config,
    pub(super) settings: &'a Settings,
}

/// Adds config, model and logs of a command; `logs` are those it was given.
pub(super) fn add_given(inputs: &mut Inputs, given: &Given<'_>, logs: &[PathBuf]) {
    let Given {
        flags,
        config,
        settings,
    } = given;
    let configs = flags.config.iter().map(PathBuf::as_path);
    for path in configs.chain(config.path()) {
        inputs.add(path);
    }
    for path in settings
        .model_file
        .iter()
        .flat_map(|path| model::files_of(path))
    {
        inputs.add(&path);
    }
    let named = settings.log.named();
    for path in logs.iter().chain(&named).chain(&settings.log.heldout) {
        inputs.add(path);
        // What is no bag is said when it is read.
        for part in log::files_of(path).unwrap_or_default() {
            inputs.add(&part);
        }
    }
}

/// A twin, and what it was made from.
pub(super) fn of_twin(folder: &Path, stored: &StoredTwin) -> Inputs {
    let mut inputs = Inputs::default();
    inputs.add(folder);
    inputs.add_originals(&stored.context.files);
    inputs
}
