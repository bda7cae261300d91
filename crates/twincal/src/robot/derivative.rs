//! What the nominal torque does when one joint's position is off: ∂τ/∂q_j, e.g. of an encoder's zero offset.

use super::Robot;
use super::block::{BlockWorkspace, Group, Registers, STRIDE, add_to, run};
use super::bodies::Body;
use super::lane_vectors::{
    V3, cross_add, dot, dot_add, origin, splat, to_child, to_parent, to_parent_add, turn, turn_back,
};
use super::motion::Motion;
use super::recursion::{State, newton_euler};
use pulp::Simd;
use std::ops::Range;

/// `∂τ_nominal/∂q_j` of every joint for one coordinate j, exact: N·m/rad (N·m/m, N/rad, N/m where sliders are
/// involved); the stiffness of springs in the model counts.
///
/// Written to `out[joint * STRIDE + s]` for the samples `samples` (at most [`BLOCK`](super::BLOCK)) of the motion.
///
/// # Panics
/// If there is no coordinate `coordinate`, `out` is shorter than dof × [`STRIDE`], or `samples` is too long or outside
/// the motion.
/// # Source
/// The recursive Newton–Euler equations (`recursion.rs`) differentiated line by line, as in Carpentier, Mansard 2018:
/// `d(Rz(q)ᵀ x)/dq = −z × Rz(q)ᵀ x` on the way out, `d(Rz(q) f)/dq = z × Rz(q) f` on the way back.
pub fn position_derivative(
    robot: &Robot,
    workspace: &mut BlockWorkspace,
    coordinate: usize,
    motion: Motion<'_>,
    samples: Range<usize>,
    out: &mut [f64],
) {
    assert!(coordinate < robot.dof(), "{} coordinates", robot.dof());
    let out = &mut out[..robot.dof() * STRIDE];
    out.fill(0.0);
    let kernel = PositionDerivative { coordinate, out };
    run(robot, workspace, motion, samples, kernel);
}

struct PositionDerivative<'a> {
    coordinate: usize,
    out: &'a mut [f64],
}

/// Derivatives of what [`State`] holds.
#[derive(Clone, Copy)]
struct Tangent<F> {
    /// The coordinate moves this body.
    moved: bool,
    w: [F; 3],
    wd: [F; 3],
    a: [F; 3],
    /// Of B.
    b: [[F; 3]; 3],
    force: [F; 3],
    moment: [F; 3],
}

impl<F: Copy> Tangent<F> {
    fn new(zero: F) -> Self {
        let v = [zero; 3];
        Self {
            moved: false,
            w: v,
            wd: v,
            a: v,
            b: [v; 3],
            force: v,
            moment: v,
        }
    }
}

impl Group for PositionDerivative<'_> {
    #[inline(always)]
    fn group<S: Simd>(
        &mut self,
        s: S,
        robot: &Robot,
        states: &mut [State<S::f64s>],
        extra: &mut Registers,
        at: Range<usize>,
    ) {
        let zero = Tangent::new(s.splat_f64s(0.0));
        let bodies = &robot.bodies[..];
        newton_euler(s, bodies, robot.description.gravity, states);
        let tangents = extra.slice(bodies.len(), zero);
        for i in 0..bodies.len() {
            let body = &bodies[i];
            let seed = self.seed(body);
            let (before, rest) = tangents.split_at_mut(i);
            let above = body.parent.map_or(&zero, |parent| &before[parent]);
            let tangent = &mut rest[0];
            *tangent = zero;
            tangent.moved = above.moved || seed != 0.0;
            if tangent.moved {
                let parent_b = body.parent.map(|parent| states[parent].b);
                forward(s, body, seed, above, parent_b, &states[i], tangent);
            }
        }
        for i in (0..bodies.len()).rev() {
            let body = &bodies[i];
            let seed = self.seed(body);
            let (before, rest) = tangents.split_at_mut(i);
            let tangent = &rest[0];
            let torque = if body.prismatic {
                tangent.force[2]
            } else {
                tangent.moment[2]
            };
            let spring = s.splat_f64s(body.stiffness * seed);
            let torque = s.mul_f64s(s.splat_f64s(body.multiplier), s.add_f64s(torque, spring));
            add_to(s, self.out, body.coordinate, &at, torque);
            if let Some(parent) = body.parent {
                backward(s, body, seed, &states[i], tangent, &mut before[parent]);
            }
        }
    }
}

impl PositionDerivative<'_> {
    /// Motion of the body's joint per unit of the coordinate.
    #[inline(always)]
    fn seed(&self, body: &Body) -> f64 {
        if body.coordinate == self.coordinate {
            body.multiplier
        } else {
            0.0
        }
    }
}

/// M v + c.
#[inline(always)]
fn matrix_add<S: Simd>(s: S, m: &[V3<S>; 3], v: V3<S>, c: V3<S>) -> V3<S> {
    [
        dot_add(s, m[0], v, c[0]),
        dot_add(s, m[1], v, c[1]),
        dot_add(s, m[2], v, c[2]),
    ]
}

/// −z × v per unit of the seed: how a vector seen from a turning frame changes.
#[inline(always)]
fn seen_from_turning<S: Simd>(s: S, seed: S::f64s, v: V3<S>, change: V3<S>) -> V3<S> {
    [
        s.mul_add_e_f64s(seed, v[1], change[0]),
        s.negate_mul_add_e_f64s(seed, v[0], change[1]),
        change[2],
    ]
}

/// z × v per unit of the seed: how a vector of a turning frame changes.
#[inline(always)]
fn of_turning<S: Simd>(s: S, seed: S::f64s, v: V3<S>, change: V3<S>) -> V3<S> {
    [
        s.negate_mul_add_e_f64s(seed, v[1], change[0]),
        s.mul_add_e_f64s(seed, v[0], change[1]),
        change[2],
    ]
}

/// How the origin in the parent's frame changes.
#[inline(always)]
fn slide<S: Simd>(s: S, body: &Body, seed: f64) -> V3<S> {
    let seed = if body.prismatic { seed } else { 0.0 };
    let r = &body.rotation;
    splat(s, [seed * r[0][2], seed * r[1][2], seed * r[2][2]])
}

/// Derivatives of a body's motion and load.
#[inline(always)]
fn forward<S: Simd>(
    s: S,
    body: &Body,
    seed: f64,
    above: &Tangent<S::f64s>,
    parent_b: Option<[V3<S>; 3]>,
    state: &State<S::f64s>,
    tangent: &mut Tangent<S::f64s>,
) {
    let p = origin(s, body, state.position);
    let mut at_origin = matrix_add(s, &above.b, p, above.a);
    if let Some(b) = parent_b {
        let dp = slide(s, body, seed);
        at_origin = matrix_add(s, &b, dp, at_origin);
    }
    let mut w = to_child(s, body, above.w);
    let mut wd = to_child(s, body, above.wd);
    let mut a = to_child(s, body, at_origin);
    let qd = state.velocity;
    if body.prismatic {
        let twice = s.add_f64s(qd, qd);
        a[0] = s.mul_add_e_f64s(w[1], twice, a[0]);
        a[1] = s.negate_mul_add_e_f64s(w[0], twice, a[1]);
    } else {
        let (c, n, seed) = (state.cos, state.sin, s.splat_f64s(seed));
        // ω̇ before the joint's own part, ω × z q̇, was added
        let before = [
            s.negate_mul_add_e_f64s(state.w[1], qd, state.wd[0]),
            s.mul_add_e_f64s(state.w[0], qd, state.wd[1]),
            state.wd[2],
        ];
        w = seen_from_turning(s, seed, state.w, turn_back(s, c, n, w));
        wd = seen_from_turning(s, seed, before, turn_back(s, c, n, wd));
        a = seen_from_turning(s, seed, state.a, turn_back(s, c, n, a));
        wd[0] = s.mul_add_e_f64s(w[1], qd, wd[0]);
        wd[1] = s.negate_mul_add_e_f64s(w[0], qd, wd[1]);
    }
    let b = relative_acceleration(s, state.w, w, wd);
    let m = s.splat_f64s(body.moments.mass);
    let mc = splat(s, body.moments.first);
    let [x, y, z] = body.moments.tensor;
    let tensor = [splat(s, x), splat(s, y), splat(s, z)];
    let none = [s.splat_f64s(0.0); 3];
    let spin = matrix_add(s, &tensor, state.w, none);
    let change = matrix_add(s, &tensor, w, none);
    let moment = matrix_add(s, &tensor, wd, none);
    let moment = cross_add(s, w, spin, moment);
    let moment = cross_add(s, state.w, change, moment);
    tangent.moment = cross_add(s, mc, a, moment);
    let inert = [
        s.mul_f64s(m, a[0]),
        s.mul_f64s(m, a[1]),
        s.mul_f64s(m, a[2]),
    ];
    tangent.force = matrix_add(s, &b, mc, inert);
    (tangent.w, tangent.wd, tangent.a, tangent.b) = (w, wd, a, b);
}

/// dB = [dω̇]× + dω ωᵀ + ω dωᵀ − 2 (ω·dω) E, of dω and dω̇.
#[inline(always)]
fn relative_acceleration<S: Simd>(s: S, spin: V3<S>, w: V3<S>, wd: V3<S>) -> [V3<S>; 3] {
    let along = dot(s, spin, w);
    let twice = s.add_f64s(along, along);
    let mut b = [[s.splat_f64s(0.0); 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            b[i][j] = s.mul_add_e_f64s(w[i], spin[j], s.mul_f64s(spin[i], w[j]));
        }
        b[i][i] = s.sub_f64s(b[i][i], twice);
    }
    for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        b[i][j] = s.sub_f64s(b[i][j], wd[k]);
        b[j][i] = s.add_f64s(b[j][i], wd[k]);
    }
    b
}

/// Derivatives of what a body gives to its parent; `state` holds the whole force and moment.
#[inline(always)]
fn backward<S: Simd>(
    s: S,
    body: &Body,
    seed: f64,
    state: &State<S::f64s>,
    tangent: &Tangent<S::f64s>,
    above: &mut Tangent<S::f64s>,
) {
    let (mut f, mut df, mut dn) = (state.force, tangent.force, tangent.moment);
    if !body.prismatic {
        let (c, n, turning) = (state.cos, state.sin, s.splat_f64s(seed));
        f = turn(s, c, n, f);
        df = of_turning(s, turning, f, turn(s, c, n, df));
        dn = of_turning(s, turning, turn(s, c, n, state.moment), turn(s, c, n, dn));
    }
    let df = to_parent(s, body, df);
    let dn = to_parent_add(s, body, dn, above.moment);
    // d(p × f) = p × df + dp × f
    let dn = cross_add(s, origin(s, body, state.position), df, dn);
    let f = to_parent(s, body, f);
    above.moment = cross_add(s, slide(s, body, seed), f, dn);
    for k in 0..3 {
        above.force[k] = s.add_f64s(above.force[k], df[k]);
    }
}
