//! Rows on which the training data say less than on others, in words: motion that training did not have, or torque that it leaves open.

use super::text::{list, number, percent, subject};
use super::view::{Joint, unit_of};
use twincal::assess::{Beyond, Cause, tested_beyond};
use twincal::calibrate::Calibration;

/// "34 of 80 moving rows".
fn rows(own: &Beyond<'_>) -> String {
    let [beyond, all] = own.rows();
    format!("{beyond} of {all} moving rows")
}

/// Joints that are predicted worse there, or whose intervals hold less there.
pub(super) fn worse(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let own = twincal::assess::beyond(calibration).filter(|own| own.narrow || own.further_off);
    let told = own.map(|own| {
        let (within, beyond) = (own.within, own.beyond);
        let (place, elsewhere) = match own.cause {
            Cause::NewMotion => ("beyond the training motion", "within it"),
            Cause::OpenTorque => ("where training leaves its torque open", "elsewhere"),
        };
        let mut said = Vec::new();
        if own.further_off {
            said.push(format!(
                "its error is {} {}, {elsewhere} {}",
                number(beyond.rmse_calibrated, 3),
                unit_of(joints, &beyond.joint),
                number(within.rmse_calibrated, 3)
            ));
        }
        if own.narrow {
            let seen = match within.rows {
                0 => String::new(),
                _ => format!(", {elsewhere} {}", percent(within.coverage95)),
            };
            said.push(format!(
                "its 95 % intervals hold {}{seen}",
                percent(beyond.coverage95)
            ));
        }
        format!(
            "{}: {place} ({}) {}.",
            subject(&[&beyond.joint]),
            rows(&own),
            said.join("; ")
        )
    });
    told.collect()
}

/// Joints that were mostly tested there.
pub(super) fn mostly(calibration: &Calibration) -> Vec<String> {
    let told = |wanted: Cause| -> Vec<String> {
        tested_beyond(calibration)
            .filter(|own| own.cause == wanted)
            .map(|own| format!("{} ({})", own.beyond.joint, rows(&own)))
            .collect()
    };
    let each = [
        (Cause::NewMotion, "Tested mostly beyond the training motion"),
        (
            Cause::OpenTorque,
            "Training leaves the torque open, known less well than its noise, on most tested rows",
        ),
    ];
    let each = each.map(|(cause, words)| (told(cause), words)).into_iter();
    each.filter(|(names, _)| !names.is_empty())
        .map(|(names, words)| format!("{words}: {}.", list(&names)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::verdict::tests::judged;
    use twincal::validate::Split;

    /// The elbow beyond on so many rows, within on as many; new motion where its held-out velocity is `speed` times what it is.
    fn limits(beyond: (u64, f64), within: (u64, f64), split: Split, speed: f64) -> Vec<String> {
        let verdict = judged(|c| {
            c.validation.split = split.clone();
            c.validation.beyond = c.validation.within.clone();
            c.validation.beyond.joints[0].rows = 0;
            for (scores, (rows, coverage95)) in [
                (&mut c.validation.beyond, beyond),
                (&mut c.validation.within, within),
            ] {
                (scores.joints[1].rows, scores.joints[1].coverage95) = (rows, coverage95);
            }
            let traces = c.validation.traces.iter_mut();
            for trace in traces.filter(|trace| trace.joint == "elbow") {
                trace.qd.iter_mut().for_each(|qd| *qd *= speed);
            }
        });
        let told = verdict.limits.into_iter();
        told.filter(|limit| limit.contains("beyond the") || limit.contains(" open"))
            .collect()
    }

    #[test]
    fn rows_of_new_motion_are_told_as_that_and_others_by_what_training_leaves_open() {
        let (beyond, within) = ((41, 0.93), (40, 0.95));
        assert_eq!(
            limits(beyond, within, Split::HeldoutLogs, 10.0),
            ["Tested mostly beyond the training motion: elbow (41 of 81 moving rows)."]
        );
        // So is a joint that is no better within.
        assert_eq!(
            limits((41, 0.95), (40, 0.93), Split::HeldoutLogs, 10.0),
            ["Tested mostly beyond the training motion: elbow (41 of 81 moving rows)."]
        );
        let open = "Training leaves the torque open, known less well than its noise, on most tested rows: elbow (41 of 81 moving rows).";
        assert_eq!(limits(beyond, within, Split::HeldoutLogs, 1.0), [open]);
        // Of later parts of the same logs the motion is in the training range by definition.
        assert_eq!(limits(beyond, within, Split::LastThirty, 10.0), [open]);
        assert!(limits((40, 0.93), within, Split::LastThirty, 1.0).is_empty());
        // No excuse where it is not worse there.
        assert!(limits((41, 0.95), (40, 0.93), Split::LastThirty, 1.0).is_empty());
    }

    #[test]
    fn an_error_that_is_larger_there_is_told_with_that_elsewhere() {
        let of = |(out, error): (u64, f64)| {
            let verdict = judged(|c| {
                c.validation.beyond = c.validation.within.clone();
                for (scores, rows, error) in [
                    (&mut c.validation.beyond, [0, out], error),
                    (&mut c.validation.within, [100, 100 - out], 0.1),
                ] {
                    for (joint, rows) in scores.joints.iter_mut().zip(rows) {
                        (joint.rows, joint.rmse_calibrated, joint.coverage95) = (rows, error, 0.95);
                    }
                }
            });
            let told = verdict.limits.into_iter();
            told.filter(|limit| limit.contains("its error"))
                .collect::<Vec<_>>()
        };
        let said = "Joint elbow: where training leaves its torque open (70 of 100 moving rows) its error is 0.200 N·m, elsewhere 0.100.";
        assert_eq!(of((70, 0.2)), [said]);
        assert!(of((70, 0.12)).is_empty() && of((9, 0.2)).is_empty());
    }

    #[test]
    fn what_is_too_narrow_there_is_said_with_what_holds_elsewhere() {
        let of = |beyond, within, speed| limits(beyond, within, Split::HeldoutLogs, speed);
        assert_eq!(
            of((34, 0.24), (46, 0.93), 10.0),
            [
                "Joint elbow: beyond the training motion (34 of 80 moving rows) its 95 % intervals hold 24.0\u{202f}%, within it 93.0\u{202f}%."
            ]
        );
        assert_eq!(
            of((34, 0.24), (46, 0.93), 1.0),
            [
                "Joint elbow: where training leaves its torque open (34 of 80 moving rows) its 95 % intervals hold 24.0\u{202f}%, elsewhere 93.0\u{202f}%."
            ]
        );
        // Nothing of it where the cause does not explain it, nor of a handful of rows.
        assert!(of((34, 0.24), (46, 0.2), 1.0).is_empty());
        assert!(of((5, 0.8), (46, 0.93), 1.0).is_empty());
        assert!(of((34, 0.94), (46, 0.95), 1.0).is_empty());
    }
}
