//! What a description may not be: every rule of [`Robot::new`] with the words of its refusal.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]

use std::collections::BTreeMap;
use twincal::Code;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Mimic, Robot, RobotDescription,
};

fn link(name: &str) -> LinkDescription {
    let tensor = [[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.01]];
    LinkDescription {
        name: name.into(),
        inertia: Some(Inertia {
            mass: 1.0,
            com: [0.0, 0.0, 0.1],
            tensor,
        }),
    }
}

fn hinge(name: &str, parent: &str, child: &str) -> JointDescription {
    JointDescription::new(name, JointKind::Revolute, parent, child)
}

/// base – shoulder – upper – elbow – lower – wrist – hand.
fn arm() -> RobotDescription {
    RobotDescription {
        name: "arm".into(),
        gravity: [0.0, 0.0, -9.81],
        links: ["base", "upper", "lower", "hand"].map(link).into(),
        joints: vec![
            hinge("shoulder", "base", "upper"),
            hinge("elbow", "upper", "lower"),
            hinge("wrist", "lower", "hand"),
        ],
        allow_unphysical: false,
    }
}

/// The refusal of a changed arm.
fn refusal(change: impl FnOnce(&mut RobotDescription)) -> String {
    let mut description = arm();
    change(&mut description);
    Robot::new(description, &BTreeMap::new())
        .unwrap_err()
        .to_string()
}

fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{text}` does not say `{part}`");
    }
}

#[test]
fn trees_only() {
    says(
        &refusal(|d| d.links[2].name = "upper".into()),
        &["link `upper`", "defined twice"],
    );
    says(
        &refusal(|d| d.joints[1].name = "wrist".into()),
        &["joint `wrist`", "defined twice"],
    );
    says(
        &refusal(|d| d.joints[1].child = "lowr".into()),
        &["joint `elbow`", "child link `lowr`", "did you mean `lower`"],
    );
    says(
        &refusal(|d| d.joints[1].parent = "lower".into()),
        &["joint `elbow`", "to itself"],
    );
    says(
        &refusal(|d| d.joints[2].child = "upper".into()),
        &["link `upper`", "two joints, `shoulder` and `wrist`"],
    );
    says(
        &refusal(|d| d.joints[1].parent = "hand".into()),
        &["link `lower`", "cycle", "`hand`"],
    );
    says(
        &refusal(|d| drop(d.joints.remove(1))),
        &["two roots", "`base`", "`lower`"],
    );
    says(
        &refusal(|d| d.links.push(link("stray"))),
        &["link `stray`", "orphan"],
    );
    says(
        &refusal(|d| d.links.clear()),
        &["robot `arm`", "has no link"],
    );
    says(
        &refusal(|d| d.links[1].name.clear()),
        &["link number 2", "no name"],
    );
    // A pure cycle has no root at all.
    let ring = |d: &mut RobotDescription| {
        d.links.remove(0);
        d.joints[0].parent = "hand".into();
    };
    says(&refusal(ring), &["cycle"]);
}

#[test]
fn a_very_long_chain_is_no_problem() {
    let n = 20_000;
    let mut description = arm();
    description.links = (0..=n).map(|i| link(&format!("link{i}"))).collect();
    description.joints = (0..n)
        .rev()
        .map(|i| {
            JointDescription::new(
                &format!("j{i}"),
                JointKind::Fixed,
                &format!("link{i}"),
                &format!("link{}", i + 1),
            )
        })
        .collect();
    description.joints[0].kind = JointKind::Revolute;
    assert_eq!(
        Robot::new(description, &BTreeMap::new()).unwrap().0.dof(),
        1
    );
}

#[test]
fn numbers_must_be_possible() {
    let inertia = |d: &mut RobotDescription, change: fn(&mut Inertia)| {
        change(d.links[1].inertia.as_mut().unwrap())
    };
    says(
        &refusal(|d| inertia(d, |i| i.mass = f64::NAN)),
        &["link `upper`", "mass is NaN"],
    );
    says(
        &refusal(|d| inertia(d, |i| i.com[1] = f64::INFINITY)),
        &["link `upper`", "centre of mass"],
    );
    says(
        &refusal(|d| inertia(d, |i| i.tensor[0][1] = 0.005)),
        &["link `upper`", "not symmetric"],
    );
    says(
        &refusal(|d| inertia(d, |i| i.tensor[0][0] = -0.02)),
        &["link `upper`", "positive definite"],
    );
    says(
        &refusal(|d| d.joints[1].axis = [0.0; 3]),
        &["joint `elbow`", "axis"],
    );
    says(
        &refusal(|d| d.joints[1].axis = [f64::NAN, 0.0, 0.0]),
        &["joint `elbow`", "axis"],
    );
    says(
        &refusal(|d| d.joints[1].placement.rotation[0][0] = 0.9),
        &["joint `elbow`", "not a rotation"],
    );
    says(
        &refusal(|d| d.joints[1].placement.translation[0] = f64::NAN),
        &["joint `elbow`", "not finite"],
    );
    says(
        &refusal(|d| d.joints[1].armature = -1.0),
        &["joint `elbow`", "armature is -1"],
    );
    says(&refusal(|d| d.gravity[0] = f64::NAN), &["gravity"]);
    says(
        &refusal(|d| d.joints.iter_mut().for_each(|j| j.kind = JointKind::Fixed)),
        &["none of its 3 joints can move"],
    );
}

#[test]
fn locked_and_mimicked_joints_must_exist() {
    let lock = |name: &str, position: f64| {
        Robot::new(arm(), &BTreeMap::from([(name.to_string(), position)]))
    };
    says(
        &lock("elbwo", 0.0).unwrap_err().to_string(),
        &["`elbwo`", "did you mean `elbow`"],
    );
    says(
        &lock("elbow", f64::NAN).unwrap_err().to_string(),
        &["`elbow`", "NaN"],
    );
    assert_eq!(
        lock("elbow", 0.3).unwrap().0.joint_names(),
        ["shoulder", "wrist"]
    );

    let mimic = |joint: &str| {
        Some(Mimic {
            joint: joint.into(),
            multiplier: 1.0,
            offset: 0.0,
        })
    };
    says(
        &refusal(|d| d.joints[1].mimic = mimic("sholder")),
        &["`elbow`", "`sholder`", "did you mean `shoulder`"],
    );
    says(
        &refusal(|d| d.joints[1].mimic = mimic("elbow")),
        &["`elbow`", "loop"],
    );
    let ring = |d: &mut RobotDescription| {
        d.joints[1].mimic = mimic("wrist");
        d.joints[2].mimic = mimic("elbow");
    };
    says(&refusal(ring), &["mimics", "loop"]);
    let fixed = |d: &mut RobotDescription| {
        d.joints[1].mimic = mimic("wrist");
        d.joints[2].kind = JointKind::Fixed;
    };
    says(&refusal(fixed), &["`elbow`", "`wrist`, which is fixed"]);
}

#[test]
fn coordinates_follow_the_files_order_and_planarity_is_seen() {
    let mut description = arm();
    description.joints.reverse();
    let (robot, findings) = Robot::new(description.clone(), &BTreeMap::new()).unwrap();
    assert_eq!(robot.joint_names(), ["wrist", "elbow", "shoulder"]);
    assert!(robot.is_planar() && findings.is_empty(), "{findings:?}");
    description.joints[1].axis = [0.0, 0.0, -3.0];
    let (robot, findings) = Robot::new(description.clone(), &BTreeMap::new()).unwrap();
    assert!(robot.is_planar(), "an axis the other way round is parallel");
    assert_eq!(findings[0].code, Code::AxisNormalised);
    description.joints[1].axis = [0.0, 0.1, 1.0];
    assert!(
        !Robot::new(description.clone(), &BTreeMap::new())
            .unwrap()
            .0
            .is_planar()
    );
    // What carries no mass is said.
    description.links[3].inertia = None;
    let (_, findings) = Robot::new(description, &BTreeMap::new()).unwrap();
    assert!(
        findings
            .iter()
            .any(|f| f.code == Code::MovesNoMass && f.subject == "wrist"),
        "{findings:?}"
    );
}
