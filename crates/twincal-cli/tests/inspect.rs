//! `inspect`: what a model can show of its parameters, what `fit` would look for, what logs do not show.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{ARM, csv, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn inspect(folder: &Path, arguments: &[&str]) -> Value {
    let all = ["inspect", "arm.urdf", "--json"];
    let done = run(folder, all.iter().chain(arguments)).expect(0);
    serde_json::from_str(&done.out).unwrap()
}

fn names(list: &Value) -> Vec<&str> {
    let all = list.as_array().unwrap().iter();
    all.map(|entry| entry.as_str().or_else(|| entry["name"].as_str()).unwrap())
        .collect()
}

fn component<'a>(inspection: &'a Value, name: &str) -> &'a Value {
    let all = inspection["components"].as_array().unwrap();
    all.iter().find(|c| c["name"] == name).unwrap()
}

/// Gautier & Khalil 1990: a planar arm with parallel axes has ZZ1R, ZZ2, MX2, MY2, with gravity in its plane also MX1R and
/// MY1. Masses stand for what they act like: fore.m is ZZ1R, so that upper.Izz = fore.m / l² (level, l = 0.4 m).
#[test]
fn base_parameters_of_a_planar_arm_are_those_of_the_textbook() {
    let folder = folder();
    let level = inspect(folder.path(), &[]);
    let base = &level["base_parameters"];
    assert_eq!(base["count"], 4);
    assert_eq!(
        names(&base["names"]),
        ["fore.m", "fore.mcx", "fore.mcy", "fore.Izz"]
    );
    assert_eq!(names(&base["dependent"]), ["upper.Izz"]);
    let shares = base["dependent"][0]["combination"].as_array().unwrap();
    assert_eq!(shares.len(), 1);
    assert_eq!(shares[0]["name"], "fore.m");
    assert!((shares[0]["weight"].as_f64().unwrap() - 1.0 / 0.16).abs() < 1e-9);
    let hidden = names(&base["unidentifiable"]);
    assert_eq!(hidden.len(), 20 - 5, "{hidden:?}");
    assert!(hidden.contains(&"upper.m") && hidden.contains(&"fore.Ixx"));

    let upright = "[model]\ngravity = [0.0, -9.81, 0.0]\n";
    fs::write(folder.path().join("up.toml"), upright).unwrap();
    let upright = inspect(folder.path(), &["--config", "up.toml"]);
    assert_eq!(upright["base_parameters"]["count"], 6);
}

#[test]
fn components_are_those_of_a_fit_with_the_same_config() {
    let folder = folder();
    let config = format!(
        "{}families = [\"viscous\", \"payload\", \"spring\", \"offset\"]\npayload_frame = \"upper\"\n",
        common::QUICK.split("friction").next().unwrap()
    );
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    let config = ["--config", "quick.toml"];
    let inspection = inspect(folder.path(), &["run.csv", config[0], config[1]]);
    common::fit(folder.path(), &["-o", "out"]).expect(0);
    let text = fs::read_to_string(folder.path().join("out/result.json")).unwrap();
    let result: Value = serde_json::from_str(&text).unwrap();
    for key in ["name", "family", "columns", "alias_of", "story"] {
        let of = |value: &Value| -> Vec<Value> {
            let all = value["components"].as_array().unwrap();
            all.iter().map(|c| c[key].clone()).collect()
        };
        assert_eq!(of(&inspection), of(&result), "{key}");
    }
    let payload = component(&inspection, "payload");
    assert_eq!(payload["story"], "payload at upper");
    assert_eq!(payload["units"][0], "kg");
    assert_eq!(
        names(&component(&inspection, "elbow.offset")["alias_of"]),
        ["elbow.spring"]
    );
    assert_eq!(component(&inspection, "shoulder.viscous")["seen"], "fully");
    // Level, a body on the first link has one parameter: the moment about the axis.
    assert_eq!(payload["directions"], serde_json::json!([1, 1]));
    let without = inspect(folder.path(), &config);
    assert_eq!(
        without["components"].as_array().unwrap().len(),
        result["components"].as_array().unwrap().len()
    );
    assert!(without["components"][0]["seen"].is_null() && without["directions"].is_null());
}

/// A log with q2 = 0.3, the torque of the arm at it (see `csv`), and white noise of 0.02 N·m.
fn log_with_elbow_at_rest() -> String {
    let (near, cross, (s, c)) = (0.0325, 0.06, 0.3_f64.sin_cos());
    csv(400, &|row_number, mut row| {
        let number = |k: usize| row[k].parse::<f64>().unwrap();
        let (v, a) = (number(3), number(5));
        let noise = |k: f64| ((row_number as f64 + k) * 12.9898).sin() * 43_758.545;
        let noise = |k: f64| 0.06 * (noise(k) - noise(k).floor() - 0.5);
        let tau1 = (0.3025 + 2.0 * cross * c) * a + 0.4 * v + noise(0.0);
        let tau2 = (near + cross * c) * a + cross * s * v * v + noise(0.5);
        for (column, value) in [(2, 0.3), (4, 0.0), (6, 0.0), (7, tau1), (8, tau2)] {
            row[column] = value.to_string();
        }
        row
    })
}

#[test]
fn an_elbow_that_stands_still_is_asked_to_move() {
    let folder = folder();
    fs::write(folder.path().join("run.csv"), log_with_elbow_at_rest()).unwrap();
    let config = "[signal]\ncutoff_hz = 0\n[library]\nfamilies = [\"viscous\", \"coulomb\", \"mass_moments\", \"tensor\"]\n\
                  generic = false\n";
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    let inspection = inspect(folder.path(), &["run.csv", "--config", "quick.toml"]);
    let unseen = inspection["unseen"].as_array().unwrap();
    assert_eq!(unseen[0]["joint"], "elbow", "{unseen:?}");
    assert_eq!(
        names(&unseen[0]["nothing_of"])[..2],
        ["elbow.viscous", "elbow.coulomb"]
    );
    let words = unseen[0]["words"].as_str().unwrap();
    assert!(words.starts_with("move `elbow` more"), "{words}");
    assert_eq!(
        component(&inspection, "elbow.viscous")["seen"],
        "not_at_all"
    );
    assert_eq!(component(&inspection, "shoulder.viscous")["seen"], "fully");
    // Four base parameters and four frictions.
    assert_eq!(inspection["directions"][0], 8);

    let shown = run(
        folder.path(),
        ["inspect", "arm.urdf", "run.csv", "--config", "quick.toml"],
    );
    let shown = shown.expect(0).out;
    assert!(shown.contains("move `elbow` more"), "{shown}");
    assert!(
        shown.lines().all(|line| line.chars().count() <= 80),
        "{shown}"
    );

    // The fit says the same, in findings, in the words of the component and in the report.
    common::fit(folder.path(), &["-o", "out"]).expect(0);
    let text = fs::read_to_string(folder.path().join("out/result.json")).unwrap();
    let result: Value = serde_json::from_str(&text).unwrap();
    let said = result["findings"].as_array().unwrap().iter();
    let said: Vec<&Value> = said.filter(|f| f["code"] == "unseen_motion").collect();
    assert_eq!(said[0]["message"], words);
    let viscous = component(&result, "elbow.viscous");
    assert_eq!(viscous["status"], "unidentifiable");
    let why = viscous["words"].as_str().unwrap();
    assert!(why.contains("not seen: move `elbow` more"), "{why}");
    let report = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(report.contains("Move <code>elbow</code> more"));
}

/// Tools are mounted on the arm, not on a finger of the gripper that the model holds still.
#[test]
fn a_payload_is_looked_for_where_no_locked_joint_leads() {
    let folder = folder();
    let gripper = r#"<link name="tool0"/>
      <joint name="flange" type="fixed"><parent link="fore"/><child link="tool0"/><origin xyz="0.3 0 0"/></joint>
      <link name="finger"/>
      <joint name="knuckle" type="prismatic"><parent link="fore"/><child link="finger"/><axis xyz="1 0 0"/>
        <limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
      <link name="tip"/>
      <joint name="pad" type="fixed"><parent link="finger"/><child link="tip"/></joint>
      </robot>"#;
    let model = ARM.replace("</robot>", gripper);
    fs::write(folder.path().join("arm.urdf"), model).unwrap();
    fs::write(
        folder.path().join("twincal.toml"),
        "[model]\nlocked = { knuckle = 0.0 }\n",
    )
    .unwrap();
    let inspection = inspect(folder.path(), &["--config", "twincal.toml"]);
    let components = inspection["components"].as_array().unwrap();
    let payload = components.iter().find(|c| c["name"] == "payload").unwrap();
    assert!(payload.to_string().contains("tool0"), "{payload}");
}

#[test]
fn case_73_joints_that_mimic_are_no_coordinates() {
    let folder = folder();
    let finger = r#"<link name="finger"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="knuckle" type="revolute"><parent link="fore"/><child link="finger"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3" effort="1" velocity="1"/><mimic joint="elbow" multiplier="-0.5" offset="0.1"/></joint>
      </robot>"#;
    fs::write(
        folder.path().join("arm.urdf"),
        ARM.replace("</robot>", finger),
    )
    .unwrap();
    let inspection = inspect(folder.path(), &[]);
    assert_eq!(
        names(&inspection["joints"]),
        ["shoulder", "elbow", "knuckle"]
    );
    assert_eq!(inspection["joints"][1]["q"], 2);
    let knuckle = &inspection["joints"][2];
    assert!(knuckle["q"].is_null() && inspection["joints"][0]["mimic"].is_null());
    assert_eq!(knuckle["mimic"]["joint"], "elbow");
    assert_eq!(knuckle["mimic"]["multiplier"], -0.5);
    assert_eq!(knuckle["type"], "revolute");
    // No friction of its own: it has no actuator; but its link has inertia.
    let all = names(&inspection["components"]);
    assert!(
        !all.iter().any(|name| name.starts_with("knuckle.")),
        "{all:?}"
    );
    assert!(all.contains(&"finger.mass_moments"), "{all:?}");
}
