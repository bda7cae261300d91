//! A twin that predicts held-out torque worse than the model it started from.

use crate::error::{Finding, Severity};
use crate::robot::Robot;
use crate::validate::{Scores, WORSE};
use crate::words::significant;

/// One finding on all joints together where they are worse than nominal by more than [`WORSE`], else one per joint that is.
pub(super) fn findings(robot: &Robot, scores: &Scores) -> Vec<Finding> {
    let ratio = |[nominal, calibrated]: [f64; 2]| calibrated / nominal;
    if ratio([scores.rmse_nominal, scores.rmse_calibrated]) > WORSE {
        let message = format!(
            "on held-out data the calibrated torque is worse than the model's own: RMSE {} instead of {} over all joints: do not use \
             this twin; log longer, with motion in all of the range that it is for",
            significant(scores.rmse_calibrated, 3),
            significant(scores.rmse_nominal, 3)
        );
        return vec![finding(String::new(), message)];
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
        finding(name.clone(), message)
    });
    told.collect()
}

fn finding(subject: String, message: String) -> Finding {
    Finding::new(Severity::Warning, "worse_than_model", subject, message, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{JointDescription, JointKind, LinkDescription, RobotDescription};
    use crate::validate::ScoreKeeper;
    use std::collections::BTreeMap;

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
