//! `report.html`: one self-contained page that says whether a twin can be used, what was found, and how sure it is.
//!
//! The page needs no network and no file beside it. Every string that came from a model, a log or a command line is
//! stripped of control characters and escaped on its way into the page, by the template's formatter, by the SVG builder
//! and by the data block. A content security policy is the second lock: it lets one script run, by its hash. Without a
//! script the page shows the same figures, still. The same calibration gives the same bytes.

mod ambiguity;
pub(crate) mod design;
mod effects;
mod figure;
mod figures;
mod findings;
#[cfg(feature = "tables")]
pub(crate) mod fleet;
mod first_screen;
mod honesty;
#[cfg(test)]
pub(crate) mod fixture;
mod page;
mod plot;
mod scale;
mod script;
mod standstill;
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
use twincal::calibrate::Calibration;

/// Probability from which an effect that was not kept is worth a line.
pub const MENTIONED: f64 = 0.05;

/// The report as HTML.
///
/// # Errors
/// [`Error::Internal`] if the template and the values that fill it do not fit together.
///
/// # Example
/// ```
/// # #[path = "../../../twincal/examples/two_link.rs"] mod two_link;
/// use twincal_io::{context::ReportContext, report::render};
///
/// # let fit = two_link::study()?;
/// let context = ReportContext { model: "arm.urdf".into(), ..ReportContext::default() };
/// let page = render(&fit, &context)?;
/// assert!(page.trim_start().starts_with("<!DOCTYPE html>") && page.contains("payload"));
/// assert!(!page.contains("src=\"http")); // it needs no network
/// assert_eq!(page, render(&fit, &context)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render(calibration: &Calibration, context: &ReportContext) -> Result<String> {
    page::fill(calibration, context).map_err(|error| Error::Internal {
        what: "report template".into(),
        problem: format!("{error:#}"),
    })
}
