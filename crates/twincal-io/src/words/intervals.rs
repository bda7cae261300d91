//! What is promised of intervals without believing the model.

use super::number::{number, percent};
use twincal::assess::has_standstill;
use twincal::validate::{Conformal, TREND_ALARM, TREND_FEWEST, Trend, Validation};
use twincal::words::significant;
use twincal::{Finding, Mistake};

/// Probability below which it is said why there is no more.
const WORTH_A_GUARANTEE: f64 = 0.9;

/// What is guaranteed without believing the model, in one sentence, and for which next log.
pub(crate) fn guarantee(validation: &Validation, findings: &[Finding]) -> String {
    if findings.iter().any(|f| f.mistake() == Some(Mistake::Copy)) {
        return "No guarantee without believing the model: a log is a copy of another, so that nothing was tested by a recording of its own."
            .into();
    }
    let Some(conformal) = &validation.conformal else {
        return "No guarantee without believing the model: that needs whole held-out logs (--heldout); three logs or more, left out one at a time, give about the same, not guaranteed."
            .into();
    };
    let each: Vec<String> = conformal
        .joints
        .iter()
        .map(|joint| format!("{} {}", joint.joint, number(joint.factor, 3)))
        .collect();
    format!(
        "Without believing the model: scaled by {}, the 95 % intervals of all joints hold {} of all rows of the next log \
         like these{}, with probability {}/{} = {} {}.{} {} Joint by joint: {}.",
        number(conformal.factor, 3),
        percent(conformal.rows),
        if has_standstill(validation) {
            ", those at standstill too"
        } else {
            ""
        },
        conformal.trajectories,
        conformal.trajectories + 1,
        percent(conformal.level),
        if conformal.guaranteed {
            "(split-conformal by trajectory, guaranteed)"
        } else {
            "(by logs left out one at a time: about, not guaranteed; give logs with --heldout for a guarantee)"
        },
        match conformal.trajectories {
            1 => " One log allows no more.".to_owned(),
            n if conformal.level < WORTH_A_GUARANTEE => format!(" {n} logs allow no more."),
            _ => String::new(),
        },
        drawn_alike(conformal),
        each.join(", ")
    )
}

/// For which next log that holds, and what the trend of the factors says.
#[must_use]
pub fn drawn_alike(conformal: &Conformal) -> String {
    let holds = "It holds if the next log is drawn like these, not if it is recorded later and the robot changes";
    let level = format!("tested at {:.0} %", 100.0 * TREND_ALARM);
    match conformal.trend {
        None => format!(
            "{holds}; a trend over the recording order is tested from {TREND_FEWEST} logs on."
        ),
        Some(Trend { tau, p }) if p < TREND_ALARM => format!(
            "{holds}: the factors {} over the recording order (Kendall's τ {tau:+.2}, p = {}, {level}).",
            if tau > 0.0 { "rise" } else { "fall" },
            significant(p, 2)
        ),
        Some(Trend { tau, p }) => format!(
            "{holds}; the factors show no trend over the recording order (Kendall's τ {tau:+.2}, p = {}, {level}).",
            significant(p, 2)
        ),
    }
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::{Code, Severity};

    #[test]
    fn a_guarantee_is_only_promised_with_held_out_logs() {
        let mut validation = fixture::two_joints().validation;
        let guarantee = |validation: &Validation| guarantee(validation, &[]);
        assert!(guarantee(&validation).contains("not guaranteed"));
        validation
            .conformal
            .as_mut()
            .expect("the fixture has one")
            .guaranteed = true;
        let text = guarantee(&validation);
        assert!(
            text.contains("3/4") && text.contains("trajectory, guaranteed)"),
            "{text}"
        );
        assert!(
            text.contains("guaranteed). 3 logs allow no more. It holds if"),
            "{text}"
        );
        let conformal = validation.conformal.as_mut().expect("the fixture has one");
        (conformal.trajectories, conformal.level) = (19, 0.95);
        assert!(!guarantee(&validation).contains("no more"));
        validation.conformal = None;
        assert!(guarantee(&validation).starts_with("No guarantee"));
        let copy = Finding::new(Severity::Degraded, Code::CopiedLog, "run", "", 0);
        let text = super::guarantee(&fixture::two_joints().validation, &[copy]);
        assert!(
            text.starts_with("No guarantee") && !text.contains("guaranteed"),
            "{text}"
        );
    }

    #[test]
    fn a_trend_of_the_factors_is_said_with_its_level() {
        let mut validation = fixture::two_joints().validation;
        let mut of = |trend| {
            let conformal = validation.conformal.as_mut().expect("the fixture has one");
            conformal.trend = trend;
            drawn_alike(conformal)
        };
        assert!(of(None).contains("from 5 logs on"));
        let rising = of(Some(Trend {
            tau: 1.0,
            p: 0.0167,
        }));
        assert!(rising.contains("rise over the recording order"), "{rising}");
        assert!(rising.contains("p = 0.017, tested at 5 %"), "{rising}");
        assert!(of(Some(Trend { tau: -0.2, p: 0.8 })).contains("show no trend"));
    }
}
