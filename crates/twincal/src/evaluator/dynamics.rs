//! The recursive Newton–Euler equations as steps: the lines of `robot/recursion.rs`, written down instead of computed.

use super::trace::{Id, Step, Trace};
use crate::robot::spatial::{Matrix, clean};
use crate::robot::{Body, Robot};
use crate::term::Function;

type Vector = [Id; 3];

/// Motion of one body; frame, names and formulas as in `robot/recursion.rs`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moving {
    cos: Id,
    sin: Id,
    position: Id,
    velocity: Id,
    acceleration: Id,
    w: Vector,
    wd: Vector,
    a: Vector,
    b: [Vector; 3],
    /// ω_x ω_y, ω_x ω_z, ω_y ω_z.
    products: Vector,
    /// ω_y² − ω_z², ω_z² − ω_x², ω_x² − ω_y².
    differences: Vector,
}

/// M v.
fn apply(t: &mut Trace, m: &Matrix, v: Vector) -> Vector {
    clean(m).map(|row| {
        let row = row.map(|x| t.number(x));
        t.dot(&row, &v)
    })
}

/// Mᵀ v.
fn apply_transposed(t: &mut Trace, m: &Matrix, v: Vector) -> Vector {
    apply(t, &crate::robot::spatial::transpose(m), v)
}

fn cross(t: &mut Trace, a: Vector, b: Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| {
        let left = t.multiply(a[i], b[j]);
        let right = t.multiply(a[j], b[i]);
        t.subtract(left, right)
    })
}

fn plus(t: &mut Trace, a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|k| t.add(a[k], b[k]))
}

/// Rz(q)ᵀ v.
fn turn_back(t: &mut Trace, m: &Moving, v: Vector) -> Vector {
    let [cx, sy] = [t.multiply(m.cos, v[0]), t.multiply(m.sin, v[1])];
    let [cy, sx] = [t.multiply(m.cos, v[1]), t.multiply(m.sin, v[0])];
    [t.add(cx, sy), t.subtract(cy, sx), v[2]]
}

/// Rz(q) v.
fn turn(t: &mut Trace, m: &Moving, v: Vector) -> Vector {
    let [cx, sy] = [t.multiply(m.cos, v[0]), t.multiply(m.sin, v[1])];
    let [cy, sx] = [t.multiply(m.cos, v[1]), t.multiply(m.sin, v[0])];
    [t.subtract(cx, sy), t.add(cy, sx), v[2]]
}

/// Origin of a body in its parent's frame.
fn origin(t: &mut Trace, robot: &Robot, body: usize, m: &Moving) -> Vector {
    let body = &robot.layout()[body];
    let mut p = body.translation.map(|x| t.number(x));
    if body.prismatic {
        for (k, row) in clean(&body.rotation).iter().enumerate() {
            let along = t.scale(row[2], m.position);
            p[k] = t.add(p[k], along);
        }
    }
    p
}

/// Motion of every body; `gravity` in the base frame. With `moves` false everything stands still: only gravity acts.
pub(super) fn motion(t: &mut Trace, robot: &Robot, gravity: [f64; 3], moves: bool) -> Vec<Moving> {
    let zero = t.number(0.0);
    let mut all: Vec<Moving> = Vec::new();
    for (index, body) in robot.layout().iter().enumerate() {
        let mut own = joint_state(t, body, zero, moves);
        match body.parent {
            Some(parent) => {
                let p = origin(t, robot, index, &own);
                carry(t, &body.rotation, &all[parent], p, &mut own);
            }
            None => {
                let up = gravity.map(|g| t.number(-g));
                own.a = apply_transposed(t, &body.rotation, up);
            }
        }
        if body.prismatic {
            slide(t, &mut own);
        } else {
            rotate(t, &mut own);
        }
        acceleration_gradient(t, &mut own);
        all.push(own);
    }
    all
}

/// Position, velocity and acceleration of a body's joint; all else `zero`.
fn joint_state(t: &mut Trace, body: &Body, zero: Id, moves: bool) -> Moving {
    let input = |t: &mut Trace, step: Step| {
        let input = t.step(step);
        t.scale(body.multiplier, input)
    };
    let k = body.coordinate;
    let position = input(t, Step::Position(k));
    let offset = t.number(body.offset);
    let position = t.add(position, offset);
    let [velocity, acceleration] = if moves {
        [input(t, Step::Velocity(k)), input(t, Step::Acceleration(k))]
    } else {
        [zero, zero]
    };
    let one = t.number(1.0);
    let [sin, cos] = if body.prismatic {
        [zero, one]
    } else {
        [Function::Sin, Function::Cos].map(|f| t.apply(f, position))
    };
    Moving {
        cos,
        sin,
        position,
        velocity,
        acceleration,
        w: [zero; 3],
        wd: [zero; 3],
        a: [zero; 3],
        b: [[zero; 3]; 3],
        products: [zero; 3],
        differences: [zero; 3],
    }
}

/// The parent's motion at a body's origin `p`, in the axes of the body's joint at q = 0.
fn carry(t: &mut Trace, rotation: &Matrix, parent: &Moving, p: Vector, own: &mut Moving) {
    // a = a_parent + B p
    let shift = parent.b.map(|row| t.dot(&row, &p));
    let at = plus(t, parent.a, shift);
    own.w = apply_transposed(t, rotation, parent.w);
    own.wd = apply_transposed(t, rotation, parent.wd);
    own.a = apply_transposed(t, rotation, at);
}

/// Adds the motion of a slider.
fn slide(t: &mut Trace, own: &mut Moving) {
    let (w, a) = (own.w, own.a);
    // a = a' + z q̈ + 2 ω × z q̇
    let twice = t.scale(2.0, own.velocity);
    let x = t.multiply(w[1], twice);
    let y = t.multiply(w[0], twice);
    own.a = [
        t.add(a[0], x),
        t.subtract(a[1], y),
        t.add(a[2], own.acceleration),
    ];
}

/// Adds the motion of a hinge, in the axes that turn with it.
fn rotate(t: &mut Trace, own: &mut Moving) {
    let mut w = turn_back(t, own, own.w);
    let wd = turn_back(t, own, own.wd);
    own.a = turn_back(t, own, own.a);
    let x = t.multiply(w[1], own.velocity);
    let y = t.multiply(w[0], own.velocity);
    own.wd = [
        t.add(wd[0], x),
        t.subtract(wd[1], y),
        t.add(wd[2], own.acceleration),
    ];
    w[2] = t.add(w[2], own.velocity);
    own.w = w;
}

/// B = [ω̇]× + ω ωᵀ − |ω|² E, and the products of ω in it.
fn acceleration_gradient(t: &mut Trace, own: &mut Moving) {
    let (w, wd) = (own.w, own.wd);
    let mut product = |i: usize, j: usize| t.multiply(w[i], w[j]);
    let (xx, yy, zz) = (product(0, 0), product(1, 1), product(2, 2));
    let (xy, xz, yz) = (product(0, 1), product(0, 2), product(1, 2));
    let mut minus = |a: Id, b: Id| {
        let sum = t.add(a, b);
        t.negate(sum)
    };
    let diagonal = [minus(yy, zz), minus(xx, zz), minus(xx, yy)];
    own.b = [
        [diagonal[0], t.subtract(xy, wd[2]), t.add(xz, wd[1])],
        [t.add(xy, wd[2]), diagonal[1], t.subtract(yz, wd[0])],
        [t.subtract(xz, wd[1]), t.add(yz, wd[0]), diagonal[2]],
    ];
    own.products = [xy, xz, yz];
    own.differences = [t.subtract(yy, zz), t.subtract(zz, xx), t.subtract(xx, yy)];
}

/// Force and moment about its origin.
pub(super) type Load = [Vector; 2];

/// Force and moment about the origin that a body of these ten parameters needs.
fn load(t: &mut Trace, m: &Moving, parameters: &[f64; 10]) -> Load {
    let p = parameters.map(|x| t.number(x));
    let (mass, mc) = (p[0], [p[1], p[2], p[3]]);
    let [xx, xy, xz, yy, yz, zz] = [p[4], p[5], p[6], p[7], p[8], p[9]];
    // f = m a + B mc
    let weight = m.a.map(|a| t.multiply(mass, a));
    let spin = m.b.map(|row| t.dot(&row, &mc));
    let force = plus(t, weight, spin);
    // n = I ω̇ + ω × I ω + mc × a, entry by entry of I: what each is multiplied with stands in B already, or is a difference.
    let [gap_x, gap_y, gap_z] =
        [(9, 7), (4, 9), (7, 4)].map(|(i, k)| t.number(parameters[i] - parameters[k]));
    let [b20, b01, b12] = [(2, 0), (0, 1), (1, 2)].map(|(i, k)| t.negate(m.b[i][k]));
    let moment = [
        t.dot(
            &[xx, gap_x, xy, xz, yz],
            &[m.wd[0], m.products[2], b20, m.b[1][0], m.differences[0]],
        ),
        t.dot(
            &[yy, gap_y, yz, xy, xz],
            &[m.wd[1], m.products[1], b01, m.b[2][1], m.differences[1]],
        ),
        t.dot(
            &[zz, gap_z, xz, yz, xy],
            &[m.wd[2], m.products[0], b12, m.b[0][2], m.differences[2]],
        ),
    ];
    let lever = cross(t, mc, m.a);
    [force, plus(t, moment, lever)]
}

/// What every body needs.
pub(super) fn loads(t: &mut Trace, moving: &[Moving], parameters: &[[f64; 10]]) -> Vec<Load> {
    (moving.iter().zip(parameters))
        .map(|(m, p)| load(t, m, p))
        .collect()
}

/// The sum, body by body.
pub(super) fn together(t: &mut Trace, a: &[Load], b: &[Load]) -> Vec<Load> {
    (a.iter().zip(b))
        .map(|(a, b)| [plus(t, a[0], b[0]), plus(t, a[1], b[1])])
        .collect()
}

/// Torque per coordinate that gives every body its load.
pub(super) fn torque(
    t: &mut Trace,
    robot: &Robot,
    moving: &[Moving],
    mut loads: Vec<Load>,
) -> Vec<Id> {
    let zero = t.number(0.0);
    let mut tau = vec![zero; robot.dof()];
    for (index, body) in robot.layout().iter().enumerate().rev() {
        let [f, n] = loads[index];
        let along = if body.prismatic { f[2] } else { n[2] };
        let along = t.scale(body.multiplier, along);
        tau[body.coordinate] = t.add(tau[body.coordinate], along);
        let Some(parent) = body.parent else { continue };
        let own = moving[index];
        let [mut f, mut n] = [f, n];
        if !body.prismatic {
            f = turn(t, &own, f);
            n = turn(t, &own, n);
        }
        let f = apply(t, &body.rotation, f);
        let n = apply(t, &body.rotation, n);
        let p = origin(t, robot, index, &own);
        let lever = cross(t, p, f);
        let moment = plus(t, n, lever);
        loads[parent][0] = plus(t, loads[parent][0], f);
        loads[parent][1] = plus(t, loads[parent][1], moment);
    }
    tau
}

/// Motor inertia, damping and springs of the model, per coordinate.
pub(super) fn passive(t: &mut Trace, robot: &Robot, moving: &[Moving]) -> Vec<Id> {
    let zero = t.number(0.0);
    let mut tau = vec![zero; robot.dof()];
    for (body, m) in robot.layout().iter().zip(moving) {
        let rest = t.number(body.spring_reference);
        let stretch = t.subtract(m.position, rest);
        let parts = [
            t.scale(body.armature, m.acceleration),
            t.scale(body.damping, m.velocity),
            t.scale(body.stiffness, stretch),
        ];
        for part in parts {
            let part = t.scale(body.multiplier, part);
            tau[body.coordinate] = t.add(tau[body.coordinate], part);
        }
    }
    tau
}

/// Axis and velocity of a body's origin per unit of each coordinate that moves it, in the body's frame.
pub(super) type Screw = (usize, [Vector; 2]);

/// The screws of every body, as in `robot/regressor.rs`.
pub(super) fn screws(t: &mut Trace, robot: &Robot, moving: &[Moving]) -> Vec<Vec<Screw>> {
    let zero = t.number(0.0);
    let mut all: Vec<Vec<Screw>> = Vec::new();
    for (index, body) in robot.layout().iter().enumerate() {
        let m = moving[index];
        let mut own: Vec<Screw> = Vec::new();
        if let Some(parent) = body.parent {
            let p = origin(t, robot, index, &m);
            for (coordinate, [u, v]) in all[parent].clone() {
                // u' = Rᵀ u, v' = Rᵀ (v + u × p), then the body's own joint
                let arm = cross(t, u, p);
                let v = plus(t, v, arm);
                let [mut u, mut v] = [
                    apply_transposed(t, &body.rotation, u),
                    apply_transposed(t, &body.rotation, v),
                ];
                if !body.prismatic {
                    u = turn_back(t, &m, u);
                    v = turn_back(t, &m, v);
                }
                own.push((coordinate, [u, v]));
            }
        }
        let place = own.iter().position(|(k, _)| *k == body.coordinate);
        let place = place.unwrap_or_else(|| {
            own.push((body.coordinate, [[zero; 3]; 2]));
            own.len() - 1
        });
        let unit = t.number(body.multiplier);
        let [u, v] = &mut own[place].1;
        let moved = if body.prismatic { v } else { u };
        moved[2] = t.add(moved[2], unit);
        all.push(own);
    }
    all
}

/// Torque of a body with these parameters on every coordinate that moves it: v·f + u·n.
pub(super) fn column(
    t: &mut Trace,
    moving: &Moving,
    screws: &[Screw],
    parameters: &[f64; 10],
) -> Vec<(usize, Id)> {
    let [f, n] = load(t, moving, parameters);
    let mut all = Vec::with_capacity(screws.len());
    for (coordinate, [u, v]) in screws {
        let along = t.dot(v, &f);
        let about = t.dot(u, &n);
        all.push((*coordinate, t.add(along, about)));
    }
    all
}
