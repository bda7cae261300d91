//! Columns that are combined from parts are the columns that are evaluated at once.

use super::super::{Course, Family, Library, LibrarySettings, Scratch};
use crate::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Mimic, Motion, Robot, RobotDescription,
};
use std::collections::BTreeMap;

/// Three joints about x, y and z with a slider between, every link's inertia turned against its frame.
fn arm(mass: f64) -> Robot {
    let names = ["base", "one", "two", "three", "tool"];
    let kinds = [
        (JointKind::Revolute, [0.0, 0.0, 1.0]),
        (JointKind::Revolute, [0.0, 1.0, 0.0]),
        (JointKind::Prismatic, [1.0, 0.0, 0.0]),
        (JointKind::Revolute, [0.6, 0.0, 0.8]),
    ];
    let link = |k: usize| LinkDescription {
        name: names[k].into(),
        inertia: (k > 0).then_some(Inertia {
            mass: mass / k as f64,
            com: [0.2, 0.03, -0.05 * k as f64],
            tensor: [
                [0.03, 0.004, 0.0],
                [0.004, 0.035, -0.003],
                [0.0, -0.003, 0.05],
            ],
        }),
    };
    let joint = |k: usize| {
        let (kind, axis) = kinds[k];
        let mut joint = JointDescription::new(&format!("joint{k}"), kind, names[k], names[k + 1]);
        joint.axis = axis;
        joint.placement.translation = [0.3, 0.1 * k as f64, 0.2];
        joint
    };
    let description = RobotDescription {
        name: "arm".into(),
        gravity: [0.0, 0.0, -9.81],
        links: (0..5).map(link).collect(),
        joints: (0..4).map(joint).collect(),
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

fn compare(library: &Library, joints: usize) {
    let len = 70;
    let wave = |a: f64| -> Vec<f64> {
        (0..joints * len)
            .map(|i| (a * (i as f64 + 0.5)).sin() * (1.0 + 0.01 * i as f64))
            .collect()
    };
    let (q, qd, qdd) = (wave(0.37), wave(0.53), wave(0.71));
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    // Any numbers for the channels of every joint.
    let history: Vec<f64> = (0..5)
        .flat_map(|k| wave(0.29 + 0.1 * f64::from(k)))
        .collect();
    let course = Course {
        motion,
        history: &history,
    };
    let mut whole = vec![Vec::new(); joints];
    library.evaluate_with(course, &mut whole, &mut Scratch::default());
    // What stands between two signals is left alone.
    let (stride, apart) = (len + 3, 1e9);
    let counts = (0..joints).map(|joint| library.recipes(joint).parts());
    let mut parts: Vec<Vec<f64>> = counts.map(|count| vec![apart; count * stride]).collect();
    library.evaluate_parts(course, stride, &mut parts, &mut Scratch::default());
    let mut combined = Vec::new();
    for joint in 0..joints {
        let recipes = library.recipes(joint);
        assert_eq!(parts[joint].len(), recipes.parts() * stride);
        for signal in parts[joint].chunks_exact(stride) {
            assert!(signal[len..].iter().all(|x| *x == apart));
        }
        recipes.combine(&parts[joint], stride, len, &mut combined);
        assert_eq!(combined.len(), whole[joint].len());
        for (i, &column) in library.columns_of_joint(joint).iter().enumerate() {
            let expected = &whole[joint][i * len..(i + 1) * len];
            let size = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(size > 0.0, "column {column} is zero on joint {joint}");
            for (got, expected) in combined[i * len..].iter().zip(expected) {
                let off = (got - expected).abs();
                let name = &library.terms()[library.columns()[column]].name;
                assert!(off < 1e-12 * (1.0 + size), "{name} on joint {joint}: {off}");
            }
        }
    }
}

/// All families, the ones from the model included; then the same library on a robot with other masses.
#[test]
fn parts_make_up_the_columns() {
    let settings = LibrarySettings {
        families: Family::NAMED.to_vec(),
        generic: Some(false),
        coulomb_velocity: 0.02,
        ..LibrarySettings::default()
    };
    let robot = arm(4.0);
    let (library, _) = Library::propose(&robot, &settings).unwrap();
    compare(&library, 4);
    compare(&library.on(&arm(5.0)), 4);
    let without = library.without_columns(&[0, 7]);
    compare(&without, 4);
    // the point of it: fewer signals than columns
    let count = |of: &dyn Fn(usize) -> usize| (0..4).map(of).sum::<usize>();
    let (parts, columns) = (
        count(&|joint| library.recipes(joint).parts()),
        count(&|joint| library.columns_of_joint(joint).len()),
    );
    assert!(parts < columns, "{parts} parts for {columns} columns");
}

/// A joint that follows another one turns what hangs on both: what is handed from body to body on the way stays right.
#[test]
fn parts_make_up_the_columns_where_a_joint_follows_another() {
    let mut description = arm(4.0).description().clone();
    description.joints[3].mimic = Some(Mimic {
        joint: "joint1".into(),
        multiplier: -0.7,
        offset: 0.2,
    });
    let robot = Robot::new(description, &BTreeMap::new()).unwrap().0;
    let settings = LibrarySettings {
        families: vec![Family::Payload, Family::MassMoments, Family::Tensor],
        generic: Some(false),
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(&robot, &settings).unwrap();
    compare(&library, 3);
}

/// How many of a joint's columns are independent: what is left of each at random states outside the span of those before.
fn rank(library: &Library, joint: usize, joints: usize) -> usize {
    let len = 150;
    let wave = |a: f64| -> Vec<f64> {
        let at = |i: usize| a * (i as f64 + 0.5) * (1.0 + 0.003 * i as f64);
        (0..joints * len).map(|i| 2.0 * at(i).sin()).collect()
    };
    let (q, qd, qdd) = (wave(0.37), wave(0.53), wave(0.71));
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut out = vec![Vec::new(); joints];
    library.evaluate(motion, &mut out);
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for column in out[joint].chunks_exact(len) {
        let size = product(column, column).sqrt();
        let mut rest: Vec<f64> = column.iter().map(|x| x / size).collect();
        for _ in 0..2 {
            for direction in &directions {
                let part = product(&rest, direction);
                rest.iter_mut()
                    .zip(direction)
                    .for_each(|(r, d)| *r -= part * d);
            }
        }
        let left = product(&rest, &rest).sqrt();
        if left > 1e-9 {
            directions.push(rest.iter().map(|x| x / left).collect());
        }
    }
    directions.len()
}

/// A single body's ten columns are its own ten entries; those of all bodies are regrouped to as few as there are directions.
#[test]
fn a_joint_has_what_is_less() {
    let library = |families: &[Family]| {
        let settings = LibrarySettings {
            families: families.to_vec(),
            generic: Some(false),
            ..LibrarySettings::default()
        };
        let (library, _) = Library::propose(&arm(4.0), &settings).unwrap();
        compare(&library, 4);
        library
    };
    let payload = library(&[Family::Payload]);
    let of = |library: &Library| (library.recipes(0).parts(), library.recipes(0).columns());
    assert_eq!(of(&payload), (10, 10));
    let all = library(&[Family::MassMoments, Family::Tensor]);
    assert_eq!(of(&all).0, rank(&all, 0, 4), "{:?}", of(&all));
    assert!(of(&all).0 < of(&all).1, "{:?}", of(&all));
}

/// What was judged once is what would be judged again; only what turns round is another column.
#[test]
fn a_library_with_another_velocity_is_the_one_that_would_be_proposed() {
    let settings = |velocity: f64| LibrarySettings {
        terms: vec!["sin(q1)".into(), "2*sin(q1)".into()],
        families: Family::NAMED.to_vec(),
        generic: Some(true),
        coulomb_velocity: velocity,
        ..LibrarySettings::default()
    };
    let robot = arm(4.0);
    let (usual, _) = Library::propose(&robot, &settings(0.02)).unwrap();
    let (proposed, _) = Library::propose(&robot, &settings(0.08)).unwrap();
    let turned = usual.turning(&robot, &settings(0.08)).unwrap();
    assert_eq!(turned.terms(), proposed.terms());
    assert_eq!(turned.components(), proposed.components());
    assert_eq!(turned.payload_is_one(), proposed.payload_is_one());
    assert_eq!(turned.prior_sds(), proposed.prior_sds());
    let (q, qd, qdd) = (vec![0.3; 8], vec![0.03; 8], vec![1.0; 8]);
    let motion = Motion {
        len: 2,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let values = |library: &Library| {
        let mut out = vec![Vec::new(); 4];
        library.evaluate(motion, &mut out);
        out
    };
    assert_eq!(values(&turned), values(&proposed));
    let other: Vec<bool> = usual
        .columns_of_joint(0)
        .iter()
        .zip(
            values(&usual)[0]
                .chunks(2)
                .zip(values(&turned)[0].chunks(2)),
        )
        .filter(|(_, (a, b))| a != b)
        .map(|(&column, _)| usual.terms()[usual.columns()[column]].family.turns_round())
        .collect();
    assert!(
        other.len() >= 3 && other.iter().all(|turns| *turns),
        "{other:?}"
    );
}
