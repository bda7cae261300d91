//! What no candidate describes, where it is more than the noise.

use crate::error::{Code, Finding, Severity};
use crate::likelihood::PlugIn;
use crate::robot::Robot;
use crate::words::significant;

/// Misfit over noise from which it is said.
const MUCH: f64 = 2.0;

/// One finding per joint whose misfit is at least twice its noise, λ_j/τ_j.
pub(in crate::calibrate) fn findings(robot: &Robot, plug_in: &PlugIn) -> Vec<Finding> {
    let names = robot.joint_names().into_iter();
    let joints = names.zip(plug_in.misfit.iter().zip(&plug_in.autocorrelation_time));
    let shares = joints.map(|(name, (misfit, time))| (name, misfit / time));
    shares
        .filter(|(_, share)| *share >= MUCH)
        .map(|(name, share)| {
            let times = significant(share, 2);
            Finding::new(
                Severity::Note,
                Code::Misfit,
                name,
                format!(
                    "joint `{name}`: what no candidate describes counts as {times} times the noise; intervals and probabilities allow for it"
                ),
                0,
            )
            .with([("misfit", share)])
        })
        .collect()
}
