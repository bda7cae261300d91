//! The recursive Newton–Euler equations for one group of samples, on the vectors of one instruction set.
//!
//! Link frames have z along the joint axis, so a joint's turn costs four products and its torque is one component.
//! With [`pulp::Scalar`] the group is a single sample: the same lines serve both.

use super::bodies::Body;
use pulp::Simd;

/// Three components, each a group of samples.
type V3<S> = [<S as Simd>::f64s; 3];

/// What one body needs and leaves behind.
#[derive(Debug, Clone, Copy)]
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
    w: [F; 3],
    /// B = [ω̇]× + ω ωᵀ − |ω|² E, row-major: acceleration of a point p of the body is a + B p.
    b: [[F; 3]; 3],
    /// ω̇.
    wd: [F; 3],
    /// Classical acceleration of the origin minus gravity.
    a: [F; 3],
    /// Force and moment about the origin that the parent must give.
    force: [F; 3],
    moment: [F; 3],
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
        forward(
            s,
            body,
            gravity,
            body.parent.map(|p| &before[p]),
            &mut rest[0],
        );
    }
    for i in (0..bodies.len()).rev() {
        let body = &bodies[i];
        let (before, rest) = states.split_at_mut(i);
        backward(s, body, body.parent.map(|p| &mut before[p]), &mut rest[0]);
    }
}

/// Motion of a body from its parent's, and the force and moment that its own mass needs.
#[inline(always)]
fn forward<S: Simd>(
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
            (
                to_child(s, body, parent.w),
                to_child(s, body, parent.wd),
                to_child(s, body, at_origin),
            )
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
    // B = [ω̇]× + ω ωᵀ − |ω|² E
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
    let b = [
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
    ];
    let m = s.splat_f64s(body.moments.mass);
    let mc = splat(s, body.moments.first);
    let tensor = body.moments.tensor.map(|row| splat(s, row));
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
    (state.w, state.wd, state.a, state.b) = (w, wd, a, b);
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
    let f = to_parent_add(s, body, f, [s.splat_f64s(0.0); 3]);
    let n = to_parent_add(s, body, n, parent.moment);
    // n_parent += R n + p × R f
    parent.moment = cross_add(s, origin(s, body, state.position), f, n);
    for k in 0..3 {
        parent.force[k] = s.add_f64s(parent.force[k], f[k]);
    }
}

/// Origin of the body in the parent's frame: fixed for a hinge, `p + R z q` for a slider.
#[inline(always)]
fn origin<S: Simd>(s: S, body: &Body, position: S::f64s) -> V3<S> {
    let p = splat(s, body.translation);
    if !body.prismatic {
        return p;
    }
    let r = &body.rotation;
    [
        s.mul_add_e_f64s(s.splat_f64s(r[0][2]), position, p[0]),
        s.mul_add_e_f64s(s.splat_f64s(r[1][2]), position, p[1]),
        s.mul_add_e_f64s(s.splat_f64s(r[2][2]), position, p[2]),
    ]
}

#[inline(always)]
fn splat<S: Simd>(s: S, v: [f64; 3]) -> V3<S> {
    [s.splat_f64s(v[0]), s.splat_f64s(v[1]), s.splat_f64s(v[2])]
}

#[inline(always)]
fn dot<S: Simd>(s: S, a: V3<S>, b: V3<S>) -> S::f64s {
    s.mul_add_e_f64s(
        a[2],
        b[2],
        s.mul_add_e_f64s(a[1], b[1], s.mul_f64s(a[0], b[0])),
    )
}

/// aᵀb + c.
#[inline(always)]
fn dot_add<S: Simd>(s: S, a: V3<S>, b: V3<S>, c: S::f64s) -> S::f64s {
    s.mul_add_e_f64s(
        a[2],
        b[2],
        s.mul_add_e_f64s(a[1], b[1], s.mul_add_e_f64s(a[0], b[0], c)),
    )
}

/// a × b + c.
#[inline(always)]
fn cross_add<S: Simd>(s: S, a: V3<S>, b: V3<S>, c: V3<S>) -> V3<S> {
    [
        s.negate_mul_add_e_f64s(a[2], b[1], s.mul_add_e_f64s(a[1], b[2], c[0])),
        s.negate_mul_add_e_f64s(a[0], b[2], s.mul_add_e_f64s(a[2], b[0], c[1])),
        s.negate_mul_add_e_f64s(a[1], b[0], s.mul_add_e_f64s(a[0], b[1], c[2])),
    ]
}

/// Rz(q)ᵀ v.
#[inline(always)]
fn turn_back<S: Simd>(s: S, cos: S::f64s, sin: S::f64s, v: V3<S>) -> V3<S> {
    [
        s.mul_add_e_f64s(sin, v[1], s.mul_f64s(cos, v[0])),
        s.negate_mul_add_e_f64s(sin, v[0], s.mul_f64s(cos, v[1])),
        v[2],
    ]
}

/// Rz(q) v.
#[inline(always)]
fn turn<S: Simd>(s: S, cos: S::f64s, sin: S::f64s, v: V3<S>) -> V3<S> {
    [
        s.negate_mul_add_e_f64s(sin, v[1], s.mul_f64s(cos, v[0])),
        s.mul_add_e_f64s(sin, v[0], s.mul_f64s(cos, v[1])),
        v[2],
    ]
}

/// Rᵀ v for the body's constant rotation R.
#[inline(always)]
fn to_child<S: Simd>(s: S, body: &Body, v: V3<S>) -> V3<S> {
    let r = &body.rotation;
    [
        dot(
            s,
            [
                s.splat_f64s(r[0][0]),
                s.splat_f64s(r[1][0]),
                s.splat_f64s(r[2][0]),
            ],
            v,
        ),
        dot(
            s,
            [
                s.splat_f64s(r[0][1]),
                s.splat_f64s(r[1][1]),
                s.splat_f64s(r[2][1]),
            ],
            v,
        ),
        dot(
            s,
            [
                s.splat_f64s(r[0][2]),
                s.splat_f64s(r[1][2]),
                s.splat_f64s(r[2][2]),
            ],
            v,
        ),
    ]
}

/// R v + c for the body's constant rotation R.
#[inline(always)]
fn to_parent_add<S: Simd>(s: S, body: &Body, v: V3<S>, c: V3<S>) -> V3<S> {
    let r = &body.rotation;
    [
        dot_add(s, splat(s, r[0]), v, c[0]),
        dot_add(s, splat(s, r[1]), v, c[1]),
        dot_add(s, splat(s, r[2]), v, c[2]),
    ]
}
