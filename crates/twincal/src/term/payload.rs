//! A body at the tool: mass, centre of mass and inertia in a named frame.

use super::Family;
use super::candidate::{Candidate, Proposal};
use super::component::Parameter;
use super::model_column::{LinkFrame, ModelColumn};
use super::{mass_moments, tensor};
use crate::robot::{Placement, to_body_frame};

/// Name of the component.
pub(super) const NAME: &str = "payload";

/// An entry of the tensor of a mass m at a distance r in any direction, in m r²: ⅔ on average on the diagonal, about ⅓ beside it.
const TENSOR: f64 = 0.5;

/// Where a payload is mounted: the frame that it is told in, and the nominal centre of mass of the link that carries it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mount {
    pub(super) frame: LinkFrame,
    /// In that frame, m.
    pub(super) centre: [f64; 3],
}

impl Mount {
    /// Prior sds of mass, first moments and tensor of a payload with a prior sd of `mass` kg that is about `size` m large; a centre far
    /// from the frame adds to that.
    pub(super) fn widths(&self, mass: f64, size: f64) -> [f64; 3] {
        let reach = self.centre.iter().fold(size, |sum, c| sum.hypot(*c));
        [mass, mass * reach, TENSOR * mass * reach * reach]
    }
}

/// `payload`: a rigid body that the model does not have. Columns `.m`, `.mx`, `.my`, `.mz`: its mass and first moments about the
/// origin of the frame; `.ixx` … `.izz`: its tensor about the carrying link's centre of mass, axes of the frame, which is in or
/// out by itself. Without it a payload is told from the link's own mass and centre of mass by nothing but the prior; with a
/// tensor about the frame's origin, wherever that is, it would always need six numbers more than the same story told of the link.
///
/// `widths` are the prior sds of mass, first moments and tensor.
pub(super) fn proposal(mount: &Mount, widths: [f64; 3]) -> Proposal {
    let Mount { frame, centre } = mount;
    let name = NAME.to_owned();
    let shift = tensor_of_moments(*centre);
    // Mass and first moments whose tensor about the centre is zero have one about the frame's origin.
    let column = |parameter: usize| {
        let mut weights = frame.weights(parameter);
        if parameter < 4 {
            for (entry, row) in shift.iter().enumerate() {
                let own = frame.weights(4 + entry);
                let pairs = weights.iter_mut().zip(own);
                pairs.for_each(|(weight, own)| *weight += row[parameter] * own);
            }
        }
        ModelColumn::Inertia {
            body: frame.body,
            weights,
        }
    };
    let moments = mass_moments::COLUMNS.into_iter();
    let columns = moments
        .chain(tensor::COLUMNS.map(|column| (column, "kg·m²")))
        .enumerate()
        .map(|(parameter, (own, unit))| {
            let (family, prior_sd) = match parameter {
                0 => (Family::Payload, widths[0]),
                1..=3 => (Family::Payload, widths[1]),
                _ => (Family::PayloadTensor, widths[2]),
            };
            Candidate::model(
                format!("{name}.{own}"),
                family,
                unit,
                format!("payload at {}", frame.name),
                column(parameter),
            )
            .within(prior_sd)
        })
        .collect();
    Proposal { name, columns }
}

/// Tensor about the frame's origin per unit of mass and first moments where the tensor about `centre` is zero (Steiner's theorem):
///
/// ```text
/// I = (2 h·c − m c·c) E − (h cᵀ + c hᵀ − m c cᵀ),   h the first moments about the origin
/// ```
fn tensor_of_moments(centre: [f64; 3]) -> [[f64; 4]; 6] {
    // As seen from an outer frame first moments add the same, a mass the opposite of what stands above.
    let outer = to_body_frame(&Placement {
        translation: centre,
        ..Placement::IDENTITY
    });
    std::array::from_fn(|entry| {
        let row = outer[4 + entry];
        [-row[0], row[1], row[2], row[3]]
    })
}

/// Mass, centre of mass and tensor about the frame's origin.
pub(super) fn parameters(_columns: &[(String, String)]) -> Vec<Parameter> {
    let mut all = vec![Parameter::new("mass", "kg")];
    all.extend(["com_x", "com_y", "com_z"].map(|name| Parameter::new(name, "m")));
    all.extend(tensor::COLUMNS.map(|name| Parameter::new(name, "kg·m²")));
    all
}

/// `[m, mx/m, my/m, mz/m, ixx … izz]`.
pub(super) fn values(beta: &[f64], centre: [f64; 3]) -> Vec<f64> {
    let shift = tensor_of_moments(centre);
    let (moments, tensor) = beta.split_at(4);
    let mass = moments[0];
    let about_origin = tensor.iter().zip(shift).map(|(own, row)| {
        let moved = row.iter().zip(moments).map(|(a, b)| a * b).sum::<f64>();
        own + moved
    });
    let mut all = vec![mass];
    all.extend(moments[1..].iter().map(|moment| moment / mass));
    all.extend(about_origin);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three point masses: their tensors about the origin and about the centre by the definition Σ m (|r|² E − r rᵀ).
    #[test]
    fn the_tensor_about_the_origin_is_that_of_the_points() {
        let points: [(f64, [f64; 3]); 3] = [
            (0.7, [0.1, -0.2, 0.3]),
            (1.1, [-0.05, 0.15, 0.02]),
            (0.4, [0.2, 0.25, -0.1]),
        ];
        let centre = [0.03, -0.11, 0.17];
        let about = |origin: [f64; 3]| {
            let mut tensor = [0.0; 6];
            for (mass, point) in points {
                let r: [f64; 3] = std::array::from_fn(|i| point[i] - origin[i]);
                let square: f64 = r.iter().map(|x| x * x).sum();
                for (own, (i, j)) in
                    tensor
                        .iter_mut()
                        .zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)])
                {
                    *own += mass * (f64::from(u8::from(i == j)) * square - r[i] * r[j]);
                }
            }
            tensor
        };
        let mass: f64 = points.iter().map(|(m, _)| m).sum();
        let first: [f64; 3] = std::array::from_fn(|i| points.iter().map(|(m, r)| m * r[i]).sum());
        let mut beta = vec![mass];
        beta.extend(first);
        beta.extend(about(centre));
        let told = values(&beta, centre);
        let mut expected = vec![mass];
        expected.extend(first.map(|moment| moment / mass));
        expected.extend(about([0.0; 3]));
        for (own, truth) in told.iter().zip(&expected) {
            assert!((own - truth).abs() < 1e-14, "{told:?} {expected:?}");
        }
    }
}
