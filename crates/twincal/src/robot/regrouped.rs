//! Inertial parameters with as many zeros as torque allows.
//!
//! What lies on the axis of a turning joint (its mass, first moment along z and second moment along z) moves alike whether it belongs to
//! the body or to its parent; so does the tensor of a sliding body. What is handed to the parent needs no steps of its own
//! (Khalil and Dombre, "Modeling, Identification and Control of Robots", chapter 9: regrouped parameters).

use super::spatial::clean;
use super::{Placement, Robot, to_body_frame};

/// The same torque on every joint: bodies hand to their parents what moves alike there, the outermost first; what the base gets
/// is dropped.
pub(crate) fn regrouped(robot: &Robot, mut parameters: Vec<[f64; 10]>) -> Vec<[f64; 10]> {
    for (index, body) in robot.layout().iter().enumerate().rev() {
        let own = &mut parameters[index];
        let mut given = [0.0; 10];
        if body.prismatic {
            given[4..].copy_from_slice(&own[4..]);
            own[4..].fill(0.0);
        } else {
            // A rod on the axis has Ixx = Iyy and Izz = 0.
            let rod = own[7];
            (given[0], given[3], given[4], given[7]) = (own[0], own[3], rod, rod);
            (own[0], own[3], own[4], own[7]) = (0.0, 0.0, own[4] - rod, 0.0);
        }
        let Some(parent) = body.parent else { continue };
        let map = to_body_frame(&Placement {
            rotation: clean(&body.rotation),
            translation: body.translation,
        });
        for (to, row) in parameters[parent].iter_mut().zip(&map) {
            *to += row.iter().zip(&given).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    parameters
}
