//! What an export says on the terminal: what went into the file, what stays out and why.

use super::super::summary::{paragraph, wrapped};
use super::file::ModelFile;
use super::short;
use crate::terminal::{Terminal, clean};
use twincal::robot::Inertia;
use twincal::write_back::{Dropped, Holds, LinkChange, Residual, WriteBack, Written};
use twincal_io::words::probability;

/// Probability above which the model average is the component's own number, as words round it.
const CERTAIN: f64 = 0.98;
/// Share of its like below which a number is rounding.
const ROUNDING: f64 = 1e-9;
/// Residual components that are told one by one; the rest is summed up.
const TOLD: usize = 8;

/// Of a generated file: that it is one, and what its format cannot hold or asks for.
pub(super) fn generated(file: &ModelFile, holds: Holds, terminal: &mut Terminal) {
    let Some(notes) = &file.notes else {
        return;
    };
    terminal.heading(&format!("Generated {}", holds.format));
    let text = format!(
        "from the calibrated robot of {}, which is no {}: kinematics, mass and joints only, no meshes, shapes or sensors",
        clean(&file.from),
        holds.format
    );
    paragraph(&text, terminal);
    notes
        .iter()
        .for_each(|note| paragraph(&clean(note), terminal));
    terminal.say("");
}

/// What the model itself has and the format cannot hold.
fn dropped(change: &WriteBack, holds: Holds, terminal: &mut Terminal) {
    for own in change.dropped.iter().take(TOLD) {
        let text = format!(
            "{} of your model: a {} cannot hold motor inertia or springs",
            of_model(own),
            holds.format
        );
        paragraph(&text, terminal);
    }
    if let Some(more) = change.dropped.len().checked_sub(TOLD + 1) {
        let text = format!("the same of {} more joints", more + 1);
        paragraph(&text, terminal);
    }
}

/// "elbow: motor inertia 0.1, stiffness 20 about 0.3 (SI units)".
fn of_model(own: &Dropped) -> String {
    let mut parts = Vec::new();
    if own.armature != 0.0 {
        parts.push(format!("motor inertia {}", short(own.armature)));
    }
    if own.stiffness != 0.0 {
        let (stiffness, rest) = (short(own.stiffness), short(own.spring_reference));
        parts.push(format!("stiffness {stiffness} about {rest}"));
    }
    format!("{}: {} (SI units)", clean(&own.joint), parts.join(", "))
}

/// What went in, what stays out and why.
pub(super) fn change(change: &WriteBack, holds: Holds, terminal: &mut Terminal) {
    let format = holds.format;
    terminal.heading(&format!("In the {format} now"));
    if let Some(projection) = &change.projection {
        let text = format!(
            "warning: the mean of what was found for {} is physically inconsistent: the body with the nearest torque was taken; read mass \
             and inertia from the twin, not from the file (a comment in the file says so, too)",
            projection.links.join(", ")
        );
        warn(&text, terminal);
    }
    if change.written.is_empty() {
        terminal.say(
            "  nothing: no found effect has a place there; the numbers are those of your model",
        );
    }
    let all = change.written.iter();
    all.for_each(|written| paragraph(&in_file(written), terminal));
    let changed: Vec<String> = change.links.iter().filter_map(change_of).collect();
    if !changed.is_empty() {
        terminal
            .say("  links before -> after, where several effects share one or bodies limit them:");
        changed.iter().for_each(|text| paragraph(text, terminal));
    }
    terminal.say("");
    residual(change, holds, terminal);
    let (lost, all) = (largest(&change.lost), largest(&change.correction));
    let lost = if lost > ROUNDING * all {
        format!("{} N·m rms", short(lost))
    } else {
        "nothing".into()
    };
    let text = format!("of what went in, {lost} is lost in one physical model");
    paragraph(&text, terminal);
    terminal.say("");
}

/// What was written of an effect. The file holds the model average.
fn in_file(written: &Written) -> String {
    let Written {
        words, place, pip, ..
    } = written;
    match written.in_file {
        Some(value) if written.nearest => format!(
            "{words} ({place}; in the file {}, nearest to that and the joint's quadratic friction)",
            short(value)
        ),
        Some(value) if *pip > CERTAIN => format!(
            "{words} ({place}; in the file {}, the average over models, some of which hold other effects beside it)",
            short(value)
        ),
        Some(value) => format!(
            "{words} ({place}; in the file {}, the average over models with and without it, PIP {})",
            short(value),
            probability(*pip)
        ),
        None if *pip > CERTAIN => format!("{words} ({place})"),
        None => format!(
            "{words} ({place}; {:.0} % of that, its probability)",
            100.0 * pip
        ),
    }
}

/// What the format cannot hold.
fn residual(change: &WriteBack, holds: Holds, terminal: &mut Terminal) {
    let (told, rest): (Vec<&Residual>, Vec<&Residual>) = change
        .residual
        .iter()
        .partition(|residual| residual.pip >= 0.5);
    if !(told.is_empty() && change.dropped.is_empty()) {
        terminal.heading("Not representable in the file: the residual");
    }
    dropped(change, holds, terminal);
    for residual in told.iter().take(TOLD) {
        let text = format!(
            "{}: {}; up to {} N·m rms",
            residual.words,
            residual.reason,
            short(largest(&residual.torque))
        );
        paragraph(&text, terminal);
    }
    let smaller: Vec<&Residual> = told.into_iter().skip(TOLD).collect();
    for (which, residuals) in [("smaller", smaller), ("less sure", rest)] {
        let most = residuals.iter().map(|r| largest(&r.torque));
        if let Some(most) = most.reduce(f64::max) {
            let text = match residuals.len() {
                1 => format!("one {which} component: up to {} N·m rms", short(most)),
                n => format!(
                    "{n} {which} components: each at most {} N·m rms",
                    short(most)
                ),
            };
            paragraph(&text, terminal);
        }
    }
}

/// A warning in its place among what is said, as wide as the terminal.
pub(super) fn warn(text: &str, terminal: &mut Terminal) {
    for (number, line) in wrapped(text, terminal.width() - 4).iter().enumerate() {
        let begin = if number == 0 { "  " } else { "    " };
        terminal.warning(&format!("{begin}{line}"));
    }
}

/// "upper_arm_link: 12.9 -> 6.28 kg, centre (-0.28, 0, 0.136) -> (-0.31, 0, 0.14) m"; `None` for a link of its own.
fn change_of(change: &LinkChange) -> Option<String> {
    let before = change.before?;
    let coordinates = before.com.iter().chain(&change.after.com);
    let far = coordinates.fold(0.0_f64, |far, x| far.max(x.abs()));
    let shown = |x: f64| short(if x.abs() > ROUNDING * far { x } else { 0.0 });
    let centre = |inertia: &Inertia| inertia.com.map(shown).join(", ");
    let (was, is) = (centre(&before), centre(&change.after));
    let mut text = format!("{}: ", clean(&change.link));
    let masses = (short(before.mass), short(change.after.mass));
    text += &if masses.0 == masses.1 {
        format!("{} kg as before", masses.0)
    } else {
        format!("{} -> {} kg", masses.0, masses.1)
    };
    text += &if was == is {
        ", centre as before".to_owned()
    } else {
        format!(", centre ({was}) -> ({is}) m")
    };
    if before.tensor != change.after.tensor {
        text += ", new inertia tensor";
    }
    if change.no_body {
        text += "; the body nearest to what was found";
    }
    Some(text)
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(*value))
}
