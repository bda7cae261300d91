//! "A or B, the data cannot tell": sets of effects that are not distinguishable, joints that hardly moved.

use super::view::Joint;
use crate::words::list::list;
use crate::words::number::percent;
use twincal::Code;
use twincal::assess::standstill;
use twincal::calibrate::Calibration;

/// A joint that stood still for more than this share of the rows hardly moved.
const STOOD: f64 = 0.5;

/// One sentence for each thing that the data leave open.
pub(super) fn sentences(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let mut out = either_or(calibration);
    let still: Vec<String> = joints
        .iter()
        .enumerate()
        .filter_map(|(j, joint)| {
            let share = standstill(calibration, j);
            (share > STOOD).then(|| format!("{} ({} of the rows)", joint.name, percent(share)))
        })
        .collect();
    if !still.is_empty() {
        out.push(format!(
            "At rest in most of the logs: {}. What is found on them rests on the other rows.",
            list(&still)
        ));
    }
    let unseen = calibration
        .findings
        .iter()
        .filter(|f| f.code == Code::UnseenMotion);
    let mut unseen: Vec<String> = unseen.map(|finding| sentence(&finding.message)).collect();
    let more = unseen.len().saturating_sub(MOTIONS);
    unseen.truncate(MOTIONS);
    out.append(&mut unseen);
    if more > 0 {
        out.push(format!(
            "{more} more such motions stand among the findings."
        ));
    }
    out
}

/// Sentences on what another motion would show, at most.
const MOTIONS: usize = 4;

/// A message as a sentence of its own; a name at its beginning stays as it is.
fn sentence(message: &str) -> String {
    let first = message.split([' ', ',']).next().unwrap_or("");
    if first.contains(|c: char| !c.is_alphabetic()) {
        return format!("{message}.");
    }
    let mut letters = message.chars();
    match letters.next() {
        Some(first) => format!("{}{}.", first.to_uppercase(), letters.as_str()),
        None => String::new(),
    }
}

/// Sets of effects of which one is there and the data cannot tell which; those that only the prior tells apart in one
/// sentence.
fn either_or(calibration: &Calibration) -> Vec<String> {
    let groups = || calibration.groups.iter();
    let open = groups().filter(|group| !group.settled);
    let mut out: Vec<String> = open.map(|group| sentence(&group.words)).collect();
    let by_prior = calibration.told_apart_by_the_prior();
    out.extend(by_prior.iter().map(|told| sentence(told)));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, view};
    use twincal::calibrate::{Alike, Group};
    use twincal::{Code, Finding, Severity};

    #[test]
    fn effects_that_stand_for_each_other_are_named_together() {
        let mut calibration = fixture::two_joints();
        assert_eq!(either_or(&calibration), Vec::<String>::new());
        calibration.groups.push(Group {
            members: vec!["elbow.spring".into(), "elbow.potential".into()],
            pip: 0.98,
            alike: Alike::TheseLogs,
            settled: false,
            words: "elbow.spring or elbow.potential, with probability 0.98".into(),
        });
        let open = either_or(&calibration);
        assert!(
            open == ["elbow.spring or elbow.potential, with probability 0.98."],
            "{open:?}"
        );
    }

    /// The demo's payload correlates by −0.955 with its first moment, and both are known to a percent.
    #[test]
    fn correlated_coefficients_alone_leave_nothing_open() {
        let mut calibration = fixture::two_joints();
        calibration.draws.values[1] = calibration.draws.values[0].clone();
        let joints = view::joints(&calibration);
        let said = sentences(&calibration, &joints);
        assert!(!said.iter().any(|s| s.contains("correlation")), "{said:?}");
    }

    #[test]
    fn a_page_without_dropped_columns_keeps_its_sets() {
        let mut calibration = fixture::two_joints();
        for own in &mut calibration.terms {
            own.term.status = twincal::term::Status::Candidate;
        }
        calibration.groups.push(Group {
            members: vec!["payload".into(), "elbow.tensor".into()],
            pip: 0.98,
            alike: Alike::EveryMotion,
            settled: true,
            words: String::new(),
        });
        let html = crate::report::render(&calibration, &crate::report::ReportContext::default());
        let html = html.expect("a page");
        assert!(html.contains("Not distinguishable in every motion"));
        assert!(!html.contains("No two candidates make the same torque"));
    }

    #[test]
    fn what_another_motion_would_show_is_told() {
        let mut calibration = fixture::two_joints();
        let message = "move `elbow` more: these logs show nothing of elbow.viscous";
        calibration.findings.push(Finding::new(
            Severity::Note,
            Code::UnseenMotion,
            "elbow",
            message,
            1,
        ));
        let said = sentences(&calibration, &view::joints(&calibration));
        let wanted = format!("M{}.", &message[1..]);
        assert!(said.contains(&wanted), "{said:?}");
    }

    #[test]
    fn joints_that_stood_still_are_named() {
        let mut calibration = fixture::two_joints();
        for log in &mut calibration.logs {
            (log.rows[1], log.standstill[1]) = (100, 900);
        }
        let said = sentences(&calibration, &view::joints(&calibration));
        assert!(
            said.iter()
                .any(|s| s.contains("elbow") && s.contains("90.0")),
            "{said:?}"
        );
        assert!(!said.iter().any(|s| s.contains("shoulder (stood")));
    }
}
