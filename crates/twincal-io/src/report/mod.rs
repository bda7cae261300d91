//! `report.html`: one self-contained page that says whether a twin can be used, what was found, and how sure it is.
//!
//! The page needs no network and no file beside it. Every string that came from a model, a log or a command line is
//! stripped of control characters and escaped on its way into the page, by the template's formatter, by the SVG builder
//! and by the data block. A content security policy is the second lock: it lets one script run, by its hash. Without a
//! script the page shows the same figures, still. The same calibration gives the same bytes.

mod ambiguity;
mod beyond;
mod effects;
mod figure;
mod figures;
mod findings;
mod first_screen;
mod grounds;
mod honesty;
#[cfg(test)]
mod fixture;
mod limits;
mod next_recording;
mod page;
mod plot;
mod remarks;
mod scale;
mod script;
mod shape;
mod standstill;
mod status;
mod svg;
mod tables;
#[cfg(test)]
mod tests;
mod text;
mod traces;
mod verdict;
mod view;

use crate::context::ReportContext;
use crate::error::{Error, Result};
use twincal::Code;
use twincal::calibrate::Calibration;

/// Probability from which an effect that was not kept is worth a line: below it, it is absent.
pub const MENTIONED: f64 = 0.05;

pub use honesty::{drawn_alike, stretched};
pub use status::reason;

/// Whether the calibrated torque can be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// May it be used?
    pub answer: twincal::assess::Answer,
    /// What decides.
    pub reason: Code,
    /// One sentence.
    pub headline: String,
    /// What it rests on.
    pub grounds: Vec<String>,
    /// What log, sampler, held-out torque and the effects say against it: what matters most.
    pub limits: Vec<String>,
    /// And the rest of that.
    pub folded: Vec<String>,
    /// The recording to make next, where that would show more.
    pub next: Option<String>,
}

/// What stands at the top of the report, without its pointers into the page.
#[must_use]
pub fn answer(calibration: &Calibration) -> Answer {
    let joints = view::joints(calibration);
    let verdict = verdict::judge(calibration, &joints);
    Answer {
        answer: verdict.answer,
        reason: verdict.reason,
        headline: verdict.headline,
        grounds: verdict.grounds,
        limits: verdict.limits,
        folded: verdict.folded,
        next: verdict.next,
    }
}

/// The report as HTML.
///
/// # Errors
/// [`Error::Internal`] if the template and the values that fill it do not fit together.
pub fn render(calibration: &Calibration, context: &ReportContext) -> Result<String> {
    page::fill(calibration, context).map_err(|error| Error::Internal {
        what: "report template".into(),
        problem: format!("{error:#}"),
    })
}
