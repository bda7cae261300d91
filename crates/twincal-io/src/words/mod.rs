//! The one place that makes sentences of what may be concluded: codes and numbers in, English out. Terminal, page, `predict`, `export` and `diff` show
//! these sentences; none of them decides anything.

mod beyond;
#[cfg(feature = "report")]
mod compact;
mod date;
pub mod design;
mod family;
#[cfg(feature = "tables")]
pub mod fleet;
mod grounds;
mod headline;
mod intervals;
mod limits;
pub(crate) mod list;
mod motion;
mod next;
pub(crate) mod number;
#[cfg(feature = "report")]
mod remark;
mod remedy;
mod rest;
mod shape;
mod status;
pub(crate) mod units;

#[cfg(feature = "report")]
pub(crate) use compact::compact;
pub use date::utc;
pub(crate) use family::family_name;
pub use grounds::before_calibration;
pub use intervals::drawn_alike;
#[cfg(feature = "report")]
pub(crate) use intervals::guarantee;
#[cfg(feature = "report")]
pub(crate) use motion::PAGE_FOLDER;
pub use motion::{NextMotion, next_motion};
pub use number::{percent, probability};
#[cfg(feature = "report")]
pub(crate) use remark::remarks;
pub use remedy::{Remedy, When, remedy};
pub use status::reason;
pub(crate) use status::with;
pub use units::pooled_unit;

use headline::Exceptions;
use twincal::Code;
use twincal::assess::{Assessment, assess};
use twincal::calibrate::Calibration;

/// Joints and effects that a sentence names; the others are counted.
const NAMED: usize = 3;

/// Whether the calibrated torque can be used, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// May it be used?
    pub answer: twincal::assess::Answer,
    /// What decides.
    pub reason: Code,
    /// One sentence.
    pub headline: String,
    /// The headline before a limit in the same line.
    pub lead: String,
    /// What it rests on.
    pub grounds: Vec<String>,
    /// What log, sampler, held-out torque and the effects say against it: what matters most.
    pub limits: Vec<String>,
    /// And the rest of that.
    pub folded: Vec<String>,
    /// The recording to make next, where that would show more.
    pub next: Option<String>,
}

/// What may be concluded from a calibration, in words.
///
/// # Example
/// ```
/// # #[path = "../../../twincal/examples/two_link.rs"] mod two_link;
/// use twincal::assess::{Answer, assess};
/// use twincal_io::words::answer;
///
/// # let fit = two_link::study()?;
/// let words = answer(&fit); // sentences for the values of `assess`
/// assert_eq!(words.answer, assess(&fit).answer);
/// assert!(words.answer <= Answer::YesWithinLimits && !words.headline.is_empty());
/// for limit in &words.limits {
///     println!("{limit}");
/// }
/// # Ok::<(), twincal::Error>(())
/// ```
#[must_use]
pub fn answer(calibration: &Calibration) -> Answer {
    of_assessment(&assess(calibration), calibration)
}

/// The limits of [`answer`] that none of the calibration's findings says, where those are listed beside them.
#[must_use]
pub fn limits_beside_findings(calibration: &Calibration) -> Vec<String> {
    let assessment = assess(calibration);
    match assessment.reason {
        Code::NotTested => Vec::new(),
        _ => limits::beside_findings(&assessment, calibration),
    }
}

/// The words of an assessment; the calibration has the names, units and effects.
pub(crate) fn of_assessment(assessment: &Assessment, calibration: &Calibration) -> Answer {
    let (answer, reason) = (assessment.answer, assessment.reason);
    let headline = |exceptions| headline::headline(assessment, calibration, exceptions);
    let (limits, folded) = match reason {
        Code::NotTested => Default::default(),
        _ => limits::fold(limits::limits(assessment, calibration)),
    };
    Answer {
        answer,
        reason,
        headline: headline(Exceptions::Below),
        lead: headline(Exceptions::Behind),
        grounds: grounds::grounds(assessment, calibration),
        limits,
        folded,
        next: next::next(assessment),
    }
}

#[cfg(all(test, feature = "report"))]
pub(crate) mod tests {
    use super::{Answer, answer};
    use crate::report::fixture;
    use twincal::calibrate::Calibration;
    use twincal::validate::Pit;

    /// A good twin of two joints without findings, changed; where its moving rows are not, they are as all rows.
    pub(crate) fn changed(change: impl Fn(&mut Calibration)) -> Calibration {
        let mut calibration = fixture::two_joints();
        calibration.findings.clear();
        let moving = calibration.validation.moving.clone();
        change(&mut calibration);
        if calibration.validation.moving == moving {
            calibration.validation.moving = calibration.validation.filtered.clone();
        }
        calibration
    }

    /// What is said of it, nothing folded away.
    pub(crate) fn judged(change: impl Fn(&mut Calibration)) -> Answer {
        let calibration = changed(change);
        require_known_numbers(&calibration);
        let mut answer = answer(&calibration);
        answer.limits.append(&mut answer.folded);
        answer
    }

    /// Every number of a claim stands at its code.
    fn require_known_numbers(calibration: &Calibration) {
        for claim in twincal::assess::assess(calibration).claims {
            let of_claims = claim.code.evidence_of_claims();
            let known = |name: &str| {
                let names = [of_claims, claim.code.evidence(), &["count"]].concat();
                names.contains(&name)
            };
            let unknown: Vec<&str> = (claim.evidence.iter())
                .map(|(name, _)| name)
                .filter(|name| !known(name))
                .collect();
            assert_eq!(unknown, [""; 0], "{}", claim.code);
        }
    }

    /// PIT with this many of 20 bins' share inside the middle ten, and a slope.
    pub(crate) fn pit(middle: f64, slope: f64) -> Pit {
        let bin = |i: usize| {
            let share = if (5..15).contains(&i) {
                middle
            } else {
                1.0 - middle
            };
            share / 10.0 + slope * (i as f64 - 9.5) / 1000.0
        };
        Pit {
            histogram: (0..20).map(bin).collect(),
            distance: 0.12,
            chance: 0.05,
        }
    }
}
