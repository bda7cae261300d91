//! One fit: the fixed point of everything that is plugged in.

use crate::calibrate::settings::CalibrationSettings;
use crate::error::Result;
use crate::likelihood::{Columns, NoiseModel};
use crate::observations::Part;
use crate::plug_in::{Fit, FitSettings, Moving, fit, fit_tempered, start};
use crate::statistics::{Purpose, Runs, Sums};

/// A fit together with what left-out training data said of it.
pub(in crate::calibrate) struct Fitted {
    pub(in crate::calibrate) fit: Fit,
    /// Per joint on the noise sd of intervals; `None` unless tempered.
    pub(in crate::calibrate) interval_factors: Option<Vec<f64>>,
}

/// The sums that [`estimate`] takes of these rows.
pub(in crate::calibrate) fn sums(
    rows: &[Part<'_>],
    settings: &CalibrationSettings,
    purpose: Purpose,
) -> Sums {
    Sums::of(rows, runs(settings), purpose)
}

/// What a fit needs to know of consecutive rows.
pub(in crate::calibrate) fn runs(settings: &CalibrationSettings) -> Runs {
    match settings.noise.model {
        NoiseModel::Ar1 => Runs::Joined,
        NoiseModel::Iid | NoiseModel::Tempered => Runs::Apart,
    }
}

/// Fixed point, and for the tempered likelihood what no candidate describes; `rows` are those behind the sums, and only robust noise asks for
/// them.
pub(in crate::calibrate) fn estimate(
    sums: &Sums,
    rows: &[Part<'_>],
    columns: &Columns,
    settings: &CalibrationSettings,
) -> Result<Fitted> {
    let fit_settings = FitSettings {
        noise: settings.noise,
        prior: &settings.prior,
    };
    match settings.noise.model {
        NoiseModel::Tempered => {
            let (fit, factors) = fit_tempered(sums, rows, columns, fit_settings)?;
            Ok(Fitted {
                fit,
                interval_factors: Some(factors),
            })
        }
        NoiseModel::Iid | NoiseModel::Ar1 => {
            let start = start(sums, columns, &settings.prior);
            let fit = fit(sums, columns, fit_settings, &start, Moving::All, None)?;
            Ok(Fitted {
                fit,
                interval_factors: None,
            })
        }
    }
}
