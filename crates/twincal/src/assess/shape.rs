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
/// Share of the rows on one side of the prediction from which it is said to be off to that side.
const ONE_SIDE: f64 = 0.6;
/// Share of right predictions that [`Pit::chance`] lets pass for wrong ones.
const ALARM: f64 = 0.05;
/// Probability below which so many joints are not off by chance.
const TOO_MANY: f64 = 0.01;

/// How a predicted distribution is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
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
    /// `None` where the distance from uniform is what chance allows one of `joints` that are looked at, in 95 of 100 right predictions.
    fn of(pit: &Pit, joints: usize) -> Option<Self> {
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
    fn agrees(self, coverage: &[(f64, f64)]) -> bool {
        let all = |of: fn(f64, f64) -> bool| coverage.iter().all(|(level, seen)| of(*level, *seen));
        match self {
            Self::Wide => all(|level, seen| seen >= level),
            Self::Narrow => all(|level, seen| seen <= level),
            Self::Above | Self::Below => true,
        }
    }

    /// What it decides where it is that of all joints together, and far.
    fn of_run(self) -> Code {
        match self {
            Self::Wide => Code::DistributionWide,
            Self::Narrow => Code::DistributionNarrow,
            Self::Above => Code::TorqueAbovePrediction,
            Self::Below => Code::TorqueBelowPrediction,
        }
    }

    /// What is seen of it.
    fn seen(self) -> Code {
        match self {
            Self::Wide => Code::ShapeWide,
            Self::Narrow => Code::ShapeNarrow,
            Self::Above => Code::ShapeAbove,
            Self::Below => Code::ShapeBelow,
        }
    }
}

/// Joints that count as looked at: one, where so many are beyond their own limit that chance would not do it in 99 of 100 right twins.
fn looked_at(reliability: &[Reliability]) -> usize {
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
fn is_far(pit: &Pit) -> bool {
    pit.distance > OFF
}

/// How the distribution of all joints together is off by more than a little and by more than chance, unless the 95 % interval of some joint says
/// the opposite.
fn together(calibration: &Calibration) -> Option<Shape> {
    let all = far(&calibration.validation.pit, 1);
    all.filter(|shape| !shape.contradicts(calibration))
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
    let numbers = |pit: &Pit| [("distance", pit.distance), ("distance_limit", pit.chance)];
    let mut out = Vec::new();
    if let Some(shape) = together(calibration) {
        let numbers = numbers(&calibration.validation.pit);
        out.push(Claim::new(shape.of_run(), Subject::Run, numbers));
    }
    out.extend(single(calibration).map(|joint| {
        let subject = Subject::Joint(joint.joint.clone());
        Claim::new(Code::JointDistributionOff, subject, numbers(&joint.pit))
    }));
    out.extend(seen(calibration));
    out
}

/// What can be seen of a distribution: how far it is from uniform, what the 50 % interval holds, the share of rows above the middle.
fn numbers_of(pit: &Pit, levels: &[(f64, f64)]) -> Vec<(&'static str, f64)> {
    let half = levels.iter().find(|(level, _)| *level == 0.5);
    let mut out = vec![
        ("distance", pit.distance),
        ("distance_limit", pit.chance),
        ("slight", f64::from(u8::from(!is_far(pit)))),
        ("share_above", share_above(pit)),
    ];
    out.extend(half.map(|(_, seen)| ("coverage50", *seen)));
    out
}

/// The shape of every joint's distribution that is off by more than chance, and where there is none that of all joints together. What its 95 %
/// interval says of a joint is claimed elsewhere; the middle of the distribution neither contradicts nor repeats it.
fn seen(calibration: &Calibration) -> Vec<Claim> {
    let validation = &calibration.validation;
    let scores = &decisive(validation).joints;
    let joints = looked_at(&validation.reliability);
    let said = |joint: &str, shape: Shape| {
        let memory = memory(&calibration.noise, joint);
        let mut own = scores.iter().filter(|score| score.joint == joint);
        let by_intervals = matches!(shape, Shape::Wide | Shape::Narrow);
        by_intervals && own.any(|own| too_narrow(own, memory) || too_wide(own, memory))
    };
    let mut out = Vec::new();
    for own in &validation.reliability {
        let Some(shape) = Shape::of(&own.pit, joints).filter(|shape| !said(&own.joint, *shape))
        else {
            continue;
        };
        let numbers = numbers_of(&own.pit, &own.coverage_levels);
        let code = match shape.agrees(&own.coverage_levels) {
            true => shape.seen(),
            false => to_one_side(&own.pit).map_or(Code::ShapeUneven, Shape::seen),
        };
        let score = scores.iter().find(|score| score.joint == own.joint);
        let bias = score.map(|score| ("bias", score.bias));
        let subject = Subject::Joint(own.joint.clone());
        let claim = Claim::new(code, subject, []).with(numbers);
        out.push(claim.with(bias.filter(|(_, bias)| bias.is_finite())));
    }
    let pooled = Shape::of(&validation.pit, 1);
    let pooled = pooled.filter(|shape| shape.agrees(&validation.coverage_levels));
    if let (true, Some(shape)) = (out.is_empty(), pooled) {
        let numbers = numbers_of(&validation.pit, &validation.coverage_levels);
        out.push(Claim::new(shape.seen(), Subject::Run, []).with(numbers));
    }
    out
}

/// Share of the rows above the middle of the prediction.
fn share_above(pit: &Pit) -> f64 {
    let bins = &pit.histogram;
    bins[bins.len() / 2..].iter().sum::<f64>() / bins.iter().sum::<f64>()
}

/// Off, but neither too wide nor too narrow as a whole: to one side, if most of it lies there.
fn to_one_side(pit: &Pit) -> Option<Shape> {
    match share_above(pit) {
        above if above > ONE_SIDE => Some(Shape::Above),
        above if above < 1.0 - ONE_SIDE => Some(Shape::Below),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// PIT with this many of 20 bins' share inside the middle ten, and a slope.
    fn pit(middle: f64, slope: f64) -> Pit {
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

    /// Of six joints three beyond what 95 of 100 right ones stay below: by chance in 2 of 1000 right twins.
    #[test]
    fn many_joints_beyond_their_own_limit_are_not_there_by_chance() {
        let of = |beyond: usize| {
            let joint = |k: usize| Reliability {
                joint: format!("joint{k}"),
                rows: 100,
                coverage_levels: Vec::new(),
                pit: Pit {
                    chance: 0.1,
                    distance: if k < beyond { 0.101 } else { 0.05 },
                    ..pit(0.75, 0.0)
                },
            };
            looked_at(&(0..6).map(joint).collect::<Vec<_>>())
        };
        assert_eq!([of(0), of(1), of(2), of(3), of(6)], [6, 6, 6, 1, 1]);
    }

    #[test]
    fn the_shape_of_the_predictions_is_that_of_the_histogram() {
        for (middle, slope, shape) in [
            (0.75, 0.0, Shape::Wide),
            (0.25, 0.0, Shape::Narrow),
            (0.5, 4.0, Shape::Above),
            (0.5, -4.0, Shape::Below),
            (0.75, 0.5, Shape::Wide),
        ] {
            assert_eq!(
                Shape::of(&pit(middle, slope), 1),
                Some(shape),
                "{middle} {slope}"
            );
        }
        let mut chance = pit(0.75, 0.0);
        chance.chance = 0.13;
        assert_eq!(Shape::of(&chance, 1), None);
        assert_eq!(Shape::of(&Pit::default(), 1), None);
    }
    /// 2 exp(−2 n d²) = 0.05/6: √(ln 240 / ln 40) times the distance of one joint alone.
    #[test]
    fn the_worst_of_six_joints_may_be_further_off_by_chance_than_one() {
        let mut pit = pit(0.75, 0.0);
        let factor = (240f64.ln() / 40f64.ln()).sqrt();
        for (distance, shape) in [(1.01, Some(Shape::Wide)), (0.99, None)] {
            pit.distance = distance * factor * pit.chance;
            assert_eq!(Shape::of(&pit, 6), shape);
            assert_eq!(Shape::of(&pit, 1), Some(Shape::Wide));
        }
    }
}
