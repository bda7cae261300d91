//! What stands beside the answer on the first screen: three numbers, the joint that matters most, what the twin is for.

use super::view::Joint;
use crate::words;
use crate::words::number::{number, percent};
use crate::words::units::pooled_unit;
use serde::Serialize;
use twincal::assess::{Answer, decisive};
use twincal::calibrate::{Calibration, Status};

/// A large figure with a short label.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Number {
    value: String,
    label: String,
}

/// Torque error before and after, coverage of the 95 % intervals, established effects.
pub(super) fn numbers(calibration: &Calibration) -> [Number; 3] {
    let scores = decisive(&calibration.validation);
    let tested = scores.joints.iter().any(|joint| joint.rows > 0);
    let error = match tested {
        true => format!(
            "{} → {}",
            number(scores.rmse_nominal, 3),
            number(scores.rmse_calibrated, 3)
        ),
        false => number(f64::NAN, 3),
    };
    let established = words::with(Status::Established, calibration).len();
    [
        Number {
            value: error,
            label: format!(
                "torque error (RMSE), {}{}",
                pooled_unit(calibration),
                if tested {
                    words::before_calibration(calibration)
                } else {
                    ""
                }
            ),
        },
        Number {
            value: percent(if tested { scores.coverage95 } else { f64::NAN }),
            label: "of held-out torque in its 95 % intervals".into(),
        },
        Number {
            value: established.to_string(),
            label: match established {
                1 => "effect established".into(),
                _ => "effects established".into(),
            },
        },
    ]
}

/// The joint whose held-out torque error calibration lowers most; in units of the torque's standard deviation where some joints have
/// N·m and others N. `None` without held-out rows.
pub(super) fn hero<'j, 'c>(
    calibration: &Calibration,
    joints: &'j [Joint<'c>],
) -> Option<&'j Joint<'c>> {
    let scores = &decisive(&calibration.validation).joints;
    let mixed = joints.iter().any(|joint| joint.units != joints[0].units);
    let lowered = |joint: &Joint<'_>| {
        let score = scores.iter().find(|score| score.joint == joint.name)?;
        let scale = if mixed { score.torque_sd } else { 1.0 };
        let lowered = (score.rmse_nominal - score.rmse_calibrated) / scale;
        lowered.is_finite().then_some(lowered)
    };
    let drawn = joints.iter().filter(|joint| !joint.traces.is_empty());
    // `max_by` takes the last of equals; the model's order has the first.
    drawn.rev().max_by(|a, b| {
        let of = |joint| lowered(joint).unwrap_or(f64::NEG_INFINITY);
        of(a).total_cmp(&of(b))
    })
}

/// What the twin may be used for, and what not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Use {
    may: &'static str,
    may_not: &'static str,
    /// Whether the next recording matters more than what the answer rests on.
    record_first: bool,
}

/// The table: answer → use.
pub(super) fn use_of(answer: Answer) -> Use {
    match answer {
        Answer::Yes => Use {
            may: "Torque and its intervals, on motions like those of the test.",
            may_not: "Motions beyond the recorded ranges: the twin extrapolates there.",
            record_first: false,
        },
        Answer::YesWithinLimits => Use {
            may: "Torque on motions like those of the test, within the limits below.",
            may_not: "Motions beyond the recorded ranges: the twin extrapolates there.",
            record_first: false,
        },
        Answer::NotYet => Use {
            may: "A look at effects and residual, to plan the next recording.",
            may_not: "Torque in a simulation or a controller: no test supports it yet.",
            record_first: true,
        },
        Answer::No => Use {
            may: "A look at the residual, to find what is missing.",
            may_not: "Torque in a simulation or a controller: the test speaks against it.",
            record_first: true,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, view};

    #[test]
    fn the_joint_whose_error_falls_most_is_shown_first() {
        let mut calibration = fixture::two_joints();
        let name = |calibration: &Calibration| {
            let joints = view::joints(calibration);
            hero(calibration, &joints).map(|joint| joint.name.to_owned())
        };
        for (low, high) in [("shoulder", "elbow"), ("elbow", "shoulder")] {
            for scores in [
                &mut calibration.validation.filtered,
                &mut calibration.validation.moving,
            ] {
                for score in &mut scores.joints {
                    score.rmse_calibrated = 0.1;
                    score.rmse_nominal = if score.joint == low { 0.2 } else { 5.0 };
                }
            }
            assert_eq!(name(&calibration).as_deref(), Some(high));
        }
        calibration.validation.traces.clear();
        assert_eq!(name(&calibration), None);
    }

    #[test]
    fn numbers_without_a_test_are_dashes() {
        let calibration = fixture::no_validation();
        let [error, coverage, _] = numbers(&calibration);
        assert_eq!((error.value.as_str(), coverage.value.as_str()), ("–", "–"));
    }
}
