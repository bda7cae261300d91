//! Can this twin be used, and where not: the first thing the page says, the words of its [`Assessment`].

use super::findings;
use crate::words;
use serde::Serialize;
use twincal::Code;
use twincal::assess::{Answer, Assessment, assess};
use twincal::calibrate::Calibration;

/// How the answer is coloured; the words carry the meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Grade {
    Good,
    Care,
    Bad,
}

impl Grade {
    fn of(assessment: &Assessment) -> Self {
        let open = [
            Code::FewHeldOutRows,
            Code::NoBetterThanNominal,
            Code::FrictionAloneIsBetter,
            Code::NothingEstablished,
        ];
        match assessment.answer {
            Answer::Yes => Self::Good,
            Answer::YesWithinLimits => Self::Care,
            Answer::NotYet if open.contains(&assessment.reason) => Self::Care,
            Answer::No | Answer::NotYet => Self::Bad,
        }
    }
}

/// The verdict in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Verdict {
    pub(super) grade: Grade,
    /// May it be used?
    pub(super) answer: Answer,
    /// What decides.
    pub(super) reason: Code,
    /// One sentence.
    pub(super) headline: String,
    /// What the headline rests on.
    pub(super) grounds: Vec<String>,
    /// Where it does not hold: what matters most, and the rest.
    pub(super) limits: Vec<String>,
    pub(super) folded: Vec<String>,
    /// Where on the page more of that stands.
    pub(super) pointers: Vec<String>,
    /// What to record next; `None` where nothing more would be learnt from it that is known of.
    pub(super) next: Option<String>,
    /// The command that designs its motion, in a sentence.
    pub(super) motion: Option<String>,
}

/// The assessment of `calibration`, as the page shows it.
pub(super) fn judge(calibration: &Calibration) -> Verdict {
    let assessment = assess(calibration);
    let words = words::of_assessment(&assessment, calibration);
    Verdict {
        grade: Grade::of(&assessment),
        answer: words.answer,
        reason: words.reason,
        headline: words.headline,
        grounds: words.grounds,
        limits: words.limits,
        folded: words.folded,
        pointers: match words.reason {
            Code::NotTested => Vec::new(),
            _ => pointers(calibration),
        },
        next: words.next,
        motion: words::next_motion(calibration, words::PAGE_FOLDER).map(|motion| motion.on_page()),
    }
}

/// Where on the page more of it stands.
fn pointers(calibration: &Calibration) -> Vec<String> {
    let mut out: Vec<String> = findings::warnings(calibration).into_iter().collect();
    out.push("Outside the motion listed under “What the data cannot tell” it extrapolates.".into());
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::words::tests::{changed, pit};
    use twincal::calibrate::Status;
    use twincal::posterior::Method;
    use twincal::validate::Pit;
    use twincal::{Finding, Mistake, Severity};

    fn judged(change: impl Fn(&mut Calibration)) -> Verdict {
        let mut verdict = judge(&changed(change));
        verdict.limits.append(&mut verdict.folded);
        verdict
    }

    /// As many held-out rows of every joint.
    fn set_rows(calibration: &mut Calibration, rows: u64) {
        let joints = calibration.validation.filtered.joints.iter_mut();
        joints.for_each(|joint| joint.rows = rows);
    }

    #[test]
    fn the_grade_follows_error_coverage_findings_and_convergence() {
        assert_eq!(judged(|_| ()).grade, Grade::Good);
        type Case = (fn(&mut Calibration), Grade, &'static str);
        let cases: [Case; 8] = [
            (|c| set_rows(c, 20), Grade::Care, "too few"),
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
            (|c| set_rows(c, 0), Grade::Bad, "Not yet"),
            (
                |c| {
                    c.validation.filtered.rmse_calibrated = c.validation.filtered.rmse_nominal;
                    let all = c.components.iter_mut();
                    all.for_each(|t| (t.pip, t.status) = (Some(0.0), Status::Absent));
                },
                Grade::Care,
                "nothing to correct",
            ),
        ];
        for (change, grade, words) in cases {
            let verdict = judged(change);
            assert_eq!(verdict.grade, grade, "{verdict:?}");
            assert!(verdict.headline.contains(words), "{verdict:?}");
        }
    }

    #[test]
    fn no_yes_stands_beside_a_mistake() {
        assert!(judged(|_| ()).headline.starts_with("Yes"));
        for (code, severity) in Mistake::codes() {
            let message = match code.leaves_out_its_log() {
                true => "wrong",
                false => "elbow: wrong",
            };
            let finding = Finding::new(severity, code, "elbow", message, 1);
            let said = judged(|c| c.findings = vec![finding.clone()]);
            assert!(said.headline.starts_with("Not yet"), "{code}: {said:?}");
            assert_eq!((said.grade, &said.next), (Grade::Bad, &None), "{code}");
            assert_eq!(said.limits[0], "elbow: wrong", "{code}");
        }
    }

    #[test]
    fn standstill_that_got_worse_is_in_the_headline() {
        let of = |after: f64, at_rest: u64| {
            judged(|c| {
                c.validation.moving = c.validation.filtered.clone();
                let joints = c.validation.filtered.joints.iter_mut();
                for (all, moving) in joints.zip(&mut c.validation.moving.joints) {
                    (all.rows, moving.rows) = (100 + at_rest, 100);
                    all.rmse_nominal = moving.rmse_nominal;
                    all.rmse_calibrated = after * moving.rmse_nominal;
                }
            })
            .headline
        };
        assert!(of(2.0, 100).starts_with("Yes, within limits: use it while joints move;"));
        assert!(of(0.5, 100).starts_with("Yes"));
        // Too few to say.
        assert!(of(9.0, 9).starts_with("Yes"));
    }

    #[test]
    fn bodies_that_are_none_on_two_links_ask_for_the_right_model() {
        let of = |links: &[&str]| {
            judged(|c| {
                let finding = |link: &&str| {
                    Finding::new(
                        Severity::Warning,
                        Code::UnphysicalInertiaFound,
                        *link,
                        "",
                        0,
                    )
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
    fn intervals_that_one_joint_misses_make_an_exception() {
        let narrow = judged(|c| c.validation.filtered.joints[1].coverage95 = 0.78);
        assert!(narrow.headline.contains("exceptions"), "{narrow:?}");
    }

    #[test]
    fn no_recording_is_advised_of_a_log_that_contradicts_the_model() {
        use twincal::validate::Split;
        let next = |codes: &[Code]| {
            judged(|c| {
                c.validation.split = Split::LastThirty;
                let finding = |code: &Code| Finding::new(Severity::Degraded, *code, "elbow", "", 0);
                c.findings = codes.iter().map(finding).collect();
            })
            .next
        };
        assert!(next(&[]).is_some());
        assert_eq!(next(&[Code::ConstantTorque]), None);
        assert_eq!(next(&[Code::SignFlip]), None);
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
    fn with_tentative_effects_alone_the_answer_is_not_yet() {
        let verdict = judged(|c| {
            let found = c.components.iter_mut().filter(|c| c.is_in());
            found.for_each(|c| c.status = Status::Tentative);
        });
        assert!(verdict.headline.starts_with("Not yet: "), "{verdict:?}");
        let said = "No effect is established.".to_owned();
        assert!(verdict.grounds.contains(&said));
    }

    #[test]
    fn an_error_as_large_as_the_torque_is_a_no() {
        // The elbow is the fixture's second joint.
        let of = |shoulder: bool, factor: f64| {
            judged(move |c| {
                let deviation = |index: usize| c.validation.filtered.joints[index].torque_sd;
                let deviations = [deviation(0), deviation(1)];
                let joints = c.validation.filtered.joints.iter_mut();
                for (joint, deviation) in joints.zip(deviations).skip(usize::from(!shoulder)) {
                    joint.rmse_calibrated = factor * deviation;
                    joint.rmse_nominal = 10.0 * deviation;
                }
            })
        };
        let all = of(true, 1.38);
        assert_eq!(
            all.headline,
            "No: the error left is larger than the torque itself."
        );
        assert_eq!(all.grade, Grade::Bad);
        let said = "Joints shoulder and elbow: the error left is 138\u{202f}% and 138\u{202f}% of the torque's standard deviation (";
        let told = all.limits.iter().find(|l| l.starts_with(said));
        assert!(
            told.is_some_and(|l| l.ends_with(" N·m): a constant would do better.")),
            "{all:?}"
        );
        let as_well = of(true, 1.02).limits;
        assert!(
            as_well
                .iter()
                .any(|l| l.ends_with(": a constant would do as well."))
        );
        let large =
            "Yes, within limits: better than the model alone, but the error that is left is large.";
        assert_eq!(of(true, 0.98).headline, large);
        let one = of(false, 1.38);
        assert_ne!(one.grade, Grade::Bad);
        assert!(
            one.limits
                .iter()
                .any(|l| l.starts_with("Joint elbow: the error left is 138"))
        );
        let single = judged(|c| {
            let deviation = c.validation.filtered.joints[0].torque_sd;
            let joints = &mut c.validation.filtered.joints;
            (joints[0].rmse_calibrated, joints[0].rmse_nominal) =
                (0.7 * deviation, 10.0 * deviation);
            c.noise.truncate(1);
        });
        assert_eq!(single.headline, large);
    }

    #[test]
    fn too_few_rows_are_counted_with_the_remedy() {
        let few = judged(|c| {
            // Memory 2.4 rows on either joint.
            let joints = c.validation.filtered.joints.iter_mut();
            joints.for_each(|j| j.rows = 12);
        });
        assert_eq!(
            few.headline,
            "Not yet: the held-out rows count as too few independent ones to judge this twin by."
        );
        assert_eq!(
            few.limits[0],
            "The held-out rows count as 10.0 independent ones over all joints, 20 are needed: hold out 2.0 times as much, by another log with \
             --heldout or by longer logs."
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
            "Yes, within limits: use its torque; its intervals are wider than they need to be."
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
