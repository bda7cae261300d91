//! Random robots: trees of revolute and sliding joints with physically possible inertias, springs and motors.

use proptest::prelude::*;
use std::collections::BTreeMap;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Placement, Robot, RobotDescription,
};

type Matrix = [[f64; 3]; 3];

/// Rodrigues' formula, written out here so that the test does not lean on the code under test.
fn turn(axis: [f64; 3], angle: f64) -> Matrix {
    let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|v| v / length);
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
    ]
}

/// `R diag(d) Rᵀ`.
fn tensor(rotation: Matrix, d: [f64; 3]) -> Matrix {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..3).map(|k| rotation[i][k] * d[k] * rotation[j][k]).sum())
    })
}

fn vector() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-1.0..1.0_f64)
}

fn direction() -> impl Strategy<Value = [f64; 3]> {
    vector().prop_filter("a direction", |v| {
        v.iter().map(|x| x * x).sum::<f64>() > 0.05
    })
}

/// One link and the joint that carries it.
#[derive(Debug, Clone)]
struct Piece {
    slides: bool,
    parent: prop::sample::Index,
    placement: Placement,
    axis: [f64; 3],
    inertia: Inertia,
    motor: f64,
    spring: (f64, f64),
}

fn piece() -> impl Strategy<Value = Piece> {
    // Half-widths of a box: every box has a possible inertia.
    let body = (
        0.1..3.0_f64,
        vector(),
        prop::array::uniform3(0.02..0.5_f64),
        direction(),
        -3.0..3.0_f64,
    );
    let inertia = body.prop_map(|(mass, com, [a, b, c], axis, angle)| {
        let moments =
            [b * b + c * c, a * a + c * c, a * a + b * b].map(|square| mass / 3.0 * square);
        Inertia {
            mass,
            com,
            tensor: tensor(turn(axis, angle), moments),
        }
    });
    let placement =
        (direction(), -3.0..3.0_f64, vector()).prop_map(|(axis, angle, translation)| Placement {
            rotation: turn(axis, angle),
            translation,
        });
    let passive = (0.0..0.5_f64, (0.0..2.0_f64, -1.0..1.0_f64));
    (
        prop::bool::weighted(0.3),
        any::<prop::sample::Index>(),
        placement,
        direction(),
        inertia,
        passive,
    )
        .prop_map(
            |(slides, parent, placement, axis, inertia, (motor, spring))| Piece {
                slides,
                parent,
                placement,
                axis,
                inertia,
                motor,
                spring,
            },
        )
}

/// A tree of 1 to `most` moving joints, gravity in any direction, no damping (so that it has a Lagrangian).
pub(crate) fn robot(most: usize) -> impl Strategy<Value = Robot> {
    (prop::collection::vec(piece(), 1..=most), vector()).prop_map(|(pieces, gravity)| {
        let mut links = vec![LinkDescription {
            name: "l0".into(),
            inertia: None,
        }];
        let mut joints = Vec::new();
        for (number, piece) in pieces.into_iter().enumerate() {
            let parent = piece.parent.index(links.len());
            links.push(LinkDescription {
                name: format!("l{}", number + 1),
                inertia: Some(piece.inertia),
            });
            joints.push(JointDescription {
                name: format!("j{}", number + 1),
                kind: if piece.slides {
                    JointKind::Prismatic
                } else {
                    JointKind::Continuous
                },
                parent: format!("l{parent}"),
                child: format!("l{}", number + 1),
                placement: piece.placement,
                axis: piece.axis,
                armature: piece.motor,
                stiffness: piece.spring.0,
                spring_reference: piece.spring.1,
                ..JointDescription::new("", JointKind::Continuous, "", "")
            });
        }
        let gravity = gravity.map(|g| 9.81 * g);
        let description = RobotDescription {
            name: "random".into(),
            gravity,
            links,
            joints,
            allow_unphysical: false,
        };
        Robot::new(description, &BTreeMap::new())
            .expect("a possible robot")
            .0
    })
}
