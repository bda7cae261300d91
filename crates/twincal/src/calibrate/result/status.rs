//! One status per effect: what these data say of it, with the reason as numbers.

use crate::calibrate::checks::left_out::LeftOutError;
use serde::{Deserialize, Serialize};

/// Probability below which an effect is absent.
const ABSENT: f64 = 0.2;
/// Probability from which an effect is in the median-probability model.
pub(in crate::calibrate) const MEDIAN: f64 = 0.5;
/// What the data say of an effect.
///
/// # Example
/// ```
/// # #[path = "../../../examples/two_link.rs"] mod two_link;
/// use twincal::prelude::*;
///
/// # let fit = two_link::study()?;
/// let count = |status| fit.components.iter().filter(|own| own.status == status).count();
/// assert_eq!(count(Status::Established), 2); // the load at the tip and the hidden term
/// println!("{} {}", count(Status::Absent), Status::Absent.word());
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// PIP ≥ 0.95, and it lowers the error of left-out data by more than two standard errors.
    Established,
    /// Neither established nor absent.
    Tentative,
    /// One of at most four of which at least one is in (probability ≥ 0.95) and none is established alone.
    Equivalent,
    /// The data leave it as wide as the prior, or it has no torque of its own.
    Unidentifiable,
    /// PIP < 0.2.
    Absent,
}

impl Status {
    /// Its word, as in `result.json`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Established => "established",
            Self::Tentative => "tentative",
            Self::Equivalent => "equivalent",
            Self::Unidentifiable => "unidentifiable",
            Self::Absent => "absent",
        }
    }
}

/// Why an effect has its [`Status`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum StatusReason {
    /// Its inclusion probability alone.
    Probability,
    /// Its probability is high; the error of left-out data decides.
    LeftOut(LeftOutError),
    /// Others explain the same torque.
    SameTorque {
        /// Names of the set, the likeliest first.
        members: Vec<String>,
        /// Probability that at least one of them is in.
        pip: f64,
        /// For every motion of this robot, or in these logs only.
        alike: Alike,
    },
    /// No rigid body has the inertia found of its link.
    NoRigidBody {
        /// Chance that the rigid body nearest to it is found as far from every rigid body.
        chance: f64,
    },
    /// The data leave its coefficients as wide as the prior.
    WideAsPrior,
    /// It has no torque in these logs.
    NoTorqueInLogs,
    /// Its columns were dropped: no motion gives it a torque, or one that no other column has.
    NoColumn,
}

/// Status by probability alone: [`super::settle::settle`] decides what is claimed.
pub(in crate::calibrate) fn by_probability(
    pip: f64,
    mcse: f64,
    seen: bool,
) -> (Status, StatusReason) {
    if !seen {
        (Status::Unidentifiable, StatusReason::WideAsPrior)
    } else if pip < ABSENT && !is_open(pip, mcse) {
        (Status::Absent, StatusReason::Probability)
    } else {
        (Status::Tentative, StatusReason::Probability)
    }
}

/// Whether the sampler leaves open on which side of 0.5 a probability lies.
pub(in crate::calibrate) fn is_open(pip: f64, mcse: f64) -> bool {
    (pip - MEDIAN).abs() < 3.0 * mcse
}

/// Why the members of a [`Group`](crate::calibrate::Group) cannot be told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alike {
    /// Their torque is the same for every motion of this robot: only the prior prefers one.
    EveryMotion,
    /// Their torque is the same in these logs; another motion would separate them.
    #[default]
    TheseLogs,
}
