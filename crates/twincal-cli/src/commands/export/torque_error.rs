//! How good an exported model file is alone: its torque error on held-out rows, beside that of the user's file and of the twin.

use super::super::summary::paragraph;
use super::super::table::{print_table, table};
use super::said::warn;
use super::short;
use crate::args::AllowExport;
use crate::failure::Outcome;
use crate::terminal::{Terminal, clean};
use serde::Serialize;
use twincal::assess::decisive;
use twincal::calibrate::Calibration;
use twincal::validate::{Scores, Split};
use twincal::words::listed;
use twincal::write_back::{Holds, JointTorqueError, WriteBack};

/// What `--json` has of it.
#[derive(Serialize)]
pub(super) struct TorqueErrors<'a> {
    /// True where the file was fitted without these rows.
    held_out: bool,
    joints: Vec<TorqueError<'a>>,
}

#[derive(Serialize)]
struct TorqueError<'a> {
    joint: &'a str,
    unit: &'a str,
    /// RMSE of the user's file, of the exported one, and of the twin.
    rms_before: Option<f64>,
    rms: Option<f64>,
    rms_twin: Option<f64>,
}

impl<'a> TorqueErrors<'a> {
    pub(super) fn of(change: &'a WriteBack, calibration: &'a Calibration) -> Self {
        let scores = decisive(&calibration.validation);
        let robot = &calibration.twin.robot;
        let joints = change.torque_error.iter().enumerate();
        let joints = joints.map(|(number, own)| TorqueError {
            joint: &own.joint,
            unit: robot.joint_kind(number).torque_unit(),
            rms_before: own.rms_before,
            rms: own.rms,
            rms_twin: twin(scores, number),
        });
        Self {
            held_out: is_held_out(calibration),
            joints: joints.collect(),
        }
    }
}

/// Whether the file, which comes from all logs of the fit, was fitted without the rows of its errors.
fn is_held_out(calibration: &Calibration) -> bool {
    calibration.validation.split == Split::HeldoutLogs
}

/// What the errors are of.
fn rows(calibration: &Calibration) -> &'static str {
    match is_held_out(calibration) {
        true => "held-out rows",
        false => "rows that were fitted",
    }
}

/// RMSE of the twin on a joint.
fn twin(scores: &Scores, joint: usize) -> Option<f64> {
    let own = scores.joints.get(joint).map(|own| own.rmse_calibrated);
    own.filter(|error| error.is_finite())
}

/// Refuses a file that is worse than the user's on some joint, unless that is allowed.
pub(super) fn require_no_worse(
    change: &WriteBack,
    calibration: &Calibration,
    format: &str,
    allow: &[AllowExport],
) -> Outcome<()> {
    if allow.contains(&AllowExport::WorseThanModel) {
        return Ok(());
    }
    let Some(joints) = worse_joints(&change.torque_error, calibration) else {
        return Ok(());
    };
    let rows = rows(calibration);
    Err(twincal::Error::Refused {
        problem: format!("the exported {format} predicts torque worse than your model: {joints} (RMSE on {rows})"),
        remedy: format!(
            "use the whole twin (--to c, rust, python or json), add what the {format} cannot hold (--to c --beyond {}), or export it with --allow worse-than-model",
            format.to_lowercase()
        ),
    }
    .into())
}

/// "elbow 10.0 -> 12.0 N·m": joints on which the written file is worse than the user's.
fn worse_joints(errors: &[JointTorqueError], calibration: &Calibration) -> Option<String> {
    let robot = &calibration.twin.robot;
    let worse: Vec<String> = (errors.iter().enumerate())
        .filter_map(|(number, own)| {
            let [before, after] = own.worse()?;
            let unit = robot.joint_kind(number).torque_unit();
            let (joint, before, after) = (clean(&own.joint), short(before), short(after));
            Some(format!("{joint} {before} -> {after} {unit}"))
        })
        .collect();
    (!worse.is_empty()).then(|| listed(worse, ", "))
}

/// Torque error of the file, before and after, beside that of the twin on rows that it was not fitted to.
pub(super) fn print(
    change: &WriteBack,
    calibration: &Calibration,
    holds: Holds,
    terminal: &mut Terminal,
) {
    let format = holds.format;
    terminal.heading(&format!("Torque error on {} (RMSE)", rows(calibration)));
    let this = format!("this {format}");
    let mut table = table(&["joint", "your file", &this, "twin"]);
    let scores = decisive(&calibration.validation);
    for (joint, own) in change.torque_error.iter().enumerate() {
        let number = |value: Option<f64>| {
            let value = value.filter(|value| value.is_finite());
            value.map_or("–".into(), short)
        };
        let twin = twin(scores, joint);
        table.add_row([
            &*clean(&own.joint),
            &*number(own.rms_before),
            &number(own.rms),
            &number(twin),
        ]);
    }
    print_table(&table, terminal);
    if let Some(text) = worse_alone(&change.torque_error, format) {
        warn(&format!("warning: {text}"), terminal);
    }
    let seen = match calibration.validation.split {
        Split::HeldoutLogs | Split::NotTested => "",
        Split::LeaveOneLogOut | Split::LeaveLogGroupsOut | Split::LastThirty => {
            " The file comes from all logs; the twin's errors are of fits without these rows."
        }
    };
    let text = format!(
        "Rows of moving joints, N·m, of sliders N. Damping and friction that a file states count.{seen}"
    );
    paragraph(&text, terminal);
    terminal.say("");
}

/// Joints on which the written file is worse than the user's: what it cannot hold kept the rest in balance.
fn worse_alone(errors: &[JointTorqueError], format: &str) -> Option<String> {
    let worse: Vec<String> = (errors.iter())
        .filter_map(|own| Some((&own.joint, own.worse()?)))
        .map(|(joint, [before, after])| {
            format!("{} ({} -> {})", clean(joint), short(before), short(after))
        })
        .collect();
    (!worse.is_empty()).then(|| {
        format!(
            "this {format} alone is WORSE than your model on {}: add what it cannot represent (--to c, rust, python or json)",
            worse.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_that_a_file_alone_makes_worse_are_named() {
        let of = |file: [f64; 2]| {
            let joints = [("a", 10.0, file[0]), ("b", 20.0, file[1])];
            let errors = joints.map(|(joint, before, after)| JointTorqueError {
                joint: joint.into(),
                rms_before: Some(before),
                rms: Some(after),
            });
            worse_alone(&errors, "URDF")
        };
        assert_eq!(of([1.0, 20.1]), None);
        let said = "this URDF alone is WORSE than your model on b (20.0 -> 30.0): add what it cannot represent (--to c, rust, python or json)";
        assert_eq!(of([1.0, 30.0]).as_deref(), Some(said));
    }
}
