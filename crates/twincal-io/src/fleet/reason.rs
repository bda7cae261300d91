//! Why a log is left out of a fleet, in words.

use twincal::fleet::Reason;
use twincal::words::significant;

/// Code and sentence.
#[must_use]
pub fn reason(reason: &Reason) -> (&'static str, String) {
    match reason {
        Reason::OtherRobot => (
            "other_robot",
            "another model file than that of most robots".into(),
        ),
        Reason::OtherPlan => (
            "other_plan",
            "made with another plan than those of most robots: make it with --plan FILE".into(),
        ),
        Reason::Twice { robot, log } => ("twice", format!("the same as log `{log}` of `{robot}`")),
        Reason::Overlap { log, seconds } => (
            "overlap",
            format!("overlaps with log `{log}` by {seconds:.1} s"),
        ),
        Reason::Size { ratio } => (
            "torque_unit",
            format!(
                "torque is {} times that of the other robots on every joint: check its unit",
                significant(*ratio, 2)
            ),
        ),
        Reason::NotFinite => ("not_finite", "numbers that are not finite".into()),
    }
}
