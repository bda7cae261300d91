//! What a fit says of each joint's noise.

use super::fitted::Fitted;
use crate::likelihood::{JointNoise, Spread};
use crate::robot::Robot;
use crate::statistics::{of_joint, residual_form};

/// Noise per joint as reported; σ_j = √E[φ/(w_j(1−ρ_j²)) | y].
pub(in crate::calibrate) fn noise_of(
    robot: &Robot,
    fitted: &Fitted,
    out_of_band: &[f64],
    spreads: &[Spread],
) -> Vec<JointNoise> {
    let (plug_in, posterior) = (&fitted.fit.plug_in, &fitted.fit.posterior);
    robot
        .joint_names()
        .into_iter()
        .enumerate()
        .map(|(j, name)| {
            let gram = &fitted.fit.gram.joints[j];
            let (n, rho) = (gram.n, plug_in.rho[j]);
            let left_over = residual_form(&gram.s0, &of_joint(gram, &posterior.mean));
            let left = plug_in.variance.get(j).copied().unwrap_or(1.0);
            JointNoise {
                joint: name.to_owned(),
                sigma: (left * posterior.noise / (plug_in.weight[j] * (1.0 - rho * rho))).sqrt(),
                training_rmse: (left_over.max(0.0) / n.max(1.0)).sqrt(),
                rho,
                weight: plug_in.weight[j],
                n,
                n_eff: n * plug_in.counted(j) * (1.0 - rho) / (1.0 + rho),
                autocorrelation_time: plug_in.autocorrelation_time[j],
                misfit: plug_in.misfit.get(j).copied().unwrap_or(1.0),
                interval_factor: fitted
                    .interval_factors
                    .as_ref()
                    .map_or_else(|| left.sqrt(), |factors| factors[j]),
                out_of_band: out_of_band[j],
                spread: spreads[j].clone(),
            }
        })
        .collect()
}
