//! A changed payload as mass and centre of mass, of the coefficients of its columns.

use super::ChangeNumber;
use crate::term::{Before, Family, Library};

/// Standard deviations from which a mass has a centre; without it first moments are given.
const CLEAR: f64 = 4.0;
/// Step of a derivative, in standard deviations.
const STEP: f64 = 1e-3;

/// Mass and centre of mass in the payload frame, of the coefficients `value` of these columns and their covariance, row by row; `None` where the
/// columns are not a payload's.
pub(super) fn numbers(
    library: &Library,
    columns: &[usize],
    (value, covariance): (&[f64], &[f64]),
) -> Option<Vec<ChangeNumber>> {
    let mut components = library.components().iter();
    let index = components.position(|own| own.family == Family::Payload)?;
    let component = &library.components()[index];
    let terms = columns.iter().map(|&column| library.columns()[column]);
    let places: Option<Vec<usize>> = terms
        .map(|term| component.terms.iter().position(|own| *own == term))
        .collect();
    let places = places?;
    let at = |value: &[f64]| {
        let mut beta = vec![0.0; component.terms.len()];
        for (place, value) in places.iter().zip(value) {
            beta[*place] = *value;
        }
        library.parameter_values(index, &beta)
    };
    let all = with_errors(&at, (value, covariance));
    let parameters = library.parameters(index);
    let place = |name: &str| parameters.iter().position(|own| own.name == name);
    let is_seen = |name: &str| {
        let known = place(name).map(|own| library.before(index, own));
        known.is_some_and(|before| before != Some(Before::Hidden))
    };
    let (mass, sd) = all[place("mass")?];
    let others = match is_seen("mass") && mass.abs() > CLEAR * sd {
        true => ["com_x", "com_y", "com_z"],
        false => ["mx", "my", "mz"],
    };
    let names = std::iter::once("mass").chain(others);
    let names = names.filter(|name| is_seen(name));
    let numbers = names.filter_map(|name| {
        let place = place(name)?;
        let (value, sd) = all[place];
        Some(ChangeNumber {
            name: format!("{}.{name}", component.name),
            unit: parameters[place].unit.clone(),
            value,
            sd,
        })
    });
    Some(numbers.collect())
}

/// What `at` makes of `value`, and its standard errors to first order in that of `value`.
fn with_errors(
    at: &dyn Fn(&[f64]) -> Vec<f64>,
    (value, covariance): (&[f64], &[f64]),
) -> Vec<(f64, f64)> {
    let size = value.len();
    let slope = |k: usize| -> Vec<f64> {
        let step = STEP * covariance[k * size + k].sqrt();
        let moved = |by: f64| {
            let mut moved = value.to_vec();
            moved[k] += by;
            at(&moved)
        };
        let [up, down] = [moved(step), moved(-step)];
        let pairs = up.iter().zip(&down);
        pairs.map(|(up, down)| (up - down) / (2.0 * step)).collect()
    };
    let slopes: Vec<Vec<f64>> = (0..size).map(slope).collect();
    let variance = |parameter: usize| {
        let along = |i: usize| {
            let row = (0..size).map(|j| covariance[i * size + j] * slopes[j][parameter]);
            slopes[i][parameter] * row.sum::<f64>()
        };
        (0..size).map(along).sum::<f64>().max(0.0)
    };
    let middle = at(value).into_iter().enumerate();
    middle
        .map(|(own, value)| (value, variance(own).sqrt()))
        .collect()
}
