//! Kinetic and potential energy of the nominal robot.

use super::Robot;
use super::spatial::{Vector, add, apply, cross, dot, multiply, scale, transpose};
use super::{Placement, spatial};

/// Kinetic energy, J: `½ q̇ᵀ M(q) q̇` with the motors' inertia.
///
/// # Panics
/// If a slice is shorter than dof.
///
/// # Example
/// Two links of 0.5 m, stretched out, turn about the shoulder at 2 rad/s: ½ (3 · 0.5² + 2 · 1²) · 2² J.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::kinetic_energy;
///
/// # let robot = two_link::arm(2.0)?;
/// let energy = kinetic_energy(&robot, &[0.0, 0.0], &[2.0, 0.0]);
/// assert!((energy - 5.5).abs() < 1e-9);
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn kinetic_energy(robot: &Robot, q: &[f64], qd: &[f64]) -> f64 {
    // Angular and linear velocity of each body's origin, in the body's frame.
    let mut velocities: Vec<(Vector, Vector)> = Vec::with_capacity(robot.bodies.len());
    let mut energy = 0.0;
    for body in &robot.bodies {
        let place = joint_placement(robot, velocities.len(), q);
        let speed = body.multiplier * qd[body.coordinate];
        let back = transpose(&place.rotation);
        let (mut w, mut v) = match body.parent {
            Some(parent) => {
                let (w, v) = velocities[parent];
                (
                    apply(&back, w),
                    apply(&back, add(v, cross(w, place.translation))),
                )
            }
            None => ([0.0; 3], [0.0; 3]),
        };
        if body.prismatic {
            v[2] += speed;
        } else {
            w[2] += speed;
        }
        velocities.push((w, v));
        // T = ½ m |v|² + v · (ω × mc) + ½ ωᵀ I ω + ½ armature q̇²
        let m = &body.moments;
        energy += 0.5 * m.mass * dot(v, v)
            + dot(v, cross(w, m.first))
            + 0.5 * dot(w, apply(&m.tensor, w));
        energy += 0.5 * body.armature * speed * speed;
    }
    energy
}

/// Potential energy, J: gravity of the moving bodies (0 with their mass at the base's origin) plus joint springs.
///
/// # Panics
/// If `q` is shorter than dof.
///
/// # Example
/// 3 kg at 0.5 m and 2 kg at 1 m above the base.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::potential_energy;
///
/// # let robot = two_link::arm(2.0)?;
/// let upright = potential_energy(&robot, &[std::f64::consts::FRAC_PI_2, 0.0]);
/// assert!((upright - 9.81 * (3.0 * 0.5 + 2.0 * 1.0)).abs() < 1e-9);
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn potential_energy(robot: &Robot, q: &[f64]) -> f64 {
    let mut places: Vec<Placement> = Vec::with_capacity(robot.bodies.len());
    let mut energy = 0.0;
    for body in &robot.bodies {
        let place = joint_placement(robot, places.len(), q);
        let place = body
            .parent
            .map_or(place, |parent| places[parent].compose(&place));
        // U = −gᵀ (m p + R mc) + ½ k (q − q_ref)²
        let m = &body.moments;
        let moment = add(
            scale(m.mass, place.translation),
            apply(&place.rotation, m.first),
        );
        let stretch = body.multiplier * q[body.coordinate] + body.offset - body.spring_reference;
        energy += 0.5 * body.stiffness * stretch * stretch - dot(robot.description.gravity, moment);
        places.push(place);
    }
    energy
}

/// The body's frame in its parent body's frame at q.
fn joint_placement(robot: &Robot, body: usize, q: &[f64]) -> Placement {
    let body = &robot.bodies[body];
    let position = body.multiplier * q[body.coordinate] + body.offset;
    if body.prismatic {
        let slide = apply(&body.rotation, [0.0, 0.0, position]);
        return Placement {
            rotation: body.rotation,
            translation: add(body.translation, slide),
        };
    }
    let turn = spatial::axis_angle([0.0, 0.0, 1.0], position);
    Placement {
        rotation: multiply(&body.rotation, &turn),
        translation: body.translation,
    }
}
