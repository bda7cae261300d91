//! Effects of no single joint: payload, links, tilt, sets whose members are not distinguishable, and tentative ones by name.

use super::Detail;
use super::joints::joint_of;
use super::text::{Page, Width};
use crate::commands::not_kept::{with_ends, with_sd};
use twincal::calibrate::{Calibration, ComponentSummary, Status, StatusReason};

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
    let (shown, more) = (texts.len().min(detail.effects), texts.len().saturating_sub(detail.effects));
    for text in &texts[..shown] {
        page.paragraph(text, ["  ", "    "], width, detail.effect);
    }
    if more > 0 {
        page.paragraph(&format!("… {more} more effects (-v)"), ["  ", "    "], width, 1);
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
    page.blank();
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
    let text = |members: &&[String]| {
        format!(
            "{}: not distinguishable, at least one is in",
            members.join(" or ")
        )
    };
    sets.iter().map(text).collect()
}

/// "+0.73 ± 0.04", or both ends of the 95 % interval where ± would mislead; "–" without a number.
pub(super) fn value(component: &ComponentSummary) -> String {
    let Some(parameter) = component.parameters.iter().find(|own| own.seen) else {
        return "–".into();
    };
    match (parameter.told(), parameter.ends()) {
        ((value, _), _) if !value.is_finite() => "–".into(),
        ((value, _), Some(ends)) => with_ends(value, ends),
        ((value, spread), None) => {
            let (value, spread) = with_sd(value, spread);
            format!("{value} ± {spread}")
        }
    }
}

/// Unit of that number.
pub(super) fn unit(component: &ComponentSummary) -> &str {
    let shown = component.parameters.iter().find(|own| own.seen);
    shown.map_or("", |own| own.unit.as_str())
}
