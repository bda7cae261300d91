//! `twincal diff`: what changed between two twins of the same robot.

use super::print_json;
use super::summary::{Notes, findings, paragraph, pip};
use crate::args::Diff;
use crate::failure::Outcome;
use crate::terminal::Terminal;
use serde::Serialize;
use std::path::Path;
use twincal::Finding;
use twincal::compare::{Change, compare, hindrances};
use twincal_io::artifact::Artifact;
use twincal_io::twin_json::StoredTwin;

/// What `--json` prints.
#[derive(Serialize)]
struct Difference {
    schema: u64,
    before: String,
    after: String,
    components: Vec<Change>,
    findings: Vec<Finding>,
}

pub(super) fn run(flags: &Diff, terminal: &mut Terminal) -> Outcome<u8> {
    let read = |folder: &Path| StoredTwin::read(&Artifact::open(folder)?, false);
    let (before, after) = (read(&flags.before)?, read(&flags.after)?);
    let (old, new) = (&before.calibration.twin, &after.calibration.twin);
    let (changes, found) = (compare(old, new)?, hindrances(old, new)?);
    if flags.json {
        let difference = Difference {
            schema: 1,
            before: flags.before.to_string_lossy().into_owned(),
            after: flags.after.to_string_lossy().into_owned(),
            components: changes,
            findings: found,
        };
        print_json(terminal, &difference)?;
    } else {
        print(&changes, terminal);
        findings(&found, Notes::Shown, terminal);
    }
    Ok(0)
}

fn print(changes: &[Change], terminal: &mut Terminal) {
    terminal.heading("What changed (after - before)");
    let (changed, same): (Vec<_>, Vec<_>) = changes.iter().partition(|change| change.changed);
    if changed.is_empty() {
        terminal.say("  nothing that these logs can tell");
    }
    for change in changed {
        paragraph(&format!("{} ({})", change.words, pips(change)), terminal);
    }
    let (turned, same): (Vec<_>, Vec<_>) = same.into_iter().partition(|change| turned(change));
    if !turned.is_empty() {
        let named = turned
            .iter()
            .map(|change| format!("{}: {}", change.name, pips(change)));
        let named: Vec<String> = named.collect();
        let text = format!(
            "in one of the two only, though no number clearly differs: {}",
            named.join("; ")
        );
        paragraph(&text, terminal);
    }
    if !same.is_empty() {
        let names: Vec<&str> = same.iter().map(|change| change.name.as_str()).collect();
        paragraph(&format!("as before: {}", names.join(", ")), terminal);
    }
    terminal.say("");
}

/// "PIP 0.032 → >0.999".
fn pips(change: &Change) -> String {
    let [before, after] = change.pip.map(pip);
    format!("PIP {before} → {after}")
}

/// Whether the component is in on one side alone.
fn turned(change: &Change) -> bool {
    let [before, after] = change.pip.map(|pip| pip.is_some_and(|pip| pip > 0.5));
    before != after
}
