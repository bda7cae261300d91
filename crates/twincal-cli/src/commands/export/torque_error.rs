//! How good an exported model file is alone: its torque error on held-out rows, beside that of the user's file and of the twin.

use super::super::summary::paragraph;
use super::super::table::{print_table, table};
use super::{short, warn};
use crate::terminal::{Terminal, clean};
use twincal::assess::decisive;
use twincal::calibrate::Calibration;
use twincal::validate::{Split, WORSE};
use twincal::write_back::{Holds, JointTorqueError, WriteBack};

/// Torque error of the file on held-out rows, before and after, beside that of the twin.
pub(super) fn print(
    change: &WriteBack,
    calibration: &Calibration,
    holds: Holds,
    terminal: &mut Terminal,
) {
    let format = holds.format;
    terminal.heading("Torque error on held-out rows (RMSE)");
    let this = format!("this {format}");
    let mut rows = table(&["joint", "your file", &this, "twin"]);
    let scores = decisive(&calibration.validation);
    for (joint, own) in change.torque_error.iter().enumerate() {
        let number = |value: Option<f64>| {
            let value = value.filter(|value| value.is_finite());
            value.map_or("–".into(), short)
        };
        let twin = scores.joints.get(joint).map(|own| own.rmse_calibrated);
        rows.add_row([
            &*clean(&own.joint),
            &*number(own.rms_before),
            &number(own.rms),
            &number(twin),
        ]);
    }
    print_table(&rows, terminal);
    if let Some(text) = worse_alone(&change.torque_error, format) {
        warn(&format!("warning: {text}"), terminal);
    }
    let seen = match calibration.validation.split {
        Split::HeldoutLogs | Split::NotTested => "",
        Split::LeaveOneLogOut | Split::LeaveLogGroupsOut | Split::LastThirty => {
            " The file comes from all logs: these rows are among those that it was fitted to."
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
        .filter_map(|own| Some((&own.joint, own.rms_before?, own.rms?)))
        .filter(|(_, before, after)| *after > WORSE * *before)
        .map(|(joint, before, after)| {
            format!("{} ({} -> {})", clean(joint), short(before), short(after))
        })
        .collect();
    (!worse.is_empty()).then(|| {
        format!(
            "this {format} alone is WORSE than your model on {}: add what stays beside it (--to c, rust, python or json)",
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
        let said = "this URDF alone is WORSE than your model on b (20.0 -> 30.0): add what stays beside it (--to c, rust, python or json)";
        assert_eq!(of([1.0, 30.0]).as_deref(), Some(said));
    }
}
