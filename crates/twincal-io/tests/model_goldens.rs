//! What the readers and the dynamics give together, against Pinocchio and MuJoCo.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]
#![expect(
    clippy::print_stdout,
    reason = "a skipped test and the measured errors are said"
)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use twincal::robot::{
    Motion, Robot, RobotDescription, Workspace, inverse_dynamics, nominal_torque,
};
use twincal_io::model::{ModelSettings, parse_model, read_model};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
const REFERENCE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../twincal/tests/reference/robot"
);

/// Structure of arrays: q, qd, qdd and the expected torque, each `joint * len + sample`.
struct Golden {
    len: usize,
    groups: [Vec<f64>; 4],
}

/// Largest |ours − theirs| of each joint relative to the joint's largest torque; one sample and batch.
fn worst(description: RobotDescription, golden: &Golden) -> f64 {
    let (robot, _) = Robot::new(description, &BTreeMap::new()).unwrap();
    let (n, len) = (robot.dof(), golden.len);
    let [q, qd, qdd, expected] = &golden.groups;
    assert_eq!(q.len(), n * len, "the golden file belongs to another robot");
    let mut batch = vec![0.0; n * len];
    nominal_torque(&robot, Motion { len, q, qd, qdd }, &mut batch);
    let mut workspace = Workspace::new(&robot);
    let mut worst = 0f64;
    for sample in 0..len {
        let pick = |v: &[f64]| (0..n).map(|j| v[j * len + sample]).collect::<Vec<_>>();
        let mut one = vec![0.0; n];
        inverse_dynamics(
            &robot,
            &mut workspace,
            &pick(q),
            &pick(qd),
            &pick(qdd),
            &mut one,
        );
        for j in 0..n {
            let largest = expected[j * len..(j + 1) * len]
                .iter()
                .fold(1e-6f64, |m, v| m.max(v.abs()));
            for torque in [one[j], batch[j * len + sample]] {
                worst = worst.max((torque - expected[j * len + sample]).abs() / largest);
            }
        }
    }
    worst
}

/// A CSV with columns q1…, qd1…, qdd1…, tau_nom1….
fn golden_csv(path: &Path) -> Golden {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let width = reader.headers().unwrap().len();
    let mut columns = vec![Vec::new(); width];
    for record in reader.records() {
        for (c, field) in record.unwrap().iter().enumerate() {
            columns[c].push(field.parse::<f64>().unwrap());
        }
    }
    let n = width / 4;
    Golden {
        len: columns[0].len(),
        groups: std::array::from_fn(|g| columns[g * n..(g + 1) * n].concat()),
    }
}

fn golden_json(case: &Value) -> Golden {
    let samples = case["samples"].as_array().unwrap();
    let groups = ["q", "qd", "qdd", "tau"].map(|key| {
        let n = samples[0][key].as_array().unwrap().len();
        (0..n)
            .flat_map(|j| samples.iter().map(move |s| s[key][j].as_f64().unwrap()))
            .collect()
    });
    Golden {
        len: samples.len(),
        groups,
    }
}

fn cases(file: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(Path::new(REFERENCE).join(file)).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    document["cases"].as_array().unwrap().clone()
}

#[test]
fn nominal_torque_of_real_robots_is_pinocchios() {
    let folders = [
        "double_pendulum",
        "kuka_kr300",
        "simple_pendulum",
        "staubli_tx40",
        "ur10",
    ];
    for folder in folders.map(|f| Path::new(DATA).join(f)) {
        if !folder.is_dir() {
            println!(
                "skipped: {} is not there",
                folder.file_name().unwrap().display()
            );
            continue;
        }
        let golden = golden_csv(&folder.join("golden_nominal_pinocchio.csv"));
        // The golden files hold 12 digits of the state, which a large acceleration turns into 2e-11 of the torque. The
        // MJCF files hold 6 digits of the model; the double pendulum's one also states damping.
        for (file, tolerance) in [("model.urdf", 1e-10), ("model.xml", 1e-4)] {
            let path = folder.join(file);
            if !path.is_file() {
                continue;
            }
            let mut description = read_model(&path, &ModelSettings::default())
                .unwrap()
                .description;
            for joint in &mut description.joints {
                joint.damping = 0.0;
            }
            let error = worst(description, &golden);
            println!("{}: {error:.1e}", path.display());
            assert!(error < tolerance, "{}: {error:.1e}", path.display());
        }
    }
}

#[test]
fn urdf_torque_is_pinocchios() {
    for case in cases("pinocchio.json") {
        let urdf = case["urdf"].as_str().unwrap();
        let gravity = [0, 1, 2].map(|k| case["description"]["gravity"][k].as_f64().unwrap());
        let settings = ModelSettings {
            gravity: Some(gravity),
            ..ModelSettings::default()
        };
        let model = parse_model("case.urdf", urdf.as_bytes(), &settings).unwrap();
        let error = worst(model.description, &golden_json(&case));
        println!("{}: {error:.1e}", case["name"]);
        assert!(error < 1e-10, "{}: {error:.1e}", case["name"]);
    }
}

#[test]
fn mjcf_torque_is_mujocos() {
    for case in cases("mujoco.json") {
        let mjcf = case["mjcf"].as_str().unwrap();
        let model = parse_model("case.xml", mjcf.as_bytes(), &ModelSettings::default()).unwrap();
        let (robot, findings) = Robot::new(model.description.clone(), &BTreeMap::new()).unwrap();
        let names: Vec<&str> = case["joints"]
            .as_array()
            .unwrap()
            .iter()
            .map(|j| j.as_str().unwrap())
            .collect();
        assert_eq!(robot.joint_names(), names);
        let error = worst(model.description, &golden_json(&case));
        println!(
            "{}: {error:.1e} {:?} {findings:?}",
            case["name"], model.findings
        );
        assert!(error < 1e-10, "{}: {error:.1e}", case["name"]);
    }
}
