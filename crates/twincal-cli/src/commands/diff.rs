//! `twincal diff`: what changed between two twins of the same robot.

use super::print_json;
use super::summary::{Notes, findings, indented, paragraph};
use super::verdict::doubt;
use crate::args::Diff;
use crate::failure::Outcome;
use crate::terminal::Terminal;
use serde::Serialize;
use std::path::Path;
use twincal::Finding;
use twincal::compare::{Became, Change, ParameterChange, compare, hindrances, surest};
use twincal_io::artifact::Artifact;
use twincal_io::twin_json::StoredTwin;
use twincal_io::words::probability;

/// What stands before and after the arrows.
const VALUES: &str = "values: medians over all models, 0 in those without the effect; `fit` prints medians given that it is in";

/// What `--json` prints.
#[derive(Serialize)]
struct Difference {
    schema: u64,
    before: String,
    after: String,
    components: Vec<Change>,
    findings: Vec<Finding>,
}

pub(super) fn run(flags: &Diff, terminal: &mut Terminal) -> Outcome<u8> {
    let read = |folder: &Path| StoredTwin::read(&Artifact::open(folder)?, false);
    let (before, after) = (read(&flags.before)?, read(&flags.after)?);
    let (old, new) = (&before.calibration.twin, &after.calibration.twin);
    let (changes, mut found) = (
        compare(&before.calibration, &after.calibration)?,
        hindrances(old, new)?,
    );
    for (folder, stored) in [(&flags.before, &before), (&flags.after, &after)] {
        found.extend(doubt(&stored.calibration).map(|mut doubt| {
            doubt.subject = folder.to_string_lossy().into_owned();
            doubt
        }));
    }
    if flags.json {
        let difference = Difference {
            schema: 1,
            before: flags.before.to_string_lossy().into_owned(),
            after: flags.after.to_string_lossy().into_owned(),
            components: changes,
            findings: found,
        };
        print_json(terminal, &difference)?;
    } else {
        let velocities = [old, new].map(|twin| twin.library.coulomb_velocity);
        print(&changes, velocities, terminal);
        findings(&found, Notes::Shown, terminal);
    }
    Ok(0)
}

/// What can be compared, then what cannot.
fn print(changes: &[Change], velocities: [f64; 2], terminal: &mut Terminal) {
    let (alike, other): (Vec<_>, Vec<_>) = changes.iter().partition(|change| change.comparable);
    terminal.heading("What changed (before → after)");
    let same = print_changed(&alike, terminal);
    if same == alike.len() {
        terminal.say("  nothing that these logs can tell");
    }
    if same > 0 {
        let components = counted(same, "component");
        paragraph(
            &format!("{components} as before (--json has the numbers)"),
            terminal,
        );
    }
    if same < changes.len() {
        paragraph(VALUES, terminal);
    }
    terminal.say("");
    if other.is_empty() {
        return;
    }
    let [before, after] = velocities;
    terminal.heading(&format!(
        "Not the same quantity: friction reverses within {before} → {after} rad/s (m/s)"
    ));
    let same = print_changed(&other, terminal);
    if same > 0 {
        let components = counted(same, "component");
        let text = format!("{components} of this kind without a clear difference");
        paragraph(&text, terminal);
    }
    terminal.say("");
}

/// Each component that is not as before; the number of the others.
fn print_changed(changes: &[&Change], terminal: &mut Terminal) -> usize {
    // What is open comes last.
    let order = [
        Became::New,
        Became::Gone,
        Became::Changed,
        Became::PerhapsNew,
        Became::PerhapsGone,
    ];
    let of = |became: Became| changes.iter().filter(move |change| change.became == became);
    let (weak, told): (Vec<&&Change>, Vec<_>) = order
        .into_iter()
        .flat_map(of)
        .partition(|change| is_weak(change));
    for change in told {
        print_change(change, terminal);
    }
    print_rivals(changes, terminal);
    if !weak.is_empty() {
        let name = |change: &&&Change| format!("{} ({})", change.name, pips(change));
        let names: Vec<String> = weak.iter().map(name).collect();
        let text = format!("perhaps, below 0.5 in both: {}", names.join(", "));
        paragraph(&text, terminal);
    }
    of(Became::AsBefore).count()
}

/// What is there on both sides under one of two names.
fn print_rivals(changes: &[&Change], terminal: &mut Terminal) {
    let find = |name: &str| changes.iter().copied().find(|change| change.name == name);
    let mut told: Vec<&str> = Vec::new();
    for change in changes
        .iter()
        .filter(|change| change.became == Became::OneOfTwo)
    {
        let Some(rival) = change.rival.as_deref().and_then(find) else {
            continue;
        };
        if told.contains(&change.name.as_str()) {
            continue;
        }
        told.extend([change.name.as_str(), rival.name.as_str()]);
        let name = |change: &Change| format!("{} (PIP {})", change.story, pips(change));
        let text = format!(
            "one or the other in both, these logs leave open which: {} or {}",
            name(change),
            name(rival)
        );
        paragraph(&text, terminal);
    }
}

/// Whether a component is likelier out than in on both sides, and its numbers are next to nothing.
fn is_weak(change: &Change) -> bool {
    let perhaps = matches!(change.became, Became::PerhapsNew | Became::PerhapsGone);
    perhaps && !change.changed && change.pip.iter().all(|pip| pip.unwrap_or(0.0) < 0.5)
}

/// "0.032 → >0.999".
fn pips(change: &Change) -> String {
    let [before, after] = (change.pip).map(|pip| probability(pip.unwrap_or(f64::NAN)));
    format!("{before} → {after}")
}

fn print_change(change: &Change, terminal: &mut Terminal) {
    let mark = match change.became {
        Became::New => "new",
        Became::Gone => "gone",
        Became::PerhapsNew => "perhaps new",
        Became::PerhapsGone => "perhaps gone",
        Became::OneOfTwo | Became::Changed | Became::AsBefore => "changed",
    };
    let text = format!("{mark}: {} (PIP {})", change.story, pips(change));
    paragraph(&text, terminal);
    let told = surest(&change.parameters);
    for parameter in &told {
        indented(&line(change, parameter), ["    ", "      "], terminal);
    }
    if told.is_empty() {
        terminal.say("    most draws of the two twins show no difference");
    }
    let differs = |p: &&ParameterChange| p.mean != [0.0; 2];
    let more = change.parameters.iter().filter(differs).count();
    let more = more.saturating_sub(told.len());
    if more > 0 {
        let numbers = counted(more, "more number");
        terminal.say(&format!("    {numbers} without a clear difference"));
    }
}

/// "mass: 0 → +1.740 kg, difference +1.740 ± 0.004 (95 %: +1.732 to +1.748)".
fn line(change: &Change, parameter: &ParameterChange) -> String {
    let (factor, unit) = change.family.told_in(&parameter.unit);
    let name = match parameter.name.as_str() {
        "value" => String::new(),
        name => format!("{}: ", name.replace('_', " ")),
    };
    let spread = factor * parameter.spread();
    let [before, after, difference] = [
        parameter.before.median,
        parameter.after.median,
        parameter.median,
    ]
    .map(|x| factor * x);
    let size = [before, after, difference, spread].map(f64::abs);
    let size = size.into_iter().fold(0.0, f64::max);
    // The spread gives the digits: two of its own, and what stands beside it to the same place.
    let plain = spread > 0.0 && (1e-3..1e6).contains(&size);
    let places = (1.0 - spread.log10().floor()).clamp(0.0, 6.0) as usize;
    let number = |x: f64| match (x, plain) {
        (0.0, _) => "0".to_owned(),
        (x, true) => format!("{x:+.places$}"),
        (x, false) => format!("{x:+.3e}"),
    };
    let spread = number(spread).trim_start_matches('+').to_owned();
    let ends = |ends: [f64; 2]| ends.map(|x| number(factor * x)).join(" to ");
    let how_sure = if parameter.lopsided() {
        let central = ends(parameter.interval68);
        format!(" (68 %: {central}, 95 %: {})", ends(parameter.interval95))
    } else {
        format!(" ± {spread} (95 %: {})", ends(parameter.interval95))
    };
    let unit = match unit {
        "" | "°" => unit.to_owned(),
        unit => format!(" {unit}"),
    };
    format!(
        "{name}{} → {}{unit}, difference {}{how_sure}",
        number(before),
        number(after),
        number(difference)
    )
}

/// "1 component", "3 components".
fn counted(count: usize, what: &str) -> String {
    let end = if count == 1 { "" } else { "s" };
    format!("{count} {what}{end}")
}
