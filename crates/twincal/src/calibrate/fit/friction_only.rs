//! What friction alone would leave: the nominal model with viscous and Coulomb friction and an offset per joint by least squares, the first thing that
//! anybody adds to one. Errors of a model without friction say little for what else was found.

use crate::gram::JointGram;
use crate::plug_in::Fit;
use crate::posterior::{Model, Posterior};
use crate::term::{Family, Library};

/// Share of a column that the others have to leave for it to have a coefficient.
const ITS_OWN: f64 = 1e-9;

/// Least squares joint by joint over the training rows of `fit`, which the noise of other joints, slabs and bounds do not touch: only the mean
/// is of use. Columns that are no candidates are 0; `None` where no friction is a candidate.
pub(in crate::calibrate) fn fitted(library: &Library, fit: &Fit) -> Option<Posterior> {
    let family = |column: u32| library.terms()[library.columns()[column as usize]].family;
    let mut mean = vec![0.0; library.columns().len()];
    let mut any = false;
    for joint in &fit.gram.joints {
        let friction = |column| matches!(family(column), Family::Viscous | Family::Coulomb);
        any |= joint.columns.iter().any(|column| friction(*column));
        let wanted = |column: u32| friction(column) || family(column) == Family::Offset;
        for (column, value) in least_squares(joint, wanted) {
            mean[column as usize] = value;
        }
    }
    let nothing = Model {
        members: Vec::new(),
        weight: 1.0,
        scale: fit
            .posterior
            .models
            .first()
            .map_or(1.0, |model| model.scale),
        mean: Vec::new(),
        factor: Vec::new(),
        sites: Vec::new(),
    };
    any.then(|| Posterior {
        mean,
        models: vec![nothing],
        ..fit.posterior.clone()
    })
}

/// Coefficients of the wanted columns; those that depend on earlier ones stay out.
fn least_squares(joint: &JointGram, wanted: impl Fn(u32) -> bool) -> Vec<(u32, f64)> {
    let (s0, y) = (&joint.s0, joint.columns.len());
    let mut inside: Vec<usize> = Vec::new();
    // Rows of the triangle, each column scaled to one, with Xᵀy behind.
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let scale = |place: usize| s0.at(place, place).sqrt();
    for place in (0..y).filter(|place| wanted(joint.columns[*place]) && scale(*place) > 0.0) {
        let entry = |other: usize| s0.at(place, other) / (scale(place) * scale(other));
        // What is left of the column beside the earlier ones.
        let mut along: Vec<f64> = Vec::new();
        for (row, &other) in rows.iter().zip(&inside) {
            let known: f64 = along.iter().zip(row).map(|(a, b)| a * b).sum();
            along.push((entry(other) - known) / row[along.len()]);
        }
        let left = 1.0 - along.iter().map(|a| a * a).sum::<f64>();
        if left > ITS_OWN {
            along.push(left.sqrt());
            rows.push(along);
            inside.push(place);
        }
    }
    let count = inside.len();
    let mut solution: Vec<f64> = Vec::with_capacity(count);
    for (row, &place) in rows.iter().zip(&inside) {
        let known: f64 = solution.iter().zip(row).map(|(a, b)| a * b).sum();
        solution.push((s0.at(place, y) / scale(place) - known) / row[solution.len()]);
    }
    for i in (0..count).rev() {
        let later: f64 = (i + 1..count).map(|k| rows[k][i] * solution[k]).sum();
        solution[i] = (solution[i] - later) / rows[i][i];
    }
    let each = inside.iter().zip(solution);
    each.map(|(&place, value)| (joint.columns[place], value / scale(place)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gram::Symmetric;

    /// y = 2 a − 3 c, b the double of a, d not wanted: rows with random a, c, d in general position.
    #[test]
    fn dependent_columns_stay_out_and_the_others_are_least_squares() {
        let mut joint = JointGram::empty(vec![3, 4, 7, 9]);
        for [a, c, d] in [
            [1.0, 0.5, 2.0],
            [-0.3, 1.0, 0.1],
            [2.0, -1.5, 1.0],
            [0.2, 0.4, -3.0],
        ] {
            joint.s0.add_outer(&[a, 2.0 * a, c, d, 2.0 * a - 3.0 * c]);
        }
        let found = least_squares(&joint, |column| column != 9);
        let columns: Vec<u32> = found.iter().map(|(column, _)| *column).collect();
        assert_eq!(columns, [3, 7]);
        assert!((found[0].1 - 2.0).abs() < 1e-12 && (found[1].1 + 3.0).abs() < 1e-12);
        // One column alone: Σ c y / Σ c².
        let alone = least_squares(&joint, |column| column == 7);
        let (cy, cc) = (joint.s0.at(2, 4), joint.s0.at(2, 2));
        assert!((alone[0].1 - cy / cc).abs() < 1e-12);
        joint.s0 = Symmetric::zeros(5);
        assert!(least_squares(&joint, |_| true).is_empty());
    }
}
