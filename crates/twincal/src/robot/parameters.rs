//! The ten inertial parameters of a rigid body: their order, and how they change with the frame.
//!
//! ```text
//! π = [m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]
//! ```
//! with c the centre of mass and I the inertia about the ORIGIN of the frame, axes parallel to the frame. In these,
//! inertias simply add and the torque of a robot is linear.
//!
//! - URDF and MJCF give mass, centre of mass and the tensor about the centre of mass: [`body_parameters`] and
//!   [`inertia_of`] convert, `I = I_com + m (|c|² E − c cᵀ)`.
//! - Pinocchio's `toDynamicParameters` is `[m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]`, also about the origin:
//!   `pinocchio[k] = π[PINOCCHIO_ORDER[k]]`.

use super::inertia::Moments;
use super::spatial::{Matrix, Vector, apply, dot, rotate_tensor, scale};
use super::{Inertia, Placement, Robot};

/// Names of the parameters, in their order.
pub const PARAMETERS: [&str; 10] = [
    "m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz",
];

/// Where Pinocchio's k-th dynamic parameter stands among [`PARAMETERS`], and the other way round.
pub const PINOCCHIO_ORDER: [usize; 10] = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9];

/// Row and column of the six entries of a tensor, in the order of [`PARAMETERS`].
pub(super) const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Parameters about the origin of the outer frame, of an inertia whose frame sits at `placement` in it.
///
/// # Source
/// Parallel axes (Steiner), as in [`Inertia`]'s documentation.
///
/// # Example
/// 2 kg at 0.5 m along x: the first moment is m c, the moments about y and z grow by m c² (Steiner).
/// ```
/// use twincal::robot::{Inertia, Placement, body_parameters, inertia_of};
///
/// let link = Inertia { mass: 2.0, com: [0.5, 0.0, 0.0], tensor: [[0.25, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]] };
/// let parameters = body_parameters(&link, &Placement::IDENTITY);
/// assert_eq!(parameters, [2.0, 1.0, 0.0, 0.0, 0.25, 0.0, 0.0, 1.0, 0.0, 1.0]);
/// assert_eq!(inertia_of(&parameters), Some(link));
/// ```
pub fn body_parameters(inertia: &Inertia, placement: &Placement) -> [f64; 10] {
    flatten(&Moments::placed(inertia, placement))
}

fn flatten(moments: &Moments) -> [f64; 10] {
    let mut parameters = [0.0; 10];
    parameters[0] = moments.mass;
    parameters[1..4].copy_from_slice(&moments.first);
    for (k, (i, j)) in ENTRIES.into_iter().enumerate() {
        parameters[4 + k] = moments.tensor[i][j];
    }
    parameters
}

/// The inertia as a model file states it: centre of mass, and the tensor about it. `None` where the mass is not
/// positive: there is no centre of mass then.
pub fn inertia_of(parameters: &[f64; 10]) -> Option<Inertia> {
    let mass = parameters[0];
    if mass <= 0.0 || mass.is_nan() {
        return None;
    }
    let com = [1, 2, 3].map(|k| parameters[k] / mass);
    let mut tensor: Matrix = [[0.0; 3]; 3];
    for (k, (i, j)) in ENTRIES.into_iter().enumerate() {
        let square = if i == j { dot(com, com) } else { 0.0 };
        tensor[i][j] = parameters[4 + k] - mass * (square - com[i] * com[j]);
        tensor[j][i] = tensor[i][j];
    }
    Some(Inertia { mass, com, tensor })
}

/// The constant matrix A that turns parameters about the origin of a frame at `placement` into parameters about the
/// origin of the outer frame: `π_outer = A π_inner`.
///
/// The columns of a regressor change the other way: a column for inner parameter k is `Σ_i Y_outer[i] · A[i][k]`.
///
/// # Source
/// `m' = m`, `mc' = R mc + m p`,
/// `I' = R I Rᵀ + 2 (p·R mc) E − p (R mc)ᵀ − (R mc) pᵀ + m (|p|² E − p pᵀ)`.
pub fn to_body_frame(placement: &Placement) -> [[f64; 10]; 10] {
    let Placement {
        rotation,
        translation: p,
    } = placement;
    let mut map = [[0.0; 10]; 10];
    for k in 0..10 {
        let mut unit = [0.0; 10];
        unit[k] = 1.0;
        let mass = unit[0];
        let first: Vector = apply(rotation, [unit[1], unit[2], unit[3]]);
        let mut inner: Matrix = [[0.0; 3]; 3];
        for (e, (i, j)) in ENTRIES.into_iter().enumerate() {
            (inner[i][j], inner[j][i]) = (unit[4 + e], unit[4 + e]);
        }
        let tensor = rotate_tensor(rotation, &inner);
        let shifted = super::spatial::add(first, scale(mass, *p));
        let trace = 2.0 * dot(*p, first) + mass * dot(*p, *p);
        let mut column = [0.0; 10];
        column[0] = mass;
        column[1..4].copy_from_slice(&shifted);
        for (e, (i, j)) in ENTRIES.into_iter().enumerate() {
            let diagonal = if i == j { trace } else { 0.0 };
            column[4 + e] =
                tensor[i][j] + diagonal - p[i] * first[j] - first[i] * p[j] - mass * p[i] * p[j];
        }
        for (row, value) in map.iter_mut().zip(column) {
            row[k] = value;
        }
    }
    map
}

impl Robot {
    /// Names of the moving bodies, parents first: of each the child link of its moving joint. Links that are fixed
    /// to it (or joined by a locked joint) are merged into it, see [`Robot::links_of_body`].
    pub fn bodies(&self) -> Vec<&str> {
        self.bodies
            .iter()
            .map(|body| self.description.links[body.link].name.as_str())
            .collect()
    }

    /// How a body moves against its parent: coordinate (0-based), multiplier and offset of `position = multiplier · q +
    /// offset`; multiplier 1 and offset 0 unless its joint mimics. Several bodies may share a coordinate.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn motion_of_body(&self, body: usize) -> (usize, f64, f64) {
        let body = &self.bodies[body];
        (body.coordinate, body.multiplier, body.offset)
    }

    /// Names of the links that move rigidly as one body, in the model's order.
    pub fn links_of_body(&self, body: usize) -> Vec<&str> {
        let links = self.description.links.iter().zip(&self.homes);
        links
            .filter(|(_, (home, _))| *home == Some(body))
            .map(|(link, _)| link.name.as_str())
            .collect()
    }

    /// The body that a link belongs to, and the link's frame in the body's frame (z along the joint's axis). `None`
    /// for a link that does not exist or does not move.
    pub fn body_of_link(&self, link: &str) -> Option<(usize, Placement)> {
        let index = self.description.links.iter().position(|l| l.name == link)?;
        let (body, placement) = self.homes[index];
        body.map(|body| (body, placement))
    }

    /// Nominal parameters of a body with everything merged into it, in the body's frame.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn parameters_of_body(&self, body: usize) -> [f64; 10] {
        flatten(&self.bodies[body].moments)
    }
}

#[cfg(test)]
mod tests {
    use super::super::spatial::axis_angle;
    use super::*;

    #[test]
    fn the_map_is_what_moving_a_real_inertia_gives() {
        let inertia = Inertia {
            mass: 1.7,
            com: [0.1, -0.2, 0.05],
            tensor: [[0.3, 0.01, -0.02], [0.01, 0.25, 0.03], [-0.02, 0.03, 0.2]],
        };
        let placement = Placement {
            rotation: axis_angle([0.6, 0.0, 0.8], 1.1),
            translation: [0.4, -0.7, 0.2],
        };
        let inner = body_parameters(&inertia, &Placement::IDENTITY);
        let outer = body_parameters(&inertia, &placement);
        let map = to_body_frame(&placement);
        for i in 0..10 {
            let moved: f64 = (0..10).map(|k| map[i][k] * inner[k]).sum();
            assert!((moved - outer[i]).abs() < 1e-15, "{moved} {}", outer[i]);
        }
        let back = inertia_of(&inner).unwrap();
        for i in 0..3 {
            assert!((back.com[i] - inertia.com[i]).abs() < 1e-15);
            for j in 0..3 {
                assert!((back.tensor[i][j] - inertia.tensor[i][j]).abs() < 1e-15);
            }
        }
        assert_eq!(inertia_of(&[0.0; 10]), None);
    }
}
