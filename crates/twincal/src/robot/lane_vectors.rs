//! Vectors of three components in lanes, and a body's frame seen from its parent's: what every recursion shares.

use super::bodies::Body;
use super::spatial::Matrix;
use pulp::Simd;

/// Three components, each a group of samples.
pub(super) type V3<S> = [<S as Simd>::f64s; 3];

/// As many samples as `cells` holds, zeros behind them.
#[inline(always)]
pub(super) fn load<S: Simd>(s: S, cells: &[f64]) -> S::f64s {
    // A whole vector needs no mask, and no call.
    match S::as_simd_f64s(cells) {
        ([whole], []) => *whole,
        _ => s.partial_load_f64s(cells),
    }
}

/// As many samples as `cells` holds; behind them anything finite: one sample alone fills the vector, which costs no mask.
#[inline(always)]
pub(super) fn load_any<S: Simd>(s: S, cells: &[f64]) -> S::f64s {
    match cells {
        [one] => s.splat_f64s(*one),
        _ => load(s, cells),
    }
}

/// The first samples of `value`, as many as `cells` takes.
#[inline(always)]
pub(super) fn store<S: Simd>(s: S, cells: &mut [f64], value: S::f64s) {
    if cells.len() == S::F64_LANES {
        let (whole, _) = S::as_mut_simd_f64s(cells);
        whole[0] = value;
    } else {
        s.partial_store_f64s(cells, value);
    }
}

/// Origin of the body in the parent's frame: fixed for a hinge, `p + R z q` for a slider.
#[inline(always)]
pub(super) fn origin<S: Simd>(s: S, body: &Body, position: S::f64s) -> V3<S> {
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
pub(super) fn splat<S: Simd>(s: S, v: [f64; 3]) -> V3<S> {
    [s.splat_f64s(v[0]), s.splat_f64s(v[1]), s.splat_f64s(v[2])]
}

#[inline(always)]
pub(super) fn dot<S: Simd>(s: S, a: V3<S>, b: V3<S>) -> S::f64s {
    s.mul_add_e_f64s(
        a[2],
        b[2],
        s.mul_add_e_f64s(a[1], b[1], s.mul_f64s(a[0], b[0])),
    )
}

/// aᵀb + c.
#[inline(always)]
pub(super) fn dot_add<S: Simd>(s: S, a: V3<S>, b: V3<S>, c: S::f64s) -> S::f64s {
    s.mul_add_e_f64s(
        a[2],
        b[2],
        s.mul_add_e_f64s(a[1], b[1], s.mul_add_e_f64s(a[0], b[0], c)),
    )
}

/// a × b + c.
#[inline(always)]
pub(super) fn cross_add<S: Simd>(s: S, a: V3<S>, b: V3<S>, c: V3<S>) -> V3<S> {
    [
        s.negate_mul_add_e_f64s(a[2], b[1], s.mul_add_e_f64s(a[1], b[2], c[0])),
        s.negate_mul_add_e_f64s(a[0], b[2], s.mul_add_e_f64s(a[2], b[0], c[1])),
        s.negate_mul_add_e_f64s(a[1], b[0], s.mul_add_e_f64s(a[0], b[1], c[2])),
    ]
}

/// Rz(q)ᵀ v.
#[inline(always)]
pub(super) fn turn_back<S: Simd>(s: S, cos: S::f64s, sin: S::f64s, v: V3<S>) -> V3<S> {
    [
        s.mul_add_e_f64s(sin, v[1], s.mul_f64s(cos, v[0])),
        s.negate_mul_add_e_f64s(sin, v[0], s.mul_f64s(cos, v[1])),
        v[2],
    ]
}

/// Rz(q) v.
#[inline(always)]
pub(super) fn turn<S: Simd>(s: S, cos: S::f64s, sin: S::f64s, v: V3<S>) -> V3<S> {
    [
        s.negate_mul_add_e_f64s(sin, v[1], s.mul_f64s(cos, v[0])),
        s.mul_add_e_f64s(sin, v[0], s.mul_f64s(cos, v[1])),
        v[2],
    ]
}

/// Rᵀ v for the body's constant rotation R.
#[inline(always)]
pub(super) fn to_child<S: Simd>(s: S, body: &Body, v: V3<S>) -> V3<S> {
    let [v] = all_to_child(s, body, [v]);
    v
}

/// The same of several vectors, which asks once what kind of rotation it is.
#[inline(always)]
pub(super) fn all_to_child<S: Simd, const N: usize>(
    s: S,
    body: &Body,
    mut vectors: [V3<S>; N],
) -> [V3<S>; N] {
    let r = &body.rotation;
    if body.about_x {
        for v in &mut vectors {
            *v = [
                v[0],
                two(s, r[1][1], r[2][1], [v[1], v[2]]),
                two(s, r[1][2], r[2][2], [v[1], v[2]]),
            ];
        }
    } else {
        for v in &mut vectors {
            *v = back(s, r, *v);
        }
    }
    vectors
}

#[inline(always)]
fn back<S: Simd>(s: S, r: &Matrix, v: V3<S>) -> V3<S> {
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

/// The first product of [`dot`] left out, where it is with zero: the same bytes.
#[inline(always)]
fn two<S: Simd>(s: S, a: f64, b: f64, v: [S::f64s; 2]) -> S::f64s {
    let first = s.mul_f64s(s.splat_f64s(a), v[0]);
    s.mul_add_e_f64s(s.splat_f64s(b), v[1], first)
}

/// R v for the body's constant rotation R.
#[inline(always)]
pub(super) fn to_parent<S: Simd>(s: S, body: &Body, v: V3<S>) -> V3<S> {
    let r = &body.rotation;
    if body.about_x {
        return [
            v[0],
            two(s, r[1][1], r[1][2], [v[1], v[2]]),
            two(s, r[2][1], r[2][2], [v[1], v[2]]),
        ];
    }
    [
        dot(s, splat(s, r[0]), v),
        dot(s, splat(s, r[1]), v),
        dot(s, splat(s, r[2]), v),
    ]
}

/// R v + c for the body's constant rotation R.
#[inline(always)]
pub(super) fn to_parent_add<S: Simd>(s: S, body: &Body, v: V3<S>, c: V3<S>) -> V3<S> {
    let r = &body.rotation;
    if body.about_x {
        let y = s.mul_add_e_f64s(s.splat_f64s(r[1][1]), v[1], c[1]);
        let z = s.mul_add_e_f64s(s.splat_f64s(r[2][1]), v[1], c[2]);
        let y = s.mul_add_e_f64s(s.splat_f64s(r[1][2]), v[2], y);
        let z = s.mul_add_e_f64s(s.splat_f64s(r[2][2]), v[2], z);
        return [s.add_f64s(v[0], c[0]), y, z];
    }
    [
        dot_add(s, splat(s, r[0]), v, c[0]),
        dot_add(s, splat(s, r[1]), v, c[1]),
        dot_add(s, splat(s, r[2]), v, c[2]),
    ]
}

/// a × b.
#[inline(always)]
pub(super) fn cross<S: Simd>(s: S, a: V3<S>, b: V3<S>) -> V3<S> {
    [
        s.negate_mul_add_e_f64s(a[2], b[1], s.mul_f64s(a[1], b[2])),
        s.negate_mul_add_e_f64s(a[0], b[2], s.mul_f64s(a[2], b[0])),
        s.negate_mul_add_e_f64s(a[1], b[0], s.mul_f64s(a[0], b[1])),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{JointDescription, JointKind, LinkDescription, Robot, RobotDescription};
    use pulp::Scalar;
    use std::collections::BTreeMap;

    /// A hinge about z whose frame is turned by 0.3 rad about x.
    fn turned() -> Body {
        let (n, c) = 0.3f64.sin_cos();
        let mut joint = JointDescription::new("hinge", JointKind::Revolute, "base", "arm");
        joint.axis = [0.0, 0.0, 1.0];
        joint.placement.rotation = [[1.0, 0.0, 0.0], [0.0, c, -n], [0.0, n, c]];
        let link = |name: &str| LinkDescription {
            name: name.into(),
            inertia: None,
        };
        let description = RobotDescription {
            name: String::new(),
            gravity: [0.0, 0.0, -9.81],
            links: vec![link("base"), link("arm")],
            joints: vec![joint],
            allow_unphysical: false,
        };
        let (robot, _) = Robot::new(description, &BTreeMap::new()).unwrap();
        robot.bodies[0].clone()
    }

    #[test]
    fn a_rotation_about_x_gives_the_bytes_of_any_rotation() {
        let short = turned();
        assert!(short.about_x);
        let long = Body {
            about_x: false,
            ..short.clone()
        };
        let (v, c) = ([0.1, -2.7, 31.3], [1e-3, 0.77, -5.1]);
        assert_eq!(to_child(Scalar, &short, v), to_child(Scalar, &long, v));
        assert_eq!(to_parent(Scalar, &short, v), to_parent(Scalar, &long, v));
        let add = |body: &Body| to_parent_add(Scalar, body, v, c);
        assert_eq!(add(&short), add(&long));
        // There and back.
        let back = to_child(Scalar, &short, to_parent(Scalar, &short, v));
        assert!(back.iter().zip(v).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
