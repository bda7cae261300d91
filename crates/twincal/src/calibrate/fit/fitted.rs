//! One fit: the fixed point of everything that is plugged in.

use crate::calibrate::settings::CalibrationSettings;
use crate::error::Result;
use crate::likelihood::{Columns, NoiseModel};
use crate::observations::Part;
use crate::plug_in::{Fit, FitSettings, Moving, fit, fit_tempered, start};
use crate::statistics::Training;

/// A fit together with what left-out training data said of it.
pub(in crate::calibrate) struct Fitted {
    pub(in crate::calibrate) fit: Fit,
    /// Per joint on the noise sd of intervals; `None` unless tempered.
    pub(in crate::calibrate) interval_factors: Option<Vec<f64>>,
}

/// Fixed point, and for the tempered likelihood what no candidate describes.
pub(in crate::calibrate) fn estimate(
    training: &[Part<'_>],
    columns: &Columns,
    settings: &CalibrationSettings,
) -> Result<Fitted> {
    let fit_settings = FitSettings {
        noise: settings.noise,
        prior: &settings.prior,
    };
    match settings.noise.model {
        NoiseModel::Tempered => {
            let (fit, factors) = fit_tempered(training, columns, fit_settings)?;
            Ok(Fitted {
                fit,
                interval_factors: Some(factors),
            })
        }
        NoiseModel::Iid | NoiseModel::Ar1 => {
            let training = Training::whole(training);
            let start = start(&training, columns, &settings.prior);
            let fit = fit(&training, columns, fit_settings, &start, Moving::All, None)?;
            Ok(Fitted {
                fit,
                interval_factors: None,
            })
        }
    }
}
