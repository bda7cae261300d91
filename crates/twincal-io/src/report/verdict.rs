//! Can this twin be used, and where not: the first thing the report says, derived from held-out data alone.

use super::limits::{COVERAGE, converged, large, limits, no_bodies, worse};
use super::shape;
use super::text::{number, percent, with_sd};
use super::view::{Joint, independent_rows, pooled_unit};
use serde::Serialize;
use twincal::calibrate::{Calibration, Verdict as Decision};
use twincal::validate::{Scores, Split, WORSE};
use twincal::{Finding, Severity};

/// Ratio of errors from which calibration counts as an improvement.
const BETTER: f64 = 0.95;
/// Held-out rows, in independent ones, below which nothing is promised.
const FEW: f64 = 20.0;
/// Change of an error by the rows at standstill from which it is told without and with them.
const WORTH_TELLING: f64 = 0.05;
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
    let found = calibration.components.iter().filter(|c| c.selected).count();
    let rows: u64 = scores.joints.iter().map(|j| j.rows).sum();
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
    let ratio = scores.rmse_calibrated / scores.rmse_nominal;
    let worse = worse(scores);
    let honest = (COVERAGE.0..=COVERAGE.1).contains(&scores.coverage95);
    let off = shape::off(calibration);
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
    } else if 2 * large.len() > joints.len() {
        (
            Grade::Care,
            "Better than the model alone, but on most joints the error that is left is large.",
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
    } else if let Some(shape) = off.all.filter(|shape| !shape.contradicts(scores)) {
        (Grade::Care, shape.headline())
    } else if no_bodies(calibration).len() > 1 {
        (
            Grade::Care,
            "The torque yes; but what was found are no rigid bodies: look whether this is the robot's model.",
        )
    } else if worse.is_empty() && !serious && !off.single {
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

/// Whether a log has no torque that changes.
fn no_measurement(calibration: &Calibration) -> bool {
    let mut findings = calibration.findings.iter();
    findings.any(|f| f.code == "constant_torque" && f.severity == Severity::Degraded)
}

fn grounds(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let scores = &calibration.validation.filtered;
    let rows: u64 = scores.joints.iter().map(|j| j.rows).sum();
    vec![
        torque_error(calibration, joints),
        format!(
            "The 95 % intervals contain {} of the {} held-out values.",
            percent(scores.coverage95),
            super::text::count(rows)
        ),
        effects_found(calibration),
    ]
}

/// RMSE before and after on all held-out rows, and on those of moving joints where some stand still: there friction is whatever it takes.
fn torque_error(calibration: &Calibration, joints: &[Joint<'_>]) -> String {
    let rows = |scores: &Scores| scores.joints.iter().map(|j| j.rows).sum::<u64>();
    let told = |scores: &Scores| {
        let way = match scores.rmse_calibrated / scores.rmse_nominal - 1.0 {
            c if c.abs() < 5e-4 => "unchanged".into(),
            c if c < 0.0 => format!("{} less", percent(-c)),
            c => format!("{} more", percent(c)),
        };
        let [before, after] = [scores.rmse_nominal, scores.rmse_calibrated].map(|x| number(x, 3));
        format!("{before} → {after} {}, {way}", pooled_unit(joints))
    };
    let validation = &calibration.validation;
    let (all, moving) = (&validation.filtered, &validation.moving);
    let split = match validation.split {
        Split::HeldoutLogs => "held-out logs",
        Split::LeaveOneLogOut => "logs left out one at a time",
        Split::LastThirty => "the last 30 % of each log",
    };
    let differ = (all.rmse_calibrated / moving.rmse_calibrated - 1.0).abs() > WORTH_TELLING;
    if differ && (1..rows(all)).contains(&rows(moving)) {
        return format!(
            "Torque error (RMSE) on {split}, joints that move: {}; with those at standstill {}.",
            told(moving),
            told(all)
        );
    }
    format!("Torque error (RMSE) on {split}: {}.", told(all))
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
        change(&mut calibration);
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
                "exceptions",
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
    fn rows_at_standstill_do_not_hide_what_moving_joints_gain() {
        let of = |moving: u64| {
            let verdict = judged(move |c| {
                c.validation.moving = c.validation.filtered.clone();
                for joint in &mut c.validation.moving.joints {
                    joint.rows = moving;
                }
                (
                    c.validation.moving.rmse_nominal,
                    c.validation.moving.rmse_calibrated,
                ) = (2.0, 0.5);
            });
            verdict.grounds[0].clone()
        };
        let both = of(7);
        assert!(
            both.contains(
                "joints that move: 2.00 → 0.500 N·m, 75.0\u{202f}% less; with those at standstill"
            ),
            "{both}"
        );
        assert!(!of(0).contains("standstill"));
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
        assert!(two.headline.contains("the robot's model"), "{two:?}");
        assert_eq!(two.grade, Grade::Care);
        assert!(!of(&["forearm"]).headline.contains("model"));
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
                .any(|l| l.contains("elbow: its intervals lie too low"))
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
