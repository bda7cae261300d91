//! The compact twin and what it costs.

use super::number::{count, number};
use super::units::pooled_unit;
use twincal::calibrate::Calibration;

/// The compact twin and what it costs, in sentences; none in results without it.
pub(crate) fn compact(calibration: &Calibration) -> Vec<String> {
    let Some(compact) = &calibration.compact else {
        return Vec::new();
    };
    let unit = pooled_unit(calibration);
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
