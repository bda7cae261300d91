//! What is asked of the moving joints of a robot whose log is read.

use crate::robot::{JointKind, Robot};

/// What the pipeline has to know of a moving joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointFacts {
    /// Name in the model.
    pub(crate) name: String,
    /// Only angles are unfolded.
    pub(crate) kind: JointKind,
    /// Upper less lower limit where the model states both, rad or m.
    pub(crate) range: Option<f64>,
    /// Largest torque that the model states, N·m or N.
    pub(crate) effort: Option<f64>,
}

/// The moving joints of a robot.
pub(crate) fn joint_facts(robot: &Robot) -> Vec<JointFacts> {
    let names = robot.joint_names();
    (0..robot.dof())
        .map(|joint| {
            let limits = robot.joint(joint).limits;
            JointFacts {
                name: names[joint].to_owned(),
                kind: robot.joint_kind(joint),
                range: limits.lower.zip(limits.upper).map(|(low, high)| high - low),
                effort: limits.effort,
            }
        })
        .collect()
}
