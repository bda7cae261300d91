//! Torque that a motion needs: one sample, batches over lanes, and the mass matrix.

use super::Robot;
use super::block::{Angles, BLOCK, Instructions};
use super::lane_vectors::{load, store};
use super::motion::Motion;
use super::recursion::{State, newton_euler};
use pulp::{Scalar, Simd};

/// Scratch memory of the one-sample algorithms for one robot; one per thread.
#[derive(Debug, Clone)]
pub struct Workspace {
    states: Vec<State<f64>>,
}

impl Workspace {
    /// Scratch memory for `robot`.
    pub fn new(robot: &Robot) -> Self {
        Self {
            states: vec![State::new(0.0); robot.bodies.len()],
        }
    }
}

/// Nominal torque of one sample, by the recursive Newton–Euler equations.
///
/// ```text
/// τ = M(q) q̈ + bias(q, q̇) + armature·q̈ + damping·q̇ + stiffness·(q − q_ref)
/// ```
/// | value | shape | unit |
/// |---|---|---|
/// | `q`, `qd`, `qdd` | dof | rad, rad/s, rad/s² (m for a slider) |
/// | `tau` (written) | dof | N·m (N for a slider) |
///
/// A joint that mimics coordinate k adds its torque times its multiplier to `tau[k]`.
///
/// # Panics
/// If a slice is shorter than dof or the workspace belongs to a robot with fewer bodies.
/// # Source
/// method section 1; `recursion.rs`.
///
/// # Example
/// Two links of 0.5 m, stretched out: 3 kg at the elbow and 2 kg at the tip are held against gravity.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::{Workspace, inverse_dynamics};
///
/// # let robot = two_link::arm(2.0)?;
/// let (mut workspace, mut tau, rest) = (Workspace::new(&robot), [0.0; 2], [0.0; 2]);
/// inverse_dynamics(&robot, &mut workspace, &[0.0, 0.0], &rest, &rest, &mut tau);
/// let (shoulder, elbow) = (9.81 * (3.0 * 0.5 + 2.0 * 1.0), 9.81 * 2.0 * 0.5);
/// assert!((tau[0] - shoulder).abs() < 1e-9 && (tau[1] - elbow).abs() < 1e-9);
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn inverse_dynamics(
    robot: &Robot,
    workspace: &mut Workspace,
    q: &[f64],
    qd: &[f64],
    qdd: &[f64],
    tau: &mut [f64],
) {
    run_one(robot, workspace, robot.description.gravity, [q, qd, qdd]);
    tau[..robot.dof()].fill(0.0);
    for (body, state) in robot.bodies.iter().zip(&workspace.states) {
        let passive = body.armature * state.acceleration
            + body.damping * state.velocity
            + body.stiffness * (state.position - body.spring_reference);
        tau[body.coordinate] += body.multiplier * (state.torque + passive);
    }
}

/// Mass matrix M(q), motor inertia included: `M[i * dof + j]`, kg·m² (kg, kg·m where sliders are involved).
///
/// By unit accelerations: column j is the torque of q̈ = e_j at rest without gravity. O(dof²).
///
/// # Panics
/// If `q` is shorter than dof or `mass` than dof².
///
/// # Example
/// Two links l of 0.5 m with point masses of 3 kg and 2 kg at their ends, elbow at a right angle: M₁₁ = 3 l² + 2 (l² + l²), M₁₂ = M₂₂ = 2 l².
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::{Workspace, mass_matrix};
///
/// # let robot = two_link::arm(2.0)?;
/// let (mut workspace, mut mass) = (Workspace::new(&robot), [0.0; 4]);
/// mass_matrix(&robot, &mut workspace, &[0.3, std::f64::consts::FRAC_PI_2], &mut mass);
/// for (found, expected) in mass.iter().zip([1.75, 0.5, 0.5, 0.5]) {
///     assert!((found - expected).abs() < 1e-9);
/// }
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn mass_matrix(robot: &Robot, workspace: &mut Workspace, q: &[f64], mass: &mut [f64]) {
    let n = robot.dof();
    let still = vec![0.0; n];
    let mut unit = vec![0.0; n];
    mass[..n * n].fill(0.0);
    for j in 0..n {
        unit[j] = 1.0;
        run_one(robot, workspace, [0.0; 3], [q, &still, &unit]);
        unit[j] = 0.0;
        for (body, state) in robot.bodies.iter().zip(&workspace.states) {
            let torque = state.torque + body.armature * state.acceleration;
            mass[body.coordinate * n + j] += body.multiplier * torque;
        }
    }
}

/// Fills the workspace's joint states from one sample and runs the recursion.
fn run_one(robot: &Robot, workspace: &mut Workspace, gravity: [f64; 3], [q, qd, qdd]: [&[f64]; 3]) {
    for (body, state) in robot.bodies.iter().zip(&mut workspace.states) {
        let k = body.coordinate;
        state.position = body.multiplier * q[k] + body.offset;
        state.velocity = body.multiplier * qd[k];
        state.acceleration = body.multiplier * qdd[k];
        (state.sin, state.cos) = if body.prismatic {
            (0.0, 1.0)
        } else {
            state.position.sin_cos()
        };
    }
    newton_euler(Scalar, &robot.bodies, gravity, &mut workspace.states);
}

/// Nominal torque of a batch: `M q̈ + bias + armature q̈ + damping q̇ + stiffness (q − q_ref)`; written to
/// `tau[joint * len + sample]`, N·m or N.
///
/// The same equations as [`inverse_dynamics`], as many samples at a time as the processor's vectors hold; a sample's
/// result does not depend on its place in the batch.
///
/// # Panics
/// If a slice is shorter than dof × len.
///
/// # Example
/// Two samples of an arm with 3 kg at its elbow and 2 kg at its tip: stretched out, and hanging down, where no torque is needed.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::{Motion, nominal_torque};
///
/// # let robot = two_link::arm(2.0)?;
/// let q = [0.0, -std::f64::consts::FRAC_PI_2, 0.0, 0.0]; // both samples of the shoulder, then of the elbow
/// let motion = Motion { len: 2, q: &q, qd: &[0.0; 4], qdd: &[0.0; 4] };
/// let mut tau = [0.0; 4];
/// nominal_torque(&robot, motion, &mut tau);
/// for (found, expected) in tau.iter().zip([9.81 * 3.5, 0.0, 9.81, 0.0]) {
///     assert!((found - expected).abs() < 1e-9);
/// }
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn nominal_torque(robot: &Robot, motion: Motion<'_>, tau: &mut [f64]) {
    nominal_torque_with(Instructions::Widest, robot, motion, tau);
}

/// [`nominal_torque`] on chosen instructions: to compare them, or to have the same bytes on different machines.
///
/// # Panics
/// As [`nominal_torque`].
pub fn nominal_torque_with(
    instructions: Instructions,
    robot: &Robot,
    motion: Motion<'_>,
    tau: &mut [f64],
) {
    let total = robot.dof() * motion.len;
    let motion = Motion {
        len: motion.len,
        q: &motion.q[..total],
        qd: &motion.qd[..total],
        qdd: &motion.qdd[..total],
    };
    instructions.dispatch(Batch {
        robot,
        motion,
        tau: &mut tau[..total],
    });
}

struct Batch<'a> {
    robot: &'a Robot,
    motion: Motion<'a>,
    tau: &'a mut [f64],
}

impl pulp::WithSimd for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let Self { robot, motion, tau } = self;
        let bodies = &robot.bodies[..];
        let mut states = vec![State::new(s.splat_f64s(0.0)); bodies.len()];
        let mut angles = Angles::new(bodies.len());
        tau.fill(0.0);
        let mut start = 0;
        while start < motion.len {
            let end = motion.len.min(start + BLOCK);
            angles.fill(s, bodies, &motion, start..end);
            let mut first = start;
            while first < end {
                let last = end.min(first + S::F64_LANES);
                for i in 0..bodies.len() {
                    let state = &mut states[i];
                    angles.joint(s, i, &bodies[i], &motion, first..last, state);
                }
                newton_euler(s, bodies, robot.description.gravity, &mut states);
                for i in 0..bodies.len() {
                    let body = &bodies[i];
                    let state = &states[i];
                    let row = body.coordinate * motion.len;
                    let cell = &mut tau[row + first..row + last];
                    let stretch = s.sub_f64s(state.position, s.splat_f64s(body.spring_reference));
                    let mut torque = state.torque;
                    torque =
                        s.mul_add_e_f64s(s.splat_f64s(body.armature), state.acceleration, torque);
                    torque = s.mul_add_e_f64s(s.splat_f64s(body.damping), state.velocity, torque);
                    torque = s.mul_add_e_f64s(s.splat_f64s(body.stiffness), stretch, torque);
                    let sum =
                        s.mul_add_e_f64s(s.splat_f64s(body.multiplier), torque, load(s, cell));
                    store(s, cell, sum);
                }
                first = last;
            }
            start = end;
        }
    }
}
