//! May the twin be used: one ordered table from codes to answers.

use crate::error::Code;
use serde::Serialize;

/// May the twin be used?
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// Yes, on motions like the ones that it was tested on.
    Yes,
    /// Yes, but for what the limits say.
    YesWithinLimits,
    /// No.
    No,
    /// It cannot be said, or not before something else was recorded or corrected.
    NotYet,
}

/// What a result means, in the order in which codes are looked for: the first that is claimed is the reason. Codes of mistakes in logs and models
/// stand before all of them, after `not_tested`; a finding that data were lost stands last.
pub(super) const TABLE: &[(Code, Answer)] = &[
    (Code::NotTested, Answer::NotYet),
    (Code::FewHeldOutRows, Answer::NotYet),
    (Code::ErrorAboveGate, Answer::No),
    (Code::CoverageOutsideGate, Answer::No),
    (Code::FrictionChanged, Answer::No),
    (Code::PayloadChanged, Answer::No),
    (Code::JointZeroChanged, Answer::No),
    (Code::TooShortToCheck, Answer::NotYet),
    (Code::WorseThanNominal, Answer::No),
    (Code::ErrorAboveTorque, Answer::No),
    (Code::ErrorAboveTorqueOnMostJoints, Answer::No),
    (Code::NoBetterThanNominal, Answer::NotYet),
    (Code::FrictionAloneIsBetter, Answer::NotYet),
    (Code::NothingEstablished, Answer::NotYet),
    (Code::NothingFound, Answer::YesWithinLimits),
    (Code::LargeError, Answer::YesWithinLimits),
    (Code::LargeErrorOnMostJoints, Answer::YesWithinLimits),
    (Code::UnphysicalLinks, Answer::YesWithinLimits),
    (Code::JointTorqueWorse, Answer::YesWithinLimits),
    (Code::NarrowIntervals, Answer::YesWithinLimits),
    (Code::NarrowIntervalsInMotion, Answer::YesWithinLimits),
    (Code::WorseAtRest, Answer::YesWithinLimits),
    (Code::DistributionNarrow, Answer::YesWithinLimits),
    (Code::TorqueAbovePrediction, Answer::YesWithinLimits),
    (Code::TorqueBelowPrediction, Answer::YesWithinLimits),
    (Code::JointErrorAboveTorque, Answer::YesWithinLimits),
    (Code::JointIntervalsNarrow, Answer::YesWithinLimits),
    (Code::WideIntervals, Answer::YesWithinLimits),
    (Code::DistributionWide, Answer::YesWithinLimits),
    (Code::JointDistributionOff, Answer::YesWithinLimits),
    (Code::NotConverged, Answer::YesWithinLimits),
    (Code::TorqueError, Answer::Yes),
    (Code::IntervalsHold, Answer::Yes),
    (Code::EffectsEstablished, Answer::Yes),
];

/// The table: results that decide, in the order in which they are looked for.
pub fn decision_table() -> impl Iterator<Item = (Code, Answer)> {
    TABLE.iter().copied()
}

impl Answer {
    /// Its name in files.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::YesWithinLimits => "yes_within_limits",
            Self::No => "no",
            Self::NotYet => "not_yet",
        }
    }

    /// What a result of the fit means; `None` of a finding.
    pub(super) fn of_result(code: Code) -> Option<Self> {
        let row = TABLE.iter().find(|(own, _)| *own == code);
        row.map(|(_, answer)| *answer)
    }
}
