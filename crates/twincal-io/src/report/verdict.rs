//! Can this twin be used, and where not: the first thing the report says, derived from held-out data alone.

use super::shape;
use super::text::{list, number, percent, with_sd};
use super::view::{Joint, independent_rows, memory, pooled_unit, standard_deviation};
use serde::Serialize;
use twincal::calibrate::{Calibration, Verdict as Decision};
use twincal::posterior::Method;
use twincal::validate::{JointScore, Scores, Split, Validation, WORSE};
use twincal::{Finding, Severity};

/// A 95 % interval is honest if it holds this share of the held-out rows.
const COVERAGE: (f64, f64) = (0.90, 0.99);
/// What an interval promises to hold.
const LEVEL: f64 = 0.95;
/// Ratio of errors from which calibration counts as an improvement.
const BETTER: f64 = 0.95;
/// Held-out rows, in independent ones, below which nothing is promised.
const FEW: f64 = 20.0;
/// Probability from which a half of the data shows an effect.
const LIKELY: f64 = 0.5;
/// Share of the torque's standard deviation from which the remaining error is called large.
const LARGE: f64 = 0.5;

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
    /// Those among them that speak of errors and intervals, not of findings.
    #[serde(skip)]
    pub(super) of_torque: Vec<String>,
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
            of_torque: Vec::new(),
        };
    }
    let ratio = scores.rmse_calibrated / scores.rmse_nominal;
    let worse = names(
        scores
            .joints
            .iter()
            .filter(|j| j.rmse_calibrated > WORSE * j.rmse_nominal),
    );
    let honest = (COVERAGE.0..=COVERAGE.1).contains(&scores.coverage95);
    let off = shape::off(calibration);
    let large = large(scores, joints);
    let of_torque = limits_of_torque(calibration, joints, &worse, &large);
    let limits = limits(calibration, of_torque.clone());
    let serious = calibration
        .findings
        .iter()
        .any(|f| f.severity == Severity::Degraded)
        || !converged(calibration);
    let (grade, headline) = if calibration.findings.iter().any(Finding::doubts_the_log) {
        (
            Grade::Bad,
            "Not yet: log and model do not seem to speak of the same robot.",
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
        of_torque,
    }
}

/// Whether a log has no torque that changes.
fn no_measurement(calibration: &Calibration) -> bool {
    let mut findings = calibration.findings.iter();
    findings.any(|f| f.code == "constant_torque" && f.severity == Severity::Degraded)
}

fn grounds(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let scores = &calibration.validation.filtered;
    let change = scores.rmse_calibrated / scores.rmse_nominal - 1.0;
    let way = match change {
        c if c.abs() < 5e-4 => "unchanged".into(),
        c if c < 0.0 => format!("{} less", percent(-c)),
        c => format!("{} more", percent(c)),
    };
    let rows: u64 = scores.joints.iter().map(|j| j.rows).sum();
    vec![
        format!(
            "Torque error (RMSE) on {}: {} → {} {}, {way}.",
            match calibration.validation.split {
                Split::HeldoutLogs => "held-out logs",
                Split::LeaveOneLogOut => "logs left out one at a time",
                Split::LastThirty => "the last 30 % of each log",
            },
            number(scores.rmse_nominal, 3),
            number(scores.rmse_calibrated, 3),
            pooled_unit(joints),
        ),
        format!(
            "The 95 % intervals contain {} of the {} held-out values.",
            percent(scores.coverage95),
            super::text::count(rows)
        ),
        effects_found(calibration),
    ]
}

/// Fewer held-out rows in the 95 % interval than an honest one has.
pub(super) fn too_narrow(joint: &JointScore) -> bool {
    joint.rows > 0 && joint.coverage95 < COVERAGE.0
}

/// More of them.
pub(super) fn too_wide(joint: &JointScore) -> bool {
    joint.rows > 0 && joint.coverage95 > COVERAGE.1
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

/// Links of which what was found is no rigid body, and effects that neither half of the data has.
fn not_to_rest_on(calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    let bodies = calibration.findings.iter();
    let bodies = bodies.filter(|f| f.code == "unphysical_inertia_found");
    let bodies: Vec<&str> = bodies
        .filter(|f| f.severity == Severity::Warning)
        .map(|f| f.subject.as_str())
        .collect();
    if !bodies.is_empty() {
        out.push(format!(
            "What was found of {} is no rigid body: it stands in for another effect; do not read it as mass or inertia.",
            list(&bodies)
        ));
    }
    let groups = calibration
        .repeatability
        .chunk_by(|a, b| a.component == b.component);
    let in_neither = groups.filter(|own| {
        own.iter()
            .all(|r| r.first_pip < LIKELY && r.second_pip < LIKELY)
    });
    let in_neither: Vec<&str> = in_neither.map(|own| own[0].component.as_str()).collect();
    if !in_neither.is_empty() {
        out.push(format!(
            "Neither half of the data shows by itself: {}.",
            list(&in_neither)
        ));
    }
    out
}

/// Joints on which the calibrated torque is off by more than [`LARGE`].
fn large(scores: &Scores, joints: &[Joint<'_>]) -> Vec<String> {
    let is_large = |joint: &&Joint<'_>| {
        let score = scores.joints.iter().find(|s| s.joint == joint.name);
        let deviation = torque_deviation(joint);
        score.is_some_and(|s| deviation > 0.0 && s.rmse_calibrated > LARGE * deviation)
    };
    let joints = joints.iter().filter(is_large);
    joints.map(|joint| joint.name.to_owned()).collect()
}

/// What errors and intervals of held-out torque say against the twin.
fn limits_of_torque(
    calibration: &Calibration,
    joints: &[Joint<'_>],
    worse: &[String],
    large: &[String],
) -> Vec<String> {
    let scores = &calibration.validation.filtered;
    let mut out = Vec::new();
    let mut say = |joints: &[String], one: &str, many: &str| {
        if !joints.is_empty() {
            out.push(format!(
                "{} {}: {}.",
                if joints.len() == 1 { "Joint" } else { "Joints" },
                list(joints),
                if joints.len() == 1 { one } else { many }
            ));
        }
    };
    say(
        worse,
        "its torque got worse by calibration",
        "their torque got worse by calibration",
    );
    let narrow = with_coverage(scores.joints.iter().filter(|j| too_narrow(j)));
    say(
        &narrow,
        "its intervals are too narrow",
        "their intervals are too narrow",
    );
    let wide = with_coverage(scores.joints.iter().filter(|j| too_wide(j)));
    say(
        &wide,
        "its intervals are wider than they need to be",
        "their intervals are wider than they need to be",
    );
    let mut out_of_shape = shape::sentences(calibration);
    say(
        large,
        "the error left is more than half of the torque's standard deviation",
        "the error left is more than half of the torque's standard deviation",
    );
    out.append(&mut out_of_shape);
    out.extend(beyond(calibration, joints));
    out
}

fn limits(calibration: &Calibration, of_torque: Vec<String>) -> Vec<String> {
    let doubts = calibration.findings.iter().filter(|f| f.doubts_the_log());
    let mut out: Vec<String> = doubts.map(|f| f.message.clone()).collect();
    out.extend(of_torque);
    out.extend(not_to_rest_on(calibration));
    if calibration.validation.split == Split::LastThirty {
        out.push(
            "It was tested on later parts of the same motions only; another motion was not tried."
                .into(),
        );
    }
    if !converged(calibration) {
        out.push("The sampler has not converged: run it with more draws before relying on the probabilities.".into());
    }
    let degraded = calibration
        .findings
        .iter()
        .filter(|f| f.severity == Severity::Degraded && !f.doubts_the_log());
    out.extend(degraded.map(|f| f.message.clone()));
    match calibration
        .findings
        .iter()
        .filter(|f| f.severity == Severity::Warning)
        .count()
    {
        0 => {}
        1 => out.push(
            "There is one warning to read (see “What was read, dropped and filtered”).".into(),
        ),
        n => out.push(format!(
            "There are {n} warnings to read (see “What was read, dropped and filtered”)."
        )),
    }
    out.push("Outside the motion listed under “What the data cannot tell” it extrapolates.".into());
    out
}

/// Joints whose intervals are too narrow where their motion was not seen before, and less so where it was: by more than two standard
/// errors of as many independent rows.
fn beyond(calibration: &Calibration, joints: &[Joint<'_>]) -> impl Iterator<Item = String> {
    let Validation { within, beyond, .. } = &calibration.validation;
    let narrow = within
        .joints
        .iter()
        .zip(&beyond.joints)
        .filter(|(within, beyond)| {
            let independent = beyond.rows as f64 / memory(joints, &beyond.joint);
            let chance = 2.0 * (LEVEL * (1.0 - LEVEL) / independent).sqrt();
            let better_within = within.rows == 0 || within.coverage95 > beyond.coverage95;
            better_within && too_narrow(beyond) && beyond.coverage95 < LEVEL - chance
        });
    narrow.map(|(within, beyond)| {
        let seen = match within.rows {
            0 => String::new(),
            _ => format!(", within it {}", percent(within.coverage95)),
        };
        format!(
            "Joint {}: beyond the training motion ({} of {} moving rows) its 95 % intervals hold {}{seen}.",
            beyond.joint,
            beyond.rows,
            within.rows + beyond.rows,
            percent(beyond.coverage95)
        )
    })
}

/// R̂ and effective sample size as Vehtari et al. (2021) ask for.
pub(super) fn converged(calibration: &Calibration) -> bool {
    match calibration.twin.posterior.method {
        Method::Exact { .. } => true,
        Method::Search { missing, .. } => missing < 1e-3,
        Method::Gibbs { r_hat, ess, .. } => r_hat <= 1.01 && ess >= 400.0,
    }
}

/// Standard deviation of the measured held-out torque.
pub(super) fn torque_deviation(joint: &Joint<'_>) -> f64 {
    standard_deviation(joint.traces.iter().flat_map(|t| t.measured.iter().copied()))
}

/// Names with the share of rows in the 95 % interval.
fn with_coverage<'a>(scores: impl Iterator<Item = &'a JointScore>) -> Vec<String> {
    let named =
        |s: &JointScore| format!("{} ({} in 95 % intervals)", s.joint, percent(s.coverage95));
    scores.filter(|s| s.rows > 0).map(named).collect()
}

fn names<'a>(scores: impl Iterator<Item = &'a JointScore>) -> Vec<String> {
    scores
        .filter(|s| s.rows > 0)
        .map(|s| s.joint.clone())
        .collect()
}

/// "mean ± sd" with matching digits.
pub(super) fn plus_minus(mean: f64, sd: f64) -> String {
    let (mean, sd) = with_sd(mean, sd);
    format!("{mean} ± {sd}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use crate::report::shape::tests::pit;
    use crate::report::view;
    use twincal::validate::Pit;

    fn judged(change: impl Fn(&mut Calibration)) -> Verdict {
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
        let said = "Joints shoulder and elbow: their intervals are wider than they need to be (on elbow PIT off uniform by 0.12, \
                    by chance below 0.050).";
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
                distance: 0.033,
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

    #[test]
    fn what_is_too_narrow_beyond_the_training_motion_is_said_of_it() {
        let beyond = |c: &mut Calibration, coverage95: f64| {
            c.validation.beyond = c.validation.within.clone();
            for (joint, rows) in c.validation.beyond.joints.iter_mut().zip([0, 34]) {
                (joint.rows, joint.coverage95) = (rows, coverage95);
            }
            c.validation.within.joints[1].rows = 46;
            c.validation.within.joints[1].coverage95 = 0.93;
        };
        let said = "Joint elbow: beyond the training motion (34 of 80 moving rows) its 95 % intervals hold 24.0\u{202f}%, within it 93.0\u{202f}%.";
        let limits = judged(|c| beyond(c, 0.24)).limits;
        assert!(limits.iter().any(|limit| limit == said), "{limits:?}");
        assert_eq!(limits.iter().filter(|l| l.contains("beyond")).count(), 1);
        // Nothing of it where the motion does not explain it.
        let limits = judged(|c| {
            beyond(c, 0.24);
            c.validation.within.joints[1].coverage95 = 0.2;
        });
        assert!(!limits.limits.iter().any(|l| l.contains("beyond")));
        // Nor of a handful of rows.
        let limits = judged(|c| {
            beyond(c, 0.8);
            c.validation.beyond.joints[1].rows = 5;
        });
        assert!(!limits.limits.iter().any(|l| l.contains("beyond")));
        let limits = judged(|c| beyond(c, 0.94)).limits;
        assert!(!limits.iter().any(|l| l.contains("beyond")), "{limits:?}");
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
