//! Can the numbers be believed: intervals joint by joint, a guarantee, what the compact twin costs.

use super::tables::{Table, with_unit};
use super::text::{count, number, percent};
use super::view::{Joint, pooled_unit};
use twincal::assess::has_standstill;
use twincal::calibrate::Calibration;
use twincal::validate::{Conformal, TREND_ALARM, TREND_FEWEST, Trend, Validation};
use twincal::words::significant;
use twincal::{Finding, Mistake};

/// Coverage at four levels and shape of the predictions per joint; no rows without held-out rows.
pub(super) fn reliability(validation: &Validation) -> Table {
    let mut table = Table::new([
        "joint",
        "in 50 %",
        "in 80 %",
        "in 90 %",
        "in 95 %",
        "PIT deviation",
        "by chance",
    ]);
    let mut add = |name: &str, levels: &[(f64, f64)], distance: f64, chance: f64| {
        let mut row = vec![name.to_owned()];
        row.extend(levels.iter().map(|(_, seen)| percent(*seen)));
        row.extend([number(distance, 3), format!("below {}", number(chance, 3))]);
        table.rows.push(row);
    };
    for joint in validation.reliability.iter().filter(|joint| joint.rows > 0) {
        let pit = &joint.pit;
        add(
            &joint.joint,
            &joint.coverage_levels,
            pit.distance,
            pit.chance,
        );
    }
    if validation.reliability.len() > 1 && !validation.coverage_levels.is_empty() {
        let pit = &validation.pit;
        add(
            "all joints",
            &validation.coverage_levels,
            pit.distance,
            pit.chance,
        );
    }
    table
}

/// Moving rows that the training data speak of, beside those beyond; no rows where every motion was seen before.
pub(super) fn beyond(validation: &Validation, joints: &[Joint<'_>]) -> Table {
    let mut table = Table::new([
        "joint",
        "rows within",
        "95 % coverage",
        "RMSE",
        "rows beyond",
        "95 % coverage there",
        "RMSE there",
    ]);
    let pairs = validation
        .within
        .joints
        .iter()
        .zip(&validation.beyond.joints);
    for (within, beyond) in pairs.filter(|(_, beyond)| beyond.rows > 0) {
        let joint = joints.iter().find(|joint| joint.name == within.joint);
        let unit = joint.map_or("", |joint| joint.units.torque);
        let mut row = vec![within.joint.clone()];
        for scores in [within, beyond] {
            row.push(count(scores.rows));
            row.push(percent(scores.coverage95));
            row.push(with_unit(scores.rmse_calibrated, unit));
        }
        table.rows.push(row);
    }
    table
}

/// Probability below which it is said why there is no more.
const WORTH_A_GUARANTEE: f64 = 0.9;

/// What is guaranteed without believing the model, in one sentence, and for which next log.
pub(super) fn guarantee(validation: &Validation, findings: &[Finding]) -> String {
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
        "Without believing the model: {} by {}, the 95 % intervals of all joints hold {} of all rows of the next log \
         like these{}, with probability {}/{} = {} {}.{} {} Joint by joint: {}.",
        stretched(conformal.factor),
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

/// What a factor does to intervals.
#[must_use]
pub fn stretched(factor: f64) -> &'static str {
    if factor < 1.0 {
        "narrowed"
    } else {
        "stretched"
    }
}

/// The compact twin and what it costs, in sentences; none in results without it.
pub(super) fn compact(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let Some(compact) = &calibration.compact else {
        return Vec::new();
    };
    let unit = pooled_unit(joints);
    let mut out = vec![match compact.components.len() {
        0 => "The compact twin, the effects with probability 0.5 or more fitted again together, is the nominal model.".into(),
        n => format!(
            "The compact twin holds the effects with probability 0.5 or more, fitted again together: {} with {}.",
            if n == 1 { "one effect".into() } else { format!("{} effects", count(n as u64)) },
            match compact.terms.len() {
                1 => "one number".into(),
                n => format!("{} numbers", count(n as u64)),
            }
        ),
    }];
    out.push("It is a check: `predict` and `export` use the average over all models.".into());
    let [average, own] = compact.training_rmse;
    if average.is_finite() && own.is_finite() {
        out.push(format!(
            "Training RMSE of moving joints: {} instead of {} {unit} of the model average.",
            number(own, 4),
            number(average, 4)
        ));
    }
    if let Some([average, own]) = calibration.validation.compact {
        out.push(format!(
            "Held-out RMSE of moving joints: {} instead of {} {unit}; log score {} instead of {} nats per row (larger is better).",
            number(own.rmse, 4),
            number(average.rmse, 4),
            number(own.log_score, 4),
            number(average.log_score, 4)
        ));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::Code;

    use twincal::Severity;

    #[test]
    fn a_guarantee_is_only_promised_with_held_out_logs() {
        let mut validation = fixture::two_joints().validation;
        let guarantee = |validation: &Validation| guarantee(validation, &[]);
        assert!(guarantee(&validation).contains("not guaranteed"));
        validation.conformal.as_mut().unwrap().guaranteed = true;
        let text = guarantee(&validation);
        assert!(
            text.contains("3/4") && text.contains("trajectory, guaranteed)"),
            "{text}"
        );
        assert!(
            text.contains("guaranteed). 3 logs allow no more. It holds if"),
            "{text}"
        );
        let conformal = validation.conformal.as_mut().unwrap();
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
            let conformal = validation.conformal.as_mut().unwrap();
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
