//! Have the predicted distributions the right shape: what the PIT of held-out rows says, joint by joint, in words.

use super::limits::{decisive, has_standstill, too_narrow, too_wide};
use super::text::{number, percent, subject};
use super::view::{Joint, memory};
use twincal::calibrate::Calibration;
use twincal::validate::{JointScore, Pit, Reliability, Scores};

/// Distance of the PIT from uniform beyond which, if chance does not explain it, intervals are more than a little off: the
/// 50 % interval then holds less than 40 % or more than 60 %.
const OFF: f64 = 0.05;
/// Share of right predictions that [`Pit::chance`] lets pass for wrong ones.
const ALARM: f64 = 0.05;
/// Share of the rows on one side of the prediction from which it is said to be off to that side.
const ONE_SIDE: f64 = 0.6;
/// Probability below which so many joints are not off by chance.
const TOO_MANY: f64 = 0.01;

/// How a predicted distribution is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Wide,
    Narrow,
    /// The measured torque lies above the middle of the prediction too often.
    Above,
    Below,
}

impl Shape {
    const ALL: [Self; 4] = [Self::Wide, Self::Narrow, Self::Above, Self::Below];

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

    pub(super) fn headline(self) -> &'static str {
        match self {
            Self::Wide => "The torque yes; its intervals are wider than they need to be.",
            Self::Narrow => "The torque yes, its intervals not: they are too narrow.",
            Self::Above | Self::Below => {
                "The torque yes, its intervals not: they lie off to one side."
            }
        }
    }

    /// True where the 95 % interval of some joint says the opposite: in the middle of a distribution and at its ends errors may differ.
    pub(super) fn contradicts(self, scores: &Scores, joints: &[Joint<'_>]) -> bool {
        let any = |of: fn(&JointScore, f64) -> bool| {
            let mut scores = scores.joints.iter();
            scores.any(|score| of(score, memory(joints, &score.joint)))
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

    /// What a reader can see of it: how much the 50 % interval holds, or on which side of the middle torque lies.
    fn shown(self, pit: &Pit, coverage: &[(f64, f64)], rows: &str) -> String {
        let bins = pit.histogram.len();
        let above =
            pit.histogram[bins / 2..].iter().sum::<f64>() / pit.histogram.iter().sum::<f64>();
        let half = coverage.iter().find(|(level, _)| *level == 0.5);
        match (self, half) {
            (Self::Above, _) => format!("{} of the {rows}", percent(above)),
            (Self::Below, _) => format!("{} of the {rows}", percent(1.0 - above)),
            (_, Some((_, seen))) => format!("{} of the {rows} in 50 % intervals", percent(*seen)),
            (_, None) => format!("PIT off uniform by {}", number(pit.distance, 2)),
        }
    }

    /// What is said of joints, and of one; `slightly` where intervals are still of use.
    fn words(self, slightly: bool) -> &'static str {
        match (self, slightly) {
            (Self::Wide, false) => "intervals are wider than they need to be",
            (Self::Wide, true) => "intervals are a little wider than they need to be",
            (Self::Narrow, false) => "intervals are too narrow",
            (Self::Narrow, true) => "intervals are a little too narrow",
            (Self::Above, false) => "torque lies above the prediction too often",
            (Self::Above, true) => "torque lies above the prediction a little too often",
            (Self::Below, false) => "torque lies below the prediction too often",
            (Self::Below, true) => "torque lies below the prediction a little too often",
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

/// Where the shape of the predictions is off by more than [`OFF`] and by more than chance.
pub(super) struct Off {
    /// Over all joints.
    pub(super) all: Option<Shape>,
    /// On a single joint.
    pub(super) single: bool,
}

pub(super) fn off(calibration: &Calibration) -> Off {
    let validation = &calibration.validation;
    let far = |pit: &Pit, joints| Shape::of(pit, joints).filter(|_| pit.distance > OFF);
    let joints = looked_at(&validation.reliability);
    Off {
        all: far(&validation.pit, 1),
        single: (validation.reliability.iter()).any(|j| far(&j.pit, joints).is_some()),
    }
}

/// Every joint whose predictions are off by more than chance allows, in words and with the number behind them.
pub(super) fn sentences(calibration: &Calibration, all: &[Joint<'_>]) -> Vec<String> {
    let validation = &calibration.validation;
    let mut out = Vec::new();
    let mut to_one_side: [Vec<(Shape, &str, String)>; 2] = Default::default();
    let joints = looked_at(&validation.reliability);
    // What its 95 % interval says of a joint stands elsewhere; the middle of the distribution neither contradicts nor repeats it.
    let scores = &decisive(validation).joints;
    let rows = match has_standstill(validation) {
        true => "moving rows",
        false => "rows",
    };
    let said = |joint: &str, shape: Shape| {
        let (mut own, memory) = (
            scores.iter().filter(|score| score.joint == joint),
            memory(all, joint),
        );
        own.any(|score| match shape {
            Shape::Wide | Shape::Narrow => too_narrow(score, memory) || too_wide(score, memory),
            Shape::Above | Shape::Below => false,
        })
    };
    for (shape, slightly) in Shape::ALL.into_iter().flat_map(|s| [(s, false), (s, true)]) {
        let own: Vec<&Reliability> = (validation.reliability.iter())
            .filter(|j| {
                Shape::of(&j.pit, joints) == Some(shape) && (j.pit.distance <= OFF) == slightly
            })
            .filter(|j| !said(&j.joint, shape) && shape.agrees(&j.coverage_levels))
            .collect();
        let Some(worst) = (own.iter()).max_by(|a, b| a.pit.distance.total_cmp(&b.pit.distance))
        else {
            continue;
        };
        let names: Vec<&str> = own.iter().map(|j| j.joint.as_str()).collect();
        let one = |j: &Reliability| {
            let shown = shape.shown(&j.pit, &j.coverage_levels, rows);
            match shape {
                Shape::Above | Shape::Below => shown + &by_how_much(scores, all, &j.joint),
                Shape::Wide | Shape::Narrow => shown,
            }
        };
        if matches!(shape, Shape::Above | Shape::Below) {
            let told = own.iter().map(|j| (shape, j.joint.as_str(), one(j)));
            to_one_side[usize::from(slightly)].extend(told);
            continue;
        }
        let (names, words) = (subject(&names), shape.words(slightly));
        out.push(match own[..] {
            [_] => format!("{names}: its {words} ({}).", one(worst)),
            _ => format!(
                "{names}: their {words} (on {} {}).",
                worst.joint,
                one(worst)
            ),
        });
    }
    // Off, but neither too wide nor too narrow as a whole: to one side, if most of it lies there.
    for joint in &validation.reliability {
        let Some(shape) = Shape::of(&joint.pit, joints) else {
            continue;
        };
        if shape.agrees(&joint.coverage_levels) || said(&joint.joint, shape) {
            continue;
        }
        let bins = &joint.pit.histogram;
        let above = bins[bins.len() / 2..].iter().sum::<f64>() / bins.iter().sum::<f64>();
        let side = match above {
            _ if above > ONE_SIDE => Some(Shape::Above),
            _ if above < 1.0 - ONE_SIDE => Some(Shape::Below),
            _ => None,
        };
        match side {
            Some(side) => {
                let shown = side.shown(&joint.pit, &joint.coverage_levels, rows);
                let shown = shown + &by_how_much(scores, all, &joint.joint);
                to_one_side[0].push((side, &joint.joint, shown));
            }
            None => out.push(format!(
                "{}: predicted probabilities are not evenly spread (off by {}, by chance below {}).",
                subject(&[&joint.joint]),
                number(joint.pit.distance, 2),
                number(joint.pit.chance, 2)
            )),
        }
    }
    let sides = to_one_side.iter().zip([false, true]);
    let sides = sides.filter_map(|(own, slightly)| off_to_sides(own, slightly));
    out.splice(0..0, sides);
    let pooled = Shape::of(&validation.pit, 1);
    let pooled = pooled.filter(|shape| shape.agrees(&validation.coverage_levels));
    if let (true, Some(shape)) = (out.is_empty(), pooled) {
        let pit = &validation.pit;
        let words = shape.words(pit.distance <= OFF);
        let shown = shape.shown(pit, &validation.coverage_levels, rows);
        out.push(format!("All joints together: {words} ({shown})."));
    }
    out
}

/// Joints whose torque lies to one side of its prediction, all in one sentence.
fn off_to_sides(own: &[(Shape, &str, String)], slightly: bool) -> Option<String> {
    let names: Vec<&str> = own.iter().map(|(_, name, _)| *name).collect();
    let subject = subject(&names);
    let [(first, _, shown), others @ ..] = own else {
        return None;
    };
    if others.is_empty() {
        return Some(format!(
            "{subject}: its {} ({shown}).",
            first.words(slightly)
        ));
    }
    let same = others.iter().all(|(shape, ..)| shape == first);
    let each = own.iter().map(|(shape, name, shown)| match (same, shape) {
        (true, _) => format!("{name}: {shown}"),
        (false, Shape::Above) => format!("{name} above: {shown}"),
        (false, _) => format!("{name} below: {shown}"),
    });
    let each: Vec<String> = each.collect();
    let words = match (same, slightly) {
        (true, _) => first.words(slightly),
        (false, false) => "torque lies to one side of the prediction too often",
        (false, true) => "torque lies to one side of the prediction a little too often",
    };
    Some(format!("{subject}: their {words} ({}).", each.join("; ")))
}

/// ", by 44.1 N·m on average".
fn by_how_much(scores: &[JointScore], joints: &[Joint<'_>], name: &str) -> String {
    let score = scores.iter().find(|score| score.joint == name);
    let joint = joints.iter().find(|joint| joint.name == name);
    match score.zip(joint) {
        Some((score, joint)) if score.bias.is_finite() => {
            let (bias, unit) = (number(score.bias.abs(), 3), joint.units.torque);
            format!(", by {bias} {unit} on average")
        }
        _ => String::new(),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Of six joints three beyond what 95 of 100 right ones stay below: by chance in 2 of 1000 right twins.
    #[test]
    fn many_joints_beyond_their_own_limit_are_not_there_by_chance() {
        let of = |beyond: usize| {
            let mut calibration = crate::report::fixture::two_joints();
            let one = calibration.validation.reliability[0].clone();
            let joint = |k: usize| {
                let mut own = one.clone();
                own.pit.chance = 0.1;
                own.pit.distance = if k < beyond { 0.101 } else { 0.05 };
                own
            };
            calibration.validation.reliability = (0..6).map(joint).collect();
            looked_at(&calibration.validation.reliability)
        };
        assert_eq!([of(0), of(1), of(2), of(3), of(6)], [6, 6, 6, 1, 1]);
    }

    #[test]
    fn torque_off_to_one_side_is_told_in_its_unit() {
        let mut calibration = crate::report::fixture::two_joints();
        // 44 below while it moves, 1000 above at rest.
        calibration.validation.moving.joints[1].bias = -44.0;
        calibration.validation.filtered.joints[1].bias = 478.0;
        calibration.validation.reliability[1].pit = pit(0.5, -4.0);
        let joints = crate::report::view::joints(&calibration);
        let said = "Joint elbow: its torque lies below the prediction too often (70.0\u{202f}% of the rows, by 44.0 N·m on average).";
        let all = sentences(&calibration, &joints);
        assert!(all.iter().any(|s| s == said), "{all:?}");
    }

    #[test]
    fn joints_off_to_either_side_are_one_sentence() {
        let of = |own: &[(Shape, &str)], slightly| {
            let own: Vec<(Shape, &str, String)> = own
                .iter()
                .map(|(shape, name)| (*shape, *name, "70 %".to_owned()))
                .collect();
            off_to_sides(&own, slightly).unwrap_or_default()
        };
        let (above, below) = (Shape::Above, Shape::Below);
        assert_eq!(of(&[], false), "");
        assert_eq!(
            of(&[(above, "a")], true),
            "Joint a: its torque lies above the prediction a little too often (70 %)."
        );
        assert_eq!(
            of(&[(below, "a"), (below, "b")], false),
            "Joints a and b: their torque lies below the prediction too often (a: 70 %; b: 70 %)."
        );
        assert_eq!(
            of(&[(below, "a"), (above, "b")], false),
            "Joints a and b: their torque lies to one side of the prediction too often (a below: 70 %; b above: 70 %)."
        );
    }

    /// PIT with this many of 20 bins' share inside the middle ten, and a slope.
    pub(in crate::report) fn pit(middle: f64, slope: f64) -> Pit {
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

    #[test]
    fn what_is_wrong_is_shown_in_shares_of_rows() {
        let shown = |shape: Shape, slope| shape.shown(&pit(0.5, slope), &[(0.5, 0.75)], "rows");
        assert_eq!(
            shown(Shape::Wide, 0.0),
            "75.0\u{202f}% of the rows in 50 % intervals"
        );
        // The slope's upper half: Σ (i − 9.5)/1000 over i = 10 … 19 is 0.05, times four.
        assert_eq!(shown(Shape::Above, 4.0), "70.0\u{202f}% of the rows");
        assert_eq!(shown(Shape::Below, -4.0), "70.0\u{202f}% of the rows");
    }
}
