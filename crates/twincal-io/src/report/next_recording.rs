//! The recording to make next: what it has to hold so that this data's open questions get an answer.

use super::beyond;
use super::limits::FEW;
use super::standing::of_halves;
use super::standstill::hardly_at_rest;
use super::text::list;
use super::view::{Joint, independent_rows};
use twincal::calibrate::{Alike, Calibration, Repeated};
use twincal::validate::Split;

/// In one phrase, without its beginning; `None` where nothing is known that it would show.
pub(super) fn next(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let mut holds = Vec::new();
    let mut halves = calibration.components.iter().filter(|own| own.selected);
    if halves.any(|own| of_halves(own, calibration) == Repeated::InNeitherHalf) {
        holds.push("as long again as these logs: some effects show in all of the data only, in neither half of it".to_owned());
    }
    if hardly_at_rest(calibration, joints).is_some() {
        holds.push("with pauses in several poses, for standstill".into());
    }
    let new = beyond::new_motion(calibration);
    if !new.is_empty() {
        holds.push(format!(
            "with what the held-out motion has of {} and these logs have not, to be fitted with them",
            list(&new)
        ));
    }
    let apart: Vec<String> = (calibration.groups.iter())
        .filter(|group| group.alike == Alike::TheseLogs && !group.settled)
        .filter_map(|group| group.members.first().cloned())
        .collect();
    if !apart.is_empty() {
        holds.push(format!(
            "moving otherwise than here, so that {} can be told from what is alike in these logs",
            list(&apart)
        ));
    }
    let untried = calibration.validation.split == Split::LastThirty;
    let few = independent_rows(calibration, joints) < FEW;
    if holds.is_empty() && !untried && !few {
        return None;
    }
    let holds = match holds.is_empty() {
        true => String::new(),
        false => format!(", {}", holds.join("; ")),
    };
    let test = match (untried, few) {
        (true, _) => {
            ". Given with --heldout it is the test on a motion that was not fitted; so far only later parts of the fitted ones were tried"
        }
        (false, true) => ". Given with --heldout it makes the test longer",
        (false, false) => "",
    };
    Some(format!("another motion{holds}{test}."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, view};
    use twincal::calibrate::Group;

    #[test]
    fn it_holds_what_these_data_leave_open_and_nothing_else() {
        let of = |change: &dyn Fn(&mut Calibration)| {
            let mut calibration = fixture::two_joints();
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
        let test = "Given with --heldout it is the test on a motion that was not fitted; so far only later parts of the fitted ones were tried.";
        assert_eq!(untried, Some(format!("another motion. {test}")));
        let halves = of(&|c| {
            let mut own = fixture::two_joints().repeatability[0].clone();
            let found = c.components.iter().find(|own| own.selected);
            own.component = found.unwrap().name.clone();
            (own.first_pip, own.second_pip, own.z) = (0.3, 0.3, Some(0.5));
            c.repeatability = vec![own];
        });
        let halves = halves.unwrap();
        assert!(
            halves.starts_with("another motion, as long again as these logs: "),
            "{halves}"
        );
        let group = |alike| Group {
            members: vec!["elbow.spring".into(), "elbow.offset".into()],
            pip: 1.0,
            alike,
            settled: false,
            words: String::new(),
        };
        let said = "another motion, moving otherwise than here, so that elbow.spring can be told from what is alike in these logs.";
        let apart = of(&|c| c.groups = vec![group(Alike::TheseLogs)]);
        assert_eq!(apart.as_deref(), Some(said));
        assert_eq!(of(&|c| c.groups = vec![group(Alike::EveryMotion)]), None);
    }
}
