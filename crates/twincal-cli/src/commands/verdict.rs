//! The twin's own verdict, for commands that use it: nobody ought to meet it in the simulator first.

use twincal::assess;
use twincal::calibrate::Calibration;
use twincal::{Code, Finding, Severity};
use twincal_io::words::{Answer, answer};

/// The verdict where it is not a plain yes: the answer and its first reason. It is of the fit, not of what the command does, so that exit codes
/// do not follow from it.
pub(super) fn doubt(calibration: &Calibration) -> Option<Finding> {
    let answer = answer(calibration);
    (answer.answer != assess::Answer::Yes).then(|| {
        let words = words(&answer);
        Finding::new(Severity::Warning, Code::Verdict, "", words, 0)
    })
}

/// "Can this twin be used? No: … Joint elbow: …"
fn words(answer: &Answer) -> String {
    let next = answer.next.as_ref().map(|next| format!("Record {next}"));
    let mut reasons = answer.limits.iter().chain(&next);
    let reason = reasons.next().or(answer.grounds.first());
    let reason = reason.map_or("", String::as_str);
    let more = match answer.limits.len() + answer.folded.len() {
        0 | 1 => "",
        _ => " (more in its report)",
    };
    format!("can this twin be used? {} {reason}{more}", answer.lead)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_reason_stands_behind_the_answer() {
        let of = |lead: &str, limits: &[&str]| Answer {
            answer: assess::Answer::NotYet,
            reason: Code::NothingEstablished,
            headline: String::new(),
            lead: lead.into(),
            grounds: vec!["Torque error: 1 → 2 N·m.".into()],
            limits: limits.iter().map(|&limit| limit.into()).collect(),
            folded: Vec::new(),
            next: None,
        };
        let told = |lead: &str, limits: &[&str]| words(&of(lead, limits));
        assert_eq!(
            told("No: worse.", &[]),
            "can this twin be used? No: worse. Torque error: 1 → 2 N·m."
        );
        let not_tested = Answer {
            next: Some("another motion.".into()),
            ..of("Not yet: not tested.", &[])
        };
        let said = "can this twin be used? Not yet: not tested. Record another motion.";
        assert_eq!(words(&not_tested), said);
        assert_eq!(
            told(
                "Yes, within limits: to predict torque, with the exceptions:",
                &["Joint a: one.", "Joint b: two."]
            ),
            "can this twin be used? Yes, within limits: to predict torque, with the exceptions: Joint a: one. (more in its report)"
        );
    }
}
