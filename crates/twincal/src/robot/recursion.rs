//! The recursive Newton–Euler equations for one group of samples, on the vectors of one instruction set.
//!
//! Link frames have z along the joint axis, so a joint's turn costs four products and its torque is one component.
//! With [`pulp::Scalar`] the group is a single sample: the same lines serve both.

use super::bodies::Body;
use super::lane_vectors::{
    all_to_child, cross_add, dot, dot_add, origin, splat, to_child, to_parent, to_parent_add, turn,
    turn_back,
};
use pulp::Simd;

/// What one body needs and leaves behind, from a cache line on.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct State<F> {
    /// cos of the joint angle (1 for a slider).
    pub(crate) cos: F,
    /// sin of the joint angle (0 for a slider).
    pub(crate) sin: F,
    /// Joint position, rad or m.
    pub(crate) position: F,
    /// Joint velocity.
    pub(crate) velocity: F,
    /// Joint acceleration.
    pub(crate) acceleration: F,
    /// ω, in the body's frame.
    pub(crate) w: [F; 3],
    /// B = [ω̇]× + ω ωᵀ − |ω|² E, row-major: acceleration of a point p of the body is a + B p.
    pub(crate) b: [[F; 3]; 3],
    /// ω̇.
    pub(crate) wd: [F; 3],
    /// Classical acceleration of the origin minus gravity.
    pub(crate) a: [F; 3],
    /// Force and moment about the origin that the parent must give.
    pub(crate) force: [F; 3],
    pub(crate) moment: [F; 3],
    /// Torque or force along the joint axis, without passive terms.
    pub(crate) torque: F,
}

impl<F: Copy> State<F> {
    /// All components `zero`.
    pub(crate) fn new(zero: F) -> Self {
        let v = [zero; 3];
        Self {
            cos: zero,
            sin: zero,
            position: zero,
            velocity: zero,
            acceleration: zero,
            w: v,
            b: [v; 3],
            wd: v,
            a: v,
            force: v,
            moment: v,
            torque: zero,
        }
    }
}

/// Torque of every body's joint from positions, velocities and accelerations in `states`.
///
/// # Source
/// Luh, Walker, Paul 1980; in the form of Siciliano et al., *Robotics*, section 7.5, with B of Atkeson, An, Hollerbach
/// 1986. Checked against Pinocchio and MuJoCo (`tests/reference/robot`).
#[inline(always)]
pub(crate) fn newton_euler<S: Simd>(
    s: S,
    bodies: &[Body],
    gravity: [f64; 3],
    states: &mut [State<S::f64s>],
) {
    let states = &mut states[..bodies.len()];
    for i in 0..bodies.len() {
        let body = &bodies[i];
        let (before, rest) = states.split_at_mut(i);
        move_body(
            s,
            body,
            gravity,
            body.parent.map(|p| &before[p]),
            &mut rest[0],
        );
        load(s, body, &mut rest[0]);
    }
    for i in (0..bodies.len()).rev() {
        let body = &bodies[i];
        let (before, rest) = states.split_at_mut(i);
        backward(s, body, body.parent.map(|p| &mut before[p]), &mut rest[0]);
    }
}

/// Motion of a body from its parent's.
#[inline(always)]
pub(crate) fn move_body<S: Simd>(
    s: S,
    body: &Body,
    gravity: [f64; 3],
    parent: Option<&State<S::f64s>>,
    state: &mut State<S::f64s>,
) {
    let zero = s.splat_f64s(0.0);
    // The parent's motion at our origin, in our frame before the joint moves.
    let (mut w, mut wd, mut a) = match parent {
        Some(parent) => {
            let p = origin(s, body, state.position);
            let b = &parent.b;
            // a = a_parent + B p
            let at_origin = [
                dot_add(s, b[0], p, parent.a[0]),
                dot_add(s, b[1], p, parent.a[1]),
                dot_add(s, b[2], p, parent.a[2]),
            ];
            let [w, wd, a] = all_to_child(s, body, [parent.w, parent.wd, at_origin]);
            (w, wd, a)
        }
        // a_base = −g: gravity as an acceleration of the base upwards.
        None => (
            [zero; 3],
            [zero; 3],
            to_child(s, body, splat(s, [-gravity[0], -gravity[1], -gravity[2]])),
        ),
    };
    let (qd, qdd) = (state.velocity, state.acceleration);
    if body.prismatic {
        // a = a' + z q̈ + 2 ω × z q̇
        let twice = s.add_f64s(qd, qd);
        a[0] = s.mul_add_e_f64s(w[1], twice, a[0]);
        a[1] = s.negate_mul_add_e_f64s(w[0], twice, a[1]);
        a[2] = s.add_f64s(a[2], qdd);
    } else {
        let (c, n) = (state.cos, state.sin);
        w = turn_back(s, c, n, w);
        wd = turn_back(s, c, n, wd);
        a = turn_back(s, c, n, a);
        // ω̇ = ω̇' + z q̈ + ω' × z q̇,  ω = ω' + z q̇
        wd[0] = s.mul_add_e_f64s(w[1], qd, wd[0]);
        wd[1] = s.negate_mul_add_e_f64s(w[0], qd, wd[1]);
        wd[2] = s.add_f64s(wd[2], qdd);
        w[2] = s.add_f64s(w[2], qd);
    }
    (state.w, state.wd, state.a, state.b) = (w, wd, a, relative_acceleration(s, w, wd));
}

/// B = [ω̇]× + ω ωᵀ − |ω|² E: a point p accelerates by B p beyond the origin.
#[inline(always)]
fn relative_acceleration<S: Simd>(s: S, w: [S::f64s; 3], wd: [S::f64s; 3]) -> [[S::f64s; 3]; 3] {
    let (xx, yy, zz) = (
        s.mul_f64s(w[0], w[0]),
        s.mul_f64s(w[1], w[1]),
        s.mul_f64s(w[2], w[2]),
    );
    let (xy, xz, yz) = (
        s.mul_f64s(w[0], w[1]),
        s.mul_f64s(w[0], w[2]),
        s.mul_f64s(w[1], w[2]),
    );
    [
        [
            s.neg_f64s(s.add_f64s(yy, zz)),
            s.sub_f64s(xy, wd[2]),
            s.add_f64s(xz, wd[1]),
        ],
        [
            s.add_f64s(xy, wd[2]),
            s.neg_f64s(s.add_f64s(xx, zz)),
            s.sub_f64s(yz, wd[0]),
        ],
        [
            s.sub_f64s(xz, wd[1]),
            s.add_f64s(yz, wd[0]),
            s.neg_f64s(s.add_f64s(xx, yy)),
        ],
    ]
}

/// Force and moment that the body's own mass needs.
#[inline(always)]
fn load<S: Simd>(s: S, body: &Body, state: &mut State<S::f64s>) {
    let State { w, wd, a, b, .. } = *state;
    let m = s.splat_f64s(body.moments.mass);
    let mc = splat(s, body.moments.first);
    let [x, y, z] = body.moments.tensor;
    let tensor = [splat(s, x), splat(s, y), splat(s, z)];
    // f = m a + B mc
    state.force = [
        dot_add(s, b[0], mc, s.mul_f64s(m, a[0])),
        dot_add(s, b[1], mc, s.mul_f64s(m, a[1])),
        dot_add(s, b[2], mc, s.mul_f64s(m, a[2])),
    ];
    // n = I ω̇ + ω × I ω + mc × a
    let spin = [
        dot(s, tensor[0], w),
        dot(s, tensor[1], w),
        dot(s, tensor[2], w),
    ];
    let mut moment = [
        dot(s, tensor[0], wd),
        dot(s, tensor[1], wd),
        dot(s, tensor[2], wd),
    ];
    moment = cross_add(s, w, spin, moment);
    state.moment = cross_add(s, mc, a, moment);
}

/// Torque along the axis; force and moment go on to the parent.
#[inline(always)]
fn backward<S: Simd>(
    s: S,
    body: &Body,
    parent: Option<&mut State<S::f64s>>,
    state: &mut State<S::f64s>,
) {
    state.torque = if body.prismatic {
        state.force[2]
    } else {
        state.moment[2]
    };
    let Some(parent) = parent else { return };
    let (mut f, mut n) = (state.force, state.moment);
    if !body.prismatic {
        f = turn(s, state.cos, state.sin, f);
        n = turn(s, state.cos, state.sin, n);
    }
    let f = to_parent(s, body, f);
    let n = to_parent_add(s, body, n, parent.moment);
    // n_parent += R n + p × R f
    parent.moment = cross_add(s, origin(s, body, state.position), f, n);
    for k in 0..3 {
        parent.force[k] = s.add_f64s(parent.force[k], f[k]);
    }
}
