//! Where a twin does not hold, in sentences: the claims against it, what matters most first.

use super::list::{each_or_range, first_of, list, subject};
use super::number::{THIN, number, percent};
use super::units::{pooled_unit, unit_of};
use super::{NAMED, beyond, rest, shape};
use twincal::assess::{Assessment, has_standstill};
use twincal::calibrate::Calibration;
use twincal::{Code, Finding, Severity};

/// Share of the torque's standard deviation from which a constant would do better, not only as well.
const CLEARLY_LOST: f64 = 1.05;
/// Intervals that are judged.
const LEVEL_WORDS: &str = "95 % intervals";

/// Where the twin does not hold and what to mind, in the order of the report.
pub(super) fn limits(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let of_findings = |keep: fn(&&Finding) -> bool| {
        let findings = calibration.findings.iter().filter(keep);
        findings.map(|f| said(f, calibration)).collect::<Vec<_>>()
    };
    let mut out = of_findings(|f| f.forbids_yes());
    out.extend(not_converged(assessment));
    out.extend(of_findings(|f| {
        f.severity == Severity::Degraded && !f.forbids_yes()
    }));
    out.extend(of_the_fit(assessment, calibration));
    out
}

/// The limits that no finding says.
pub(super) fn beside_findings(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let mut out: Vec<String> = not_converged(assessment).into_iter().collect();
    out.extend(of_the_fit(assessment, calibration));
    out
}

fn not_converged(assessment: &Assessment) -> Option<String> {
    assessment.claims(Code::NotConverged).next()?;
    Some("The sampler has not converged: run it with more draws before relying on the probabilities.".into())
}

/// What held-out torque says against the twin.
fn of_the_fit(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let mut out: Vec<String> = too_few(assessment).into_iter().collect();
    out.extend(limits_of_torque(assessment, calibration));
    let worse = [Code::WorseAtRest, Code::WorseInFewPauses];
    out.extend(rest::error(assessment, calibration, &worse));
    out.extend(raw_is_worse(assessment, calibration));
    out.extend(friction_does_as_well(assessment, calibration));
    out.extend(beyond::mostly(assessment));
    out.extend(rest::not_tested(assessment, calibration));
    out
}

/// The message of a finding, with the log that it is about where there are several.
fn said(finding: &Finding, calibration: &Calibration) -> String {
    let log = finding.code.leaves_out_its_log() && !finding.subject.is_empty();
    match log && calibration.logs.len() > 1 {
        true => format!("{}: {}", finding.subject, finding.message),
        false => finding.message.clone(),
    }
}

/// What is shown at once where there is more to fold away.
const SHOWN: usize = 3;

/// Those that are shown at once, and the others; one alone is not worth a fold.
pub(super) fn fold(mut limits: Vec<String>) -> (Vec<String>, Vec<String>) {
    let shown = match limits.len() {
        few if few <= SHOWN + 1 => few,
        _ => SHOWN,
    };
    let folded = limits.split_off(shown);
    (limits, folded)
}

/// "Joints a and b: their torque got worse."; nothing of no joint.
fn of_joints(joints: &[&str], one: &str, many: &str) -> Option<String> {
    (!joints.is_empty()).then(|| {
        let words = if joints.len() == 1 { one } else { many };
        format!("{}: {words}.", subject(joints))
    })
}

/// Joints of which something is claimed.
fn named(assessment: &Assessment, code: Code) -> Vec<&str> {
    let claims = assessment.claims(code);
    claims.map(|claim| claim.subject.name()).collect()
}

/// What errors and intervals of held-out torque say against the twin.
fn limits_of_torque(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    out.extend(of_joints(
        &named(assessment, Code::JointTorqueWorse),
        "its torque got worse by calibration",
        "their torque got worse by calibration",
    ));
    let moving = match has_standstill(&calibration.validation) {
        true => " moving",
        false => "",
    };
    let widths = [
        (Code::JointIntervalsNarrow, "too narrow"),
        (Code::JointIntervalsWide, "wider than they need to be"),
    ];
    for (code, words) in widths {
        let claims = assessment.claims(code);
        let held: Vec<f64> = claims.map(|c| c.number("coverage95")).collect();
        let held = each_or_range(&held, percent);
        let held = format!("({LEVEL_WORDS} hold {held} of the{moving} rows)");
        out.extend(of_joints(
            &named(assessment, code),
            &format!("its intervals are {words} {held}"),
            &format!("their intervals are {words} {held}"),
        ));
    }
    out.extend(above_torque(assessment, calibration));
    let words = "the error left is more than half of the torque's standard deviation";
    let large = named(assessment, Code::JointErrorLarge);
    out.extend(of_joints(&large, words, words));
    out.extend(beyond::worse(assessment, calibration));
    out.extend(shape::sentences(assessment, calibration));
    out
}

/// Joints on which a constant would predict the torque as well.
fn above_torque(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claims = || assessment.claims(Code::JointErrorAboveTorque);
    let share = |(error, sd): (f64, f64)| error / sd;
    let numbers = || claims().map(|c| (c.number("rms_calibrated"), c.number("torque_sd")));
    let shares: Vec<f64> = numbers().map(share).collect();
    let deviations: Vec<String> = claims()
        .map(|claim| {
            let unit = unit_of(calibration, claim.subject.name());
            format!("{} {unit}", number(claim.number("torque_sd"), 3))
        })
        .collect();
    let deviations = match deviations.len() {
        0..=NAMED => format!(" ({})", deviations.join(", ")),
        _ => String::new(),
    };
    let better = numbers().all(|n| share(n) > CLEARLY_LOST);
    let names = named(assessment, Code::JointErrorAboveTorque);
    let unseen = match claims().any(|claim| claim.has("hardly_driven_held_out")) {
        true => "; it is hardly driven in the held-out log",
        false => "",
    };
    let words = format!(
        "the error left is {} of the torque's standard deviation{deviations}: a constant would do {}{}",
        each_or_range(&shares, whole_percent),
        if better { "better" } else { "as well" },
        unseen
    );
    of_joints(&names, &words, &words)
}

/// How many rows count, how many are needed, and what to do.
fn too_few(assessment: &Assessment) -> Option<String> {
    let claim = assessment.claims(Code::FewHeldOutRows).next()?;
    let [independent, needed] = ["independent_rows", "needed"].map(|name| claim.number(name));
    // Not rounded up to what is needed.
    let shown = (10.0 * independent).floor() / 10.0;
    Some(format!(
        "The held-out rows count as {shown:.1} independent ones over all joints, {needed} are needed: hold out {} times as much, by another log \
         with --heldout or by longer logs.",
        number(needed / independent, 2)
    ))
}

/// Joints on which what was found besides friction gains nothing, and by how much friction alone is better.
fn friction_does_as_well(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claims = assessment.claims(Code::JointFrictionAlone);
    let named: Vec<String> = claims
        .map(|claim| {
            let joint = claim.subject.name();
            format!(
                "{joint} ({} instead of {} {})",
                number(claim.number("rms_friction"), 3),
                number(claim.number("rms_calibrated"), 3),
                unit_of(calibration, joint)
            )
        })
        .collect();
    (!named.is_empty()).then(|| {
        format!(
            "Friction and an offset alone do about as well or better on {}.",
            list(&first_of(named, NAMED))
        )
    })
}

/// Torque as it was logged, where the twin predicts it worse than the model did.
fn raw_is_worse(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claim = assessment.claims(Code::RawTorqueWorse).next()?;
    Some(format!(
        "Unfiltered torque is predicted worse than by the model alone: RMSE {} → {} {}.",
        number(claim.number("rms_nominal"), 3),
        number(claim.number("rms_calibrated"), 3),
        pooled_unit(calibration)
    ))
}

/// "138 %".
fn whole_percent(share: f64) -> String {
    format!("{:.0}{THIN}%", 100.0 * share)
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::words::tests::judged;
    use crate::words::tests::pit;

    #[test]
    fn three_are_shown_and_the_rest_is_folded_but_for_one_alone() {
        let of = |count: usize| {
            let (shown, folded) = fold(vec![String::new(); count]);
            [shown.len(), folded.len()]
        };
        assert_eq!([of(0), of(4), of(5)], [[0, 0], [4, 0], [3, 2]]);
    }

    #[test]
    fn the_middle_of_a_distribution_does_not_speak_against_what_its_intervals_hold() {
        let of = |levels: [(f64, f64); 2]| {
            let verdict = judged(move |c| {
                c.validation.reliability[1].pit = pit(0.75, 0.0);
                c.validation.reliability[1].coverage_levels = levels.to_vec();
            });
            verdict
                .limits
                .iter()
                .any(|l| l.contains("elbow: its intervals are wider"))
        };
        assert!(of([(0.5, 0.75), (0.95, 0.97)]));
        assert!(!of([(0.5, 0.75), (0.95, 0.925)]));
        // With the share that they hold, and once.
        let narrow = judged(|c| {
            c.validation.filtered.joints[1].coverage95 = 0.697;
            c.validation.reliability[1].pit = pit(0.25, 0.0);
            c.validation.reliability[1].coverage_levels = vec![(0.5, 0.25), (0.95, 0.697)];
        });
        let of_elbow: Vec<&String> = narrow
            .limits
            .iter()
            .filter(|l| l.contains("narrow"))
            .collect();
        assert_eq!(of_elbow.len(), 1, "{narrow:?}");
        assert!(of_elbow[0].contains("hold 69.7"), "{narrow:?}");
    }

    #[test]
    fn joints_without_a_score_are_no_rows_at_standstill() {
        let mut validation = crate::report::fixture::two_joints().validation;
        validation.moving = validation.filtered.clone();
        for scores in [&mut validation.filtered, &mut validation.moving] {
            (scores.joints[1].rows, scores.joints[1].coverage95) = (0, f64::NAN);
        }
        assert!(!has_standstill(&validation));
        validation.moving.joints[0].rows -= 1;
        assert!(has_standstill(&validation));
    }

    #[test]
    fn single_joints_that_hold_another_share_are_named_with_what_chance_has_to_do_with_it() {
        let mut calibration = crate::report::fixture::two_joints();
        let mut told = |rows: [u64; 2], shares: [f64; 2]| {
            let scores = &mut calibration.validation.moving.joints;
            for ((score, rows), share) in scores.iter_mut().zip(rows).zip(shares) {
                (score.rows, score.coverage95) = (rows, share);
            }
            crate::words::grounds::other_shares(&twincal::assess::assess(&calibration))
        };
        let thin = "\u{202f}";
        let said = format!(
            "a little outside 92 to 98 %: shoulder 91.0{thin}%; within chance for so few rows: elbow 88.0{thin}%"
        );
        assert_eq!(told([100_000, 20], [0.91, 0.88]), Some(said));
        assert_eq!(told([100_000, 20], [0.93, 0.97]), None);
        // Too narrow, which is said elsewhere; all of a few rows inside, as in every third honest twin.
        let said = format!("within chance for so few rows: elbow 100.0{thin}%");
        assert_eq!(told([100_000, 20], [0.80, 1.0]), Some(said));
        // Of one joint alone the share of all rows is its own.
        assert_eq!(told([0, 20], [f64::NAN, 0.88]), None);
    }

    #[test]
    fn standstill_that_was_hardly_tested_is_said() {
        let of = |logs: u64, still: u64| {
            let verdict = judged(|c| {
                for log in &mut c.logs {
                    (log.rows, log.standstill) = (vec![1000, 1000 - logs], vec![0, logs]);
                }
                c.validation.moving = c.validation.filtered.clone();
                c.validation.moving.joints[1].rows -= still;
            });
            let mut limits = verdict.limits.into_iter();
            limits.find(|limit| limit.contains("tandstill"))
        };
        let said = |text: Option<String>| text.unwrap_or_default();
        assert_eq!(
            said(of(120, 4)),
            "Standstill is hardly tested: elbow is at rest in 12.0\u{202f}% of the logs' rows, but only 4 held-out rows are at rest (error 0.431 → 0.0546 N·m, 87.3\u{202f}% less)."
        );
        assert_eq!(
            said(of(120, 0)),
            "Standstill is not tested: elbow is at rest in 12.0\u{202f}% of the logs' rows, but no held-out row is at rest."
        );
        assert_eq!(of(120, 40), None);
        assert_eq!(of(10, 4), None);
    }

    #[test]
    fn joints_on_which_friction_alone_does_as_well_are_named() {
        let of = |left: f64| {
            let verdict = judged(|c| {
                let joint = &mut c.validation.filtered.joints[1];
                (joint.rmse_calibrated, joint.rmse_friction) = (0.1, Some(left));
            });
            let mut limits = verdict.limits.into_iter();
            limits.find(|limit| limit.starts_with("Friction"))
        };
        let said = "Friction and an offset alone do about as well or better on elbow (0.104 instead of 0.100 N·m).";
        assert_eq!(of(0.104).as_deref(), Some(said));
        assert_eq!(of(0.106), None);
    }

    #[test]
    fn of_many_joints_three_are_named() {
        let mut calibration = crate::report::fixture::seven_joints();
        let validation = &mut calibration.validation;
        for scores in [&mut validation.filtered, &mut validation.moving] {
            for joint in &mut scores.joints {
                (joint.rmse_calibrated, joint.rmse_friction) = (0.1, Some(0.1));
            }
        }
        let answer = crate::words::answer(&calibration);
        let mut limits = answer.limits.iter().chain(&answer.folded);
        let friction = limits.find(|limit| limit.starts_with("Friction"));
        let friction = friction.expect("a limit of seven joints");
        assert!(friction.ends_with(" and 4 more."), "{friction}");
    }

    #[test]
    fn limits_that_a_finding_says_are_told_apart() {
        let calibration = crate::words::tests::changed(|c| {
            c.validation.filtered.joints[1].rmse_calibrated = 9.0;
            let (code, words) = (Code::SignFlip, "torque has the other sign");
            c.findings = vec![Finding::new(Severity::Degraded, code, "elbow", words, 1)];
        });
        let assessment = twincal::assess::assess(&calibration);
        let all = limits(&assessment, &calibration);
        let beside = beside_findings(&assessment, &calibration);
        assert_eq!(all[0], "torque has the other sign");
        assert_eq!(all[1..], beside);
        assert!(beside.iter().any(|limit| limit.contains("got worse")));
    }

    #[test]
    fn limits_name_the_joints() {
        let verdict = judged(|c| c.validation.filtered.joints[1].rmse_calibrated = 9.0);
        assert!(
            verdict
                .limits
                .iter()
                .any(|l| l.contains("elbow") && l.contains("got worse")),
            "{verdict:?}"
        );
    }
}
