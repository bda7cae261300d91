//! Rows on which the training data say less than on others: motion that training did not have, or torque that it leaves open.

use super::NAMED;
use super::list::{first_of, list, subject};
use super::number::{number, percent};
use super::units::unit_of;
use twincal::Code;
use twincal::assess::{Assessment, Claim};
use twincal::calibrate::Calibration;

/// "34 of 80 moving rows".
fn rows(claim: &Claim) -> String {
    let [beyond, all] = ["rows_beyond", "rows"].map(|name| claim.number(name));
    format!("{beyond} of {all} moving rows")
}

/// Joints that are predicted worse there, or whose intervals hold less there.
pub(super) fn worse(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let codes = [Code::WorseOnNewMotion, Code::WorseOnOpenTorque];
    let claims = assessment.claims.iter();
    let claims = claims.filter(|claim| codes.contains(&claim.code));
    claims
        .map(|claim| worse_there(claim, calibration))
        .collect()
}

fn worse_there(claim: &Claim, calibration: &Calibration) -> String {
    let (place, elsewhere) = match claim.code {
        Code::WorseOnNewMotion => ("beyond the training motion", "within it"),
        _ => ("where training leaves its torque open", "elsewhere"),
    };
    let joint = claim.subject.name();
    let mut said = Vec::new();
    if claim.has("rms_beyond") {
        said.push(format!(
            "its error is {} {}, {elsewhere} {}",
            number(claim.number("rms_beyond"), 3),
            unit_of(calibration, joint),
            number(claim.number("rms_within"), 3)
        ));
    }
    if claim.has("coverage95_beyond") {
        let within = claim.number("coverage95_within");
        let seen = match within.is_finite() {
            false => String::new(),
            true => format!(", {elsewhere} {}", percent(within)),
        };
        let there = percent(claim.number("coverage95_beyond"));
        said.push(format!("its 95 % intervals hold {there}{seen}"));
    }
    let said = said.join("; ");
    format!("{}: {place} ({}) {said}.", subject(&[joint]), rows(claim))
}

/// Joints that were mostly tested there.
pub(super) fn mostly(assessment: &Assessment) -> Vec<String> {
    let each = [
        (
            Code::TestedOnNewMotion,
            "Tested mostly beyond the training motion",
        ),
        (
            Code::TestedOnOpenTorque,
            "Training leaves the torque open, known less well than its noise, on most tested rows",
        ),
    ];
    let told = |code: Code| -> Vec<String> {
        let claims = assessment.claims(code);
        claims
            .map(|claim| format!("{} ({})", claim.subject.name(), rows(claim)))
            .collect()
    };
    let each = each.map(|(code, words)| (told(code), words)).into_iter();
    each.filter(|(names, _)| !names.is_empty())
        .map(|(names, words)| format!("{words}: {}.", list(&first_of(names, NAMED))))
        .collect()
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use crate::words::tests::judged;
    use twincal::validate::Split;

    /// The elbow beyond on so many rows, within on as many; all of them new motion or none.
    fn limits(beyond: (u64, f64), within: (u64, f64), split: Split, is_new: bool) -> Vec<String> {
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
            c.validation.new_motion = vec![0, if is_new { beyond.0 } else { 0 }];
        });
        let told = verdict.limits.into_iter();
        told.filter(|limit| limit.contains("beyond the") || limit.contains(" open"))
            .collect()
    }

    #[test]
    fn rows_of_new_motion_are_told_as_that_and_others_by_what_training_leaves_open() {
        let (beyond, within) = ((41, 0.93), (40, 0.95));
        assert_eq!(
            limits(beyond, within, Split::HeldoutLogs, true),
            ["Tested mostly beyond the training motion: elbow (41 of 81 moving rows)."]
        );
        // So is a joint that is no better within.
        assert_eq!(
            limits((41, 0.95), (40, 0.93), Split::HeldoutLogs, true),
            ["Tested mostly beyond the training motion: elbow (41 of 81 moving rows)."]
        );
        let open = "Training leaves the torque open, known less well than its noise, on most tested rows: elbow (41 of 81 moving rows).";
        assert_eq!(limits(beyond, within, Split::HeldoutLogs, false), [open]);
        // Of later parts of the same logs the motion is in the training range by definition.
        assert_eq!(limits(beyond, within, Split::LastThirty, true), [open]);
        assert!(limits((40, 0.93), within, Split::LastThirty, false).is_empty());
        // No excuse where it is not worse there.
        assert!(limits((41, 0.95), (40, 0.93), Split::LastThirty, false).is_empty());
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
        let of = |beyond, within, is_new| limits(beyond, within, Split::HeldoutLogs, is_new);
        assert_eq!(
            of((34, 0.24), (46, 0.93), true),
            [
                "Joint elbow: beyond the training motion (34 of 80 moving rows) its 95 % intervals hold 24.0\u{202f}%, within it 93.0\u{202f}%."
            ]
        );
        assert_eq!(
            of((34, 0.24), (46, 0.93), false),
            [
                "Joint elbow: where training leaves its torque open (34 of 80 moving rows) its 95 % intervals hold 24.0\u{202f}%, elsewhere 93.0\u{202f}%."
            ]
        );
        // Nothing of it where the cause does not explain it, nor of a handful of rows.
        assert!(of((34, 0.24), (46, 0.2), false).is_empty());
        assert!(of((5, 0.8), (46, 0.93), false).is_empty());
        assert!(of((34, 0.94), (46, 0.95), false).is_empty());
    }
}
