//! What can go wrong (`Error`: cannot go on) and what must be said (`Finding`: go on, but say so).

mod code;
mod evidence;
mod examples;
mod mistake;
mod numbers;
mod table;

pub use code::Code;
pub use evidence::Evidence;
pub use mistake::Mistake;
pub use numbers::{FINDING_NUMBERS, FindingNumber};

use serde::{Deserialize, Serialize};

/// `Result` with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Why the mathematics cannot go on. Every message names the culprit, the number and the remedy.
///
/// # Example
/// ```
/// use twincal::prelude::*;
///
/// let log = Recording::new("run1", [0.0, 0.1, 0.2]);
/// let error = log.joint([1.0; 3], [0.0; 2]).unwrap_err();
/// assert!(matches!(&error, Error::Log { log, .. } if log == "run1"));
/// assert_eq!(error.remedy(), Some("give one value for each stamp, NaN where it is not known"));
/// println!("{error}"); // culprit, numbers and remedy in one sentence
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The robot description is not a physical tree of rigid bodies.
    #[error("model: {culprit}: {problem}; {remedy}")]
    Model {
        /// Link or joint, with its kind: "link `forearm`".
        culprit: String,
        /// What is wrong, with the number.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// The log cannot be turned into trajectories.
    #[error("log `{log}`: {problem}; {remedy}")]
    Log {
        /// Name of the log as given by the user.
        log: String,
        /// What is wrong, with channel, row or time.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// The numbers of a log are in another unit than they should be.
    #[error("log `{log}`: {problem}; {remedy}")]
    Unit {
        /// Name of the log as given by the user.
        log: String,
        /// The unit that they are in.
        unit: WrongUnit,
        /// What shows it, with the joint and the number.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// A term of the library cannot be built.
    #[error("term `{term}`, column {column}: {problem}; {remedy}")]
    Term {
        /// The expression as written.
        term: String,
        /// 1-based character position in the expression.
        column: usize,
        /// What is wrong.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// A setting is out of its range.
    #[error("setting `{key}`: {problem}; {remedy}")]
    Setting {
        /// Dotted key as in `twincal.toml`.
        key: String,
        /// What is wrong, with the value.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// The data cannot answer the question (exit code 4).
    #[error("refused: {problem}; {remedy}")]
    Refused {
        /// What is missing, with the counts.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// A number that must be finite is not; names the column.
    #[error("{what} is not finite for column `{column}`; {remedy}")]
    NotFinite {
        /// Which quantity.
        what: String,
        /// Name of the column (term or `torque`).
        column: String,
        /// How to fix it.
        remedy: String,
    },
    /// Statistics that do not belong together.
    #[error("statistics: {problem}; {remedy}")]
    Statistics {
        /// What differs, with the counts.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
    /// Whoever watches the progress asked for an end.
    #[error("cancelled: the calibration was asked to stop; run it again for a result")]
    Cancelled,
}

/// A unit in which a log cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum WrongUnit {
    /// Position, velocity or both of this joint are in degrees.
    Degrees(String),
    /// Stamps are in milliseconds.
    Milliseconds,
    /// Stamps are in microseconds.
    Microseconds,
    /// Stamps are in nanoseconds.
    Nanoseconds,
}

impl Error {
    /// How to fix it: the end of its message.
    #[must_use]
    pub fn remedy(&self) -> Option<&str> {
        match self {
            Self::Model { remedy, .. }
            | Self::Log { remedy, .. }
            | Self::Unit { remedy, .. }
            | Self::Term { remedy, .. }
            | Self::Setting { remedy, .. }
            | Self::Refused { remedy, .. }
            | Self::NotFinite { remedy, .. }
            | Self::Statistics { remedy, .. } => Some(remedy),
            Self::Cancelled => None,
        }
    }

    /// Its message without the name of the log: of errors about one.
    pub(crate) fn without_log(&self) -> String {
        match self {
            Self::Log {
                problem, remedy, ..
            }
            | Self::Unit {
                problem, remedy, ..
            } => format!("{problem}; {remedy}"),
            other => other.to_string(),
        }
    }

    /// Its log with another name; itself where it is not about one.
    #[must_use]
    pub fn with_log_name(mut self, rename: impl FnOnce(&str) -> String) -> Self {
        if let Self::Log { log, .. } | Self::Unit { log, .. } = &mut self {
            *log = rename(log);
        }
        self
    }
}

/// How much a [`Finding`] matters.
///
/// # Example
/// ```
/// use twincal::Severity;
///
/// assert!(Severity::Note < Severity::Warning && Severity::Warning < Severity::Degraded);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know.
    Note,
    /// Read this before you trust the numbers.
    Warning,
    /// Data was lost or degraded beyond the stated limit: the program ends with exit code 3.
    Degraded,
}

/// Something was dropped, changed, assumed or looks wrong. Shown in terminal, JSON and report; never silent.
///
/// # Example
/// The outer link of this arm has no mass. Programs read code, subject and severity; people read the message.
/// ```
/// # #[path = "../examples/two_link.rs"] mod two_link;
/// use std::collections::BTreeMap;
/// use twincal::robot::Robot;
/// use twincal::{Code, Severity};
///
/// # let description = two_link::arm(0.0)?.description().clone();
/// let (_, findings) = Robot::new(description, &BTreeMap::new())?;
/// let massless = findings.iter().find(|finding| finding.code == Code::MovesNoMass).ok_or("none")?;
/// assert_eq!((massless.subject.as_str(), massless.severity), ("elbow", Severity::Warning));
/// println!("{}", massless.message);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What it says, for programs.
    pub code: Code,
    /// How much it matters.
    pub severity: Severity,
    /// What it is about: log, joint, term or link, by name. Empty when it is about the whole run.
    pub subject: String,
    /// The joint of the log that is its subject: of `joint_not_driven`, `joint_stands_still` and `standstill`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// One sentence: culprit, number, remedy.
    pub message: String,
    /// How many samples, rows or elements it concerns; 0 when it does not count anything.
    pub count: u64,
    /// The numbers of the message by name, in SI units and radians, shares 0 … 1; [`Code::number`] and docs/codes.md say what each is.
    #[serde(default, skip_serializing_if = "Evidence::is_empty")]
    pub evidence: Evidence,
}

impl Finding {
    /// A finding of the given severity about `subject`, counting `count` items.
    pub fn new(
        severity: Severity,
        code: Code,
        subject: impl Into<String>,
        message: impl Into<String>,
        count: u64,
    ) -> Self {
        Self {
            code,
            severity,
            subject: subject.into(),
            joint: None,
            message: message.into(),
            count,
            evidence: Evidence::default(),
        }
    }

    /// With these numbers of its message, in SI units and radians, shares 0 … 1. [`Code::evidence`] lists the names of each code.
    ///
    /// # Example
    /// ```
    /// use twincal::{Code, Finding, Severity};
    ///
    /// let finding = Finding::new(Severity::Note, Code::RateCapped, "", "rows are kept at 50 Hz", 0);
    /// assert_eq!(finding.with([("rate", 50.0)]).evidence.get("rate"), Some(50.0));
    /// ```
    #[must_use]
    pub fn with(mut self, numbers: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        self.evidence.extend(numbers);
        self
    }

    /// The same about one joint of the log that is its subject.
    #[must_use]
    pub fn of_joint(self, joint: impl Into<String>) -> Self {
        Self {
            joint: Some(joint.into()),
            ..self
        }
    }

    /// Whether it is about this joint, of whichever log.
    #[must_use]
    pub fn is_about(&self, joint: &str) -> bool {
        self.joint.as_deref() == Some(joint) || self.joint.is_none() && self.subject == joint
    }
}
