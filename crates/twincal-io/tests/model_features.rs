//! Features of model files against MuJoCo and Pinocchio: includes, orientations, limits, sections in pieces, and bases that
//! do not stand upright.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use twincal::robot::{JointKind, Robot, Workspace, inverse_dynamics};
use twincal_io::model::{ModelSettings, parse_model, read_model};

fn reference() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/model.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Largest |ours − theirs| relative to the joint's largest torque over all samples.
fn worst(robot: &Robot, samples: &Value) -> f64 {
    let numbers = |value: &Value| -> Vec<f64> {
        let values = value.as_array().unwrap();
        values.iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let mut workspace = Workspace::new(robot);
    let mut tau = vec![0.0; robot.dof()];
    let mut largest = vec![1e-6_f64; robot.dof()];
    let mut error = vec![0.0_f64; robot.dof()];
    for sample in samples.as_array().unwrap() {
        let [q, qd, qdd, expected] = ["q", "qd", "qdd", "tau"].map(|key| numbers(&sample[key]));
        assert_eq!(q.len(), robot.dof());
        inverse_dynamics(robot, &mut workspace, &q, &qd, &qdd, &mut tau);
        for j in 0..robot.dof() {
            largest[j] = largest[j].max(expected[j].abs());
            error[j] = error[j].max((tau[j] - expected[j]).abs());
        }
    }
    let relative = error.iter().zip(&largest).map(|(e, l)| e / l);
    relative.fold(0.0, f64::max)
}

#[test]
fn mjcf_of_several_files_and_forms_is_read_as_mujoco_reads_it() {
    for case in reference()["mjcf"].as_array().unwrap() {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in case["files"].as_object().unwrap() {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text.as_str().unwrap()).unwrap();
        }
        let name = case["name"].as_str().unwrap();
        let main = folder.path().join("main.xml");
        let model = read_model(&main, &ModelSettings::default()).unwrap();
        let (robot, findings) = model.robot(&BTreeMap::new()).unwrap();
        let error = worst(&robot, &case["samples"]);
        assert!(error < 1e-10, "{name}: {error:.1e} {findings:#?}");
        for (j, expected) in case["limits"].as_array().unwrap().iter().enumerate() {
            let joint = robot.joint(j);
            assert_eq!(Some(&*joint.name), expected["joint"].as_str(), "{name}");
            let limits = joint.limits;
            let range = |k: usize| expected["range"].get(k).and_then(Value::as_f64);
            for (ours, theirs) in [
                (limits.lower, range(0)),
                (limits.upper, range(1)),
                (limits.effort, expected["effort"].as_f64()),
            ] {
                let alike = match (ours, theirs) {
                    (Some(a), Some(b)) => (a - b).abs() < 1e-12,
                    (a, b) => a == b,
                };
                assert!(alike, "{name}, {}: {ours:?} {theirs:?}", joint.name);
            }
            let endless = joint.kind == JointKind::Continuous;
            let turns = joint.kind != JointKind::Prismatic;
            assert!(
                !turns || endless == range(0).is_none(),
                "{name}, {}",
                joint.name
            );
        }
    }
}

#[test]
fn a_base_on_wall_or_ceiling_is_a_turned_robot() {
    let reference = reference();
    let turned = reference["turned"].as_array().unwrap();
    assert_eq!(turned.len(), 6);
    for case in turned {
        let (name, text) = (
            case["name"].as_str().unwrap(),
            case["model"].as_str().unwrap(),
        );
        let build = |base_rpy: Option<[f64; 3]>, gravity: Option<[f64; 3]>| {
            let settings = ModelSettings {
                base_rpy,
                gravity,
                ..ModelSettings::default()
            };
            let model = parse_model(name, text.as_bytes(), &settings).unwrap();
            model.robot(&BTreeMap::new()).unwrap().0
        };
        let rpy = [0, 1, 2].map(|k| case["rpy"][k].as_f64().unwrap());
        let error = worst(&build(Some(rpy), None), &case["samples"]);
        assert!(error < 1e-10, "{name} {rpy:?}: {error:.1e}");
        // The given gravity is the world's, too.
        let stated = build(Some(rpy), Some([0.0, 0.0, -9.81]));
        assert!(worst(&stated, &case["samples"]) < 1e-10);
        assert!(worst(&build(None, None), &case["samples"]) > 0.1);
    }
}

#[test]
fn a_robot_is_called_what_its_file_calls_it() {
    let body = r#"<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint type="hinge"/>"#;
    let named = |attribute: &str| {
        let text = format!(
            "<mujoco {attribute}><worldbody><body name=\"a\">{body}</body></worldbody></mujoco>"
        );
        let model = parse_model("arm.xml", text.as_bytes(), &ModelSettings::default()).unwrap();
        model.robot_name().to_owned()
    };
    assert_eq!(named("model=\" my arm \""), "my arm");
    assert_eq!(named(""), "");
    let urdf = r#"<robot name="r2"><link name="a"/></robot>"#;
    let model = parse_model("arm.urdf", urdf.as_bytes(), &ModelSettings::default()).unwrap();
    assert_eq!(model.robot_name(), "r2");
}
