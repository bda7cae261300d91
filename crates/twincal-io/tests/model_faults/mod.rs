//! Bad robot models, one test per numbered case of the fault list: a clear error with a place, no panic, no abort, no
//! file opened that nobody named.

#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test itself may"
)]

mod files;
mod mutations;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};
use twincal::Finding;
use twincal::robot::Robot;
use twincal_io::model::{ModelSettings, parse_model, read_model};

/// A two-joint arm with a finger that mimics; lines are counted by the tests below.
const URDF: &str = r#"<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.2" rpy="0 0.1 0"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.002"/></inertial>
    <visual><geometry><mesh filename="package://arm/upper.stl"/></geometry></visual></link>
  <link name="lower"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.001"/></inertial></link>
  <link name="finger"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="50" velocity="3"/><dynamics damping="0.5" friction="1.5"/></joint>
  <joint name="elbow" type="continuous"><origin xyz="0 0 0.4"/><parent link="upper"/><child link="lower"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="grip" type="prismatic"><origin xyz="0 0 0.3" rpy="0 1.5 0"/><parent link="lower"/><child link="finger"/>
    <axis xyz="1 0 0"/><mimic joint="elbow" multiplier="0.01" offset="0.02"/></joint>
</robot>
"#;

const MJCF: &str = r#"<mujoco model="arm">
  <compiler angle="radian"/>
  <default><joint damping="0.1"/><default class="d"><geom size="0.05 0.1" type="capsule"/></default></default>
  <worldbody>
    <body name="upper" childclass="d" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" range="-1 1"/>
      <geom/>
      <body name="lower" pos="0.2 0 0" euler="0.1 0.2 0.3">
        <joint name="elbow" axis="1 0 0" ref="0.2" stiffness="2"/>
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.02 0.02 0.01"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"#;

fn build(name: &str, text: &[u8]) -> Result<(Robot, Vec<Finding>), String> {
    parse_model(name, text, &ModelSettings::default())
        .and_then(|model| model.robot(&BTreeMap::new()))
        .map_err(|error| error.to_string())
}

/// The refusal of the arm with `from` replaced by `to`.
fn refusal(source: &str, from: &str, to: &str) -> String {
    assert!(source.contains(from), "the test's text has no `{from}`");
    let text = source.replacen(from, to, 1);
    let name = if source == URDF {
        "arm.urdf"
    } else {
        "arm.xml"
    };
    match build(name, text.as_bytes()) {
        Err(message) => message,
        Ok(_) => panic!("`{to}` was accepted"),
    }
}

fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{text}` does not say `{part}`");
    }
}

fn codes(findings: &[Finding]) -> Vec<&str> {
    findings.iter().map(|f| f.code.as_str()).collect()
}

fn read(path: &Path) -> Result<Robot, String> {
    read_model(path, &ModelSettings::default())
        .and_then(|model| model.robot(&BTreeMap::new()))
        .map(|(robot, _)| robot)
        .map_err(|error| error.to_string())
}

#[test]
fn the_good_ones_are_read() {
    let (robot, findings) = build("arm.urdf", URDF.as_bytes()).unwrap();
    assert_eq!(robot.joint_names(), ["shoulder", "elbow"]);
    assert_eq!(codes(&findings), ["urdf_dynamics"]);
    assert_eq!(robot.joint(0).limits.effort, Some(50.0));
    assert_eq!(robot.joint(0).damping, 0.0);
    let settings = ModelSettings {
        use_urdf_friction: true,
        ..ModelSettings::default()
    };
    let model = parse_model("arm.urdf", URDF.as_bytes(), &settings).unwrap();
    assert_eq!(model.description.joints[0].damping, 0.5);
    assert_eq!(model.bytes, URDF.as_bytes());

    let (robot, findings) = build("arm.xml", MJCF.as_bytes()).unwrap();
    assert_eq!(robot.joint_names(), ["shoulder", "elbow"]);
    assert!(findings.is_empty(), "{findings:?}");
    // A byte-order mark and Windows line ends change nothing.
    let dressed = format!("\u{feff}{}", URDF.replace('\n', "\r\n"));
    assert_eq!(
        build("arm.urdf", dressed.as_bytes())
            .unwrap()
            .0
            .description(),
        build("a", URDF.as_bytes()).unwrap().0.description()
    );
}

#[test]
fn case_67_impossible_mass() {
    for mass in ["NaN", "inf", "-1", "0"] {
        says(
            &refusal(URDF, "value=\"2\"", &format!("value=\"{mass}\"")),
            &["arm.urdf:4:3: link `upper`", "mass"],
        );
        says(
            &refusal(MJCF, "mass=\"1\"", &format!("mass=\"{mass}\"")),
            &["arm.xml:8:7: link `lower`", "mass"],
        );
    }
    says(
        &refusal(URDF, "value=\"2\"", "value=\"two\""),
        &["arm.urdf:4:", "`two` is not a number"],
    );
    // Without mass and without inertia it is a frame.
    let massless = URDF.replace(
        "0.1\"/><inertia ixx=\"1e-4\" iyy=\"1e-4\" izz=\"1e-4\"",
        "0\"/><inertia ixx=\"0\" iyy=\"0\" izz=\"0\"",
    );
    assert!(massless != URDF && build("arm.urdf", massless.as_bytes()).is_ok());
}

#[test]
fn case_68_impossible_inertia() {
    for (tensor, word) in [
        ("-0.03", "positive definite"),
        ("0.09", "triangle inequality"),
    ] {
        let text = URDF.replacen("ixx=\"0.03\"", &format!("ixx=\"{tensor}\""), 1);
        says(
            &build("arm.urdf", text.as_bytes()).unwrap_err(),
            &["link `upper`", word, "unphysical_inertia"],
        );
        let settings = ModelSettings {
            allow_unphysical: true,
            ..ModelSettings::default()
        };
        let model = parse_model("arm.urdf", text.as_bytes(), &settings).unwrap();
        let (_, findings) = Robot::new(model.description, &BTreeMap::new()).unwrap();
        assert_eq!(codes(&findings), ["unphysical_inertia"]);
    }
    says(
        &refusal(MJCF, "0.02 0.02 0.01", "0.02 0.02 0.05"),
        &["link `lower`", "triangle inequality"],
    );
}

#[test]
fn case_69_duplicate_names() {
    says(
        &refusal(URDF, "link name=\"lower\"", "link name=\"upper\""),
        &["link `upper`", "defined twice"],
    );
    says(
        &refusal(URDF, "joint name=\"elbow\"", "joint name=\"shoulder\""),
        &["joint `shoulder`", "defined twice"],
    );
    says(
        &refusal(MJCF, "joint name=\"elbow\"", "joint name=\"shoulder\""),
        &["joint `shoulder`", "defined twice"],
    );
    says(
        &refusal(MJCF, "body name=\"lower\"", "body name=\"upper\""),
        &["link `upper`"],
    );
    says(
        &refusal(URDF, "name=\"base\"", "name=\"base\" name=\"base\""),
        &["arm.urdf:3:", "`name` twice"],
    );
}

#[test]
fn case_70_cycles_roots_orphans() {
    says(
        &refusal(URDF, "<parent link=\"base\"/>", "<parent link=\"lower\"/>"),
        &["cycle"],
    );
    says(
        &refusal(URDF, "<child link=\"lower\"/>", "<child link=\"finger\"/>"),
        &["two joints"],
    );
    says(
        &refusal(
            URDF,
            "<link name=\"base\"/>",
            "<link name=\"base\"/><link name=\"lost\"/>",
        ),
        &["link `lost`", "orphan"],
    );
    says(
        &refusal(URDF, "<parent link=\"base\"/>", "<parent link=\"bsae\"/>"),
        &["`bsae`", "did you mean `base`"],
    );
}

#[test]
fn case_71_unknown_joint_names_are_answered_with_the_nearest() {
    let model = parse_model("arm.urdf", URDF.as_bytes(), &ModelSettings::default()).unwrap();
    let locked = BTreeMap::from([("sholder".to_string(), 0.0)]);
    says(
        &Robot::new(model.description, &locked)
            .unwrap_err()
            .to_string(),
        &["`sholder`", "did you mean `shoulder`"],
    );
}

#[test]
fn case_72_a_joint_that_the_log_lacks_can_be_locked() {
    let model = parse_model("arm.urdf", URDF.as_bytes(), &ModelSettings::default()).unwrap();
    let locked = BTreeMap::from([("elbow".to_string(), 0.5)]);
    // The finger that mimics the elbow stands still with it.
    assert_eq!(
        Robot::new(model.description, &locked)
            .unwrap()
            .0
            .joint_names(),
        ["shoulder"]
    );
}

#[test]
fn case_73_mimic_joints_follow() {
    assert_eq!(
        build("arm.urdf", URDF.as_bytes()).unwrap().0.dof(),
        2,
        "grip is no coordinate of its own"
    );
    says(
        &refusal(URDF, "<mimic joint=\"elbow\"", "<mimic joint=\"elbo\""),
        &["joint `grip`", "`elbo`", "did you mean `elbow`"],
    );
    says(
        &refusal(URDF, "<mimic joint=\"elbow\"", "<mimic joint=\"grip\""),
        &["joint `grip`", "loop"],
    );
    let coupled = MJCF.replace("</worldbody>", "</worldbody><equality><joint joint1=\"elbow\" joint2=\"shoulder\" polycoef=\"0 2\"/></equality>");
    let (robot, findings) = build("arm.xml", coupled.as_bytes()).unwrap();
    assert_eq!(
        (robot.joint_names(), codes(&findings)),
        (vec!["shoulder"], vec!["mimic_from_equality"])
    );
}

#[test]
fn case_74_axes() {
    says(
        &refusal(URDF, "axis xyz=\"0 1 0\"", "axis xyz=\"0 0 0\""),
        &["arm.urdf:9:3: joint `shoulder`", "axis"],
    );
    says(
        &refusal(MJCF, "axis=\"0 1 0\"", "axis=\"0 0 0\""),
        &["arm.xml:6:", "joint `shoulder`", "axis"],
    );
    let long = URDF.replacen("axis xyz=\"0 1 0\"", "axis xyz=\"0 2 0\"", 1);
    let (_, findings) = build("arm.urdf", long.as_bytes()).unwrap();
    assert_eq!(codes(&findings), ["urdf_dynamics", "axis_normalised"]);
    // A fixed joint's axis means nothing.
    let fixed = URDF
        .replacen("type=\"continuous\"", "type=\"fixed\"", 1)
        .replacen(
            "axis xyz=\"0 1 0\"/></joint>",
            "axis xyz=\"0 0 0\"/></joint>",
            1,
        );
    let fixed = fixed.replace(
        "<mimic joint=\"elbow\" multiplier=\"0.01\" offset=\"0.02\"/>",
        "",
    );
    assert_eq!(
        build("arm.urdf", fixed.as_bytes()).unwrap().0.joint_names(),
        ["shoulder", "grip"]
    );
}

#[test]
fn case_75_document_types_are_refused() {
    let mut bomb = String::from("<?xml version=\"1.0\"?>\n<!DOCTYPE robot [<!ENTITY a0 \"ha\">");
    for i in 1..30 {
        bomb += &format!("<!ENTITY a{i} \"&a{};&a{};\">", i - 1, i - 1);
    }
    bomb += "]>\n<robot name=\"&a29;\"/>";
    says(
        &build("x.urdf", bomb.as_bytes()).unwrap_err(),
        &["x.urdf:2:1", "DOCTYPE"],
    );
    says(
        &refusal(URDF, "name=\"arm\"", "name=\"&lol;\""),
        &["arm.urdf:2:", "lol"],
    );
    says(
        &refusal(URDF, "<link name=\"base\"/>", "<link name=\"base\"/>&lol;"),
        &["arm.urdf:3:22", "&lol;"],
    );
    let plain = URDF.replace("name=\"arm\"", "name=\"&lt;a&#x62;&gt;\"");
    assert_eq!(
        build("x", plain.as_bytes()).unwrap().0.description().name,
        "<ab>"
    );
}

#[test]
fn case_77_deep_nesting() {
    for root in ["robot", "mujoco"] {
        let deep = format!(
            "<{root}>{}{}</{root}>",
            "<body>".repeat(20_000),
            "</body>".repeat(20_000)
        );
        says(
            &build("deep.xml", deep.as_bytes()).unwrap_err(),
            &["deep.xml:1:", "256 levels"],
        );
    }
    // The deepest that is allowed works on the small stack of a test thread.
    let n = 250;
    let open = "<body><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><joint/>".repeat(n);
    let text = format!(
        "<mujoco><worldbody>{open}{}</worldbody></mujoco>",
        "</body>".repeat(n)
    );
    assert_eq!(build("deep.xml", text.as_bytes()).unwrap().0.dof(), n);
}

#[test]
fn case_78_many_attributes() {
    let attributes: String = (0..400_000).map(|i| format!(" a{i}=\"1\"")).collect();
    let text = format!("<robot name=\"r\"><link name=\"l\"{attributes}/></robot>");
    let start = Instant::now();
    says(
        &build("wide.urdf", text.as_bytes()).unwrap_err(),
        &["wide.urdf:1:", "more than 64 attributes"],
    );
    assert!(
        start.elapsed() < Duration::from_secs(1),
        "{:?}",
        start.elapsed()
    );
}

#[test]
fn case_83_unknown_elements_are_listed() {
    let odd = MJCF
        .replace(
            "<joint name=\"elbow\"",
            "<joint name=\"elbow\" armatur=\"3\"",
        )
        .replace("</worldbody>", "</worldbody><koint/>")
        .replace("<geom/>", "<geom/><gom/>");
    let (_, findings) = build("arm.xml", odd.as_bytes()).unwrap();
    assert_eq!(codes(&findings), ["unknown_elements"]);
    assert_eq!(findings[0].count, 3);
    says(
        &findings[0].message,
        &[
            "<koint> at arm.xml:13:",
            "<gom> at arm.xml:7:",
            "<joint> armatur= at arm.xml:9:",
        ],
    );
    says(
        &refusal(MJCF, "childclass=\"d\"", "childclass=\"e\""),
        &["default class `e`", "there are `d`, `main`"],
    );
    says(
        &refusal(
            MJCF,
            "<joint name=\"elbow\"",
            "<freejoint/><joint name=\"elbow\"",
        ),
        &["arm.xml:9:", "floats freely"],
    );
    says(
        &refusal(MJCF, "name=\"elbow\"", "name=\"elbow\" type=\"ball\""),
        &["joint `elbow`", "ball"],
    );
    says(
        &refusal(MJCF, "<geom/>", "<geom type=\"mesh\" mesh=\"m\"/>"),
        &["arm.xml:7:", "body `upper`", "mesh", "inertial"],
    );
    says(
        &refusal(MJCF, "<worldbody>", "<worldbody><replicate count=\"2\"/>"),
        &["<replicate>", "mj_saveLastXML"],
    );
    says(
        &refusal(URDF, "type=\"continuous\"", "type=\"floating\""),
        &["arm.urdf:11:", "joint `elbow`", "floating"],
    );
}

#[test]
fn case_84_other_formats_say_how_to_convert() {
    says(
        &build("m.sdf", b"<sdf version='1.9'><model name='m'/></sdf>").unwrap_err(),
        &["SDF", "convert"],
    );
    says(
        &build("m.xml", b"#usda 1.0\n").unwrap_err(),
        &["USD", "convert"],
    );
    says(
        &build("m.usd", b"PXR-USDC").unwrap_err(),
        &["USD", "convert"],
    );
    says(
        &build("m.xml", b"<html/>").unwrap_err(),
        &["m.xml:1:1", "<html>", "<robot>", "<mujoco>"],
    );
    says(
        &build("m.urdf", b"version https://git-lfs.github.com/spec/v1\noid").unwrap_err(),
        &["Git LFS"],
    );
    says(
        &build("m.urdf", b"\xff\xfe<\0r\0").unwrap_err(),
        &["UTF-16"],
    );
    says(
        &build("m.urdf", b"<robot name=\"\xe4\"/>").unwrap_err(),
        &["m.urdf:1:14", "UTF-8"],
    );
    says(&build("m.urdf", b"").unwrap_err(), &["empty"]);
    says(&build("m.urdf", b"hello").unwrap_err(), &["no XML element"]);
    says(
        &build("m.urdf", b"<robot name='r'><link name='l'>").unwrap_err(),
        &["m.urdf:1:17", "<link>", "never closed"],
    );
    says(
        &read(Path::new("nowhere/none.urdf")).unwrap_err(),
        &["nowhere/none.urdf", "cannot read"],
    );
}

#[test]
fn a_moving_shape_without_inertia_is_said() {
    let start = URDF.find("<inertial>").unwrap();
    let end = URDF.find("</inertial>").unwrap() + "</inertial>".len();
    let text = format!("{}{}", &URDF[..start], &URDF[end..]);
    let (_, findings) = build("arm.urdf", text.as_bytes()).unwrap();
    assert!(codes(&findings).contains(&"link_without_inertia"));
    says(
        &findings[1].message,
        &["link `upper`", "<inertial>", "mesh"],
    );
    // What stands on the base needs none.
    let fixed = text.replace("type=\"revolute\"", "type=\"fixed\"");
    let (_, findings) = build("arm.urdf", fixed.as_bytes()).unwrap();
    assert!(!codes(&findings).contains(&"link_without_inertia"));
}

#[test]
fn case_20_an_actuators_gear_is_said() {
    let geared = MJCF.replace(
        "</worldbody>",
        "</worldbody><actuator><motor name=\"m\" joint=\"elbow\" gear=\"50\" armature=\"1e-4\"/></actuator>",
    );
    let (robot, findings) = build("arm.xml", geared.as_bytes()).unwrap();
    assert_eq!(codes(&findings), ["actuator_gear"]);
    says(
        &findings[0].message,
        &["gear 50", "joint `elbow`", "50 × the actuator's force"],
    );
    assert_eq!(robot.joint(1).armature, 0.25);
}

#[test]
fn an_undefined_world_is_the_fixed_base() {
    let text = URDF
        .replace("<link name=\"base\"/>", "<joint name=\"weld\" type=\"fixed\"><parent link=\"world\"/><child link=\"base\"/></joint><link name=\"base\"/>");
    let (robot, findings) = build("arm.urdf", text.as_bytes()).unwrap();
    assert_eq!(
        (robot.dof(), codes(&findings)[1]),
        (2, "undefined_world_link")
    );
}
