//! One thing that speaks for or against a twin, in numbers.

use super::answer::Answer;
use crate::calibrate::Calibration;
use crate::error::{Code, Evidence, Finding, Severity};
use serde::Serialize;

/// A claim: what is said of whom, by which numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// What is said.
    pub code: Code,
    /// What it means for the answer.
    pub role: Role,
    /// How much it matters.
    pub severity: Severity,
    /// Of whom.
    pub subject: Subject,
    /// By which numbers.
    pub evidence: Evidence,
}

/// What a claim means for the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Beside it there is no "yes".
    ForbidsYes,
    /// It says where a "yes" does not hold.
    Limits,
    /// It is what a "yes" rests on.
    Supports,
    /// It is good to know.
    Informs,
}

/// Whom a claim is about. In JSON `{"kind": "joint", "name": "elbow"}`; of the run `{"kind": "run"}`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind", content = "name")]
pub enum Subject {
    /// The whole run.
    Run,
    /// A log, by its name.
    Log(String),
    /// A joint.
    Joint(String),
    /// A link.
    Link(String),
    /// A component: one physical effect.
    Component(String),
    /// A term: one candidate.
    Term(String),
    /// Several of these together, or a key of the settings.
    Other(String),
}

impl Subject {
    /// What a finding's name stands for.
    fn of(name: &str, calibration: &Calibration) -> Self {
        let robot = calibration.twin.robot.description();
        let own = name.to_owned();
        if name.is_empty() {
            Self::Run
        } else if calibration.logs.iter().any(|log| log.name == name) {
            Self::Log(own)
        } else if robot.joints.iter().any(|joint| joint.name == name) {
            Self::Joint(own)
        } else if robot.links.iter().any(|link| link.name == name) {
            Self::Link(own)
        } else if calibration.components.iter().any(|c| c.name == name) {
            Self::Component(own)
        } else if calibration.terms.iter().any(|t| t.term.name == name) {
            Self::Term(own)
        } else {
            Self::Other(own)
        }
    }

    /// Its name; empty for the run.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Run => "",
            Self::Log(name)
            | Self::Joint(name)
            | Self::Link(name)
            | Self::Component(name)
            | Self::Term(name)
            | Self::Other(name) => name,
        }
    }
}

impl Claim {
    /// A number of its evidence; NaN where it has none of this name.
    #[must_use]
    pub fn number(&self, name: &str) -> f64 {
        self.evidence.get(name).unwrap_or(f64::NAN)
    }

    /// Whether a number of this name speaks for it.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.evidence.get(name).is_some()
    }

    /// With these numbers too.
    pub(super) fn with(mut self, numbers: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        self.evidence.extend(numbers);
        self
    }

    /// Role and severity are those that the answer to the code means.
    pub(super) fn new<const N: usize>(
        code: Code,
        subject: Subject,
        numbers: [(&'static str, f64); N],
    ) -> Self {
        let (role, severity) = match Answer::of_result(code) {
            Some(Answer::No | Answer::NotYet) => (Role::ForbidsYes, Severity::Degraded),
            Some(Answer::YesWithinLimits) => (Role::Limits, Severity::Warning),
            Some(Answer::Yes) => (Role::Supports, Severity::Note),
            None => (Role::Informs, Severity::Note),
        };
        Self {
            code,
            role,
            severity,
            subject,
            evidence: Evidence::of(numbers),
        }
    }

    /// The same as a limit that does not change the answer.
    pub(super) fn limit<const N: usize>(
        code: Code,
        subject: Subject,
        numbers: [(&'static str, f64); N],
    ) -> Self {
        Self {
            role: Role::Limits,
            severity: Severity::Warning,
            ..Self::new(code, subject, numbers)
        }
    }

    /// A claim about the run that needs no number.
    #[must_use]
    pub fn of_run(code: Code) -> Self {
        Self::new(code, Subject::Run, [])
    }

    /// A gate of new logs that does not hold: a value outside its limits.
    #[must_use]
    pub fn of_gate(code: Code, subject: Subject, value: f64, [low, high]: [f64; 2]) -> Self {
        let numbers = [("value", value), ("low", low), ("high", high)];
        Self::new(code, subject, numbers)
    }

    /// What was found before the fit was judged.
    pub(super) fn of_finding(finding: &Finding, calibration: &Calibration) -> Self {
        Self::found(finding, Subject::of(&finding.subject, calibration))
    }

    /// What was found, and of whom, by its numbers and its count.
    pub(super) fn found(finding: &Finding, subject: Subject) -> Self {
        let role = match (finding.mistake(), finding.severity) {
            (Some(_), _) => Role::ForbidsYes,
            (None, Severity::Note) => Role::Informs,
            (None, Severity::Warning | Severity::Degraded) => Role::Limits,
        };
        let count = (finding.count > 0).then_some(("count", finding.count as f64));
        let mut evidence = finding.evidence.clone();
        evidence.extend(count);
        Self {
            code: finding.code,
            role,
            severity: finding.severity,
            subject,
            evidence,
        }
    }
}
