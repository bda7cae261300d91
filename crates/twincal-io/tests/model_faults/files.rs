//! Faults that only a file can have: what is opened, how large it is, what its name says.

use super::{MJCF, URDF, build, read, refusal, says};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tempfile::TempDir;

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
fn case_80_meshes_are_never_opened_and_includes_stay_inside() {
    let outer = TempDir::new().unwrap();
    let folder = TempDir::new_in(outer.path()).unwrap();
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

    let part = "<mujoco><worldbody><body><inertial pos='0 0 1' mass='1' diaginertia='1 1 1'/><joint name='in'/></body></worldbody></mujoco>";
    write(&outer, "outside.xml", part);
    std::fs::create_dir(folder.path().join("parts")).unwrap();
    write(&folder, "parts/inside.xml", part);
    std::os::unix::fs::symlink(
        outer.path().join("outside.xml"),
        folder.path().join("link.xml"),
    )
    .unwrap();
    let include = |file: &str| {
        write(
            &folder,
            "main.xml",
            &MJCF.replace(
                "<worldbody>",
                &format!("<include file=\"{file}\"/>\n<worldbody>"),
            ),
        )
    };
    for bad in [
        "../outside.xml",
        "link.xml",
        "/etc/passwd",
        &outer.path().join("outside.xml").display().to_string(),
    ] {
        says(
            &read(&include(bad)).unwrap_err(),
            &["main.xml:4:", "outside the model's folder"],
        );
    }
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
        &part.replace("mass='1'", "mass='x'"),
    );
    says(
        &read(&include("parts/inside.xml")).unwrap_err(),
        &["parts/inside.xml:1:", "`x` is not a number"],
    );
}

#[test]
fn case_81_include_bombs() {
    let folder = TempDir::new().unwrap();
    // Ten files, each including the next twenty times: 20^10 in all.
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
    // Few files, many bytes: refused by their size before they are read.
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
    // Cycles and long chains.
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
