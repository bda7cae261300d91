//! A planar arm of two links, whose base parameters are known in closed form (Gautier & Khalil 1990): ZZ1R, ZZ2, MX2, MY2,
//! and with gravity in its plane MX1R, MY1.

use super::*;
use crate::gram::{JointAccumulator, Workspace};
use crate::robot::{Inertia, JointDescription, JointKind, LinkDescription, RobotDescription};
use crate::term::{Family, LibrarySettings};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const INERTIAL: [Family; 2] = [Family::MassMoments, Family::Tensor];

/// Links of 0.4 m with axes along z.
fn arm(joints: usize, gravity: [f64; 3]) -> Robot {
    let names = ["base", "upper", "fore"];
    let link = |k: usize| LinkDescription {
        name: names[k].into(),
        inertia: (k > 0).then_some(Inertia {
            mass: 3.0 / k as f64,
            com: [0.2, 0.03, 0.0],
            tensor: [[0.02, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.04]],
        }),
    };
    let joint = |k: usize| {
        let name = ["shoulder", "elbow"][k];
        let mut joint = JointDescription::new(name, JointKind::Revolute, names[k], names[k + 1]);
        joint.placement.translation = [0.4 * k as f64, 0.0, 0.0];
        joint
    };
    let description = RobotDescription {
        name: "arm".into(),
        gravity,
        links: (0..=joints).map(link).collect(),
        joints: (0..joints).map(joint).collect(),
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}

/// 400 states; `moves` and `turns` say which joints have a velocity and acceleration, and which change their position.
fn states(dof: usize, moves: &[bool], turns: &[bool], mask_still: bool) -> States {
    let (mut random, len) = (ChaCha8Rng::seed_from_u64(7), 400);
    let mut values = |which: &[bool], scale: f64, rest: f64| -> Vec<f64> {
        (0..dof * len)
            .map(|i| {
                // variance scale²
                let value = scale * 12f64.sqrt() * (random.random::<f64>() - 0.5);
                if which[i / len] { value } else { rest }
            })
            .collect()
    };
    States {
        len,
        q: values(turns, 1.0, 0.7),
        qd: values(moves, 1.0, 0.0),
        qdd: values(moves, 2.0, 0.0),
        still: (0..dof * len)
            .map(|i| mask_still && !moves[i / len])
            .collect(),
    }
}

fn seen(robot: &Robot, families: &[Family], states: &States) -> Excitation {
    let settings = LibrarySettings {
        families: families.to_vec(),
        generic: Some(false),
        coulomb_velocity: 0.02,
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(robot, &settings).unwrap();
    let len = states.len;
    let mut out = vec![Vec::new(); robot.dof()];
    library.evaluate(states.motion(), &mut out);
    let joints = out.iter().enumerate().map(|(joint, x)| {
        let columns = library.columns_of_joint(joint).iter();
        let mut accumulator = JointAccumulator::new(columns.map(|&c| c as u32).collect());
        let still = &states.still[joint * len..(joint + 1) * len];
        let keep: Vec<bool> = still.iter().map(|still| !still).collect();
        let (y, mut workspace) = (vec![0.0; len], Workspace::default());
        accumulator.push_block(x, len, &y, &keep, true, &mut workspace);
        accumulator.finish()
    });
    let gram = Gram {
        joints: joints.collect(),
    };
    excitation(robot, &library, &gram, states)
}

fn joints(found: &Excitation) -> Vec<Option<&str>> {
    found.unseen.iter().map(|u| u.joint.as_deref()).collect()
}

const LEVEL: [f64; 3] = [0.0, 0.0, -9.81];
const UPRIGHT: [f64; 3] = [0.0, -9.81, 0.0];

#[test]
fn everything_moves_and_everything_is_seen() {
    for (gravity, rank) in [(LEVEL, 4), (UPRIGHT, 6)] {
        let arm = arm(2, gravity);
        let found = seen(&arm, &INERTIAL, &states(2, &[true; 2], &[true; 2], false));
        assert_eq!(found.directions, [rank, rank]);
        assert_eq!(found.unseen, []);
    }
    // A single axis without gravity has one parameter: ZZ1.
    let found = seen(
        &arm(1, LEVEL),
        &INERTIAL,
        &states(1, &[true], &[true], false),
    );
    assert_eq!(found.directions, [1, 1]);
    assert_eq!(found.unseen, []);
    // With gravity also MX1 and MY1, of which one pose shows one combination.
    let found = seen(
        &arm(1, UPRIGHT),
        &INERTIAL,
        &states(1, &[true], &[false], false),
    );
    assert_eq!(found.directions, [3, 2]);
    assert_eq!(joints(&found), [Some("shoulder")]);
}

/// With q2 at rest, level:
///
/// ```text
/// τ1 = (ZZ1R + ZZ2 + 2l(MX2 c − MY2 s)) q̈1     τ2 = (ZZ2 + l(MX2 c − MY2 s)) q̈1 + l(MX2 s + MY2 c) q̇1²
/// ```
/// three of four; where the rows of the joint that stands still do not count, one.
#[test]
fn an_elbow_at_rest_hides_what_only_its_motion_shows() {
    let (arm, moves) = (arm(2, LEVEL), [true, false]);
    for (mask, rank) in [(false, 3), (true, 1)] {
        let found = seen(&arm, &INERTIAL, &states(2, &moves, &moves, mask));
        assert_eq!(found.directions, [4, rank]);
        assert_eq!(joints(&found), [Some("elbow")]);
        assert_eq!(found.unseen[0].directions, 4 - rank);
    }
    let families = [Family::Viscous, Family::Coulomb, Family::MotorInertia];
    let found = seen(&arm, &families, &states(2, &moves, &moves, true));
    assert_eq!(found.directions, [6, 3]);
    assert_eq!(joints(&found), [Some("elbow")]);
    assert_eq!(
        found.unseen[0].nothing_of,
        ["elbow.viscous", "elbow.coulomb", "elbow.motor_inertia"]
    );
    for component in &found.components {
        let still = component.name.starts_with("elbow");
        let expected = if still { Seen::NotAtAll } else { Seen::Fully };
        assert_eq!(component.seen, expected, "{}", component.name);
        assert_eq!(component.excitation < 1e-9, still, "{}", component.name);
    }
}

/// One pose shows M11, M12, M22 and h (ZZ1R, ZZ2, MX2, MY2) and the two gravity torques, of which τ2's is known from
/// MX2 and MY2 and τ1's tells one combination of MX1R and MY1: five of six. Only q1 shows the other.
#[test]
fn one_pose_asks_for_the_shoulder() {
    let arm = arm(2, UPRIGHT);
    let found = seen(&arm, &INERTIAL, &states(2, &[true; 2], &[false; 2], false));
    assert_eq!(found.directions, [6, 5]);
    assert_eq!(joints(&found), [Some("shoulder")]);
    let apart = &found.unseen[0].not_apart;
    assert!(apart.contains(&"upper.mass_moments".into()), "{apart:?}");
}

/// Torque gain, a payload's mass and gravity: of an arm that only shakes in one pose each column is one constant per joint.
#[test]
fn gain_payload_and_gravity_are_one_direction_in_a_pose() {
    let arm = arm(1, UPRIGHT);
    let families = [Family::Offset, Family::Payload, Family::Gain];
    let rest = seen(&arm, &families, &states(1, &[false], &[false], false));
    // Torque is one constant: one direction.
    assert_eq!(rest.directions[1], 1);
    // offset; payload: mx, my by gravity and the inertia about the axis; the gain is nominal torque, in the payload's span.
    assert_eq!(rest.directions[0], 4);
    // The gain is no third story: it says what a payload can say, in every motion.
    assert_eq!(joints(&rest), [Some("shoulder")]);
    assert_eq!(rest.unseen[0].not_apart, ["shoulder.offset", "payload"]);
}
