//! What two halves of the data say of an effect that all data together have.

use super::text::number;
use twincal::calibrate::{Calibration, ComponentSummary, Repeat, Repeated};

/// Sd between all data and both halves from which that is told: with the same effects in they would be next to none, for the halves are
/// nearly all rows.
const APART: f64 = 2.0;

/// What the two halves of the data say, where they do not agree.
pub(super) fn repeats(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let of = |repeat: &&Repeat| repeat.component == component.name;
    let own: Vec<Repeat> = (calibration.repeatability.iter())
        .filter(of)
        .cloned()
        .collect();
    let apart = own.iter().filter_map(|repeat| repeat.z).map(f64::abs);
    match Repeat::of_effect(&own) {
        Repeated::Repeats | Repeated::NotSeen => None,
        Repeated::Differs | Repeated::Wavers => Some(format!(
            "the two halves of the data differ by {} sd",
            number(apart.fold(0.0, f64::max), 2)
        )),
        Repeated::TooLoose => {
            Some("its numbers from either half are too loose to be compared".into())
        }
        state => Some(state.words().into()),
    }
}

/// Sd between the halves from which they differ themselves.
const DIFFER: f64 = 3.0;

/// "5.0 against -0.9 and 0.6 N·m": a number from all data and from both halves, where it is [`APART`] or more of their sd from what they say
/// together: the halves with the same effects in have nearly all of its rows. Not where the halves differ themselves.
pub(super) fn whole_against_halves(
    component: &ComponentSummary,
    calibration: &Calibration,
) -> Option<String> {
    let own = calibration.repeatability.iter();
    let own = own.filter(|repeat| {
        repeat.component == component.name && repeat.z.is_some_and(|z| z.abs() < DIFFER)
    });
    let apart = own.filter_map(|repeat| {
        let term = (calibration.terms.iter()).find(|term| term.term.name == repeat.term)?;
        let whole = term.conditional_median?;
        let [first, second] = [repeat.first_sd, repeat.second_sd].map(|sd| sd.powi(-2));
        let both = (first * repeat.first + second * repeat.second) / (first + second);
        // Between the two it says what one of them says, and how far they are apart is told of them.
        let beyond =
            !(repeat.first.min(repeat.second)..=repeat.first.max(repeat.second)).contains(&whole);
        let apart = match beyond {
            true => (whole - both).abs() * (first + second).sqrt(),
            false => 0.0,
        };
        let (factor, unit) = term.term.family.told_in(&repeat.unit);
        let [whole, one, other] = [whole, repeat.first, repeat.second].map(|x| factor * x);
        let words = format!(
            "{} against {} and {} {unit}",
            number(whole, 2),
            number(one, 2),
            number(other, 2)
        );
        let words = words.trim_end().to_owned();
        (apart >= APART && apart.is_finite()).then_some((apart, words))
    });
    let most = apart.max_by(|(a, _), (b, _)| a.total_cmp(b));
    most.map(|(_, words)| words)
}
