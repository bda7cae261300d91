//! How many of the effects found two halves of the data agree on: every effect is counted once, in the words of the report.

use crate::terminal::clean;
use twincal::calibrate::{Halves, Repeat, Repeated};

/// One sentence with the counts, which add up, and the names of those that do not agree; none without halves.
pub(super) fn lines(repeats: &[Repeat], halves: Option<Halves>) -> Vec<String> {
    let Some(halves) = halves else {
        return Vec::new();
    };
    let effects = repeats.chunk_by(|a, b| a.component == b.component);
    let effects: Vec<(Repeated, &[Repeat])> = effects
        .map(|own| (Repeat::of_effect(own), own))
        .filter(|(state, _)| *state != Repeated::NotSeen)
        .collect();
    if effects.is_empty() {
        return Vec::new();
    }
    let of = |wanted: Repeated| effects.iter().filter(move |(state, _)| *state == wanted);
    let mut counts = Vec::new();
    for (state, words) in [
        (Repeated::Wavers, "waver (2 to 3 sd apart)"),
        (Repeated::Differs, "do not (3 sd or more)"),
        (Repeated::InOneHalf, "found in one half alone"),
        (Repeated::InNeitherHalf, "found in neither"),
        (Repeated::TooLoose, "too loose to tell"),
    ] {
        match of(state).count() {
            0 => {}
            count => counts.push(format!("{count} {words}")),
        }
    }
    let (one, two) = halves.words();
    let rest = match counts.is_empty() {
        true => String::new(),
        false => format!("; {}", counts.join(", ")),
    };
    let mut lines = vec![format!(
        "{} of {} effects repeat from {one} to {two}{rest}",
        of(Repeated::Repeats).count(),
        effects.len()
    )];
    for (state, words) in [
        (Repeated::Wavers, "waver"),
        (Repeated::Differs, "do not repeat"),
        (Repeated::TooLoose, "too loose in either half to tell"),
    ] {
        let names: Vec<String> = of(state).map(|(_, own)| name(state, own)).collect();
        if !names.is_empty() {
            lines.push(format!("{words}: {}", names.join(", ")));
        }
    }
    lines
}

/// Its name, and by how much it is apart.
fn name(state: Repeated, own: &[Repeat]) -> String {
    let name = own
        .first()
        .map_or_else(String::new, |r| clean(&r.component));
    if state == Repeated::TooLoose {
        return name;
    }
    let apart = own.iter().filter_map(|repeat| repeat.z).map(f64::abs);
    format!("{name} ({:.1} sd apart)", apart.fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_counted_once_and_the_counts_add_up() {
        let repeat = |name: &str, z: f64, sd: f64, pips: [f64; 2]| Repeat {
            component: name.into(),
            term: name.into(),
            unit: "N·m".into(),
            first: 10.0,
            first_sd: sd,
            first_pip: pips[0],
            second: 10.0,
            second_sd: sd,
            second_pip: pips[1],
            z: z.is_finite().then_some(z),
        };
        let sure = [1.0, 1.0];
        let all = [
            repeat("a", 1.9, 0.1, sure),
            repeat("b", -2.1, 0.1, sure),
            repeat("c", 3.1, 0.1, sure),
            repeat("d", 0.1, 9.0, sure),
            repeat("e", 0.1, 0.1, [0.9, 0.1]),
            repeat("f", 0.1, 0.1, [0.1, 0.1]),
            repeat("g", f64::NAN, 0.1, sure),
        ];
        assert_eq!(
            lines(&all, Some(Halves::OneLog)),
            [
                "1 of 6 effects repeat from the first half of the log to the second; 1 waver (2 to 3 sd apart), 1 do not (3 sd or more), 1 found in one \
                 half alone, 1 found in neither, 1 too loose to tell",
                "waver: b (2.1 sd apart)",
                "do not repeat: c (3.1 sd apart)",
                "too loose in either half to tell: d"
            ]
        );
        assert_eq!(
            lines(&all[..1], Some(Halves::OneLog)),
            ["1 of 1 effects repeat from the first half of the log to the second"]
        );
        assert!(lines(&all, None).is_empty() && lines(&all[6..], Some(Halves::OneLog)).is_empty());
    }
}
