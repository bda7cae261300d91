//! Why a twin can be used or not: one ordered list of reasons, and the answer that each of them means.

use serde::Serialize;
use twincal::Mistake;

/// May the twin be used?
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Conclusion {
    /// Yes, on motions like the ones that it was tested on.
    Yes,
    /// Yes, but for what the limits say.
    YesWithinLimits,
    /// It cannot be said, or not before something else was recorded or corrected.
    NotYet,
    /// No.
    No,
}

/// What decides the answer. The order is that in which they are looked for: the first that holds is the reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// No row was held out.
    NotTested,
    /// Log and model contradict each other in orientation, sign, scale or order of joints.
    Contradiction,
    /// Torque that never changes while joints move.
    NoMeasurement,
    /// A log is a copy of another one.
    CopiedLog,
    /// The torque of one log or joint contradicts the others.
    OddTorque,
    /// Positions or their clock are wrong in a log.
    OddMotion,
    /// A held-out log is of another robot, or of another state of it.
    AnotherState,
    /// The held-out rows count as too few independent ones.
    FewHeldOutRows,
    /// The calibrated torque is worse than the nominal one.
    WorseThanNominal,
    /// The error left is larger than the torque itself, on every joint.
    ErrorAboveTorque,
    /// The same on most joints.
    ErrorAboveTorqueOnMostJoints,
    /// No candidate is in these logs.
    NothingFound,
    /// The calibrated torque is no better than the nominal one.
    NoBetterThanNominal,
    /// Friction and an offset alone predict held-out torque better.
    FrictionAloneIsBetter,
    /// Torque is better, but no effect is established.
    NothingEstablished,
    /// The error that is left is large on every joint.
    LargeError,
    /// The same on most joints.
    LargeErrorOnMostJoints,
    /// What was found of several links is no rigid body.
    UnphysicalLinks,
    /// Torque got worse on some joints.
    WorseOnSomeJoints,
    /// The intervals hold too little.
    NarrowIntervals,
    /// The same of joints that move; at rest torque got worse.
    NarrowIntervalsInMotion,
    /// The intervals hold more than they promise.
    WideIntervals,
    /// At rest torque got worse.
    WorseAtRest,
    /// The errors have another distribution than the intervals say.
    ErrorDistribution,
    /// All checks are passed.
    Passed,
    /// Some check is not passed.
    Exceptions,
}

impl Reason {
    /// The table: reason → answer.
    #[must_use]
    pub fn conclusion(self) -> Conclusion {
        match self {
            Self::Passed => Conclusion::Yes,
            Self::NothingFound
            | Self::LargeError
            | Self::LargeErrorOnMostJoints
            | Self::UnphysicalLinks
            | Self::WorseOnSomeJoints
            | Self::NarrowIntervals
            | Self::NarrowIntervalsInMotion
            | Self::WideIntervals
            | Self::WorseAtRest
            | Self::ErrorDistribution
            | Self::Exceptions => Conclusion::YesWithinLimits,
            Self::NotTested
            | Self::Contradiction
            | Self::NoMeasurement
            | Self::CopiedLog
            | Self::OddTorque
            | Self::OddMotion
            | Self::AnotherState
            | Self::FewHeldOutRows
            | Self::NoBetterThanNominal
            | Self::FrictionAloneIsBetter
            | Self::NothingEstablished => Conclusion::NotYet,
            Self::WorseThanNominal
            | Self::ErrorAboveTorque
            | Self::ErrorAboveTorqueOnMostJoints => Conclusion::No,
        }
    }
}

impl From<Mistake> for Reason {
    fn from(mistake: Mistake) -> Self {
        match mistake {
            Mistake::Contradiction => Self::Contradiction,
            Mistake::NoMeasurement => Self::NoMeasurement,
            Mistake::Copy => Self::CopiedLog,
            Mistake::OddTorque => Self::OddTorque,
            Mistake::OddMotion => Self::OddMotion,
            Mistake::AnotherState => Self::AnotherState,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::verdict::{Grade, tests::judged};
    use twincal::calibrate::Calibration;
    use twincal::{Code, Finding, Severity};

    /// Each reason where it holds, and "yes" where the page is green and nowhere else.
    #[test]
    fn the_reason_is_the_first_that_holds() {
        type Case = (fn(&mut Calibration), Reason, Conclusion);
        let cases: [Case; 7] = [
            (|_| (), Reason::Passed, Conclusion::Yes),
            (
                |c| {
                    c.validation
                        .filtered
                        .joints
                        .iter_mut()
                        .for_each(|j| j.rows = 0)
                },
                Reason::NotTested,
                Conclusion::NotYet,
            ),
            (
                |c| {
                    c.validation
                        .filtered
                        .joints
                        .iter_mut()
                        .for_each(|j| j.rows = 20)
                },
                Reason::FewHeldOutRows,
                Conclusion::NotYet,
            ),
            (
                |c| {
                    let scores = &mut c.validation.filtered;
                    scores.rmse_calibrated = 2.0 * scores.rmse_nominal;
                },
                Reason::WorseThanNominal,
                Conclusion::No,
            ),
            (
                |c| c.validation.filtered.coverage95 = 0.7,
                Reason::NarrowIntervals,
                Conclusion::YesWithinLimits,
            ),
            (
                |c| c.validation.filtered.coverage95 = 1.0,
                Reason::WideIntervals,
                Conclusion::YesWithinLimits,
            ),
            (
                |c| {
                    let copy = Finding::new(Severity::Warning, Code::CopiedLog, "b", "a copy", 0);
                    c.findings.push(copy);
                },
                Reason::CopiedLog,
                Conclusion::NotYet,
            ),
        ];
        for (change, reason, conclusion) in cases {
            let verdict = judged(change);
            assert_eq!(verdict.reason, reason, "{}", verdict.headline);
            assert_eq!(reason.conclusion(), conclusion, "{reason:?}");
            assert_eq!(conclusion == Conclusion::Yes, verdict.grade == Grade::Good);
        }
    }
}
