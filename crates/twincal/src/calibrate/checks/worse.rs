//! A twin that predicts held-out torque worse than the model it started from.

use crate::error::{Code, Finding, Severity};
use crate::robot::Robot;
use crate::validate::{Loss, Scores, Validation, WORSE};
use crate::words::significant;

/// Error of the compact twin over the average's from which it is told.
const COMPACT: f64 = 1.25;

/// What is worse on held-out rows: than nominal, and of the compact twin than of the average.
pub(in crate::calibrate) fn of_validation(robot: &Robot, validation: &Validation) -> Vec<Finding> {
    let mut all = findings(robot, &validation.filtered);
    all.extend(of_compact(validation.compact));
    all
}

/// One finding on all joints together where they are worse than nominal by more than [`WORSE`], else one per joint that is.
fn findings(robot: &Robot, scores: &Scores) -> Vec<Finding> {
    let ratio = |[nominal, calibrated]: [f64; 2]| calibrated / nominal;
    if ratio([scores.rmse_nominal, scores.rmse_calibrated]) > WORSE {
        let message = format!(
            "on held-out data the calibrated torque is worse than the model's own: RMSE {} instead of {} over all joints: do not use \
             this twin; log longer, with motion in all of the range that it is for",
            significant(scores.rmse_calibrated, 3),
            significant(scores.rmse_nominal, 3)
        );
        return vec![finding(
            String::new(),
            message,
            [scores.rmse_calibrated, scores.rmse_nominal],
        )];
    }
    let worse = (scores.joints.iter().enumerate())
        .filter(|(_, score)| ratio([score.rmse_nominal, score.rmse_calibrated]) > WORSE);
    let told = worse.map(|(joint, score)| {
        let (name, unit) = (&score.joint, robot.joint_kind(joint).torque_unit());
        let message = format!(
            "joint `{name}`: on held-out data the calibrated torque is worse than the model's own: RMSE {} {unit} instead of \
             {} {unit}; its corrections do not hold beyond the motion of the fit: log it longer, in the motion that the twin is for",
            significant(score.rmse_calibrated, 3),
            significant(score.rmse_nominal, 3)
        );
        finding(name.clone(), message, [score.rmse_calibrated, score.rmse_nominal])
    });
    told.collect()
}

/// One on the compact twin where it loses by more than [`COMPACT`] of the error to the average over all models, or says of a held-out row that
/// it could not be.
fn of_compact(losses: Option<[Loss; 2]>) -> Option<Finding> {
    let [average, own] = losses?;
    let impossible = own.log_score == f64::NEG_INFINITY && average.log_score.is_finite();
    let worse = own.rmse > COMPACT * average.rmse;
    (worse || impossible).then(|| {
        let message = format!(
            "the compact twin (effects with probability 0.5 or more alone) predicts held-out torque worse than the average over all models: RMSE {} instead \
             of {} on moving joints; effects below 0.5 matter here: predict with the twin as it is, and do not read the compact one's numbers for \
             the robot's",
            significant(own.rmse, 3),
            significant(average.rmse, 3)
        );
        Finding::new(Severity::Warning, Code::CompactWorse, "", message, 0)
            .with([("rms_compact", own.rmse), ("rms_calibrated", average.rmse)])
    })
}

fn finding(subject: String, message: String, [calibrated, nominal]: [f64; 2]) -> Finding {
    Finding::new(Severity::Warning, Code::WorseThanModel, subject, message, 0)
        .with([("rms_calibrated", calibrated), ("rms_nominal", nominal)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{JointDescription, JointKind, LinkDescription, RobotDescription};
    use crate::validate::ScoreKeeper;
    use std::collections::BTreeMap;

    #[test]
    fn a_compact_twin_that_loses_much_is_told() {
        let loss = |rmse, log_score| Loss {
            rows: 9,
            rmse,
            log_score,
        };
        let told = |own| of_compact(Some([loss(1.0, 0.3), own])).map(|f| f.message);
        assert_eq!(told(loss(1.2, 0.2)), None);
        let message = told(loss(1.87, -3.0)).unwrap_or_default();
        assert!(message.contains("RMSE 1.87 instead of 1.00"), "{message}");
        assert!(told(loss(1.0, f64::NEG_INFINITY)).is_some());
        assert!(of_compact(None).is_none());
    }

    /// A chain of a hinge, a slider and another hinge.
    fn chain() -> Robot {
        use JointKind::{Prismatic, Revolute};
        let link = |k: usize| format!("link{k}");
        let kinds = [Revolute, Prismatic, Revolute].into_iter().enumerate();
        let description = RobotDescription {
            name: "chain".to_owned(),
            gravity: [0.0, 0.0, -9.81],
            joints: kinds
                .map(|(k, kind)| {
                    let name = format!("joint{k}");
                    JointDescription::new(&name, kind, &link(k), &link(k + 1))
                })
                .collect(),
            links: (0..4)
                .map(|k| LinkDescription {
                    name: link(k),
                    inertia: None,
                })
                .collect(),
            allow_unphysical: false,
        };
        Robot::new(description, &BTreeMap::new()).unwrap().0
    }

    /// Nominal and calibrated RMSE of all joints, and of each.
    fn told(all: [f64; 2], joints: [[f64; 2]; 3]) -> Vec<Finding> {
        let robot = chain();
        let mut scores = ScoreKeeper::new(robot.joint_names()).scores();
        [scores.rmse_nominal, scores.rmse_calibrated] = all;
        for (score, [nominal, calibrated]) in scores.joints.iter_mut().zip(joints) {
            (score.rmse_nominal, score.rmse_calibrated) = (nominal, calibrated);
        }
        findings(&robot, &scores)
    }

    #[test]
    fn what_is_worse_than_nominal_is_told_once() {
        let none = told([2.0, 1.0], [[2.0, 1.0], [2.0, 2.02], [0.0, 0.0]]);
        assert_eq!(none, []);
        // Without held-out rows there is nothing to tell.
        assert_eq!(told([f64::NAN; 2], [[f64::NAN; 2]; 3]), []);
        let joints = [[2.0, 1.0], [2.0, 2.5], [1.0, 1.5]];
        let some = told([5.0, 1.0], joints);
        let subjects: Vec<&str> = some.iter().map(|f| f.subject.as_str()).collect();
        assert_eq!(subjects, ["joint1", "joint2"]);
        let units = [
            "RMSE 2.50 N instead of 2.00 N;",
            "RMSE 1.50 N·m instead of 1.00 N·m;",
        ];
        for (finding, part) in some.iter().zip(units) {
            assert!(finding.message.contains(part), "{}", finding.message);
        }
        let all = told([1.0, 1e35], joints);
        assert_eq!((all.len(), all[0].subject.as_str()), (1, ""));
    }
}
