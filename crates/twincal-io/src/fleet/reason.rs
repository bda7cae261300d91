//! Why a log is left out of a fleet, in words.

use twincal::fleet::Reason;
use twincal::words::significant;

/// The sentence of a reason.
#[must_use]
pub fn reason(reason: &Reason) -> String {
    match reason {
        Reason::OtherRobot => "another model file than that of most robots".into(),
        Reason::OtherPlan => {
            "another plan than that of most robots: make it with --plan FILE".into()
        }
        Reason::Twice { robot, log } => format!("the same as log `{log}` of `{robot}`"),
        Reason::Overlap { log, seconds } => format!("overlaps with log `{log}` by {seconds:.1} s"),
        Reason::Size { ratio } => format!(
            "torque is {} times that of the other logs on every joint: check its unit",
            significant(*ratio, 2)
        ),
        Reason::NotFinite => "numbers that are not finite".into(),
    }
}
