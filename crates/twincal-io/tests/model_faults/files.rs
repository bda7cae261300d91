//! Faults that only a file can have: what is opened, how large it is, what its name says.

use super::{MJCF, URDF, build, codes, read, refusal, says};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use twincal::robot::{Robot, Workspace, inverse_dynamics};

fn write(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// A named pipe: whoever opens it for reading hangs until somebody writes, and nobody does.
fn trap(folder: &TempDir, name: &str) -> PathBuf {
    let path = folder.path().join(name);
    rustix::fs::mknodat(
        rustix::fs::CWD,
        &path,
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR,
        0,
    )
    .unwrap();
    path
}

/// Runs `work` on a thread; fails when it does not come back, as it would from an opened [`trap`].
fn returns<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || sender.send(work()));
    receiver
        .recv_timeout(Duration::from_secs(20))
        .expect("a file was opened that must not be")
}

#[test]
fn case_76_external_entities_open_no_file() {
    let folder = TempDir::new().unwrap();
    let secret = trap(&folder, "passwd");
    let text = format!(
        "<!DOCTYPE robot [<!ENTITY x SYSTEM \"file://{0}\"><!ENTITY % y SYSTEM \"{0}\"> %y;]><robot name=\"&x;\">&x;</robot>",
        secret.display()
    );
    let path = write(&folder, "arm.urdf", &text);
    says(
        &returns(move || read(&path)).unwrap_err(),
        &["arm.urdf:1:1", "DOCTYPE"],
    );
}

#[test]
fn case_79_large_files() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("large.urdf");
    std::fs::File::create(&path)
        .unwrap()
        .set_len(100 << 20)
        .unwrap();
    says(
        &read(&path).unwrap_err(),
        &["large.urdf", "100.0 MiB", "32 MiB"],
    );
    says(
        &build("memory.urdf", &vec![b' '; (32 << 20) + 1]).unwrap_err(),
        &["32 MiB"],
    );
}

#[test]
fn case_80_meshes_are_never_opened() {
    let folder = TempDir::new().unwrap();
    let mesh = trap(&folder, "mesh.stl");
    for name in [
        mesh.display().to_string(),
        "mesh.stl".into(),
        "package://../../etc/x".into(),
    ] {
        let text = URDF.replace("package://arm/upper.stl", &name);
        let path = write(&folder, "arm.urdf", &text);
        returns(move || read(&path)).unwrap();
        let text = MJCF.replace("<worldbody>", &format!("<asset><mesh name=\"m\" file=\"{name}\"/><model file=\"{name}\"/></asset><worldbody>"));
        let text = text.replace("<inertial", "<geom type=\"mesh\" mesh=\"m\"/><inertial");
        let path = write(&folder, "arm.xml", &text);
        returns(move || read(&path)).unwrap();
    }
}

/// What a model includes.
const PART: &str = "<mujoco><worldbody><body><inertial pos='0 0 1' mass='1' diaginertia='1 1 1'/><joint name='in'/></body></worldbody></mujoco>";

/// Writes a model that includes this file.
fn include(folder: &TempDir, file: &str) -> PathBuf {
    write(
        folder,
        "main.xml",
        &MJCF.replace(
            "<worldbody>",
            &format!("<include file=\"{file}\"/>\n<worldbody>"),
        ),
    )
}

#[test]
fn case_80_includes_stay_inside() {
    let outer = TempDir::new().unwrap();
    let folder = TempDir::new_in(outer.path()).unwrap();
    write(&outer, "outside.xml", PART);
    std::os::unix::fs::symlink(
        outer.path().join("outside.xml"),
        folder.path().join("link.xml"),
    )
    .unwrap();
    for bad in [
        "../outside.xml",
        "link.xml",
        "/etc/passwd",
        &outer.path().join("outside.xml").display().to_string(),
    ] {
        says(
            &read(&include(&folder, bad)).unwrap_err(),
            &["main.xml:4:", "outside the model's folder"],
        );
    }
}

#[test]
fn case_80_what_is_included_is_a_file() {
    let folder = TempDir::new().unwrap();
    std::fs::create_dir(folder.path().join("parts")).unwrap();
    write(&folder, "parts/inside.xml", PART);
    let include = |file: &str| include(&folder, file);
    says(
        &read(&include("parts/none.xml")).unwrap_err(),
        &["main.xml:4:", "cannot include"],
    );
    says(&read(&include("parts")).unwrap_err(), &["not a file"]);
    assert_eq!(
        read(&include("parts/inside.xml")).unwrap().joint_names(),
        ["in", "shoulder", "elbow"]
    );
    assert_eq!(
        read(&include("parts/../parts/inside.xml")).unwrap().dof(),
        3
    );
    // A pipe inside the folder is not a file either.
    trap(&folder, "mesh.stl");
    let path = include("mesh.stl");
    says(&returns(move || read(&path)).unwrap_err(), &["not a file"]);
    // From memory there is no folder.
    says(
        &refusal(
            MJCF,
            "<worldbody>",
            "<include file=\"parts/inside.xml\"/><worldbody>",
        ),
        &["arm.xml:4:", "does not come from a file"],
    );
    // An error inside an included file names that file.
    write(
        &folder,
        "parts/inside.xml",
        &PART.replace("mass='1'", "mass='x'"),
    );
    says(
        &read(&include("parts/inside.xml")).unwrap_err(),
        &["parts/inside.xml:1:", "`x` is not a number"],
    );
}

/// Ten files, each including the next twenty times: 20^10 in all.
#[test]
fn case_81_include_bombs() {
    let folder = TempDir::new().unwrap();
    for i in 0..10 {
        let body = if i == 9 {
            "<worldbody/>".into()
        } else {
            format!("<include file=\"f{}.xml\"/>", i + 1).repeat(20)
        };
        write(
            &folder,
            &format!("f{i}.xml"),
            &format!("<mujoco>{body}</mujoco>"),
        );
    }
    let start = Instant::now();
    says(
        &read(&folder.path().join("f0.xml")).unwrap_err(),
        &["limit", "1000 files"],
    );
    assert!(
        start.elapsed() < Duration::from_secs(10),
        "{:?}",
        start.elapsed()
    );
}

/// Few files, many bytes: refused by their size before they are read.
#[test]
fn case_81_large_includes() {
    let folder = TempDir::new().unwrap();
    let big = folder.path().join("big.xml");
    std::fs::File::create(&big)
        .unwrap()
        .set_len(31 << 20)
        .unwrap();
    let small = format!(
        "<mujoco><!--{}--><include file=\"big.xml\"/></mujoco>",
        " ".repeat(2 << 20)
    );
    says(
        &read(&write(&folder, "main.xml", &small)).unwrap_err(),
        &["big.xml", "32 MiB"],
    );
}

#[test]
fn case_81_cycles_and_long_chains() {
    let folder = TempDir::new().unwrap();
    let ring = write(
        &folder,
        "ring.xml",
        "<mujoco><include file=\"ring2.xml\"/></mujoco>",
    );
    write(
        &folder,
        "ring2.xml",
        "<mujoco>\n<include file=\"./ring.xml\"/></mujoco>",
    );
    says(&read(&ring).unwrap_err(), &["ring2.xml:2:1", "cycle"]);
    for i in 0..20 {
        write(
            &folder,
            &format!("c{i}.xml"),
            &format!("<mujoco><include file=\"c{}.xml\"/></mujoco>", i + 1),
        );
    }
    says(
        &read(&folder.path().join("c0.xml")).unwrap_err(),
        &["deeper than 16 files"],
    );
}

#[test]
fn case_82_xacro_says_how_to_expand() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder, "arm.urdf.xacro", URDF);
    says(
        &read(&path).unwrap_err(),
        &["xacro '", "arm.urdf.xacro' > 'arm.urdf'"],
    );
    says(
        &refusal(URDF, "<link name=\"base\"/>", "<xacro:base prefix=\"a\"/>"),
        &["arm.urdf:3:3", "xacro 'arm.urdf'"],
    );
    says(
        &refusal(URDF, "value=\"2\"", "value=\"${mass}\""),
        &["arm.urdf:4:", "xacro"],
    );
    // An expanded file often keeps the namespace: that is fine.
    let expanded = URDF.replace(
        "name=\"arm\"",
        "name=\"arm\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"",
    );
    assert!(build("arm.urdf", expanded.as_bytes()).is_ok());
}

#[test]
fn a_second_inertial_and_a_nul_byte_are_refused() {
    let second = "<inertial><mass value=\"3\"/></inertial></link>\n  <joint name=\"shoulder\"";
    let text = URDF.replacen("</link>\n  <joint name=\"shoulder\"", second, 1);
    says(
        &build("arm.urdf", text.as_bytes()).unwrap_err(),
        &[
            "arm.urdf:8:",
            "link `finger` has a second <inertial>",
            "keep one",
        ],
    );
    let inertial = "<inertial pos=\"0 0 0.1\" mass=\"1\" diaginertia=\"0.02 0.02 0.01\"/>";
    let text = MJCF.replacen(inertial, &format!("{inertial}{inertial}"), 1);
    says(
        &build("arm.xml", text.as_bytes()).unwrap_err(),
        &["body `lower` has a second <inertial>"],
    );
    let text = URDF.replacen("name=\"upper\"", "name=\"up\0per\"", 1);
    says(
        &build("arm.urdf", text.as_bytes()).unwrap_err(),
        &["arm.urdf:4:", "NUL byte"],
    );
}

/// Numbers whose products overflow, at the link or joint that has them.
#[test]
fn a_mass_or_length_beyond_all_machines_is_refused() {
    for (from, to, words) in [
        (
            "value=\"2\"",
            "value=\"1e308\"",
            "link `upper`: mass is 1e308 kg",
        ),
        (
            "xyz=\"0 0 0.2\"",
            "xyz=\"0 0 1e308\"",
            "link `upper`: centre of mass is 1e308 m",
        ),
        (
            "izz=\"0.001\"",
            "izz=\"1e200\"",
            "link `lower`: an entry of the inertia tensor is 1e200",
        ),
        (
            "xyz=\"0 0 0.4\"",
            "xyz=\"0 0 -1e308\"",
            "joint `elbow`: its origin is -1e308 m away",
        ),
    ] {
        says(
            &refusal(URDF, from, to),
            &["arm.urdf:", words, "limit is 1e12", "unit"],
        );
    }
    says(
        &refusal(MJCF, "mass=\"1\"", "mass=\"1e308\""),
        &["arm.xml:8:", "mass is 1e308 kg"],
    );
    says(
        &refusal(MJCF, "damping=\"0.1\"", "damping=\"1e308\""),
        &["damping is 1e308"],
    );
}

/// A tool frame at the end of the chain, with mass 0, with a tensor of its own, or with nothing: the torque is that without it.
#[test]
fn a_massless_frame_behind_a_fixed_joint_is_read() {
    let (plain, _) = build("arm.urdf", URDF.as_bytes()).unwrap();
    for (inside, code) in [
        ("", None),
        (
            "<inertial><mass value=\"0\"/></inertial>",
            Some("massless_frame"),
        ),
        (
            "<inertial><mass value=\"0\"/><inertia ixx=\"1e-3\" iyy=\"1e-3\" izz=\"1e-3\"/></inertial>",
            Some("massless_frame"),
        ),
    ] {
        let tool = format!(
            "  <link name=\"tool\">{inside}</link>\n  <joint name=\"mount\" type=\"fixed\"><origin xyz=\"0 0 0.1\"/><parent \
             link=\"finger\"/><child link=\"tool\"/></joint>\n</robot>"
        );
        let text = URDF.replacen("</robot>", &tool, 1);
        let (robot, findings) = build("arm.urdf", text.as_bytes()).unwrap();
        let said: Vec<&str> = codes(&findings)
            .into_iter()
            .filter(|code| *code == "massless_frame")
            .collect();
        assert_eq!(said.first().copied(), code, "{inside}");
        let (q, qd, qdd) = ([0.3, -0.7], [0.5, 1.1], [2.0, -3.0]);
        let torque = |robot: &Robot| {
            let mut workspace = Workspace::new(robot);
            let mut tau = [0.0; 2];
            inverse_dynamics(robot, &mut workspace, &q, &qd, &qdd, &mut tau);
            tau
        };
        assert_eq!(torque(&robot), torque(&plain));
    }
    // A tensor without mass that moves by itself is a mistake as before.
    let text = URDF.replacen("<mass value=\"1\"/>", "<mass value=\"0\"/>", 1);
    says(
        &build("arm.urdf", text.as_bytes()).unwrap_err(),
        &["link `lower`", "mass is 0 kg"],
    );
}
