//! A designed motion for tests: smooth, within its limits, of joints with any names.

use crate::collision::{CollisionWorld, Surroundings};
use crate::model::{ModelSettings, parse_model};
use std::collections::BTreeMap;
use std::path::Path;
use twincal::design::{
    Approach, Design, DesignSettings, DesignedMotion, JointLimits, JointUse, Promise, joint_limits,
};

/// Names that would be markup, script and a second column.
pub(crate) const HOSTILE: [&str; 3] = [
    r#"</script><b>"'&"#,
    "<img src=x onerror=alert(1)>",
    "a,\"b\"\n=c()",
];

const RATE: f64 = 250.0;

/// A sine for every joint, each with another frequency.
pub(crate) fn motion(joints: &[&str], len: usize) -> DesignedMotion {
    let of = |make: fn(f64, f64) -> f64| -> Vec<f64> {
        let joints = (0..joints.len()).map(|joint| 1.0 + joint as f64 / 3.0);
        joints
            .flat_map(|w| (0..len).map(move |k| make(w, k as f64 / RATE)))
            .collect()
    };
    DesignedMotion {
        joints: joints.iter().map(|name| (*name).to_owned()).collect(),
        rate: RATE,
        len,
        q: of(|w, t| 0.5 * (w * t).sin()),
        qd: of(|w, t| 0.5 * w * (w * t).cos()),
        qdd: of(|w, t| -0.5 * w * w * (w * t).sin()),
    }
}

/// A motion with what it shows; `effects` are what a twin leaves open, the last one structurally.
pub(crate) fn design(joints: &[&str], effects: &[&str], len: usize) -> Design {
    let promise = |(at, effect): (usize, &&str)| Promise {
        effect: (*effect).to_owned(),
        pip: 0.31,
        right: 0.89,
        wrong: 0.016,
        sd: (at + 1 < effects.len()).then_some(0.021),
        structural: at + 1 == effects.len(),
        decided_by: Vec::new(),
    };
    let used = |name: &&str| JointUse {
        joint: (*name).to_owned(),
        position: [-0.5, 0.5],
        share: [0.97, 0.42, 0.083],
        torque: Some(0.66),
    };
    Design {
        motion: motion(joints, len),
        columns: 30,
        log_determinant: -12.34,
        condition: 45.6,
        promises: effects.iter().enumerate().map(promise).collect(),
        used: joints.iter().map(used).collect(),
        closest: Some(Approach {
            between: [HOSTILE[0].to_owned(), "floor".to_owned()],
            distance: 0.031,
            time: 1.25,
        }),
        stopped: false,
    }
}

/// A robot of one joint, whose only link has a mesh that is not there.
pub(crate) fn world() -> CollisionWorld {
    let text = r#"<robot name="r"><link name="base"/><link name="arm"><collision><geometry><mesh filename="&lt;b&gt;.dae"/></geometry></collision>
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><limit lower="-1" upper="1" velocity="1"/></joint></robot>"#;
    let model = parse_model("r.urdf", text.as_bytes(), &ModelSettings::default());
    let model = model.expect("a model");
    let (robot, _) = model.robot(&BTreeMap::new()).expect("a robot");
    let limits = joint_limits(&robot, &BTreeMap::new()).expect("limits");
    let geometry = model.geometry().expect("geometry");
    let around = Surroundings::default();
    CollisionWorld::new(&robot, (&geometry, Path::new("r.urdf")), &limits, &around)
        .expect("a world")
}

/// Limits in force; the first joint's acceleration and jerk are assumed, the last joint's torque is not limited.
pub(crate) fn limits(joints: &[&str]) -> Vec<JointLimits> {
    let own = joints.iter().enumerate().map(|(at, name)| JointLimits {
        joint: (*name).to_owned(),
        position: [-1.0, 1.5],
        velocity: 1.1,
        acceleration: 5.5,
        jerk: 55.0,
        torque: (at + 1 < joints.len()).then_some(40.0),
        start: 0.1,
        assumed: match at {
            0 => vec!["acceleration", "jerk"],
            _ => Vec::new(),
        },
        beyond_model: Vec::new(),
    });
    own.collect()
}

/// What was asked for.
pub(crate) fn settings(design: &Design) -> DesignSettings {
    DesignSettings {
        duration: (design.motion.len - 1) as f64 / design.motion.rate,
        rate: design.motion.rate,
        ..DesignSettings::default()
    }
}
