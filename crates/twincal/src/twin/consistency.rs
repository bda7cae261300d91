//! Whether a posterior and the joints it is for fit each other, before anything indexes into them.

use super::JointSetting;
use crate::error::{Error, Result};
use crate::likelihood::JointNoise;
use crate::posterior::{Model, Posterior};

/// What rounding may add to weights that sum to 1.
const WEIGHT_ROUNDING: f64 = 1e-6;

/// A posterior read from a file may have been cut or edited: nothing below may index out of range.
pub(super) fn check(posterior: &Posterior, joints: &[JointSetting<'_>]) -> Result<()> {
    let columns = posterior.inclusion.len();
    check_totals(posterior)?;
    let models = posterior.models.len();
    for (number, model) in posterior.models.iter().enumerate() {
        if !is_model_consistent(model, columns) {
            return Err(damaged(format!(
                "model {number} of {models} is not consistent"
            )));
        }
    }
    for (number, joint) in joints.iter().enumerate() {
        if !is_joint_consistent(joint, columns) {
            return Err(damaged(format!(
                "joint {number} (`{}`) is not consistent",
                joint.noise.joint
            )));
        }
    }
    Ok(())
}

fn damaged(problem: String) -> Error {
    Error::Setting {
        key: "twin".into(),
        problem,
        remedy: "the twin's file is damaged or from another version: fit again".into(),
    }
}

/// Numbers of columns, weights of all models together, and the shape of the noise.
fn check_totals(posterior: &Posterior) -> Result<()> {
    let columns = posterior.inclusion.len();
    if posterior.mean.len() != columns || posterior.sd.len() != columns {
        return Err(damaged(format!(
            "{} means for {columns} columns",
            posterior.mean.len()
        )));
    }
    if posterior
        .models
        .iter()
        .all(|model| model.weight.is_nan() || model.weight <= 0.0)
    {
        return Err(damaged(
            "the posterior holds no model with positive weight".into(),
        ));
    }
    let sum: f64 = posterior.models.iter().map(|model| model.weight).sum();
    if sum > 1.0 + WEIGHT_ROUNDING {
        return Err(damaged(format!(
            "the weights of the posterior's models add up to {sum:e}, more than 1"
        )));
    }
    if !posterior.shape.is_finite() || posterior.shape <= 0.0 {
        return Err(damaged(format!(
            "shape of the noise is {}",
            posterior.shape
        )));
    }
    Ok(())
}

/// Members are columns, and there are as many finite numbers as they need.
fn is_model_consistent(model: &Model, columns: usize) -> bool {
    let size = model.members.len();
    let ascending = model.members.windows(2).all(|pair| pair[0] < pair[1]);
    let inside = model
        .members
        .last()
        .is_none_or(|&last| (last as usize) < columns);
    let finite = model
        .mean
        .iter()
        .chain(&model.factor)
        .chain([&model.weight, &model.scale])
        .all(|v| v.is_finite())
        && model.weight >= 0.0;
    let positive = (0..size).all(|i| {
        model
            .factor
            .get(i * size + i)
            .is_some_and(|&pivot| pivot > 0.0)
    });
    let sites = model.sites.iter().all(|site| {
        let numbers = [site.lower, site.precision, site.shift];
        let directed = site
            .direction()
            .all(|(i, f)| i < size && f.is_finite() && f != 0.0);
        (site.place as usize) < size && directed && numbers.iter().all(|v| v.is_finite())
    });
    ascending
        && sites
        && inside
        && finite
        && positive
        && model.mean.len() == size
        && model.factor.len() == size * size
}

/// Its noise is in range, and its columns are columns of the posterior.
fn is_joint_consistent(joint: &JointSetting<'_>, columns: usize) -> bool {
    let JointNoise {
        weight,
        rho,
        interval_factor,
        out_of_band,
        ..
    } = *joint.noise;
    let sound = weight > 0.0 && rho.abs() < 1.0 && interval_factor > 0.0 && out_of_band >= 0.0;
    let sound = sound && joint.noise.spread.is_sound();
    let known = joint
        .columns
        .iter()
        .chain(&joint.coulomb)
        .all(|&k| k < columns);
    sound && known && joint.columns.windows(2).all(|pair| pair[0] < pair[1])
}
