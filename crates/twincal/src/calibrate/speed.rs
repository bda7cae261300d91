//! Does the noise of a joint change with its speed? Said where it does and the fit assumes that it does not.

use crate::error::{Finding, Severity};
use crate::likelihood::SpeedProfile;
use crate::observations::Part;
use crate::plug_in::{Fit, residual_correlation_time};
use crate::robot::Robot;

/// Ratio of the largest to the smallest noise sd from which it is worth a word.
const WORTH: f64 = 2.0;

/// One finding for all joints whose residual is much larger at some speeds than at others.
pub(super) fn findings(robot: &Robot, fit: &Fit, training: &[Part<'_>]) -> Vec<Finding> {
    let mut found: Vec<(&str, f64)> = Vec::new();
    for (joint, name) in robot.joint_names().into_iter().enumerate() {
        let memory = residual_correlation_time(training, joint, &fit.posterior.mean);
        let rows = super::weigh::moving(training, joint, &fit.posterior.mean);
        if let Some(profile) = SpeedProfile::of_rows(rows, memory)
            && profile.ratio() > WORTH
        {
            found.push((name, profile.ratio()));
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let Some((name, ratio)) = found.first() else {
        return Vec::new();
    };
    let others = match found.len() {
        1 => String::new(),
        n => format!(" (and {} more)", n - 1),
    };
    vec![Finding::new(
        Severity::Note,
        "noise_varies_with_speed",
        *name,
        format!(
            "joint `{name}`{others}: what is left is {ratio:.1} times larger at some speeds than at others; intervals are too wide at \
             some and too narrow at others: noise.varies_with_speed = true"
        ),
        found.len() as u64,
    )]
}
