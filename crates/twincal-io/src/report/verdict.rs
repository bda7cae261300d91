//! Can this twin be used, and where not: the first thing the report says, by held-out data and by what was found that is not to be rested on.

use super::limits::{
    COVERAGE, converged, decisive, has_standstill, large, limits, no_bodies, not_to_rest_on,
    too_narrow, worse,
};
use super::shape;
use super::text::{number, percent, with_sd};
use super::view::{Joint, independent_rows, memory, pooled_unit};
use serde::Serialize;
use twincal::calibrate::{Calibration, Verdict as Decision};
use twincal::validate::{JointScore, Scores, Split, WORSE};
use twincal::{Finding, Severity};

/// Ratio of errors from which calibration counts as an improvement.
const BETTER: f64 = 0.95;
/// Held-out rows, in independent ones, below which nothing is promised.
const FEW: f64 = 20.0;
/// Change of an error by the rows at standstill from which these are told apart.
const WORTH_TELLING: f64 = 0.05;
/// The same of the share of rows that intervals hold.
const SHARE_WORTH_TELLING: f64 = 0.01;
/// How the answer is coloured; the words carry the meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Grade {
    Good,
    Care,
    Bad,
}

/// The verdict in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Verdict {
    pub(super) grade: Grade,
    /// One sentence.
    pub(super) headline: String,
    /// What the headline rests on.
    pub(super) grounds: Vec<String>,
    /// Where it does not hold.
    pub(super) limits: Vec<String>,
}

/// Judges `calibration`.
pub(super) fn judge(calibration: &Calibration, joints: &[Joint<'_>]) -> Verdict {
    let scores = &calibration.validation.filtered;
    let found = || calibration.components.iter().filter(|c| c.selected);
    let sure = found().filter(|c| c.verdict != Some(Decision::Undecided));
    let (found, sure) = (found().count(), sure.count());
    let rows = rows_of(scores);
    if rows == 0 || !(scores.rmse_nominal.is_finite() && scores.rmse_calibrated.is_finite()) {
        return Verdict {
            grade: Grade::Bad,
            headline: "Not yet: there are no held-out rows to judge this twin by.".into(),
            grounds: vec![effects_found(calibration)],
            limits: vec![
                "Record another motion and give it with --heldout, or fit at least three logs."
                    .into(),
            ],
        };
    }
    let scores = decisive(&calibration.validation);
    let ratio = scores.rmse_calibrated / scores.rmse_nominal;
    let worse = worse(scores);
    let honest = (COVERAGE.0..=COVERAGE.1).contains(&scores.coverage95);
    let off = shape::off(calibration);
    let mut each = scores.joints.iter();
    let too_narrow = each.any(|j| too_narrow(j, memory(joints, &j.joint)));
    let firm = not_to_rest_on(calibration).is_empty();
    let large = large(scores, joints);
    let limits = limits(calibration, joints);
    let serious = calibration
        .findings
        .iter()
        .any(|f| f.severity == Severity::Degraded)
        || !converged(calibration);
    let (grade, headline) = if calibration.findings.iter().any(Finding::doubts_the_log) {
        (
            Grade::Bad,
            "Not yet: log and model contradict each other in sign, scale or order of joints.",
        )
    } else if no_measurement(calibration) {
        (
            Grade::Bad,
            "Not yet: torque that never changes while joints move is no measurement.",
        )
    } else if independent_rows(calibration, joints) < FEW {
        (
            Grade::Care,
            "Hard to say: the held-out rows count as too few independent ones to judge this twin by.",
        )
    } else if ratio > WORSE {
        (
            Grade::Bad,
            "No: on held-out data the calibrated torque is worse than the nominal one.",
        )
    } else if found == 0 && ratio > BETTER {
        (
            Grade::Care,
            "Nothing to correct was found: none of the candidate effects is in this log.",
        )
    } else if ratio > BETTER {
        (
            Grade::Care,
            "Hardly: on held-out data the calibrated torque is no better than the nominal one.",
        )
    } else if found > 0 && sure == 0 {
        (
            Grade::Care,
            "Perhaps: low-passed torque is better with it, but none of its effects is sure.",
        )
    } else if 2 * large.len() > joints.len() {
        (
            Grade::Care,
            "Better than the model alone, but on most joints the error that is left is large.",
        )
    } else if no_bodies(calibration).len() > 1 {
        (
            Grade::Care,
            "With care: what was found of several links is no rigid body. Is this the robot's model?",
        )
    } else if !worse.is_empty() {
        (
            Grade::Care,
            "With care: better than the model alone, but on some joints torque got worse.",
        )
    } else if scores.coverage95 < COVERAGE.0 {
        (
            Grade::Care,
            "The torque yes, its intervals not: they are too narrow.",
        )
    } else if !honest {
        (
            Grade::Care,
            "Yes; its intervals are wider than they need to be.",
        )
    } else if let Some(shape) = off.all.filter(|shape| !shape.contradicts(scores, joints)) {
        (Grade::Care, shape.headline())
    } else if !serious && !off.single && !too_narrow && firm {
        (
            Grade::Good,
            "Yes, on motions like the ones it was tested on.",
        )
    } else {
        (Grade::Care, "Yes, with the exceptions below.")
    };
    Verdict {
        grade,
        headline: headline.into(),
        grounds: grounds(calibration, joints),
        limits,
    }
}

fn rows_of(scores: &Scores) -> u64 {
    scores.joints.iter().map(|j| j.rows).sum()
}

/// Whether a log has no torque that changes.
fn no_measurement(calibration: &Calibration) -> bool {
    let mut findings = calibration.findings.iter();
    findings.any(|f| f.code == "constant_torque" && f.severity == Severity::Degraded)
}

fn grounds(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    vec![
        torque_error(calibration, joints),
        held(calibration),
        effects_found(calibration),
    ]
}

/// How much the 95 % intervals hold: of moving joints, and of all rows where some stand still.
fn held(calibration: &Calibration) -> String {
    let all = &calibration.validation.filtered;
    let judged = decisive(&calibration.validation);
    let (rows, share) = (
        super::text::count(rows_of(judged)),
        percent(judged.coverage95),
    );
    if !has_standstill(&calibration.validation) {
        return format!("The 95 % intervals contain {share} of the {rows} held-out values.");
    }
    let differ = (judged.coverage95 - all.coverage95).abs() > SHARE_WORTH_TELLING;
    let all = match differ {
        true => {
            let rows = super::text::count(rows_of(all));
            format!(", {} of all {rows}", percent(all.coverage95))
        }
        false => String::new(),
    };
    format!(
        "The 95 % intervals contain {share} of the {rows} held-out values of moving joints{all}."
    )
}

/// RMSE before and after: of joints that move, and apart from them of those that stand still where that is another matter, for there friction
/// is whatever it takes.
fn torque_error(calibration: &Calibration, joints: &[Joint<'_>]) -> String {
    let told = |[before, after]: [f64; 2]| {
        let way = match after / before - 1.0 {
            c if c.abs() < 5e-4 => "unchanged".into(),
            c if c < 0.0 => format!("{} less", percent(-c)),
            c => format!("{} more", percent(c)),
        };
        let [before, after] = [before, after].map(|x| number(x, 3));
        format!("{before} → {after} {}, {way}", pooled_unit(joints))
    };
    let validation = &calibration.validation;
    let (all, moving) = (&validation.filtered, decisive(validation));
    let split = match validation.split {
        Split::HeldoutLogs => "held-out logs",
        Split::LeaveOneLogOut => "logs left out one at a time",
        Split::LastThirty => "the last 30 % of each log",
    };
    let judged = told([moving.rmse_nominal, moving.rmse_calibrated]);
    if !has_standstill(validation) {
        return format!("Torque error (RMSE) on {split}: {judged}.");
    }
    let differ = (all.rmse_calibrated / moving.rmse_calibrated - 1.0).abs() > WORTH_TELLING;
    let at_rest = match differ {
        true => format!("; at standstill {}", told(still(all, moving))),
        false => String::new(),
    };
    format!("Torque error (RMSE) on {split}, joints that move: {judged}{at_rest}.")
}

/// RMSE before and after on the rows that are not among the moving ones.
fn still(all: &Scores, moving: &Scores) -> [f64; 2] {
    let squares = |scores: &Scores, of: fn(&JointScore) -> f64| -> f64 {
        let some = scores.joints.iter().filter(|joint| joint.rows > 0);
        some.map(|joint| joint.rows as f64 * of(joint).powi(2))
            .sum()
    };
    let rows = (rows_of(all) - rows_of(moving)) as f64;
    let each: [fn(&JointScore) -> f64; 2] = [|j| j.rmse_nominal, |j| j.rmse_calibrated];
    each.map(|of| ((squares(all, of) - squares(moving, of)).max(0.0) / rows).sqrt())
}

/// What is more likely than not, without and with what the data leave open.
fn effects_found(calibration: &Calibration) -> String {
    let likely = || calibration.components.iter().filter(|c| c.selected);
    let all = likely().count();
    let open = likely().filter(|c| c.verdict == Some(Decision::Undecided));
    let open = open.count();
    let more = match open {
        0 => String::new(),
        n => format!(", {n} more likely than not, but undecided"),
    };
    match all - open {
        0 if open == 0 => "No missing effect is more likely than not.".into(),
        0 => format!("No missing effect is sure{more}."),
        1 => format!("One missing effect found{more}."),
        n => format!("{n} missing effects found{more}."),
    }
}

/// "mean ± sd" with matching digits.
pub(super) fn plus_minus(mean: f64, sd: f64) -> String {
    let (mean, sd) = with_sd(mean, sd);
    format!("{mean} ± {sd}")
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::report::fixture;
    use crate::report::shape::tests::pit;
    use crate::report::view;
    use twincal::posterior::Method;
    use twincal::validate::Pit;

    pub(in crate::report) fn judged(change: impl Fn(&mut Calibration)) -> Verdict {
        let mut calibration = fixture::two_joints();
        calibration.findings.clear();
        calibration
            .repeatability
            .iter_mut()
            .for_each(|r| r.z = Some(0.1));
        (calibration.terms.iter_mut()).for_each(|t| t.pip_sensitivity.clear());
        let moving = calibration.validation.moving.clone();
        change(&mut calibration);
        if calibration.validation.moving == moving {
            calibration.validation.moving = calibration.validation.filtered.clone();
        }
        judge(&calibration, &view::joints(&calibration))
    }

    #[test]
    fn the_grade_follows_error_coverage_findings_and_convergence() {
        assert_eq!(judged(|_| ()).grade, Grade::Good);
        type Case = (fn(&mut Calibration), Grade, &'static str);
        let cases: [Case; 8] = [
            (
                |c| {
                    c.validation
                        .filtered
                        .joints
                        .iter_mut()
                        .for_each(|j| j.rows = 20)
                },
                Grade::Care,
                "too few",
            ),
            (
                |c| {
                    c.validation.filtered.rmse_calibrated = 2.0 * c.validation.filtered.rmse_nominal
                },
                Grade::Bad,
                "No:",
            ),
            (
                |c| c.validation.filtered.coverage95 = 0.7,
                Grade::Care,
                "too narrow",
            ),
            (
                |c| c.validation.filtered.coverage95 = 1.0,
                Grade::Care,
                "wider",
            ),
            (
                |c| c.validation.filtered.joints[1].rmse_calibrated = 9.0,
                Grade::Care,
                "got worse",
            ),
            (
                |c| {
                    c.twin.posterior.method = Method::Gibbs {
                        chains: 4,
                        draws: 10,
                        r_hat: 1.2,
                        ess: 30.0,
                    }
                },
                Grade::Care,
                "exceptions",
            ),
            (
                |c| {
                    c.validation
                        .filtered
                        .joints
                        .iter_mut()
                        .for_each(|j| j.rows = 0)
                },
                Grade::Bad,
                "Not yet",
            ),
            (
                |c| {
                    c.validation.filtered.rmse_calibrated = c.validation.filtered.rmse_nominal;
                    c.components.iter_mut().for_each(|t| t.selected = false);
                },
                Grade::Care,
                "Nothing to correct",
            ),
        ];
        for (change, grade, words) in cases {
            let verdict = judged(change);
            assert_eq!(verdict.grade, grade, "{verdict:?}");
            assert!(verdict.headline.contains(words), "{verdict:?}");
        }
    }

    #[test]
    fn rows_at_standstill_are_told_apart_from_what_moving_joints_gain() {
        let of = |moves: bool| {
            let verdict = judged(move |c| {
                c.validation.moving = c.validation.filtered.clone();
                for joint in &mut c.validation.moving.joints {
                    (joint.rows, joint.rmse_nominal, joint.rmse_calibrated) = (50, 2.0, 0.5);
                }
                // As many rows again, of which the mean square is 1 before and 9 after.
                for joint in &mut c.validation.filtered.joints {
                    joint.rows = 100;
                    joint.rmse_nominal = (0.5f64 * (4.0 + 1.0)).sqrt();
                    joint.rmse_calibrated = (0.5f64 * (0.25 + 9.0)).sqrt();
                }
                let all = &mut c.validation.filtered;
                (all.rmse_nominal, all.rmse_calibrated) = (1.6, 2.2);
                let moving = &mut c.validation.moving;
                (moving.rmse_nominal, moving.rmse_calibrated) = (2.0, 0.5);
                if !moves {
                    moving.joints.iter_mut().for_each(|joint| joint.rows = 0);
                }
            });
            verdict.grounds[0].clone()
        };
        let both = of(true);
        let said = "joints that move: 2.00 → 0.500 N·m, 75.0\u{202f}% less; at standstill 1.00 → 3.00 N·m, 200.0\u{202f}% more.";
        assert!(both.ends_with(said), "{both}");
        assert!(!of(false).contains("standstill"));
    }

    #[test]
    fn bodies_that_are_none_on_two_links_ask_for_the_right_model() {
        let of = |links: &[&str]| {
            judged(|c| {
                let finding = |link: &&str| {
                    Finding::new(Severity::Warning, "unphysical_inertia_found", *link, "", 0)
                };
                c.findings = links.iter().map(finding).collect();
            })
        };
        let two = of(&["forearm", "hand"]);
        assert!(
            two.headline.ends_with("Is this the robot's model?"),
            "{two:?}"
        );
        assert_eq!(two.grade, Grade::Care);
        assert!(!of(&["forearm"]).headline.contains("model"));
    }

    #[test]
    fn what_is_not_to_rest_on_makes_an_exception() {
        let apart = judged(|c| c.repeatability[0].z = Some(3.7));
        assert!(apart.headline.contains("exceptions"), "{apart:?}");
        assert!(
            apart.limits.iter().any(|l| l.contains("(3.7 sd)")),
            "{apart:?}"
        );
        let prior = judged(|c| {
            let selected = c.terms.iter_mut().find(|t| t.selected);
            selected.unwrap().pip_sensitivity = vec![0.3, 0.9];
        });
        assert!(prior.headline.contains("exceptions"), "{prior:?}");
        assert!(
            prior
                .limits
                .iter()
                .any(|l| l.starts_with("Other priors would leave out"))
        );
        let narrow = judged(|c| c.validation.filtered.joints[1].coverage95 = 0.78);
        assert!(narrow.headline.contains("exceptions"), "{narrow:?}");
    }

    #[test]
    fn unfiltered_torque_that_gets_worse_is_said() {
        let raw =
            judged(|c| c.validation.raw.rmse_calibrated = 1.2 * c.validation.raw.rmse_nominal);
        assert!(
            raw.limits
                .iter()
                .any(|l| l.starts_with("Unfiltered torque")),
            "{raw:?}"
        );
    }

    #[test]
    fn intervals_that_hold_every_one_of_few_rows_are_not_too_wide() {
        // 0.95^58 = 0.051: fifty-eight rows in a row may be inside by chance.
        let says = |rows: u64| {
            let verdict = judged(|c| {
                let memory = c.noise[1].autocorrelation_time.max(1.0);
                let joint = &mut c.validation.filtered.joints[1];
                (joint.rows, joint.coverage95) = ((rows as f64 * memory) as u64, 1.0);
            });
            verdict
                .limits
                .iter()
                .any(|l| l.contains("elbow: its intervals are wider"))
        };
        assert!(!says(57) && says(60));
    }

    #[test]
    fn what_is_undecided_is_counted_apart() {
        let of = |undecided: usize| {
            let verdict = judged(move |c| {
                let found = c.components.iter_mut().filter(|c| c.selected);
                for (i, component) in found.enumerate() {
                    component.verdict = (i < undecided).then_some(Decision::Undecided);
                }
            });
            verdict.grounds.last().cloned().unwrap_or_default()
        };
        let headline = judged(|c| {
            let found = c.components.iter_mut().filter(|c| c.selected);
            found.for_each(|c| c.verdict = Some(Decision::Undecided));
        });
        assert!(headline.headline.starts_with("Perhaps"), "{headline:?}");
        assert_eq!(of(0), "7 missing effects found.");
        assert_eq!(
            of(6),
            "One missing effect found, 6 more likely than not, but undecided."
        );
        assert_eq!(
            of(7),
            "No missing effect is sure, 7 more likely than not, but undecided."
        );
    }

    #[test]
    fn intervals_off_by_more_than_their_stated_limit_are_in_the_verdict() {
        let wide = judged(|c| {
            c.validation.pit = pit(0.75, 0.0);
            c.validation.reliability.iter_mut().for_each(|j| {
                j.pit = pit(0.75, 0.0);
                j.coverage_levels = vec![(0.5, 0.75), (0.95, 0.97)];
            });
        });
        assert_eq!(wide.grade, Grade::Care);
        assert_eq!(
            wide.headline,
            "The torque yes; its intervals are wider than they need to be."
        );
        let said = "Joints shoulder and elbow: their intervals are wider than they need to be (on elbow 75.0\u{202f}% of the rows \
                    in 50 % intervals).";
        assert!(wide.limits.iter().any(|limit| limit == said), "{wide:?}");
        let narrow = judged(|c| c.validation.pit = pit(0.25, 0.0));
        assert!(narrow.headline.contains("too narrow"), "{narrow:?}");
        // One joint alone is an exception; a little more than chance is said and forbids nothing.
        let one = judged(|c| c.validation.reliability[1].pit = pit(0.5, 4.0));
        assert!(one.headline.contains("exceptions"), "{one:?}");
        assert!(
            one.limits
                .iter()
                .any(|l| l.contains("elbow: its torque lies above the prediction too often"))
        );
        let little = judged(|c| {
            c.validation.reliability[1].pit = Pit {
                distance: 0.045,
                chance: 0.032,
                ..pit(0.55, 0.0)
            }
        });
        assert_eq!(little.grade, Grade::Good);
        assert!(
            little.limits.iter().any(|l| l.contains("a little wider")),
            "{little:?}"
        );
    }
}
