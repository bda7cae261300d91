//! The energy regressor: kinetic and potential energy per inertial parameter of each body.
//!
//! The Euler–Lagrange image of a parameter's kinetic minus potential energy is its column of the joint-torque regressor.

use super::Robot;
use super::block::{BlockWorkspace, Group, Registers, STRIDE, add_to, run};
use super::bodies::Body;
use super::lane_vectors::{cross, cross_add, dot, dot_add, origin, splat, to_child, turn_back};
use super::motion::Motion;
use super::parameters::ENTRIES;
use super::recursion::State;
use pulp::Simd;
use std::ops::Range;

/// Energies per parameter, `T = Σ_bodies Σ_k kinetic[body, k] · π[body][k]` and the same for the potential of gravity
/// (0 with the mass at the base's origin), J per unit of the parameter; without motors' inertia and springs.
///
/// Written to `kinetic[(body * 10 + k) * STRIDE + s]` and `potential[…]`, parameters in the order of
/// [`PARAMETERS`](super::PARAMETERS), for the samples `samples` (at most [`BLOCK`](super::BLOCK)) of the motion; its
/// accelerations are not used.
///
/// # Panics
/// If an output is shorter than 10 × bodies × [`STRIDE`], or `samples` is too long or outside the motion.
/// # Source
/// `T = ½ m |v|² + mc·(v × ω) + ½ ωᵀ I ω`, `U = −gravity·(m p + R mc)`; Gautier, Khalil 1988.
pub fn energy_regressor(
    robot: &Robot,
    workspace: &mut BlockWorkspace,
    motion: Motion<'_>,
    samples: Range<usize>,
    kinetic: &mut [f64],
    potential: &mut [f64],
) {
    let len = 10 * robot.bodies.len() * STRIDE;
    let (kinetic, potential) = (&mut kinetic[..len], &mut potential[..len]);
    kinetic.fill(0.0);
    potential.fill(0.0);
    let kernel = Energies { kinetic, potential };
    run(robot, workspace, motion, samples, kernel);
}

struct Energies<'a> {
    kinetic: &'a mut [f64],
    potential: &'a mut [f64],
}

/// Of one body, in its frame.
#[derive(Clone, Copy)]
struct Velocity<F> {
    w: [F; 3],
    /// Of the origin.
    v: [F; 3],
    gravity: [F; 3],
    /// gravity · origin, from the base's origin.
    fall: F,
}

impl Group for Energies<'_> {
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
        let base = Velocity {
            w: [zero; 3],
            v: [zero; 3],
            gravity: splat(s, robot.description.gravity),
            fall: zero,
        };
        let bodies = &robot.bodies[..];
        let velocities = extra.slice(bodies.len(), base);
        let half = s.splat_f64s(0.5);
        for i in 0..bodies.len() {
            let (body, state) = (&bodies[i], &states[i]);
            let parent = body.parent.map_or(base, |parent| velocities[parent]);
            let own = velocity(s, body, parent, state);
            velocities[i] = own;
            let Velocity {
                w,
                v,
                gravity,
                fall,
            } = own;
            let columns = i * 10;
            let speed = s.mul_f64s(half, dot(s, v, v));
            add_to(s, self.kinetic, columns, &at, speed);
            add_to(s, self.potential, columns, &at, s.neg_f64s(fall));
            let first = cross(s, v, w);
            for k in 0..3 {
                add_to(s, self.kinetic, columns + 1 + k, &at, first[k]);
                add_to(
                    s,
                    self.potential,
                    columns + 1 + k,
                    &at,
                    s.neg_f64s(gravity[k]),
                );
            }
            for (k, (r, c)) in ENTRIES.into_iter().enumerate() {
                let product = s.mul_f64s(w[r], w[c]);
                let value = if r == c {
                    s.mul_f64s(half, product)
                } else {
                    product
                };
                add_to(s, self.kinetic, columns + 4 + k, &at, value);
            }
        }
    }
}

/// Velocity of a body from its parent's.
#[inline(always)]
fn velocity<S: Simd>(
    s: S,
    body: &Body,
    parent: Velocity<S::f64s>,
    state: &State<S::f64s>,
) -> Velocity<S::f64s> {
    let p = origin(s, body, state.position);
    let at_origin = cross_add(s, parent.w, p, parent.v);
    let mut own = Velocity {
        w: to_child(s, body, parent.w),
        v: to_child(s, body, at_origin),
        gravity: to_child(s, body, parent.gravity),
        fall: dot_add(s, parent.gravity, p, parent.fall),
    };
    if body.prismatic {
        own.v[2] = s.add_f64s(own.v[2], state.velocity);
    } else {
        own.w = turn_back(s, state.cos, state.sin, own.w);
        own.v = turn_back(s, state.cos, state.sin, own.v);
        own.gravity = turn_back(s, state.cos, state.sin, own.gravity);
        own.w[2] = s.add_f64s(own.w[2], state.velocity);
    }
    own
}
