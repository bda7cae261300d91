//! The answer in one sentence.

use super::grounds;
use twincal::assess::{Answer, Assessment, has_standstill};
use twincal::calibrate::Calibration;
use twincal::{Code, Mistake, Severity};

/// Where the exceptions stand to which a headline leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Exceptions {
    /// Below it, in a list.
    Below,
    /// Behind it, in the same line.
    Behind,
}

/// The answer in one sentence, by what decides; of joints that move, and of torque that the filter lets pass. It begins with the answer's own words.
pub(super) fn headline(
    assessment: &Assessment,
    calibration: &Calibration,
    exceptions: Exceptions,
) -> String {
    let lead = lead(assessment.answer);
    if let Some(words) = fixed(assessment.reason) {
        return format!("{lead}: {words}");
    }
    let below = grounds::below_cutoff(calibration);
    if assessment.reason == Code::Passed {
        return format!(
            "{lead}, to predict torque{below} on motions like the ones it was tested on."
        );
    }
    let torque = match has_standstill(&calibration.validation) {
        true => "use its torque while joints move",
        false => "use its torque",
    };
    let words = match assessment.reason {
        Code::NarrowIntervals | Code::DistributionNarrow => {
            format!("{torque}, not its intervals, which are too narrow.")
        }
        Code::DistributionWide => {
            format!("{torque}; its intervals are wider than they need to be.")
        }
        Code::TorqueAbovePrediction | Code::TorqueBelowPrediction => {
            format!("{torque}, not its intervals, which are biased.")
        }
        _ => match exceptions {
            Exceptions::Below => format!("to predict torque{below}, with the exceptions below."),
            Exceptions::Behind => format!("to predict torque{below}, with the exceptions:"),
        },
    };
    format!("{lead}: {words}")
}

/// The answer's own words.
fn lead(answer: Answer) -> &'static str {
    match answer {
        Answer::Yes => "Yes",
        Answer::YesWithinLimits => "Yes, within limits",
        Answer::NotYet => "Not yet",
        Answer::No => "No",
    }
}

/// What stands behind the answer where it is the same for every robot.
fn fixed(reason: Code) -> Option<&'static str> {
    if reason == Code::TorqueCopied {
        return Some("the torque of one joint is that of another.");
    }
    if let Some(mistake) = Mistake::of(reason, Severity::Degraded) {
        return Some(mistake_words(mistake));
    }
    Some(match reason {
        Code::NotTested => "there are no held-out rows to judge this twin by.",
        Code::FewHeldOutRows => {
            "the held-out rows count as too few independent ones to judge this twin by."
        }
        Code::WorseThanNominal => {
            "on held-out data the calibrated torque is worse than the nominal one."
        }
        Code::ErrorAboveTorque => "the error left is larger than the torque itself.",
        Code::ErrorAboveTorqueOnMostJoints => {
            "on most joints the error left is larger than the torque itself."
        }
        Code::NothingFound => {
            "nothing to correct was found; none of the candidate effects is in this log."
        }
        Code::NoBetterThanNominal => {
            "on held-out data the calibrated torque is no better than the nominal one."
        }
        Code::FrictionAloneIsBetter => {
            "friction and an offset alone predict held-out torque better."
        }
        Code::NothingEstablished => {
            "low-passed torque is better with it, but none of its effects is established."
        }
        Code::LargeError => "better than the model alone, but the error that is left is large.",
        Code::LargeErrorOnMostJoints => {
            "better than the model alone, but on most joints the error that is left is large."
        }
        Code::UnphysicalLinks => {
            "the inertia found of several links is physically inconsistent. Is this the robot's model?"
        }
        Code::JointTorqueWorse => {
            "better than the model alone, but on some joints torque got worse."
        }
        Code::NarrowIntervalsInMotion => {
            "use its torque while joints move, not its intervals, which are too narrow."
        }
        Code::WideIntervals => "its intervals are wider than they need to be.",
        Code::WorseAtRest => "use it while joints move; at standstill it is worse than your model.",
        _ => return None,
    })
}

/// What stands behind the answer where a mistake stands: it is "Not yet".
fn mistake_words(mistake: Mistake) -> &'static str {
    match mistake {
        Mistake::Contradiction => {
            "log and model contradict each other in orientation, sign, scale or order of joints."
        }
        Mistake::NoMeasurement => "torque that never changes while joints move is no measurement.",
        Mistake::Copy => "one log is a copy of another.",
        Mistake::OddTorque => "the torque of one log or joint contradicts the others.",
        Mistake::OddMotion => "positions or their clock are wrong in a log.",
        Mistake::AnotherState => "a held-out log is of another robot, or of another state of it.",
    }
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use crate::words::tests::{judged, pit};

    #[test]
    fn exceptions_are_below_or_behind() {
        let answer = judged(|c| c.validation.reliability[1].pit = pit(0.5, 4.0));
        assert!(answer.headline.ends_with(", with the exceptions below."));
        assert!(answer.lead.ends_with(", with the exceptions:"));
        let plain = judged(|_| ());
        assert_eq!(plain.headline, plain.lead);
    }
}
