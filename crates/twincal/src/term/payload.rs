//! A body at the tool: mass, centre of mass and inertia in a named frame.

use super::Family;
use super::candidate::{Candidate, Proposal};
use super::component::Parameter;
use super::model_column::LinkFrame;
use super::{mass_moments, tensor};

/// `payload`: columns `.m`, `.mx`, `.my`, `.mz`, `.ixx` … `.izz` in the frame of the link `frame`: a rigid body that the model
/// does not have. `mass` is the prior sd of its mass, kg, and `reach` its size in m, for the other sds.
pub(super) fn proposal(frame: &LinkFrame, mass: f64, reach: f64) -> Proposal {
    let name = "payload".to_owned();
    let moments = mass_moments::COLUMNS.into_iter();
    let columns = moments
        .chain(tensor::COLUMNS.map(|column| (column, "kg·m²")))
        .enumerate()
        .map(|(parameter, (column, unit))| {
            Candidate::model(
                format!("{name}.{column}"),
                Family::Payload,
                unit,
                format!("payload at {}", frame.name),
                frame.column(parameter),
            )
            .within(match parameter {
                0 => mass,
                1..=3 => mass * reach,
                _ => mass * reach * reach,
            })
        })
        .collect();
    Proposal { name, columns }
}

/// Mass, centre of mass and tensor about the frame's origin.
pub(super) fn parameters(_columns: &[(String, String)]) -> Vec<Parameter> {
    let mut all = vec![Parameter::new("mass", "kg")];
    all.extend(["com_x", "com_y", "com_z"].map(|name| Parameter::new(name, "m")));
    all.extend(tensor::COLUMNS.map(|name| Parameter::new(name, "kg·m²")));
    all
}

/// `[m, mx/m, my/m, mz/m, ixx … izz]`.
pub(super) fn values(beta: &[f64]) -> Vec<f64> {
    let mass = beta[0];
    beta.iter()
        .enumerate()
        .map(|(k, value)| {
            if (1..=3).contains(&k) {
                value / mass
            } else {
                *value
            }
        })
        .collect()
}
