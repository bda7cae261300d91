//! Have the predicted distributions the right shape: what the PIT of held-out rows says, joint by joint, in words.

use super::text::{number, percent, subject};
use super::view::Joint;
use twincal::assess::{
    Shape, decisive, has_standstill, is_far, looked_at, memory, too_narrow, too_wide,
};
use twincal::calibrate::Calibration;
use twincal::validate::{JointScore, Pit, Reliability};

/// Share of the rows on one side of the prediction from which it is said to be off to that side.
const ONE_SIDE: f64 = 0.6;

/// What a reader can see of it: how much the 50 % interval holds, or on which side of the middle torque lies.
fn shown(shape: Shape, pit: &Pit, coverage: &[(f64, f64)], rows: &str) -> String {
    let bins = pit.histogram.len();
    let above = pit.histogram[bins / 2..].iter().sum::<f64>() / pit.histogram.iter().sum::<f64>();
    let half = coverage.iter().find(|(level, _)| *level == 0.5);
    match (shape, half) {
        (Shape::Above, _) => format!("{} of the {rows}", percent(above)),
        (Shape::Below, _) => format!("{} of the {rows}", percent(1.0 - above)),
        (_, Some((_, seen))) => format!("{} of the {rows} in 50 % intervals", percent(*seen)),
        (_, None) => format!("PIT deviation {}", number(pit.distance, 2)),
    }
}

/// What is said of joints, and of one; `slightly` where intervals are still of use.
fn words(shape: Shape, slightly: bool) -> &'static str {
    match (shape, slightly) {
        (Shape::Wide, false) => "intervals are wider than they need to be",
        (Shape::Wide, true) => "intervals are a little wider than they need to be",
        (Shape::Narrow, false) => "intervals are too narrow",
        (Shape::Narrow, true) => "intervals are a little too narrow",
        (Shape::Above, false) => "torque lies above the prediction too often",
        (Shape::Above, true) => "torque lies above the prediction a little too often",
        (Shape::Below, false) => "torque lies below the prediction too often",
        (Shape::Below, true) => "torque lies below the prediction a little too often",
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
            memory(&calibration.noise, joint),
        );
        own.any(|score| match shape {
            Shape::Wide | Shape::Narrow => too_narrow(score, memory) || too_wide(score, memory),
            Shape::Above | Shape::Below => false,
        })
    };
    for (shape, slightly) in Shape::ALL.into_iter().flat_map(|s| [(s, false), (s, true)]) {
        let own: Vec<&Reliability> = (validation.reliability.iter())
            .filter(|j| Shape::of(&j.pit, joints) == Some(shape) && is_far(&j.pit) != slightly)
            .filter(|j| !said(&j.joint, shape) && shape.agrees(&j.coverage_levels))
            .collect();
        let Some(worst) = (own.iter()).max_by(|a, b| a.pit.distance.total_cmp(&b.pit.distance))
        else {
            continue;
        };
        let names: Vec<&str> = own.iter().map(|j| j.joint.as_str()).collect();
        let one = |j: &Reliability| {
            let seen = shown(shape, &j.pit, &j.coverage_levels, rows);
            match shape {
                Shape::Above | Shape::Below => seen + &by_how_much(scores, all, &j.joint),
                Shape::Wide | Shape::Narrow => seen,
            }
        };
        if matches!(shape, Shape::Above | Shape::Below) {
            let told = own.iter().map(|j| (shape, j.joint.as_str(), one(j)));
            to_one_side[usize::from(slightly)].extend(told);
            continue;
        }
        let (names, words) = (subject(&names), words(shape, slightly));
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
                let seen = shown(side, &joint.pit, &joint.coverage_levels, rows);
                let seen = seen + &by_how_much(scores, all, &joint.joint);
                to_one_side[0].push((side, &joint.joint, seen));
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
        let words = words(shape, !is_far(pit));
        let seen = shown(shape, pit, &validation.coverage_levels, rows);
        out.push(format!("All joints together: {words} ({seen})."));
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
            words(*first, slightly)
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
        (true, _) => words(*first, slightly),
        (false, false) => "predictions are biased",
        (false, true) => "predictions are slightly biased",
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
            "Joints a and b: their predictions are biased (a below: 70 %; b above: 70 %)."
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
        let shown =
            |shape: Shape, slope| super::shown(shape, &pit(0.5, slope), &[(0.5, 0.75)], "rows");
        assert_eq!(
            shown(Shape::Wide, 0.0),
            "75.0\u{202f}% of the rows in 50 % intervals"
        );
        // The slope's upper half: Σ (i − 9.5)/1000 over i = 10 … 19 is 0.05, times four.
        assert_eq!(shown(Shape::Above, 4.0), "70.0\u{202f}% of the rows");
        assert_eq!(shown(Shape::Below, -4.0), "70.0\u{202f}% of the rows");
    }
}
