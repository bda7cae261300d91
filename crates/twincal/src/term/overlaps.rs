//! Which components no motion of this robot can tell from others: their torque lies in the others' span.

use super::component::Component;
use super::motions::{Motions, channels};
use super::{Family, Library};
use crate::linear_algebra::dot;
use crate::robot::Motion;

/// Part of a column's square that a span which holds it cannot miss: far above the rounding of dot products.
const PLAINLY_OUTSIDE: f64 = 1e-6;
/// A column that leaves less than this part of its length outside a span lies in it.
const TOLERANCE: f64 = 1e-9;
/// Directions shorter than this part of a column are rounding.
const ROUNDING: f64 = 1e-12;

/// Per component the names of those that can say the same: one other component whose columns span its columns at every
/// state, or levels of one link together (a payload at that link).
pub(super) fn spanning(library: &Library, joints: usize, states: &[Motions]) -> Vec<Vec<String>> {
    let columns = columns(library, joints, states);
    let components = library.components();
    let mut stories: Vec<(Vec<usize>, Vec<Vec<f64>>)> = (0..components.len())
        .map(|c| (vec![c], basis(columns[c].iter())))
        .collect();
    for levels in levels(components) {
        let all = basis(levels.iter().flat_map(|&c| &columns[c]));
        stories.push((levels, all));
    }
    (0..components.len())
        .map(|own| {
            let mut names: Vec<String> = Vec::new();
            let others = stories
                .iter()
                .filter(|(members, _)| !members.contains(&own));
            for (members, basis) in others {
                let spanned = columns[own].iter().all(|column| within(column, basis));
                if columns[own].is_empty() || !spanned {
                    continue;
                }
                for &member in members {
                    if !names.contains(&components[member].name) {
                        names.push(components[member].name.clone());
                    }
                }
            }
            names
        })
        .collect()
}

/// True if in every motion the tensor of the payload can do what some mass with first moments does: then motion says nothing of the one
/// without the other.
pub(super) fn payload_is_one(library: &Library, joints: usize, states: &[Motions]) -> bool {
    let terms = library.columns().iter().map(|&term| &library.terms()[term]);
    let payload = terms.filter(|term| term.family.is_payload());
    let families: Vec<(usize, Family)> =
        payload.map(|term| (term.component, term.family)).collect();
    let Some(&(component, _)) = families.first() else {
        return false;
    };
    let all = &columns(library, joints, states)[component];
    let of = |family: Family| {
        let pairs = all.iter().zip(&families);
        let own = pairs.filter(move |(_, (_, own))| *own == family);
        own.map(|(column, _)| column)
    };
    let rank = |columns: &mut dyn Iterator<Item = &Vec<f64>>| {
        let unit = |column: &Vec<f64>| column.iter().map(|x| x / norm(column)).collect();
        let columns: Vec<Vec<f64>> = columns.map(unit).collect();
        let mut directions: Vec<Vec<f64>> = Vec::new();
        for column in &columns {
            let rest = outside(column, &directions);
            let left = norm(&rest);
            if left > TOLERANCE {
                directions.push(rest.iter().map(|value| value / left).collect());
            }
        }
        directions.len()
    };
    let parts = [Family::Payload, Family::PayloadTensor].map(|family| rank(&mut of(family)));
    rank(&mut all.iter()) < parts[0] + parts[1]
}

/// Two and more levels (density, first moments, tensor) of the same link.
pub(crate) fn levels(components: &[Component]) -> Vec<Vec<usize>> {
    let link = |c: usize| components[c].name.rsplit_once('.').map(|(link, _)| link);
    let is_level = |c: &usize| components[*c].family.is_level();
    let all: Vec<usize> = (0..components.len()).filter(is_level).collect();
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for (place, &own) in all.iter().enumerate() {
        let before = all[..place]
            .iter()
            .filter(|&&other| link(other) == link(own));
        let pairs: Vec<Vec<usize>> = before.map(|&other| vec![other, own]).collect();
        let whole = match &pairs[..] {
            [a, b] => Some(vec![a[0], b[0], own]),
            _ => None,
        };
        sets.extend(pairs);
        sets.extend(whole);
    }
    sets
}

/// Torque of the columns of each component, `[state * joints + joint]`; components that are no number at a state have none.
fn columns(library: &Library, joints: usize, states: &[Motions]) -> Vec<Vec<Vec<f64>>> {
    let len = states.len();
    let [q, qd, qdd] = channels(states, joints);
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut out = vec![Vec::new(); joints];
    library.evaluate(motion, &mut out);
    let mut dense = vec![vec![0.0; len * joints]; library.columns().len()];
    for joint in 0..joints {
        for (row, &column) in library.columns_of_joint(joint).iter().enumerate() {
            for state in 0..len {
                dense[column][state * joints + joint] = out[joint][row * len + state];
            }
        }
    }
    let mut by_component = vec![Vec::new(); library.components().len()];
    for (column, &term) in dense.into_iter().zip(library.columns()) {
        by_component[library.terms()[term].component].push(column);
    }
    for columns in &mut by_component {
        if columns.iter().flatten().any(|value| !value.is_finite()) {
            columns.clear();
        }
    }
    by_component
}

/// Orthonormal directions of a span, by modified Gram–Schmidt, twice.
fn basis<'a>(columns: impl Iterator<Item = &'a Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let length = norm(column);
        let rest = outside(column, &basis);
        let left = norm(&rest);
        if left > ROUNDING * length {
            basis.push(rest.iter().map(|value| value / left).collect());
        }
    }
    basis
}

fn within(column: &[f64], basis: &[Vec<f64>]) -> bool {
    let square = dot(column, column);
    let along = basis.iter().map(|direction| dot(direction, column).powi(2));
    if along.sum::<f64>() < (1.0 - PLAINLY_OUTSIDE) * square {
        return false;
    }
    norm(&outside(column, basis)) < TOLERANCE * norm(column)
}

/// What of a column lies outside the span.
fn outside(column: &[f64], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut rest = column.to_vec();
    for _ in 0..2 {
        for direction in basis {
            let along = dot(direction, &rest);
            for (value, d) in rest.iter_mut().zip(direction) {
                *value -= along * d;
            }
        }
    }
    rest
}

fn norm(column: &[f64]) -> f64 {
    dot(column, column).sqrt()
}
