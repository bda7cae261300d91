//! The recording to make next: what it has to hold so that this data's open questions get an answer.

use super::grounds::NAMED;
use super::text::{first_of, list};
use twincal::Code;
use twincal::assess::{FEW, driven_together, hardly_at_rest, independent_rows, new_motion};
use twincal::calibrate::{Alike, Calibration};
use twincal::validate::Split;

/// In one phrase, without its beginning; `None` where nothing is known that it would show.
pub(super) fn next(calibration: &Calibration) -> Option<String> {
    let mut holds = Vec::new();
    let findings = || calibration.findings.iter();
    let mut more: Vec<String> = findings()
        .filter(|f| f.code == Code::UnseenMotion && !f.subject.is_empty())
        .map(|f| f.subject.clone())
        .collect();
    more.dedup();
    if !more.is_empty() {
        holds.push(format!(
            "with more motion of {}",
            list(&first_of(more, NAMED))
        ));
    }
    if let Some((together, logs)) = driven_together(calibration) {
        holds.push(format!(
            "with no joint at rest or hardly driven, as in {} of these {logs} logs",
            match together {
                0 => "none".to_owned(),
                n => format!("only {n}"),
            }
        ));
    }
    let new: Vec<String> = new_motion(calibration).map(str::to_owned).collect();
    if !new.is_empty() {
        holds.push(format!(
            "with the motion of {} that only the held-out logs have",
            list(&first_of(new, NAMED))
        ));
    }
    let apart: Vec<String> = (calibration.groups.iter())
        .filter(|group| group.alike == Alike::TheseLogs && !group.settled)
        .filter_map(|group| group.members.first().cloned())
        .collect();
    if !apart.is_empty() {
        holds.push(format!(
            "of another motion, so that {} can be told from what is alike in these",
            list(&first_of(apart, NAMED))
        ));
    }
    if findings().any(|f| f.code == Code::QuantisedEncoder) {
        holds.push("with the encoder’s full resolution".into());
    }
    let untried = calibration.validation.split == Split::LastThirty;
    let few = independent_rows(calibration) < FEW;
    let fitted = (!holds.is_empty()).then(|| format!("to fit with these, {}", holds.join("; ")));
    // Standstill is no part of a fit.
    let pauses = match hardly_at_rest(calibration) {
        Some(_) => " with pauses in several poses",
        None => "",
    };
    let test = match (untried, few, pauses) {
        (true, ..) => Some(format!(
            "another motion{pauses}, given with --heldout, as the test: so far only later parts of the fitted motion were tried"
        )),
        (false, true, _) => Some(format!(
            "another motion{pauses}, given with --heldout, for a longer test"
        )),
        (false, false, "") => None,
        (false, false, _) => Some(format!(
            "another motion{pauses}, given with --heldout, to test standstill"
        )),
    };
    match (fitted, test) {
        (None, None) => None,
        (Some(one), None) => Some(format!("one {one}.")),
        (None, Some(test)) => Some(format!("{test}.")),
        (Some(one), Some(test)) => Some(format!("one {one}. And {test}.")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::{Group, LogSummary};
    use twincal::{Code, Finding, Severity};

    #[test]
    fn it_holds_what_these_data_leave_open_and_nothing_else() {
        let of = |change: &dyn Fn(&mut Calibration)| {
            let mut calibration = fixture::two_joints();
            calibration.findings.clear();
            calibration.groups.clear();
            for log in &mut calibration.logs {
                log.standstill.iter_mut().for_each(|rows| *rows = 0);
            }
            change(&mut calibration);
            next(&calibration)
        };
        assert_eq!(of(&|_| ()), None);
        let untried = of(&|c| c.validation.split = Split::LastThirty);
        let test = "another motion, given with --heldout, as the test: so far only later parts of the fitted motion were tried.";
        assert_eq!(untried.as_deref(), Some(test));
        let encoder = of(&|c| {
            let code = Code::QuantisedEncoder;
            c.findings = vec![Finding::new(Severity::Warning, code, "elbow", "", 1)];
        });
        let said = "one to fit with these, with the encoder’s full resolution.";
        assert_eq!(encoder.as_deref(), Some(said));
        let passive = |joints: [&str; 4]| {
            of(&|c| {
                let one = c.logs[0].clone();
                let log = |name: &str| LogSummary {
                    name: name.to_owned(),
                    role: "fit".into(),
                    ..one.clone()
                };
                c.logs = ["a", "b", "c", "d"].map(log).to_vec();
                let codes = [Code::JointNotDriven, Code::JointStandsStill];
                let logs = c.logs.iter().zip(codes.into_iter().cycle());
                for ((log, code), joint) in logs.zip(joints) {
                    let words = format!("joint `{joint}` …");
                    let own = Finding::new(Severity::Note, code, log.name.as_str(), words, 1);
                    c.findings.extend((!joint.is_empty()).then_some(own));
                }
            })
        };
        let said = "one to fit with these, with no joint at rest or hardly driven, as in only 1 of these 4 logs.";
        let three = passive(["elbow", "shoulder", "elbow", ""]);
        assert_eq!(three.as_deref(), Some(said));
        let none = said.replace("only 1", "none");
        let four = passive(["elbow", "shoulder", "elbow", "shoulder"]);
        assert_eq!(four, Some(none));
        assert_eq!(passive(["elbow", "elbow", "", ""]), None);
        // Parked in all of them it is not missed.
        assert_eq!(passive(["elbow"; 4]), None);
        let group = |alike| Group {
            members: vec!["elbow.spring".into(), "elbow.offset".into()],
            pip: 1.0,
            alike,
            settled: false,
            words: String::new(),
        };
        let said = "one to fit with these, of another motion, so that elbow.spring can be told from what is alike in these.";
        let apart = of(&|c| c.groups = vec![group(Alike::TheseLogs)]);
        assert_eq!(apart.as_deref(), Some(said));
        assert_eq!(of(&|c| c.groups = vec![group(Alike::EveryMotion)]), None);
    }
}
