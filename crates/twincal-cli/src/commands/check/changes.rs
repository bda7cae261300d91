//! What `check` says of changes: friction, a payload, a joint zero.

use super::gates::{Gate, MOVING};
use crate::terminal::clean;
use twincal::Code;
use twincal::term::Family;
use twincal::validate::{Change, ChangeKind, FALSE_ALARM};
use twincal::words::significant;

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
    let numbers: Vec<String> = change.numbers.iter().map(number).collect();
    let numbers = numbers.join(", ");
    let share = significant(change.share, 2);
    if change.changed {
        return format!(
            "{subject} changed: {numbers}; torque of {share} times the twin's own error. Such an estimate of an unchanged robot has probability \
             {}, the gate is {}. {remedy}",
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

/// `viscous +0.15 ± 0.01 N·m·s/rad`.
fn number(number: &twincal::validate::ChangeNumber) -> String {
    let (_, own) = number.name.rsplit_once('.').unwrap_or(("", &number.name));
    let (factor, unit) = match own {
        "encoder_zero" => Family::EncoderZero.told_in(&number.unit),
        "com_x" | "com_y" | "com_z" => Family::Payload.told_in(&number.unit),
        _ => (1.0, number.unit.as_str()),
    };
    let own = match own {
        "encoder_zero" => "moved by",
        "com_x" => "centre of mass x",
        "com_y" => "y",
        "com_z" => "z",
        "mx" => "first moment x",
        "my" => "y",
        "mz" => "z",
        own => own,
    };
    let plus = if number.value > 0.0 { "+" } else { "" };
    format!(
        "{own} {plus}{} ± {} {unit}",
        significant(factor * number.value, 3),
        significant(factor * number.sd, 2)
    )
}
