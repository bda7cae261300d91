//! A robot that has everything, for the tests of what walks over robots.

use crate::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Mimic, Robot, RobotDescription,
};
use std::collections::BTreeMap;

/// A tree: two arms on one turning body, sliders in both, one joint that mimics another, every link lopsided and every axis skew.
pub(crate) fn tree() -> Robot {
    use JointKind::{Prismatic, Revolute};
    let parents = [0, 1, 2, 1, 4, 5, 5];
    let kinds = [
        Revolute, Revolute, Prismatic, Prismatic, Revolute, Revolute, Revolute,
    ];
    let links = (0..=parents.len()).map(|i| {
        let x = i as f64;
        LinkDescription {
            name: format!("link{i}"),
            inertia: (i > 0).then_some(Inertia {
                mass: 1.0 + 0.3 * x,
                com: [0.2, -0.1 * x, 0.15],
                tensor: [
                    [0.04, 0.005, -0.003],
                    [0.005, 0.05, 0.004],
                    [-0.003, 0.004, 0.03 + 0.001 * x],
                ],
            }),
        }
    });
    let joints = parents
        .iter()
        .zip(kinds)
        .enumerate()
        .map(|(i, (parent, kind))| {
            let name = |k: usize| format!("link{k}");
            let mut joint =
                JointDescription::new(&format!("joint{i}"), kind, &name(*parent), &name(i + 1));
            joint.axis = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 2.0, 0.5]][i % 3];
            joint.placement.translation = [0.3, 0.1 * i as f64, -0.2];
            if i == 5 {
                joint.mimic = Some(Mimic {
                    joint: "joint1".into(),
                    multiplier: -0.7,
                    offset: 0.2,
                });
            }
            joint
        });
    let description = RobotDescription {
        name: "tree".to_owned(),
        gravity: [3.0, -2.0, -9.0],
        joints: joints.collect(),
        links: links.collect(),
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}
