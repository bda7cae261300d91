//! What a fit must say of itself: chains that disagree, an iteration that did not settle, correlation that the likelihood ignores.

use crate::calibrate::fit::fitted::Fitted;
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Severity};
use crate::infer::R_HAT_LIMIT;
use crate::likelihood::NoiseModel;
use crate::plug_in::correlation_time;
use crate::posterior::Method;
use crate::robot::Robot;
use crate::statistics::Sums;

/// What the fit itself must say: residual correlation that the likelihood ignores, an iteration that did not settle.
pub(in crate::calibrate) fn findings(
    robot: &Robot,
    fitted: &Fitted,
    settings: &CalibrationSettings,
    sums: &Sums,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Method::Gibbs { chains, r_hat, .. } = fitted.fit.posterior.method
        && r_hat > R_HAT_LIMIT
    {
        findings.push(Finding::new(
            Severity::Warning,
            Code::ChainsDisagree,
            "",
            format!(
                "the {chains} chains disagree (R-hat {r_hat:.3}, limit {R_HAT_LIMIT}) and were accepted as allowed: \
                 probabilities and coefficients may change with the seed; raise inference.draws"
            ),
            chains as u64,
        )
        .with([("r_hat", r_hat), ("limit", R_HAT_LIMIT)]));
    }
    if !fitted.fit.converged {
        findings.push(Finding::new(
            Severity::Warning,
            Code::PlugInsNotSettled,
            "",
            format!(
                "noise weights or slab scale still moved after {} rounds; probabilities near 0.5 may change in the second digit",
                fitted.fit.rounds
            ),
            fitted.fit.rounds as u64,
        ));
    }
    if settings.noise.model == NoiseModel::Iid {
        for (joint, name) in robot.joint_names().into_iter().enumerate() {
            let time =
                correlation_time((sums, &fitted.fit.gram), joint, &fitted.fit.posterior.mean);
            if time > 2.0 {
                findings.push(Finding::new(
                    Severity::Warning,
                    Code::ResidualCorrelated,
                    name,
                    format!(
                        "joint `{name}`: the residual stays alike for {time:.1} rows, which noise.model = \"iid\" ignores: \
                         sds are about {:.1} times too small; use \"tempered\"",
                        time.sqrt()
                    ),
                    0,
                )
                .with([("autocorrelation_time", time), ("sd_factor", time.sqrt())]));
            }
        }
    }
    findings
}
