//! What `check` says of changes: friction, a payload, a joint zero.

use super::gates::{Gate, MOVING};
use crate::terminal::clean;
use twincal::Code;
use twincal::term::Family;
use twincal::validate::{Change, ChangeKind, ChangeNumber, FALSE_ALARM};
use twincal::words::significant;

/// Standard deviations from which a number says something alone.
const CLEAR: f64 = 2.0;

/// One gate per change that these logs could show: passed where an unchanged robot may well look like this, or the change is too small to matter.
///
/// `least`: share of the twin's error from which on a change matters.
pub(super) fn gates(changes: &[Change], least: f64) -> Vec<Gate> {
    let limit = FALSE_ALARM / changes.len().max(1) as f64;
    let gate = |change: &Change| Gate {
        rows: MOVING,
        joint: change.subject.clone(),
        gate: name(change.kind),
        code: code(change.kind),
        passed: !change.changed,
        value: change.chance,
        limit: [Some(limit), None],
        words: words(change, [limit, least]),
        enough: true,
    };
    changes.iter().map(gate).collect()
}

fn name(kind: ChangeKind) -> &'static str {
    match kind {
        ChangeKind::Friction => "friction",
        ChangeKind::Payload => "payload",
        ChangeKind::JointZero => "joint_zero",
    }
}

fn code(kind: ChangeKind) -> Code {
    match kind {
        ChangeKind::Friction => Code::FrictionChanged,
        ChangeKind::Payload => Code::PayloadChanged,
        ChangeKind::JointZero => Code::JointZeroChanged,
    }
}

/// Whether a gate is one of these.
pub(super) fn is_change(gate: &Gate) -> bool {
    !["rmse", "coverage"].contains(&gate.gate)
}

fn words(change: &Change, [limit, least]: [f64; 2]) -> String {
    let (subject, remedy) = match change.kind {
        ChangeKind::Friction => (
            format!("joint `{}`: friction", clean(&change.subject)),
            "Look at its gear, brake and temperature, or fit again.",
        ),
        ChangeKind::Payload => (
            match &change.frame {
                Some(frame) => format!("payload at `{}`", clean(frame)),
                None => "payload".to_owned(),
            },
            "Say what the robot carries, take it off, or fit again.",
        ),
        ChangeKind::JointZero => (
            format!("joint `{}`: zero position", clean(&change.subject)),
            "Calibrate its encoder, or fit again.",
        ),
    };
    let numbers = numbers(change);
    let share = significant(change.share, 2);
    if change.changed {
        let clear = |own: &ChangeNumber| own.value.abs() >= CLEAR * own.sd;
        let estimate = match change.numbers.len() > 1 && !change.numbers.iter().any(clear) {
            true => "Each number alone may be 0; together, without a change, they have",
            false => "Such an estimate of an unchanged robot has",
        };
        return format!(
            "{subject} changed: {numbers}; torque of {share} times the twin's own error. {estimate} probability {}, the gate is {}. {remedy}",
            probability(change.chance),
            probability(limit)
        );
    }
    format!(
        "{subject}: no change, {numbers} (probability {}, gate {}; {share} of the twin's own error, gate {})",
        probability(change.chance),
        probability(limit),
        significant(least, 2)
    )
}

fn probability(p: f64) -> String {
    match p < 1e-4 {
        true => "below 0.0001".into(),
        false => significant(p, 2),
    }
}

/// `mass +1.2 ± 0.1 kg, centre of mass x +3 ± 1 mm, y +30 ± 2 mm`: the noun once.
fn numbers(change: &Change) -> String {
    let mut before = "";
    let numbers = change.numbers.iter().map(|own| {
        let (noun, number) = number(own);
        let again = !before.is_empty() && noun == before;
        before = noun;
        match again || noun.is_empty() {
            true => number,
            false => format!("{noun} {number}"),
        }
    });
    let numbers: Vec<String> = numbers.collect();
    numbers.join(", ")
}

/// What several numbers have in common, and `viscous +0.15 ± 0.01 N·m·s/rad`.
fn number(number: &ChangeNumber) -> (&'static str, String) {
    let (_, own) = number.name.rsplit_once('.').unwrap_or(("", &number.name));
    let (factor, unit) = match own {
        "encoder_zero" => Family::EncoderZero.told_in(&number.unit),
        "com_x" | "com_y" | "com_z" => Family::Payload.told_in(&number.unit),
        _ => (1.0, number.unit.as_str()),
    };
    let (noun, own) = match own {
        "encoder_zero" => ("", "moved by"),
        "com_x" => ("centre of mass", "x"),
        "com_y" => ("centre of mass", "y"),
        "com_z" => ("centre of mass", "z"),
        "mx" => ("first moment", "x"),
        "my" => ("first moment", "y"),
        "mz" => ("first moment", "z"),
        own => ("", own),
    };
    let plus = if number.value > 0.0 { "+" } else { "" };
    let text = format!(
        "{own} {plus}{} ± {} {unit}",
        significant(factor * number.value, 3),
        significant(factor * number.sd, 2)
    );
    (noun, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_payload_has_its_nouns_whichever_parts_are_seen() {
        let number = |(name, value): (&str, f64)| ChangeNumber {
            name: format!("payload.{name}"),
            unit: if name == "mass" { "kg" } else { "m" }.into(),
            value,
            sd: 0.002,
        };
        let numbers_of = |numbers| {
            let change = Change {
                kind: ChangeKind::Payload,
                subject: "payload".into(),
                frame: Some("tool0".into()),
                numbers,
                chance: 0.0,
                share: 1.0,
                changed: true,
            };
            super::numbers(&change)
        };
        let of =
            |numbers: &[(&str, f64)]| numbers_of(numbers.iter().copied().map(number).collect());
        assert_eq!(
            of(&[("mass", 1.5), ("com_y", 0.03), ("com_z", -0.01)]),
            "mass +1.50 ± 0.0020 kg, centre of mass y +30.0 ± 2.0 mm, z -10.0 ± 2.0 mm"
        );
    }

    #[test]
    fn numbers_that_are_clear_together_alone_are_said_to_be_so() {
        let said = |values: &[f64]| {
            let number = |(name, value): (&str, &f64)| ChangeNumber {
                name: format!("elbow.{name}"),
                unit: "N·m".into(),
                value: *value,
                sd: 0.1,
            };
            let change = Change {
                kind: ChangeKind::Friction,
                subject: "elbow".into(),
                frame: None,
                numbers: ["viscous", "coulomb"]
                    .into_iter()
                    .zip(values)
                    .map(number)
                    .collect(),
                chance: 0.00012,
                share: 0.8,
                changed: true,
            };
            words(&change, [0.0008, 0.5])
        };
        let together = "Each number alone may be 0; together, without a change, they have probability 0.00012, the gate is 0.00080.";
        assert!(
            said(&[0.15, 0.14]).contains(together),
            "{}",
            said(&[0.15, 0.14])
        );
        for clear in [&[0.15, -0.21][..], &[0.15]] {
            let words = said(clear);
            assert!(
                words.contains("Such an estimate of an unchanged robot has probability"),
                "{words}"
            );
        }
    }
}
