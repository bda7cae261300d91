//! The one list of findings that forbid a "Yes": a log or model is not what it is said to be.

use super::Severity::{self, Degraded, Note, Warning};
use super::{Code, Finding};

/// What a mistake is about. The order is that of the answer: the first kind that stands is its headline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mistake {
    /// Log and model contradict each other in orientation, sign, scale or order of joints.
    Contradiction,
    /// Torque is no measurement.
    NoMeasurement,
    /// A log is one that the twin knows: a copy of another one, or no news.
    Copy,
    /// Torque of one log or joint differs from the others'.
    OddTorque,
    /// Positions or their clock are wrong in a log.
    OddMotion,
    /// A held-out log is of another robot, or another state of it.
    AnotherState,
}

/// Every code that forbids a "Yes": from which severity on, and what it is about. Add a line for a new one; nothing else decides.
const TABLE: &[(Code, Severity, Mistake)] = &[
    // signal/filter/agreement.rs, self_check
    (Code::SignFlip, Note, Mistake::Contradiction),
    (Code::JointOrder, Note, Mistake::Contradiction),
    (Code::TorqueScale, Note, Mistake::Contradiction),
    (Code::VelocityOpposite, Note, Mistake::Contradiction),
    (Code::BaseOrientation, Degraded, Mistake::Contradiction),
    (Code::ModelTorque, Degraded, Mistake::Contradiction),
    (Code::GravityCompensated, Degraded, Mistake::Contradiction),
    (Code::ClockScale, Degraded, Mistake::Contradiction),
    (Code::TorqueCopied, Degraded, Mistake::Contradiction),
    (Code::TorqueConstant, Degraded, Mistake::NoMeasurement),
    (Code::TorqueHeld, Degraded, Mistake::NoMeasurement),
    // calibrate/result/common_gain.rs; a warning where torque comes from currents
    (Code::CommonFactor, Degraded, Mistake::Contradiction),
    // signal/clean/torque.rs; a warning where one joint of several is passive
    (Code::ConstantTorque, Degraded, Mistake::NoMeasurement),
    // cross_check
    (Code::CopiedLog, Warning, Mistake::Copy),
    (Code::LogTorqueExchanged, Warning, Mistake::OddTorque),
    (Code::LogTorqueFactor, Warning, Mistake::OddTorque),
    (Code::JointTorqueFactor, Warning, Mistake::OddTorque),
    (Code::LogTorqueLag, Warning, Mistake::OddTorque),
    (Code::ClockDrift, Warning, Mistake::OddMotion),
    (Code::EncoderStuck, Warning, Mistake::OddMotion),
    // signal/clean/jumps.rs
    (Code::PositionStep, Warning, Mistake::OddMotion),
    // calibrate/checks/another_state.rs
    (Code::AnotherState, Warning, Mistake::AnotherState),
];

impl Mistake {
    /// The codes that forbid a "Yes", with the severity from which on each does.
    pub fn codes() -> impl Iterator<Item = (Code, Severity)> {
        TABLE.iter().map(|(code, severity, _)| (*code, *severity))
    }

    /// The mistake that a finding of this severity speaks of; `None` where a "Yes" may stand beside it.
    #[must_use]
    pub fn of(code: Code, severity: Severity) -> Option<Self> {
        let named = TABLE
            .iter()
            .find(|(own, least, _)| *own == code && severity >= *least);
        named.map(|(_, _, mistake)| *mistake)
    }
}

impl Finding {
    /// The mistake that it speaks of; `None` where a "Yes" may stand beside it.
    #[must_use]
    pub fn mistake(&self) -> Option<Mistake> {
        Mistake::of(self.code, self.severity)
    }

    /// True if it forbids a "Yes".
    #[must_use]
    pub fn forbids_yes(&self) -> bool {
        self.mistake().is_some()
    }

    /// True if it says that log and model hardly speak of the same robot: turned signs, exchanged joints, torque of another scale. What
    /// is fitted all the same explains the mistake, with high probability and small errors.
    #[must_use]
    pub fn doubts_the_log(&self) -> bool {
        self.mistake() == Some(Mistake::Contradiction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn codes_are_listed_once_and_forbid_from_their_severity_on() {
        let codes: BTreeSet<Code> = Mistake::codes().map(|(code, _)| code).collect();
        assert_eq!(codes.len(), TABLE.len());
        let passive = Finding::new(Severity::Warning, Code::ConstantTorque, "", "", 0);
        assert!(!passive.forbids_yes());
        assert!(!Finding::new(Severity::Degraded, Code::Drift, "", "", 0).forbids_yes());
        for (code, severity) in Mistake::codes() {
            assert!(
                Finding::new(severity, code, "", "", 0).forbids_yes(),
                "{code}"
            );
        }
    }
}
