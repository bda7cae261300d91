//! Rows on which the training data say less than on others, by cause: motion that training did not have, or torque that it leaves open.

use super::limits::too_narrow;
use super::text::{list, number, percent, subject};
use super::view::{Joint, memory};
use twincal::calibrate::Calibration;
use twincal::validate::{JointScore, Split, Validation};

/// Share of its range by which a joint may leave the training motion.
const MARGIN: f64 = 0.05;
/// Share of a joint's rows from which the error there is told.
const MANY: f64 = 0.1;
/// Ratio of errors there and elsewhere from which they are told.
const FURTHER_OFF: f64 = 1.25;
/// Share of the rows beyond that are new motion, from which that is the cause.
const MOSTLY: f64 = 0.5;

/// Why [`Validation::beyond`] has a joint's rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    /// Its position or velocity leaves the training range.
    NewMotion,
    /// What is not known of its torque is more than the noise.
    OpenTorque,
}

impl Cause {
    /// New motion is only where whole logs were held out: of other splits the range is that of all logs.
    fn of(calibration: &Calibration, joint: &str, rows: f64) -> Self {
        if calibration.validation.split != Split::HeldoutLogs {
            return Self::OpenTorque;
        }
        let index = calibration
            .noise
            .iter()
            .position(|noise| noise.joint == joint);
        let hull = index.and_then(|index| calibration.twin.hull.get(index));
        let Some(hull) = hull else {
            return Self::NewMotion;
        };
        let leaves = |x: f64, low: f64, high: f64| {
            let margin = MARGIN * (high - low);
            x < low - margin || x > high + margin
        };
        let (mut new, mut all) = (0.0, 0.0);
        let traces = calibration.validation.traces.iter();
        for trace in traces.filter(|trace| trace.joint == joint) {
            for ((q, qd), still) in trace.q.iter().zip(&trace.qd).zip(&trace.standstill) {
                if !still {
                    all += 1.0;
                    let outside = leaves(*q, hull[0], hull[1]) || leaves(*qd, hull[2], hull[3]);
                    new += f64::from(u8::from(outside));
                }
            }
        }
        match new > MOSTLY * rows * all {
            true => Self::NewMotion,
            false => Self::OpenTorque,
        }
    }
}

/// A joint's moving rows within and beyond.
struct Pair<'a> {
    within: &'a JointScore,
    beyond: &'a JointScore,
    cause: Cause,
}

impl<'a> Pair<'a> {
    fn of(calibration: &Calibration, within: &'a JointScore, beyond: &'a JointScore) -> Self {
        let share = beyond.rows as f64 / (within.rows + beyond.rows) as f64;
        let cause = Cause::of(calibration, &beyond.joint, share);
        Self {
            within,
            beyond,
            cause,
        }
    }

    /// "34 of 80 moving rows".
    fn rows(&self) -> String {
        let all = self.within.rows + self.beyond.rows;
        format!("{} of {all} moving rows", self.beyond.rows)
    }
}

/// Joints that have most of their rows there. Of torque that training leaves open only those that are predicted better elsewhere: otherwise
/// that is no excuse.
fn mostly_there(calibration: &Calibration) -> impl Iterator<Item = Pair<'_>> {
    let Validation { within, beyond, .. } = &calibration.validation;
    let pairs = within.joints.iter().zip(&beyond.joints);
    pairs
        .filter(|(within, beyond)| beyond.rows > within.rows)
        .map(|(within, beyond)| Pair::of(calibration, within, beyond))
        .filter(
            |Pair {
                 within,
                 beyond,
                 cause,
             }| {
                let better = within.rows == 0 || within.coverage95 > beyond.coverage95;
                *cause == Cause::NewMotion || better
            },
        )
}

/// Joints of which training says less on a tenth of the held-out moving rows or more, mostly because their motion is new.
pub(super) fn new_motion(calibration: &Calibration) -> Vec<String> {
    let Validation { within, beyond, .. } = &calibration.validation;
    let pairs = within.joints.iter().zip(&beyond.joints);
    pairs
        .filter(|(within, beyond)| beyond.rows as f64 >= MANY * (within.rows + beyond.rows) as f64)
        .filter(|(_, beyond)| beyond.rows > 0)
        .map(|(within, beyond)| Pair::of(calibration, within, beyond))
        .filter(|pair| pair.cause == Cause::NewMotion)
        .map(|pair| pair.beyond.joint.clone())
        .collect()
}

/// Joints whose intervals are too narrow there, and less so elsewhere: by more than two standard errors of as many independent rows; and those
/// whose error is larger there, on many of their rows.
pub(super) fn narrow(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let Validation { within, beyond, .. } = &calibration.validation;
    let open = within.joints.iter().zip(&beyond.joints);
    let open = open.filter(|(_, beyond)| beyond.rows > 0);
    let told = open.filter_map(|(within, beyond)| {
        let all = within.rows + beyond.rows;
        let own = too_narrow(beyond, memory(joints, &beyond.joint));
        let narrow = own && (within.rows == 0 || within.coverage95 > beyond.coverage95);
        let further = within.rows > 0
            && beyond.rows as f64 >= MANY * all as f64
            && beyond.rmse_calibrated > FURTHER_OFF * within.rmse_calibrated;
        if !(narrow || further) {
            return None;
        }
        let pair = Pair::of(calibration, within, beyond);
        let (place, elsewhere) = match pair.cause {
            Cause::NewMotion => ("beyond the training motion", "within it"),
            Cause::OpenTorque => ("where training leaves its torque open", "elsewhere"),
        };
        let unit = joints.iter().find(|joint| joint.name == beyond.joint);
        let unit = unit.map_or("", |joint| joint.units.torque);
        let mut said = Vec::new();
        if further {
            said.push(format!(
                "its error is {} {unit}, {elsewhere} {}",
                number(beyond.rmse_calibrated, 3),
                number(within.rmse_calibrated, 3)
            ));
        }
        if narrow {
            let seen = match within.rows {
                0 => String::new(),
                _ => format!(", {elsewhere} {}", percent(within.coverage95)),
            };
            said.push(format!(
                "its 95 % intervals hold {}{seen}",
                percent(beyond.coverage95)
            ));
        }
        Some(format!(
            "{}: {place} ({}) {}.",
            subject(&[&beyond.joint]),
            pair.rows(),
            said.join("; ")
        ))
    });
    told.collect()
}

/// Joints that were mostly tested there.
pub(super) fn mostly(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let told = |wanted: Cause| -> Vec<String> {
        mostly_there(calibration)
            .filter(|pair| pair.cause == wanted)
            .filter(|pair| joints.iter().any(|joint| joint.name == pair.beyond.joint))
            .map(|pair| format!("{} ({})", pair.beyond.joint, pair.rows()))
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
    use super::*;

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
