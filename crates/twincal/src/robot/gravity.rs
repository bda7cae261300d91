//! The gravity regressor: joint torque per unit of each component of gravity, e.g. for a base that is not level.

use super::Robot;
use super::block::{BlockWorkspace, Group, Registers, STRIDE, add_to, run};
use super::bodies::Body;
use super::lane_vectors::{origin, splat, to_child, to_parent_add, turn, turn_back};
use super::motion::Motion;
use super::recursion::State;
use pulp::Simd;
use std::ops::Range;

/// Torque of every joint per unit of gravity along x, y, z of the base frame, with the nominal bodies:
/// `τ_gravity[j] = Σ_k G[j, k](q) · gravity[k]`, N·m per m/s².
///
/// Written to `out[(joint * 3 + k) * STRIDE + s]` for the samples `samples` (at most [`BLOCK`](super::BLOCK)) of the
/// motion; only its positions are read.
///
/// # Panics
/// If `out` is shorter than 3 × dof × [`STRIDE`], or `samples` is too long or outside the motion.
/// # Source
/// The gravity part of the recursive Newton–Euler equations on composite bodies (mass and first moment of everything
/// that a joint carries): `τ = z · (mc × a)`, a = −gravity.
///
/// # Example
/// Stretched along x, 3 kg at 0.5 m and 2 kg at 1 m: gravity along y acts on the shoulder with a lever of Σ m x = 3.5 kg·m, gravity along x with none.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::{BlockWorkspace, Motion, STRIDE, gravity_regressor};
///
/// # let robot = two_link::arm(2.0)?;
/// let motion = Motion { len: 1, q: &[0.0; 2], qd: &[0.0; 2], qdd: &[0.0; 2] };
/// let mut out = vec![0.0; 2 * 3 * STRIDE];
/// gravity_regressor(&robot, &mut BlockWorkspace::new(&robot), motion, 0..1, &mut out);
/// let [x, y] = [out[0], out[STRIDE]]; // of the shoulder
/// assert!(x.abs() < 1e-9 && (y + 3.5).abs() < 1e-9); // N·m per m/s²
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn gravity_regressor(
    robot: &Robot,
    workspace: &mut BlockWorkspace,
    motion: Motion<'_>,
    samples: Range<usize>,
    out: &mut [f64],
) {
    let out = &mut out[..3 * robot.dof() * STRIDE];
    out.fill(0.0);
    run(robot, workspace, motion, samples, Gravity { out });
}

struct Gravity<'a> {
    out: &'a mut [f64],
}

/// Of one body.
#[derive(Clone, Copy)]
struct Composite<F> {
    /// The base's x, y, z in the body's frame.
    axes: [[F; 3]; 3],
    /// Mass and first moment of the body and all above it.
    mass: F,
    first: [F; 3],
}

impl Group for Gravity<'_> {
    #[inline(always)]
    fn group<S: Simd>(
        &mut self,
        s: S,
        robot: &Robot,
        states: &mut [State<S::f64s>],
        extra: &mut Registers,
        at: Range<usize>,
    ) {
        let zero = s.splat_f64s(0.0);
        let bodies = &robot.bodies[..];
        let composites = extra.slice(
            bodies.len(),
            Composite {
                axes: [[zero; 3]; 3],
                mass: zero,
                first: [zero; 3],
            },
        );
        for i in 0..bodies.len() {
            let (body, state) = (&bodies[i], &states[i]);
            let parent = body.parent.map(|parent| &composites[parent]);
            composites[i] = alone(s, body, parent, state);
        }
        for i in (0..bodies.len()).rev() {
            let (body, state) = (&bodies[i], &states[i]);
            let Composite { axes, mass, first } = composites[i];
            let scale = s.splat_f64s(-body.multiplier);
            for k in 0..3 {
                let torque = if body.prismatic {
                    s.mul_f64s(mass, axes[k][2])
                } else {
                    s.sub_f64s(
                        s.mul_f64s(first[0], axes[k][1]),
                        s.mul_f64s(first[1], axes[k][0]),
                    )
                };
                let column = body.coordinate * 3 + k;
                add_to(s, self.out, column, &at, s.mul_f64s(scale, torque));
            }
            let Some(parent) = body.parent else { continue };
            let turned = if body.prismatic {
                first
            } else {
                turn(s, state.cos, state.sin, first)
            };
            let p = origin(s, body, state.position);
            let above = &mut composites[parent];
            // m' = Σ m, mc' = Σ R mc + m p
            let moved = to_parent_add(s, body, turned, above.first);
            for k in 0..3 {
                above.first[k] = s.mul_add_e_f64s(mass, p[k], moved[k]);
            }
            above.mass = s.add_f64s(above.mass, mass);
        }
    }
}

/// A body by itself, with the base's axes turned on from its parent's.
#[inline(always)]
fn alone<S: Simd>(
    s: S,
    body: &Body,
    parent: Option<&Composite<S::f64s>>,
    state: &State<S::f64s>,
) -> Composite<S::f64s> {
    let mut axes = [[s.splat_f64s(0.0); 3]; 3];
    for k in 0..3 {
        let axis = match parent {
            Some(parent) => parent.axes[k],
            None => splat(s, super::spatial::IDENTITY[k]),
        };
        let turned = to_child(s, body, axis);
        axes[k] = if body.prismatic {
            turned
        } else {
            turn_back(s, state.cos, state.sin, turned)
        };
    }
    Composite {
        axes,
        mass: s.splat_f64s(body.moments.mass),
        first: splat(s, body.moments.first),
    }
}
