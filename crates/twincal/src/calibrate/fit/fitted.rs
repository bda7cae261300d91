//! One fit: the fixed point of everything that is plugged in, with draws of the noise where they are asked for.

use crate::calibrate::settings::CalibrationSettings;
use crate::error::Result;
use crate::infer::{Given, sample, sampled_likelihood};
use crate::likelihood::{Columns, NoiseInterval, NoiseModel, NoiseUncertainty};
use crate::observations::Part;
use crate::plug_in::{Fit, FitSettings, Moving, fit, fit_tempered, start};

/// A fit together with what left-out training data said of it.
pub(in crate::calibrate) struct Fitted {
    pub(in crate::calibrate) fit: Fit,
    /// Per joint on the noise sd of intervals; `None` unless tempered.
    pub(in crate::calibrate) interval_factors: Option<Vec<f64>>,
    /// What draws say of each joint's noise; empty where it is a plug-in.
    pub(in crate::calibrate) sampled: Vec<NoiseInterval>,
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
    let draws_noise = settings.noise.uncertainty == NoiseUncertainty::Sampled;
    if draws_noise {
        sampled_likelihood(settings.noise.model)?;
    }
    match settings.noise.model {
        NoiseModel::Tempered => {
            let (fit, factors) = fit_tempered(training, columns, fit_settings)?;
            Ok(Fitted {
                fit,
                interval_factors: Some(factors),
                sampled: Vec::new(),
            })
        }
        NoiseModel::Iid | NoiseModel::Ar1 => {
            let start = start(training, columns, &settings.prior);
            let mut fit = fit(training, columns, fit_settings, &start, Moving::All, None)?;
            let mut noise = Vec::new();
            if draws_noise {
                let given = Given {
                    grams: &fit.gram,
                    columns,
                    plug_in: &fit.plug_in,
                    problem: &fit.problem,
                    posterior: &fit.posterior,
                    prior: &settings.prior,
                    noise: settings.noise,
                };
                let sampled = sample(given, &settings.inference)?;
                noise = sampled.noise;
                fit = Fit {
                    plug_in: sampled.plug_in,
                    problem: sampled.problem,
                    posterior: sampled.posterior,
                    ..fit
                };
            }
            Ok(Fitted {
                fit,
                interval_factors: None,
                sampled: noise,
            })
        }
    }
}
