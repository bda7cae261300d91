//! Have the predicted distributions the right shape: what the PIT of held-out rows says, joint by joint.

use super::claim::{Claim, Subject};
use super::intervals::{too_narrow, too_wide};
use super::scores::{decisive, memory};
use crate::calibrate::Calibration;
use crate::error::Code;
use crate::validate::{JointScore, Pit, Reliability};

/// Distance of the PIT from uniform beyond which, if chance does not explain it, intervals are more than a little off: the
/// 50 % interval then holds less than 40 % or more than 60 %.
const OFF: f64 = 0.05;
/// Share of right predictions that [`Pit::chance`] lets pass for wrong ones.
const ALARM: f64 = 0.05;
/// Probability below which so many joints are not off by chance.
const TOO_MANY: f64 = 0.01;

/// How a predicted distribution is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Intervals are wider than they need to be.
    Wide,
    /// They are too narrow.
    Narrow,
    /// The measured torque lies above the middle of the prediction too often.
    Above,
    /// It lies below it too often.
    Below,
}

impl Shape {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Wide, Self::Narrow, Self::Above, Self::Below];

    /// `None` where the distance from uniform is what chance allows one of `joints` that are looked at, in 95 of 100 right predictions.
    #[must_use]
    pub fn of(pit: &Pit, joints: usize) -> Option<Self> {
        let beyond = pit.distance > pit.chance * of_one_among(joints);
        if pit.histogram.is_empty() || !beyond {
            return None;
        }
        let bins = pit.histogram.len();
        let mut share = 0.0;
        let edges = (1..=bins).zip(&pit.histogram).map(|(edge, bin)| {
            share += bin;
            share - edge as f64 / bins as f64
        });
        // Share of the rows below each edge, less what it should be: of one sign where the prediction is off to one side.
        let gaps: Vec<f64> = edges.collect();
        let high = gaps.iter().copied().fold(0.0, f64::max);
        let low = -gaps.iter().copied().fold(0.0, f64::min);
        Some(if high < low / 3.0 {
            Self::Above
        } else if low < high / 3.0 {
            Self::Below
        } else if gaps[..bins / 2].iter().sum::<f64>() < 0.0 {
            Self::Wide
        } else {
            Self::Narrow
        })
    }

    /// True where the 95 % interval of some joint says the opposite: in the middle of a distribution and at its ends errors may differ.
    fn contradicts(self, calibration: &Calibration) -> bool {
        let any = |of: fn(&JointScore, f64) -> bool| {
            let mut scores = decisive(&calibration.validation).joints.iter();
            scores.any(|score| of(score, memory(&calibration.noise, &score.joint)))
        };
        match self {
            Self::Wide => any(too_narrow),
            Self::Narrow => any(too_wide),
            Self::Above | Self::Below => false,
        }
    }

    /// False where the central intervals hold too little for ones that are too wide, or too much for ones that are too narrow.
    #[must_use]
    pub fn agrees(self, coverage: &[(f64, f64)]) -> bool {
        let all = |of: fn(f64, f64) -> bool| coverage.iter().all(|(level, seen)| of(*level, *seen));
        match self {
            Self::Wide => all(|level, seen| seen >= level),
            Self::Narrow => all(|level, seen| seen <= level),
            Self::Above | Self::Below => true,
        }
    }

    fn of_run(self) -> Code {
        match self {
            Self::Wide => Code::DistributionWide,
            Self::Narrow => Code::DistributionNarrow,
            Self::Above => Code::TorqueAbovePrediction,
            Self::Below => Code::TorqueBelowPrediction,
        }
    }
}

/// Joints that count as looked at: one, where so many are beyond their own limit that chance would not do it in 99 of 100 right twins.
#[must_use]
pub fn looked_at(reliability: &[Reliability]) -> usize {
    let joints = reliability.len();
    let beyond = reliability
        .iter()
        .filter(|j| Shape::of(&j.pit, 1).is_some());
    // P(X ≥ beyond) of a binomial distribution.
    let tail = |least: usize| -> f64 {
        let one = |k: usize| {
            let ways = (0..k).map(|i| (joints - i) as f64 / (k - i) as f64);
            ways.product::<f64>() * ALARM.powi(k as i32) * (1.0 - ALARM).powi((joints - k) as i32)
        };
        (least..=joints).map(one).sum()
    };
    match beyond.count() {
        most if most > 1 && tail(most) < TOO_MANY => 1,
        _ => joints,
    }
}

/// How much further the worst of some joints goes than one alone: the Kolmogorov–Smirnov distance exceeds d by chance with a probability of
/// about 2 exp(−2 n d²), which has to be 0.05 for one and 0.05/`joints` for each of several.
fn of_one_among(joints: usize) -> f64 {
    let log_tail = |alarm: f64| (2.0 / alarm).ln();
    (log_tail(ALARM / joints.max(1) as f64) / log_tail(ALARM)).sqrt()
}

/// Whether a distribution is more than a little off.
#[must_use]
pub fn is_far(pit: &Pit) -> bool {
    pit.distance > OFF
}

/// Where the shape of the predictions is off by more than a little and by more than chance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Off {
    /// Over all joints, unless the 95 % interval of some joint says the opposite.
    pub all: Option<Shape>,
    /// On a single joint.
    pub single: bool,
}

/// Where it is.
#[must_use]
pub fn off(calibration: &Calibration) -> Off {
    let all = far(&calibration.validation.pit, 1);
    Off {
        all: all.filter(|shape| !shape.contradicts(calibration)),
        single: single(calibration).next().is_some(),
    }
}

fn far(pit: &Pit, joints: usize) -> Option<Shape> {
    Shape::of(pit, joints).filter(|_| is_far(pit))
}

/// Joints on which it is.
fn single(calibration: &Calibration) -> impl Iterator<Item = &Reliability> {
    let reliability = &calibration.validation.reliability;
    let joints = looked_at(reliability);
    let all = reliability.iter();
    all.filter(move |joint| far(&joint.pit, joints).is_some())
}

/// Distributions of all joints together, and of single joints, that are more than a little off.
pub(super) fn claims(calibration: &Calibration) -> Vec<Claim> {
    let numbers = |pit: &Pit| [("distance", pit.distance), ("chance", pit.chance)];
    let mut out = Vec::new();
    if let Some(shape) = off(calibration).all {
        let numbers = numbers(&calibration.validation.pit);
        out.push(Claim::new(shape.of_run(), Subject::Run, numbers));
    }
    out.extend(single(calibration).map(|joint| {
        let subject = Subject::Joint(joint.joint.clone());
        Claim::new(Code::JointDistributionOff, subject, numbers(&joint.pit))
    }));
    out
}
