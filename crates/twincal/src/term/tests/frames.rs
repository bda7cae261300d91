//! The prior of a component's torque knows the bodies and the joints, not how a file writes them down.

use super::super::{Family, Library, LibrarySettings};
use crate::random::Random;
use crate::robot::spatial::{apply, axis_angle, norm, rotate_tensor, scale, transpose};
use crate::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Motion, Placement, Robot,
    RobotDescription,
};
use std::collections::BTreeMap;

/// Three joints whose axes are neither parallel nor meet, links of any shape, and a flange without inertia.
fn arm(random: &mut Random) -> RobotDescription {
    let mut vector = |size: f64| [0, 1, 2].map(|_| size * random.normal());
    let names = ["base", "upper", "fore", "hand", "flange"];
    let mut links = Vec::new();
    let mut joints = Vec::new();
    for (i, name) in names.into_iter().enumerate() {
        let turn = axis_angle(unit(vector(1.0)), 1.0);
        let radii = vector(0.05).map(|r| r * r + 1e-3);
        let [a, b, c] = radii;
        let diagonal = [[b + c, 0.0, 0.0], [0.0, a + c, 0.0], [0.0, 0.0, a + b]];
        let mass = 3.0 / (i.max(1) as f64);
        links.push(LinkDescription {
            name: name.into(),
            inertia: (0 < i && i < 4).then_some(Inertia {
                mass,
                com: vector(0.1),
                tensor: rotate_tensor(&turn, &diagonal).map(|row| row.map(|x| mass * x)),
            }),
        });
        if i > 0 {
            let kind = match i {
                4 => JointKind::Fixed,
                _ => JointKind::Revolute,
            };
            let mut joint = JointDescription::new(&format!("joint{i}"), kind, names[i - 1], name);
            joint.axis = unit(vector(1.0));
            joint.placement = Placement {
                rotation: axis_angle(unit(vector(1.0)), 0.7),
                translation: vector(0.2),
            };
            joints.push(joint);
        }
    }
    RobotDescription {
        name: "arm".into(),
        gravity: [0.0, 0.0, -9.81],
        links,
        joints,
        allow_unphysical: false,
    }
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    scale(1.0 / norm(v), v)
}

fn inverse(placement: &Placement) -> Placement {
    let rotation = transpose(&placement.rotation);
    Placement {
        rotation,
        translation: scale(-1.0, apply(&rotation, placement.translation)),
    }
}

fn seen_from(inertia: &Inertia, frame: &Placement) -> Inertia {
    Inertia {
        com: inverse(frame).point(inertia.com),
        tensor: rotate_tensor(&transpose(&frame.rotation), &inertia.tensor),
        ..*inertia
    }
}

/// The same arm: every link's frame turned and slid along its joint's axis, a part of every link's mass in another link that is fixed to
/// it, joints in another order.
fn rewritten(own: &RobotDescription, random: &mut Random) -> RobotDescription {
    let mut all = own.clone();
    let mut frames: BTreeMap<String, Placement> = BTreeMap::new();
    frames.insert(own.links[0].name.clone(), Placement::IDENTITY);
    for joint in &mut all.joints {
        let direction = unit([0, 1, 2].map(|_| random.normal()));
        let turned = Placement {
            rotation: axis_angle(direction, 3.0 * random.normal()),
            translation: match joint.kind {
                JointKind::Fixed => [0, 1, 2].map(|_| random.normal()),
                _ => scale(0.3 * random.normal(), joint.axis),
            },
        };
        let parent = inverse(&frames[&joint.parent]);
        joint.placement = parent.compose(&joint.placement).compose(&turned);
        joint.axis = apply(&transpose(&turned.rotation), joint.axis);
        frames.insert(joint.child.clone(), turned);
    }
    let mut parts = Vec::new();
    for link in &mut all.links {
        let Some(inertia) = &mut link.inertia else {
            continue;
        };
        *inertia = seen_from(inertia, &frames[&link.name]);
        let share = 0.2 + 0.6 * random.uniform();
        let place = Placement {
            rotation: axis_angle(unit([0, 1, 2].map(|_| random.normal())), 1.3),
            translation: [0, 1, 2].map(|_| random.normal()),
        };
        let mut part = seen_from(inertia, &place);
        part.mass *= share;
        part.tensor = part.tensor.map(|row| row.map(|x| share * x));
        inertia.mass *= 1.0 - share;
        inertia.tensor = inertia.tensor.map(|row| row.map(|x| (1.0 - share) * x));
        let name = format!("part of {}", link.name);
        let mut joint =
            JointDescription::new(&format!("to {name}"), JointKind::Fixed, &link.name, &name);
        joint.placement = place;
        all.joints.push(joint);
        parts.push(LinkDescription {
            name,
            inertia: Some(part),
        });
    }
    all.links.extend(parts);
    let count = all.joints.len();
    for i in 0..count {
        let other = (random.uniform() * count as f64) as usize;
        all.joints.swap(i, other.min(count - 1));
    }
    all
}

const JOINTS: [&str; 3] = ["joint1", "joint2", "joint3"];
const STATES: usize = 5;

/// Prior covariance of the torque on all joints at a few states, by component: Σ sd² column columnᵀ.
fn kernels(description: &RobotDescription, frame: &str) -> BTreeMap<String, Vec<f64>> {
    let robot = Robot::new(description.clone(), &BTreeMap::new()).unwrap().0;
    let settings = LibrarySettings {
        families: vec![
            Family::Payload,
            Family::Density,
            Family::MassMoments,
            Family::Tensor,
        ],
        generic: Some(false),
        payload_frame: Some(frame.into()),
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(&robot, &settings).unwrap();
    let (torque, sds) = (column_torque(&robot, &library), library.prior_sds());
    let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (column, &term) in library.columns().iter().enumerate() {
        let own = &library.terms()[term];
        let name = &library.components()[own.component].name;
        let part = own.family == Family::PayloadTensor;
        let kernel = all
            .entry(format!("{name} {part}"))
            .or_insert(vec![0.0; 9 * STATES * STATES]);
        let sd = sds[column].unwrap();
        for (i, a) in torque[column].iter().enumerate() {
            for (j, b) in torque[column].iter().enumerate() {
                kernel[i * 3 * STATES + j] += sd * sd * a * b;
            }
        }
    }
    all
}

/// Torque of every column on [`JOINTS`] at a few states, `joint * STATES + state`.
fn column_torque(robot: &Robot, library: &Library) -> Vec<Vec<f64>> {
    let place = |name: &str| {
        robot
            .joint_names()
            .iter()
            .position(|own| *own == name)
            .unwrap()
    };
    let places = JOINTS.map(place);
    let len = STATES;
    let channel = |rate: f64| {
        let mut values = vec![0.0; 3 * len];
        for (joint, &place) in places.iter().enumerate() {
            for state in 0..len {
                let phase = rate * (1.0 + joint as f64) * (0.7 + state as f64);
                values[place * len + state] = 2.0 * phase.sin();
            }
        }
        values
    };
    let (q, qd, qdd) = (channel(0.9), channel(1.7), channel(2.3));
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut out = vec![Vec::new(); 3];
    library.evaluate(motion, &mut out);
    let mut torque = vec![vec![0.0; 3 * len]; library.columns().len()];
    for (joint, &place) in places.iter().enumerate() {
        for (row, &column) in library.columns_of_joint(place).iter().enumerate() {
            let own = &out[place][row * len..(row + 1) * len];
            torque[column][joint * len..(joint + 1) * len].copy_from_slice(own);
        }
    }
    torque
}

/// Everything that a posterior knows of a component before the data is this kernel, whose entries are the same to rounding.
#[test]
fn the_prior_of_torque_does_not_depend_on_how_a_file_writes_the_robot_down() {
    for seed in 0..20 {
        let mut random = Random::new(7, seed);
        let own = arm(&mut random);
        let expected = kernels(&own, "flange");
        assert_eq!(expected.len(), 11, "{:?}", expected.keys());
        let other = rewritten(&own, &mut random);
        for (description, frame) in [(&own, "hand"), (&other, "flange"), (&other, "part of hand")] {
            let got = kernels(description, frame);
            assert!(got.keys().eq(expected.keys()), "{:?}", got.keys());
            for (name, kernel) in &expected {
                let size = kernel.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                let pairs = kernel.iter().zip(&got[name]);
                let off = pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                assert!(off < 1e-9 * size, "seed {seed}, {name}: {off} of {size}");
            }
        }
    }
}
