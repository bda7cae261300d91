//! The answer in one sentence.

use super::grounds;
use twincal::assess::{Assessment, has_standstill};
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

/// The answer in one sentence, by what decides; of joints that move, and of torque that the filter lets pass.
pub(super) fn headline(
    assessment: &Assessment,
    calibration: &Calibration,
    exceptions: Exceptions,
) -> String {
    let reason = assessment.reason;
    if reason == Code::TorqueCopied {
        return "Not yet: the torque of one joint is that of another.".into();
    }
    if let Some(mistake) = Mistake::of(reason, Severity::Degraded) {
        return mistake_words(mistake).into();
    }
    let torque = match has_standstill(&calibration.validation) {
        true => "While joints move, the torque yes",
        false => "The torque yes",
    };
    let predict = format!(
        "Yes, to predict torque{}",
        grounds::below_cutoff(calibration)
    );
    match reason {
        Code::NarrowIntervals | Code::DistributionNarrow => {
            format!("{torque}, its intervals not: they are too narrow.")
        }
        Code::DistributionWide => {
            format!("{torque}; its intervals are wider than they need to be.")
        }
        Code::TorqueAbovePrediction | Code::TorqueBelowPrediction => {
            format!("{torque}, its intervals not: they lie off to one side.")
        }
        Code::Passed => format!("{predict} on motions like the ones it was tested on."),
        _ => match (fixed(reason), exceptions) {
            (Some(words), _) => words.to_owned(),
            (None, Exceptions::Below) => format!("{predict}, with the exceptions below."),
            (None, Exceptions::Behind) => format!("{predict}, with the exceptions:"),
        },
    }
}

/// Answers that are of the whole robot.
fn fixed(reason: Code) -> Option<&'static str> {
    Some(match reason {
        Code::NotTested => "Not yet: there are no held-out rows to judge this twin by.",
        Code::FewHeldOutRows => {
            "Hard to say: the held-out rows count as too few independent ones to judge this twin by."
        }
        Code::WorseThanNominal => {
            "No: on held-out data the calibrated torque is worse than the nominal one."
        }
        Code::ErrorAboveTorque => "No: the error left is larger than the torque itself.",
        Code::ErrorAboveTorqueOnMostJoints => {
            "No: on most joints the error left is larger than the torque itself."
        }
        Code::NothingFound => {
            "Nothing to correct was found: none of the candidate effects is in this log."
        }
        Code::NoBetterThanNominal => {
            "Hardly: on held-out data the calibrated torque is no better than the nominal one."
        }
        Code::FrictionAloneIsBetter => {
            "Hardly: friction and an offset alone predict held-out torque better."
        }
        Code::NothingEstablished => {
            "Perhaps: low-passed torque is better with it, but none of its effects is established."
        }
        Code::LargeError => "Better than the model alone, but the error that is left is large.",
        Code::LargeErrorOnMostJoints => {
            "Better than the model alone, but on most joints the error that is left is large."
        }
        Code::UnphysicalLinks => {
            "With care: the inertia found of several links is physically inconsistent. Is this the robot's model?"
        }
        Code::JointTorqueWorse => {
            "With care: better than the model alone, but on some joints torque got worse."
        }
        Code::NarrowIntervalsInMotion => {
            "While joints move the torque yes, its intervals not: they are too narrow."
        }
        Code::WideIntervals => "Yes; its intervals are wider than they need to be.",
        Code::WorseAtRest => "While joints move, yes; at standstill it is worse than your model.",
        _ => return None,
    })
}

/// The headline where a mistake stands: never "Yes".
fn mistake_words(mistake: Mistake) -> &'static str {
    match mistake {
        Mistake::Contradiction => {
            "Not yet: log and model contradict each other in orientation, sign, scale or order of joints."
        }
        Mistake::NoMeasurement => {
            "Not yet: torque that never changes while joints move is no measurement."
        }
        Mistake::Copy => "Not yet: one log is a copy of another.",
        Mistake::OddTorque => "Not yet: the torque of one log or joint contradicts the others.",
        Mistake::OddMotion => "Not yet: positions or their clock are wrong in a log.",
        Mistake::AnotherState => {
            "Not yet: a held-out log is of another robot, or of another state of it."
        }
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
