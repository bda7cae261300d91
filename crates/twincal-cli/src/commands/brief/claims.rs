//! What limits the twin: the limits of the report, gravest first, then one warning of each kind.

use super::Detail;
use super::text::{Page, Width};
use crate::commands::summary::about;
use twincal::calibrate::Calibration;
use twincal::{Code, Finding, Severity};
use twincal_io::words::Answer;

/// The list, and how many more there are.
pub(super) fn list(
    calibration: &Calibration,
    answer: &Answer,
    detail: Detail,
    width: Width,
    page: &mut Page,
) {
    let (texts, all) = claims(calibration, answer);
    if texts.is_empty() {
        return;
    }
    page.heading("Limits");
    let shown = texts.len().min(detail.claims);
    for text in &texts[..shown] {
        page.warning(text, ["  ", "    "], width, detail.claim);
    }
    if all > shown {
        page.paragraph(
            &format!("… {} more (-v)", all - shown),
            ["  ", "    "],
            width,
            1,
        );
    }
    page.blank();
}

/// What is said, gravest first, and how much there is to say.
fn claims(calibration: &Calibration, answer: &Answer) -> (Vec<String>, usize) {
    let limits = answer.limits.iter().chain(&answer.folded);
    let mut texts: Vec<String> = limits.cloned().collect();
    let mut all = texts.len();
    // Mistakes and degraded data are among the limits.
    let warnings: Vec<&Finding> = (calibration.findings.iter())
        .filter(|own| own.severity == Severity::Warning && !own.forbids_yes())
        // They stand among the effects.
        .filter(|own| own.code != Code::AlikeInData)
        .collect();
    for (number, finding) in warnings.iter().enumerate() {
        let before = &warnings[..number];
        if before
            .iter()
            .any(|own| (&own.code, &own.message) == (&finding.code, &finding.message))
        {
            continue;
        }
        all += 1;
        if !before.iter().any(|own| own.code == finding.code) {
            let subject = about(&[finding.subject.as_str()], finding.code);
            texts.push(format!("{subject}{}", finding.message));
        }
    }
    (texts, all)
}
