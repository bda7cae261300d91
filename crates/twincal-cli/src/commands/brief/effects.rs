//! Effects of no single joint: payload, links, tilt, sets whose members are not distinguishable, and tentative ones by name.

use super::Detail;
use super::joints::joint_of;
use super::text::{Page, Width};
use crate::commands::not_kept::{with_ends, with_sd};
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary, Status, StatusReason};

/// The rows under the table of joints.
pub(super) fn beside_the_joints(
    calibration: &Calibration,
    detail: Detail,
    width: Width,
    page: &mut Page,
) {
    let mut texts: Vec<String> = calibration
        .effects()
        .filter(|effect| effect.status() == Status::Established)
        .filter(|effect| joint_of(calibration, effect.component()).is_none())
        .map(|effect| in_words(effect.component()))
        .collect();
    texts.extend(sets(calibration));
    let (shown, more) = (
        texts.len().min(detail.effects),
        texts.len().saturating_sub(detail.effects),
    );
    for text in &texts[..shown] {
        page.paragraph(text, ["  ", "    "], width, detail.effect);
    }
    if more > 0 {
        page.paragraph(
            &format!("… {more} more effects (-v)"),
            ["  ", "    "],
            width,
            1,
        );
    }
    let tentative: Vec<&str> = (calibration.effects())
        .filter(|effect| effect.status() == Status::Tentative && effect.component().is_in())
        .filter(|effect| joint_of(calibration, effect.component()).is_none())
        .map(|effect| effect.name())
        .collect();
    if !tentative.is_empty() {
        let text = format!("tentative: {}", tentative.join(", "));
        page.paragraph(&text, ["  ", "    "], width, detail.effect);
    }
}

/// An established effect with its numbers; without them where no rigid body has them.
fn in_words(component: &ComponentSummary) -> String {
    match component.no_rigid_body {
        true => format!(
            "{}: torque established, inertia physically inconsistent: not a mass or an inertia",
            component.story
        ),
        false => component.words.clone(),
    }
}

/// Sets of effects of which at least one is in, each once.
fn sets(calibration: &Calibration) -> Vec<String> {
    let mut sets: Vec<&[String]> = Vec::new();
    for component in &calibration.components {
        if let (Status::Equivalent, StatusReason::SameTorque { members, .. }) =
            (component.status, &component.reason)
            && !sets.contains(&members.as_slice())
        {
            sets.push(members);
        }
    }
    let text = |members: &&[String]| format!("{} (not distinguishable)", members.join(" or "));
    sets.iter().map(text).collect()
}

/// The clearest number of an effect: that with the largest value beside its spread.
pub(super) fn clearest(component: &ComponentSummary) -> Option<&ParameterSummary> {
    let clear = |own: &&ParameterSummary| {
        let (value, spread) = own.told();
        (value / spread).abs()
    };
    let seen = component.parameters.iter().filter(|own| own.seen);
    seen.max_by(|a, b| clear(a).total_cmp(&clear(b)))
}

/// "+0.73 ± 0.04", or both ends of the 95 % interval where ± would mislead; shares in percent.
pub(in crate::commands) fn value(parameter: &ParameterSummary) -> String {
    let (value, spread) = parameter.told();
    let factor = if parameter.unit == SHARE { 100.0 } else { 1.0 };
    match parameter.ends() {
        _ if !value.is_finite() => "–".into(),
        Some(ends) => with_ends(factor * value, ends.map(|end| factor * end)),
        None => {
            let (value, spread) = with_sd(factor * value, factor * spread);
            format!("{value} ± {spread}")
        }
    }
}

/// Unit of that number.
pub(in crate::commands) fn unit(parameter: &ParameterSummary) -> &str {
    match parameter.unit.as_str() {
        SHARE => "%",
        unit => unit,
    }
}

/// Unit of a share.
const SHARE: &str = "1";
