//! Have the predicted distributions the right shape: what the PIT of held-out rows says, joint by joint.

use super::NAMED;
use super::list::{first_of, subject};
use super::number::{number, percent};
use super::units::unit_of;
use twincal::Code;
use twincal::assess::{Assessment, Claim, has_standstill};
use twincal::calibrate::Calibration;

/// What is said of joints, and of one; `slightly` where intervals are still of use.
fn words(code: Code, slightly: bool) -> &'static str {
    match (code, slightly) {
        (Code::ShapeWide, false) => "intervals are wider than they need to be",
        (Code::ShapeWide, true) => "intervals are a little wider than they need to be",
        (Code::ShapeNarrow, false) => "intervals are too narrow",
        (Code::ShapeNarrow, true) => "intervals are a little too narrow",
        (Code::ShapeAbove, false) => "torque lies above the prediction too often",
        (Code::ShapeAbove, true) => "torque lies above the prediction a little too often",
        (_, false) => "torque lies below the prediction too often",
        (_, true) => "torque lies below the prediction a little too often",
    }
}

/// What a reader can see of it: how much the 50 % interval holds, or on which side of the middle torque lies.
fn shown(claim: &Claim, rows: &str) -> String {
    let above = claim.number("share_above");
    match claim.code {
        Code::ShapeAbove => format!("{} of the {rows}", percent(above)),
        Code::ShapeBelow => format!("{} of the {rows}", percent(1.0 - above)),
        _ if claim.has("coverage50") => {
            let half = percent(claim.number("coverage50"));
            format!("{half} of the {rows} in 50 % intervals")
        }
        _ => format!("PIT deviation {}", number(claim.number("distance"), 2)),
    }
}

/// ", by 44.1 N·m on average"
fn by_how_much(claim: &Claim, calibration: &Calibration) -> String {
    if !claim.has("bias") {
        return String::new();
    }
    let bias = number(claim.number("bias").abs(), 3);
    let unit = unit_of(calibration, claim.subject.name());
    format!(", by {bias} {unit} on average")
}

/// Every joint whose predictions are off by more than chance allows, or all joints together, with the number behind it.
pub(super) fn sentences(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let rows = match has_standstill(&calibration.validation) {
        true => "moving rows",
        false => "rows",
    };
    let of = |code: Code, slightly: bool| -> Vec<&Claim> {
        let own = assessment.claims(code);
        own.filter(|own| (own.number("slight") > 0.0) == slightly)
            .collect()
    };
    let mut out = Vec::new();
    for slightly in [false, true] {
        let sides = [Code::ShapeAbove, Code::ShapeBelow].map(|code| of(code, slightly));
        let sides: Vec<_> = (sides.concat().into_iter())
            .map(|own| {
                let told = shown(own, rows) + &by_how_much(own, calibration);
                (own.code, own.subject.name(), told)
            })
            .collect();
        out.extend(off_to_sides(&sides, slightly));
    }
    for code in [Code::ShapeWide, Code::ShapeNarrow] {
        out.extend(of_width(code, &of(code, false), false, rows));
        out.extend(of_width(code, &of(code, true), true, rows));
    }
    out.extend(assessment.claims(Code::ShapeUneven).map(|own| {
        format!(
            "{}: predicted probabilities are not evenly spread (off by {}, by chance below {}).",
            subject(&[own.subject.name()]),
            number(own.number("distance"), 2),
            number(own.number("distance_limit"), 2)
        )
    }));
    out
}

/// Joints whose intervals are too wide, or too narrow, in one sentence with what is seen of the worst.
fn of_width(code: Code, own: &[&Claim], slightly: bool, rows: &str) -> Option<String> {
    let distance = |claim: &&&Claim| claim.number("distance");
    let worst = own
        .iter()
        .max_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let names: Vec<&str> = own.iter().map(|own| own.subject.name()).collect();
    let words = words(code, slightly);
    let seen = shown(worst, rows);
    Some(match own {
        [one] if one.subject.name().is_empty() => {
            format!("All joints together: {words} ({seen}).")
        }
        [_] => format!("{}: its {words} ({seen}).", subject(&names)),
        _ => format!(
            "{}: their {words} (on {} {seen}).",
            subject(&names),
            worst.subject.name()
        ),
    })
}

/// Joints whose torque lies to one side of its prediction, all in one sentence.
fn off_to_sides(own: &[(Code, &str, String)], slightly: bool) -> Option<String> {
    let names: Vec<&str> = own.iter().map(|(_, name, _)| *name).collect();
    let [(first, name, shown), others @ ..] = own else {
        return None;
    };
    if others.is_empty() {
        let words = words(*first, slightly);
        return Some(match name.is_empty() {
            true => format!("All joints together: {words} ({shown})."),
            false => format!("{}: its {words} ({shown}).", subject(&names)),
        });
    }
    let subject = subject(&names);
    let same = others.iter().all(|(code, ..)| code == first);
    let each = own.iter().map(|(code, name, shown)| match (same, *code) {
        (true, _) => format!("{name}: {shown}"),
        (false, Code::ShapeAbove) => format!("{name} above: {shown}"),
        (false, _) => format!("{name} below: {shown}"),
    });
    let each = first_of(each.collect(), NAMED);
    let words = match (same, slightly) {
        (true, _) => words(*first, slightly),
        (false, false) => "predictions are biased",
        (false, true) => "predictions are slightly biased",
    };
    Some(format!("{subject}: their {words} ({}).", each.join("; ")))
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::report::fixture;
    use crate::words::tests::pit;
    use twincal::assess::assess;

    #[test]
    fn torque_off_to_one_side_is_told_in_its_unit() {
        let mut calibration = fixture::two_joints();
        // 44 below while it moves, 1000 above at rest.
        calibration.validation.moving.joints[1].bias = -44.0;
        calibration.validation.filtered.joints[1].bias = 478.0;
        calibration.validation.reliability[1].pit = pit(0.5, -4.0);
        let said = "Joint elbow: its torque lies below the prediction too often (70.0\u{202f}% of the rows, by 44.0 N·m on average).";
        let all = sentences(&assess(&calibration), &calibration);
        assert!(all.iter().any(|s| s == said), "{all:?}");
    }

    #[test]
    fn joints_off_to_either_side_are_one_sentence() {
        let of = |own: &[(Code, &str)], slightly| {
            let own: Vec<(Code, &str, String)> = own
                .iter()
                .map(|(code, name)| (*code, *name, "70 %".to_owned()))
                .collect();
            off_to_sides(&own, slightly).unwrap_or_default()
        };
        let (above, below) = (Code::ShapeAbove, Code::ShapeBelow);
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

    #[test]
    fn what_is_wrong_is_shown_in_shares_of_rows() {
        let shown = |middle: f64, slope: f64| {
            let mut calibration = fixture::two_joints();
            let own = &mut calibration.validation.reliability[1];
            own.pit = pit(middle, slope);
            own.coverage_levels = vec![(0.5, 0.75), (0.95, 0.97)];
            let assessment = assess(&calibration);
            let mut claims = assessment.claims.iter();
            let own = claims.find(|own| own.code.as_str().starts_with("shape"));
            own.map(|own| super::shown(own, "rows")).unwrap_or_default()
        };
        assert_eq!(
            shown(0.75, 0.0),
            "75.0\u{202f}% of the rows in 50 % intervals"
        );
        // The slope's upper half: Σ (i − 9.5)/1000 over i = 10 … 19 is 0.05, times four.
        assert_eq!(shown(0.5, 4.0), "70.0\u{202f}% of the rows");
        assert_eq!(shown(0.5, -4.0), "70.0\u{202f}% of the rows");
    }
}
