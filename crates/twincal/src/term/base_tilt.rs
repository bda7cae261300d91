//! Direction of gravity: a base that is not level.

use super::Family;
use super::candidate::{Candidate, Proposal};
use super::model_column::ModelColumn;

/// How well the size of gravity is known, as a share: from the equator to the poles it differs by half a percent.
const SIZE: f64 = 0.003;
/// Cosine from which gravity is along an axis of the base.
const ALONG: f64 = 0.999;

/// `base.tilt`: gravity in the base frame is g + β; columns `.x`, `.y`, `.z`, m/s². A tilt of the base by a small angle α
/// changes gravity by 9.81 α sideways. Along an axis of the base that it points along, its size is known beforehand.
pub(super) fn proposal(gravity: [f64; 3]) -> Proposal {
    let name = "base.tilt".to_owned();
    let size = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let columns = ["x", "y", "z"]
        .into_iter()
        .enumerate()
        .map(|(axis, column)| {
            let candidate = Candidate::model(
                format!("{name}.{column}"),
                Family::Tilt,
                "m/s²",
                "error of gravity in the base frame".to_owned(),
                ModelColumn::Gravity { axis },
            );
            match size > 0.0 && gravity[axis].abs() > ALONG * size {
                true => candidate.within(SIZE * size),
                false => candidate,
            }
        })
        .collect();
    Proposal { name, columns }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_gravity_is_known_along_an_axis_alone() {
        let known = |gravity| -> Vec<Option<f64>> {
            let columns = proposal(gravity).columns.into_iter();
            columns.map(|column| column.prior_sd).collect()
        };
        assert_eq!(known([0.0, 0.0, -9.81]), [None, None, Some(SIZE * 9.81)]);
        assert_eq!(known([-9.81, 0.0, 0.0]), [Some(SIZE * 9.81), None, None]);
        assert_eq!(known([0.0, 6.0, -8.0]), [None; 3]);
        assert_eq!(known([0.0; 3]), [None; 3]);
    }
}
