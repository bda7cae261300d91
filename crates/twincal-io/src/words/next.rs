//! The recording to make next: what it has to hold so that this data's open questions get an answer.

use super::NAMED;
use super::list::{first_of, list};
use twincal::Code;
use twincal::assess::{Assessment, Request, RequestCode};

/// In one phrase, without its beginning; `None` where nothing is known that it would show.
pub(super) fn next(assessment: &Assessment) -> Option<String> {
    if assessment.reason == Code::NotTested {
        let words = "another motion, given with --heldout.";
        return Some(words.into());
    }
    let holds = to_fit(&assessment.next);
    let fitted = (!holds.is_empty()).then(|| format!("to fit with these, {}", holds.join("; ")));
    match (fitted, to_test(&assessment.next)) {
        (None, None) => None,
        (Some(one), None) => Some(format!("one {one}.")),
        (None, Some(test)) => Some(format!("{test}.")),
        (Some(one), Some(test)) => Some(format!("one {one}. And {test}.")),
    }
}

/// What a log to fit has to hold.
fn to_fit(requests: &[Request]) -> Vec<String> {
    let of = |code: RequestCode| requests.iter().filter(move |own| own.code == code);
    let named = |code| {
        let names: Vec<String> = of(code).map(|own| own.subject.name().to_owned()).collect();
        (!names.is_empty()).then(|| list(&first_of(names, NAMED)))
    };
    let mut out = Vec::new();
    out.extend(named(RequestCode::MoreMotion).map(|all| format!("with more motion of {all}")));
    out.extend(of(RequestCode::JointsTogether).map(|own| {
        let number = |name: &str| own.evidence.get(name).unwrap_or(f64::NAN);
        let together = match number("together") {
            0.0 => "none".to_owned(),
            n => format!("only {n}"),
        };
        let logs = number("logs");
        format!("with no joint at rest or hardly driven, as in {together} of these {logs} logs")
    }));
    out.extend(
        named(RequestCode::MotionOfHeldOutLogs)
            .map(|all| format!("with the motion of {all} that only the held-out logs have")),
    );
    out.extend(named(RequestCode::AnotherMotion).map(|all| {
        format!("of another motion, so that {all} can be told from what is alike in these")
    }));
    if named(RequestCode::FullResolution).is_some() {
        out.push("with the encoder’s full resolution".into());
    }
    out
}

/// What a log that is not fitted has to hold, and what for.
fn to_test(requests: &[Request]) -> Option<String> {
    let asked = |code| requests.iter().any(|own| own.code == code);
    let pauses = match asked(RequestCode::HeldOutPauses) {
        true => " with pauses in several poses",
        false => "",
    };
    let what = if asked(RequestCode::HeldOutLog) {
        ", as the test: so far only later parts of the fitted motion were tried"
    } else if asked(RequestCode::LongerHeldOutLog) {
        ", for a longer test"
    } else if pauses.is_empty() {
        return None;
    } else {
        ", to test standstill"
    };
    Some(format!(
        "another motion{pauses}, given with --heldout{what}"
    ))
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::{Alike, Calibration, Group, LogSummary};
    use twincal::validate::Split;
    use twincal::{Code, Finding, Severity};

    /// What is asked for where nothing is open but what `change` makes open.
    fn of(change: &dyn Fn(&mut Calibration)) -> Option<String> {
        let mut calibration = fixture::two_joints();
        calibration.findings.clear();
        calibration.groups.clear();
        for log in &mut calibration.logs {
            log.standstill.iter_mut().for_each(|rows| *rows = 0);
        }
        change(&mut calibration);
        next(&twincal::assess::assess(&calibration))
    }

    #[test]
    fn it_holds_what_these_data_leave_open_and_nothing_else() {
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

    /// Four logs, in each of which this joint is at rest or hardly driven.
    fn passive(joints: [&str; 4]) -> Option<String> {
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
                let own = own.of_joint(joint);
                c.findings.extend((!joint.is_empty()).then_some(own));
            }
        })
    }

    #[test]
    fn a_log_in_which_all_joints_move_is_asked_for_where_they_do_in_few() {
        let said = "one to fit with these, with no joint at rest or hardly driven, as in only 1 of these 4 logs.";
        let three = passive(["elbow", "shoulder", "elbow", ""]);
        assert_eq!(three.as_deref(), Some(said));
        let none = said.replace("only 1", "none");
        let four = passive(["elbow", "shoulder", "elbow", "shoulder"]);
        assert_eq!(four, Some(none));
        assert_eq!(passive(["elbow", "elbow", "", ""]), None);
        // Parked in all of them it is not missed.
        assert_eq!(passive(["elbow"; 4]), None);
    }
}
