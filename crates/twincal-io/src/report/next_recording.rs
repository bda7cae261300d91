//! The recording to make next: what it has to hold so that this data's open questions get an answer.

use super::beyond;
use super::grounds::NAMED;
use super::limits::FEW;
use super::standing::of_halves;
use super::standstill::hardly_at_rest;
use super::text::{first_of, list, number};
use super::view::{Joint, independent_rows};
use twincal::calibrate::{Alike, Calibration, Repeated};
use twincal::validate::Split;

/// In one phrase, without its beginning; `None` where nothing is known that it would show.
pub(super) fn next(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let mut holds = Vec::new();
    let found = calibration.components.iter().filter(|own| own.selected);
    let open = found.filter(|own| of_halves(own, calibration) == Repeated::InNeitherHalf);
    if let open @ 1.. = open.count() {
        let fitted = calibration.logs.iter().filter(|log| log.role == "fit");
        let seconds: f64 = fitted.map(|log| log.duration).sum();
        holds.push(format!(
            "at least {} s long, as these logs are: {} in all of the data only, in neither half of it",
            number(seconds, 3),
            match open {
                1 => "one effect shows".to_owned(),
                n => format!("{n} effects show"),
            }
        ));
    }
    if hardly_at_rest(calibration, joints).is_some() {
        holds.push("with pauses in several poses, for standstill".into());
    }
    let findings = || calibration.findings.iter();
    let mut more: Vec<String> = findings()
        .filter(|f| f.code == "unseen_motion" && !f.subject.is_empty())
        .map(|f| f.subject.clone())
        .collect();
    more.dedup();
    if !more.is_empty() {
        holds.push(format!(
            "with more motion of {}",
            list(&first_of(more, NAMED))
        ));
    }
    let new = beyond::new_motion(calibration);
    if !new.is_empty() {
        holds.push(format!(
            "with the motion of {} that only the held-out logs have",
            list(&new)
        ));
    }
    let apart: Vec<String> = (calibration.groups.iter())
        .filter(|group| group.alike == Alike::TheseLogs && !group.settled)
        .filter_map(|group| group.members.first().cloned())
        .collect();
    if !apart.is_empty() {
        holds.push(format!(
            "of another motion, so that {} can be told from what is alike in these",
            list(&apart)
        ));
    }
    if findings().any(|f| f.code == "quantised_encoder") {
        holds.push("with the encoder’s full resolution".into());
    }
    let untried = calibration.validation.split == Split::LastThirty;
    let few = independent_rows(calibration, joints) < FEW;
    let fitted = (!holds.is_empty()).then(|| format!("to fit with these, {}", holds.join("; ")));
    let test = match (untried, few) {
        (true, _) => Some(
            "another motion, given with --heldout, as the test: so far only later parts of the fitted motion were tried",
        ),
        (false, true) => Some("another motion, given with --heldout, for a longer test"),
        (false, false) => None,
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
    use crate::report::{fixture, view};
    use twincal::calibrate::Group;
    use twincal::{Finding, Severity};

    #[test]
    fn it_holds_what_these_data_leave_open_and_nothing_else() {
        let of = |change: &dyn Fn(&mut Calibration)| {
            let mut calibration = fixture::two_joints();
            calibration.findings.clear();
            calibration.repeatability.clear();
            calibration.groups.clear();
            for log in &mut calibration.logs {
                log.standstill.iter_mut().for_each(|rows| *rows = 0);
            }
            change(&mut calibration);
            next(&calibration, &view::joints(&calibration))
        };
        assert_eq!(of(&|_| ()), None);
        let untried = of(&|c| c.validation.split = Split::LastThirty);
        let test = "another motion, given with --heldout, as the test: so far only later parts of the fitted motion were tried.";
        assert_eq!(untried.as_deref(), Some(test));
        let halves = of(&|c| {
            let mut own = fixture::two_joints().repeatability[0].clone();
            let found = c.components.iter().find(|own| own.selected);
            own.component = found.unwrap().name.clone();
            (own.first_pip, own.second_pip, own.z) = (0.3, 0.3, Some(0.5));
            c.repeatability = vec![own];
        });
        let halves = halves.unwrap();
        assert!(
            halves.starts_with("one to fit with these, at least 180 s long, as these logs are: one effect shows in all of the data only"),
            "{halves}"
        );
        let joint = of(&|c| {
            let code = "unseen_motion";
            c.findings = vec![Finding::new(Severity::Note, code, "elbow", "", 1)];
        });
        assert_eq!(
            joint.as_deref(),
            Some("one to fit with these, with more motion of elbow.")
        );
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
