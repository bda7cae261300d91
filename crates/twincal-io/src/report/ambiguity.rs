//! "A or B, the data cannot tell": pairs of effects that stand in for each other, joints that hardly moved.

use super::view::Joint;
use crate::words::list::list;
use crate::words::number::{fixed, percent};
use twincal::Code;
use twincal::assess::standstill;
use twincal::calibrate::Calibration;

/// Two coefficients whose draws correlate this much are known as a combination.
const CORRELATED: f64 = 0.95;
/// A joint that stood still for more than this share of the rows hardly moved.
const STOOD: f64 = 0.5;

/// One sentence for each thing that the data leave open.
pub(super) fn sentences(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let mut out = either_or(calibration);
    let draws = &calibration.draws;
    for (i, j, r) in super::figures::pairs::correlations(&draws.values) {
        if let (true, Some(one), Some(other)) = (
            r.abs() >= CORRELATED,
            draws.terms.get(i),
            draws.terms.get(j),
        ) {
            out.push(format!(
                "{one} and {other} are known as a combination only (correlation {}): a motion that separates them would tell \
                 them apart.",
                fixed(r, 3)
            ));
        }
    }
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
