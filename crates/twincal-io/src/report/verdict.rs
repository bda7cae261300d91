//! Can this twin be used, and where not: the first thing the report says, derived from held-out data alone.

use super::text::{list, number, percent, with_sd};
use super::view::{Joint, independent_rows, pooled_unit, standard_deviation};
use serde::Serialize;
use twincal::Severity;
use twincal::calibrate::Calibration;
use twincal::posterior::Method;
use twincal::validate::{JointScore, Pit, Reliability, Split};

/// A 95 % interval is honest if it holds this share of the held-out rows (the range that `check` accepts).
const COVERAGE: (f64, f64) = (0.90, 0.99);
/// Ratio of errors from which calibration counts as an improvement.
const BETTER: f64 = 0.95;
/// Ratio of errors from which it counts as harm.
const WORSE: f64 = 1.02;
/// Held-out rows, in independent ones, below which nothing is promised.
const FEW: f64 = 20.0;
/// Share of the torque's standard deviation from which the remaining error is called large.
const LARGE: f64 = 0.5;

/// Distance of the PIT from uniform beyond which, if chance does not explain it, intervals are more than a little off: the
/// 50 % interval then holds less than 40 % or more than 60 %.
const OFF: f64 = 0.05;

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
            grounds: vec![effects_found(found)],
            limits: vec![
                "Record another motion and give it with --heldout, or fit at least three logs."
                    .into(),
            ],
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
    let off = shape_off(calibration);
    let limits = limits(calibration, joints, &worse);
    let serious = calibration
        .findings
        .iter()
        .any(|f| f.severity == Severity::Degraded)
        || !converged(calibration);
    let (grade, headline) = if independent_rows(calibration, joints) < FEW {
        (
            Grade::Care,
            "Hard to say: there are too few held-out rows to judge this twin by.",
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
    } else if let Some(shape) = off.all {
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
        grounds: grounds(calibration, joints, found),
        limits,
    }
}

/// How a predicted distribution is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Wide,
    Narrow,
    /// The measured torque lies above the middle of the prediction too often.
    Above,
    Below,
}

impl Shape {
    const ALL: [Self; 4] = [Self::Wide, Self::Narrow, Self::Above, Self::Below];

    /// `None` where the distance from uniform is what chance allows.
    fn of(pit: &Pit) -> Option<Self> {
        // Not a comparison with NaN: without rows there is nothing to judge.
        if pit.histogram.is_empty() || !(pit.distance > pit.chance) {
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

    fn headline(self) -> &'static str {
        match self {
            Self::Wide => "The torque yes; its intervals are wider than they need to be.",
            Self::Narrow => "The torque yes, its intervals not: they are too narrow.",
            Self::Above | Self::Below => {
                "The torque yes, its intervals not: they lie off to one side."
            }
        }
    }

    /// What is said of joints, and of one; `slightly` where intervals are still of use.
    fn words(self, slightly: bool) -> &'static str {
        match (self, slightly) {
            (Self::Wide, false) => "intervals are wider than they need to be",
            (Self::Wide, true) => "intervals are a little wider than they need to be",
            (Self::Narrow, false) => "intervals are too narrow",
            (Self::Narrow, true) => "intervals are a little too narrow",
            (Self::Above, false) => "intervals lie too low",
            (Self::Above, true) => "intervals lie a little too low",
            (Self::Below, false) => "intervals lie too high",
            (Self::Below, true) => "intervals lie a little too high",
        }
    }
}

/// Where the shape of the predictions is off by more than [`OFF`] and by more than chance.
struct ShapeOff {
    /// Over all joints.
    all: Option<Shape>,
    /// On a single joint.
    single: bool,
}

fn shape_off(calibration: &Calibration) -> ShapeOff {
    let validation = &calibration.validation;
    let far = |pit: &Pit| Shape::of(pit).filter(|_| pit.distance > OFF);
    ShapeOff {
        all: far(&validation.pit),
        single: validation.reliability.iter().any(|j| far(&j.pit).is_some()),
    }
}

/// Every joint whose predictions are off by more than chance allows, in words and with the number behind them.
fn shapes(calibration: &Calibration) -> Vec<String> {
    let validation = &calibration.validation;
    let mut out = Vec::new();
    let numbers = |pit: &Pit| {
        format!(
            "PIT off uniform by {}, by chance below {}",
            number(pit.distance, 2),
            number(pit.chance, 2)
        )
    };
    for (shape, slightly) in Shape::ALL.into_iter().flat_map(|s| [(s, false), (s, true)]) {
        let own: Vec<&Reliability> = (validation.reliability.iter())
            .filter(|j| Shape::of(&j.pit) == Some(shape) && (j.pit.distance <= OFF) == slightly)
            .collect();
        let Some(worst) = (own.iter()).max_by(|a, b| a.pit.distance.total_cmp(&b.pit.distance))
        else {
            continue;
        };
        let names: Vec<&str> = own.iter().map(|j| j.joint.as_str()).collect();
        out.push(match names[..] {
            [one] => format!(
                "Joint {one}: its {} ({}).",
                shape.words(slightly),
                numbers(&worst.pit)
            ),
            _ => format!(
                "Joints {}: their {} (on {} {}).",
                list(&names),
                shape.words(slightly),
                worst.joint,
                numbers(&worst.pit)
            ),
        });
    }
    if let (true, Some(shape)) = (out.is_empty(), Shape::of(&validation.pit)) {
        let pit = &validation.pit;
        let words = shape.words(pit.distance <= OFF);
        out.push(format!("All joints together: {words} ({}).", numbers(pit)));
    }
    out
}

fn grounds(calibration: &Calibration, joints: &[Joint<'_>], found: usize) -> Vec<String> {
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
        effects_found(found),
    ]
}

fn effects_found(found: usize) -> String {
    match found {
        0 => "No missing effect is more likely than not.".into(),
        1 => "One missing effect found.".into(),
        n => format!("{n} missing effects found."),
    }
}

fn limits(calibration: &Calibration, joints: &[Joint<'_>], worse: &[String]) -> Vec<String> {
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
    let narrow = names(scores.joints.iter().filter(|j| j.coverage95 < COVERAGE.0));
    say(
        &narrow,
        "its intervals are too narrow",
        "their intervals are too narrow",
    );
    let wide = names(scores.joints.iter().filter(|j| j.coverage95 > COVERAGE.1));
    say(
        &wide,
        "its intervals are wider than they need to be",
        "their intervals are wider than they need to be",
    );
    let mut out_of_shape = shapes(calibration);
    let large: Vec<String> = joints
        .iter()
        .filter(|joint| {
            let score = scores.joints.iter().find(|s| s.joint == joint.name);
            let deviation = torque_deviation(joint);
            score.is_some_and(|s| deviation > 0.0 && s.rmse_calibrated > LARGE * deviation)
        })
        .map(|j| j.name.to_owned())
        .collect();
    say(
        &large,
        "the error left is more than half of the torque's standard deviation",
        "the error left is more than half of the torque's standard deviation",
    );
    out.append(&mut out_of_shape);
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
        .filter(|f| f.severity == Severity::Degraded);
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
    use crate::report::view;

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
                Shape::of(&pit(middle, slope)),
                Some(shape),
                "{middle} {slope}"
            );
        }
        let mut chance = pit(0.75, 0.0);
        chance.chance = 0.13;
        assert_eq!(Shape::of(&chance), None);
        assert_eq!(Shape::of(&Pit::default()), None);
    }

    #[test]
    fn intervals_off_by_more_than_their_stated_limit_are_in_the_verdict() {
        let wide = judged(|c| {
            c.validation.pit = pit(0.75, 0.0);
            c.validation
                .reliability
                .iter_mut()
                .for_each(|j| j.pit = pit(0.75, 0.0));
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
