//! The mass matrix of a block of samples.

use super::Robot;
use super::block::{BlockWorkspace, Group, Registers, STRIDE, add_to, run};
use super::motion::Motion;
use super::recursion::{State, newton_euler};
use pulp::Simd;
use std::ops::Range;

/// Mass matrices M(q), motors' inertia included, written to `out[(i * dof + j) * STRIDE + s]` for the samples `samples`
/// (at most [`BLOCK`](super::BLOCK)) of the motion; only its positions are read. kg·m² (kg, kg·m with sliders).
///
/// By unit accelerations, like [`mass_matrix`](super::mass_matrix).
///
/// # Panics
/// If `out` is shorter than dof² × [`STRIDE`], or `samples` is too long or outside the motion.
pub fn mass_matrices(
    robot: &Robot,
    workspace: &mut BlockWorkspace,
    motion: Motion<'_>,
    samples: Range<usize>,
    out: &mut [f64],
) {
    let out = &mut out[..robot.dof() * robot.dof() * STRIDE];
    out.fill(0.0);
    run(robot, workspace, motion, samples, UnitAccelerations { out });
}

struct UnitAccelerations<'a> {
    out: &'a mut [f64],
}

impl Group for UnitAccelerations<'_> {
    #[inline(always)]
    fn group<S: Simd>(
        &mut self,
        s: S,
        robot: &Robot,
        states: &mut [State<S::f64s>],
        _extra: &mut Registers,
        at: Range<usize>,
    ) {
        let dof = robot.dof();
        for j in 0..dof {
            for (body, state) in robot.bodies.iter().zip(&mut *states) {
                let moved = body.coordinate == j;
                let unit = if moved { body.multiplier } else { 0.0 };
                state.velocity = s.splat_f64s(0.0);
                state.acceleration = s.splat_f64s(unit);
            }
            newton_euler(s, &robot.bodies, [0.0; 3], states);
            for (body, state) in robot.bodies.iter().zip(&*states) {
                let armature = s.splat_f64s(body.armature);
                let torque = s.mul_add_e_f64s(armature, state.acceleration, state.torque);
                let torque = s.mul_f64s(s.splat_f64s(body.multiplier), torque);
                add_to(s, self.out, body.coordinate * dof + j, &at, torque);
            }
        }
    }
}
