//! `twincal report`: report.html anew from the stored result.

use super::calibration::{Print, say_where, say_where_in_json};
use super::open::open;
use crate::args::Report;
use crate::failure::Outcome;
use crate::terminal::Terminal;
use twincal_io::artifact::{Artifact, Claim, Inputs, REPORT, Replace};
use twincal_io::twin_json::StoredTwin;

pub(super) fn run(flags: &Report, terminal: &mut Terminal) -> Outcome<u8> {
    let artifact = Artifact::open(&flags.twin)?;
    // A missing report is what this command is for; a changed one may hold somebody's notes.
    let rewrite = flags.force || !flags.twin.join(REPORT).exists();
    let stored = StoredTwin::read(&artifact, rewrite)?;
    // The one command whose output is its twin: every other file of it is written again as it was.
    let claim = Claim::new(&flags.twin, Replace::Artifact, &Inputs::default())?;
    stored.rewrite_report(&artifact, claim)?;
    terminal.complete(&flags.twin);
    if flags.json {
        say_where_in_json(&flags.twin, terminal)?;
    } else {
        say_where(&flags.twin, Print::Brief, terminal);
    }
    if flags.open {
        open(&flags.twin.join(REPORT), terminal);
    }
    Ok(0)
}
